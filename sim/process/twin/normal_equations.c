#include "sim/process/twin/normal_equations.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"

/* Side of a tile, px, and parts of the frame whose tiles are summed on their own, whatever the
 * number of threads. */
enum { SIDE = 32, PARTS = 8 };

/* Box of a star's light, px. */
typedef struct box {
    float x0, y0, x1, y1;
} box;

/* All that the parts of the frame share. */
typedef struct evaluation {
    const bst_twin_model *model;
    const bst_twin_layout *layout;
    bst_twin_nodes nodes;
    bst_twin_place *places[2]; /* [star][node] of both quadratures */
    box *boxes;                /* [star] */
    double reach_px[2];
    float *stars_e;
    bst_twin_sums part[PARTS];
    bool sums, failed[PARTS];
} evaluation;

/* A node of a star that lights a tile. */
typedef struct lit {
    int star, component, node;
} lit;

/* A tile of the frame, and the parameters that its pixels depend on. */
typedef struct tile {
    int x0, y0, x1, y1;
    double light[SIDE * SIDE];
    lit *lits; /* [count] */
    size_t count, room;
    int *local;  /* [parameter] its place among those of the tile; -1: none */
    int *global; /* [used] the other way */
    int used;
    double *derivative; /* [pixel][used] */
    size_t derivative_room;
    double *matrix; /* [used][used] */
    size_t matrix_room;
    double *gradient; /* [parameter], of the tile */
    int *nonzero;     /* [parameter] */
} tile;

void bst_twin_layout_make(const bst_twin_model *m, const bst_twin_freedom *f,
                          bst_twin_layout *out) {
    int n = 0;
    for (int axis = 0; axis < 3; axis++) {
        bool fitted = f->path && (axis < 2 || f->roll);
        out->angle[axis] = fitted ? n : -1;
        n += fitted ? m->path.count[axis == 2] : 0;
    }
    out->log_scale = f->scale ? n++ : -1;
    out->psf = f->psf ? n : -1;
    n += f->psf ? BST_TWIN_PSF : 0;
    out->background = n;
    n += BST_TWIN_BACKGROUND;
    for (int i = 0; i < m->count; i++) {
        const bst_twin_star *s = &m->stars[i];
        bool fitted = !(s->flux_e < f->least_snr * s->sigma_e);
        bool moves = s->found && f->path && fitted;
        out->flux[i] = fitted ? n++ : -1;
        out->place[i] = moves ? n : -1;
        n += moves ? 2 : 0;
    }
    out->count = n;
}

/* What a node adds to a pixel per electron of the star. */
typedef struct pixel_part {
    double value, x, y; /* and its derivatives by the place */
    double psf[BST_TWIN_PSF];
} pixel_part;

/* Adds the derivatives of a node's light to a pixel. */
static void add_derivatives(const evaluation *e, const tile *t, const lit *n, const pixel_part *v,
                            double *row) {
    const bst_twin_layout *l = e->layout;
    const bst_twin_node *node = &e->nodes.node[n->component][n->node];
    const bst_twin_place *p =
        &e->places[n->component]
                  [(size_t)n->star * (size_t)e->nodes.count[n->component] + (size_t)n->node];
    double flux = e->model->stars[n->star].flux_e;
    for (int axis = 0; axis < 3; axis++) {
        if (l->angle[axis] < 0) {
            continue;
        }
        double d = flux * (v->x * (double)p->dx[axis] + v->y * (double)p->dy[axis]);
        int first = node->first[axis == 2], most = e->model->path.count[axis == 2] - first;
        const int *local = t->local + l->angle[axis] + first;
        const double *b = node->basis[axis == 2];
        for (int k = 0; k < BST_TWIN_SUPPORT && k < most; k++) {
            row[local[k]] += b[k] * d;
        }
    }
    if (l->log_scale >= 0) {
        const bst_camera *c = &e->model->camera;
        row[t->local[l->log_scale]] += flux * (v->x * ((double)p->x_px - bst_camera_centre_x(c)) +
                                               v->y * ((double)p->y_px - bst_camera_centre_y(c)));
    }
    for (int k = 0; k < BST_TWIN_PSF && l->psf >= 0; k++) {
        row[t->local[l->psf + k]] += flux * v->psf[k];
    }
    if (l->flux[n->star] >= 0) {
        row[t->local[l->flux[n->star]]] += v->value;
    }
    if (l->place[n->star] >= 0) {
        double *to = row + t->local[l->place[n->star]];
        to[0] += flux * v->x;
        to[1] += flux * v->y;
    }
}

/* Adds one node of a star to a tile. */
static void add_node(const evaluation *e, const lit *n, tile *t) {
    const bst_twin_model *m = e->model;
    const bst_twin_place *p =
        &e->places[n->component]
                  [(size_t)n->star * (size_t)e->nodes.count[n->component] + (size_t)n->node];
    bst_twin_profile x, y;
    double sigma = bst_twin_sigma_px(&m->psf, n->component);
    bst_twin_profile_at((double)p->y_px, sigma, t->y0, t->y1, &y);
    bst_twin_profile_at((double)p->x_px, sigma, t->x0, t->x1, &x);
    double share = bst_twin_share(&m->psf, n->component), sign = n->component == 0 ? -1.0 : 1.0;
    double weight = e->nodes.node[n->component][n->node].weight;
    double flux = m->stars[n->star].flux_e * share * weight;
    for (int j = 0; j < y.count; j++) {
        size_t row = (size_t)(y.first + j - t->y0) * SIDE + (size_t)(x.first - t->x0);
        for (int i = 0; i < x.count; i++) {
            t->light[row + (size_t)i] += flux * x.value[i] * y.value[j];
        }
        for (int i = 0; i < x.count && e->layout; i++) {
            double plain = weight * x.value[i] * y.value[j];
            double wider = weight * share * (x.width[i] * y.value[j] + x.value[i] * y.width[j]);
            const pixel_part v = {share * plain,
                                  weight * share * x.slope[i] * y.value[j],
                                  weight * share * x.value[i] * y.slope[j],
                                  {wider, n->component == 1 ? wider : 0.0, sign * plain}};
            add_derivatives(e, t, n, &v, t->derivative + (row + (size_t)i) * (size_t)t->used);
        }
    }
}

double bst_twin_background(const bst_twin_model *m, int x, int y) {
    double u = m->width > 1 ? 2.0 * x / (m->width - 1) - 1.0 : 0.0;
    double v = m->height > 1 ? 2.0 * y / (m->height - 1) - 1.0 : 0.0;
    const double *c = m->background_e;
    return c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v;
}

/* Adds a pixel with its derivatives to the sums of the tile. */
static void add_pixel(double residual, double variance, const double *row, tile *t,
                      bst_twin_sums *s) {
    double u = fabs(residual) / sqrt(variance);
    bool out = u > BST_TWIN_HUBER;
    s->loss += out ? BST_TWIN_HUBER * (u - 0.5 * BST_TWIN_HUBER) : 0.5 * u * u;
    if (!row) {
        return;
    }
    double w = (out ? BST_TWIN_HUBER / u : 1.0) / variance;
    int count = 0;
    for (int i = 0; i < t->used; i++) {
        if (row[i] != 0.0) {
            t->nonzero[count++] = i;
        }
    }
    for (int i = 0; i < count; i++) {
        double d = w * row[t->nonzero[i]];
        double *to = t->matrix + (size_t)t->nonzero[i] * (size_t)t->used;
        t->gradient[t->nonzero[i]] += d * residual;
        for (int k = 0; k <= i; k++) {
            to[t->nonzero[k]] += d * row[t->nonzero[k]];
        }
    }
}

/* Adds the pixels of a tile. */
static void add_pixels(const evaluation *e, tile *t, bst_twin_sums *s) {
    const bst_twin_model *m = e->model;
    for (int y = t->y0; y < t->y1; y++) {
        double v = m->height > 1 ? 2.0 * y / (m->height - 1) - 1.0 : 0.0;
        for (int x = t->x0; x < t->x1; x++) {
            size_t at = (size_t)y * (size_t)m->width + (size_t)x;
            size_t here = (size_t)(y - t->y0) * SIDE + (size_t)(x - t->x0);
            double data = (double)m->data_e[at];
            if (e->stars_e) {
                e->stars_e[at] = (float)t->light[here];
            }
            if (!e->sums || !isfinite(data)) {
                continue;
            }
            double *row = NULL;
            if (e->layout) {
                double u = m->width > 1 ? 2.0 * x / (m->width - 1) - 1.0 : 0.0;
                const double terms[BST_TWIN_BACKGROUND] = {1.0, u, v, u * u, u * v, v * v};
                row = t->derivative + here * (size_t)t->used;
                memcpy(row + t->local[e->layout->background], terms, sizeof terms);
            }
            double residual = data - t->light[here] - bst_twin_background(m, x, y);
            add_pixel(residual, (double)m->variance_e2[at], row, t, s);
        }
    }
}

/* Lists the nodes that light a tile; false: no memory. */
static bool list_nodes(const evaluation *e, tile *t) {
    t->count = 0;
    for (int star = 0; star < e->model->count; star++) {
        const box *b = &e->boxes[star];
        if (b->x0 >= (float)t->x1 || b->x1 < (float)t->x0 || b->y0 >= (float)t->y1 ||
            b->y1 < (float)t->y0) {
            continue;
        }
        for (int c = 0; c < 2; c++) {
            float reach = (float)e->reach_px[c];
            const bst_twin_place *p = e->places[c] + (size_t)star * (size_t)e->nodes.count[c];
            bool none = c == 1 && e->model->psf.wide <= 0.0 && !e->layout;
            for (int i = 0; i < e->nodes.count[c] && !none; i++) {
                if (p[i].x_px + reach < (float)t->x0 || p[i].x_px - reach > (float)t->x1 ||
                    p[i].y_px + reach < (float)t->y0 || p[i].y_px - reach > (float)t->y1) {
                    continue;
                }
                if (t->count == t->room) {
                    size_t room = t->room > 0 ? 2 * t->room : 1024;
                    lit *more = realloc(t->lits, room * sizeof *more);
                    if (!more) {
                        return false;
                    }
                    t->lits = more;
                    t->room = room;
                }
                t->lits[t->count++] = (lit){star, c, i};
            }
        }
    }
    return true;
}

/* Gives parameters a place among those of the tile. */
static void use(tile *t, int first, int count) {
    for (int i = first; i < first + count && first >= 0; i++) {
        if (t->local[i] < 0) {
            t->local[i] = t->used;
            t->global[t->used++] = i;
        }
    }
}

/* Lists the parameters of a tile and clears their sums; false: no memory. */
static bool list_parameters(const evaluation *e, tile *t) {
    const bst_twin_layout *l = e->layout;
    t->used = 0;
    for (int i = 0; i < l->count; i++) {
        t->local[i] = -1;
    }
    use(t, l->background, BST_TWIN_BACKGROUND);
    use(t, l->log_scale, 1);
    use(t, l->psf, BST_TWIN_PSF);
    for (size_t i = 0; i < t->count; i++) {
        const lit *n = &t->lits[i];
        const bst_twin_node *node = &e->nodes.node[n->component][n->node];
        use(t, l->flux[n->star], 1);
        use(t, l->place[n->star], 2);
        for (int axis = 0; axis < 3; axis++) {
            int first = node->first[axis == 2], most = e->model->path.count[axis == 2] - first;
            if (l->angle[axis] >= 0) {
                use(t, l->angle[axis] + first, most < BST_TWIN_SUPPORT ? most : BST_TWIN_SUPPORT);
            }
        }
    }
    size_t n = (size_t)t->used;
    bst_ctx quiet = {0};
    if (bst_memory_grow(&quiet, "tile", (void **)&t->derivative, &t->derivative_room,
                        SIDE * SIDE * n * sizeof *t->derivative) != BST_OK ||
        bst_memory_grow(&quiet, "tile", (void **)&t->matrix, &t->matrix_room,
                        n * n * sizeof *t->matrix) != BST_OK) {
        return false;
    }
    memset(t->derivative, 0, SIDE * SIDE * n * sizeof *t->derivative);
    memset(t->matrix, 0, n * n * sizeof *t->matrix);
    memset(t->gradient, 0, n * sizeof *t->gradient);
    return true;
}

/* Adds the sums of a tile to those of its part. */
static void scatter(const evaluation *e, const tile *t, bst_twin_sums *s) {
    size_t n = (size_t)e->layout->count;
    for (int i = 0; i < t->used; i++) {
        s->gradient[t->global[i]] += t->gradient[i];
        for (int k = 0; k <= i; k++) {
            int a = t->global[i], b = t->global[k];
            s->matrix[(size_t)(a > b ? a : b) * n + (size_t)(a > b ? b : a)] +=
                t->matrix[(size_t)i * (size_t)t->used + (size_t)k];
        }
    }
}

/* Evaluates a tile; false: no memory. */
static bool evaluate_tile(const evaluation *e, tile *t, bst_twin_sums *s) {
    memset(t->light, 0, sizeof t->light);
    if (!list_nodes(e, t) || (e->layout && !list_parameters(e, t))) {
        return false;
    }
    for (size_t i = 0; i < t->count; i++) {
        add_node(e, &t->lits[i], t);
    }
    add_pixels(e, t, s);
    if (e->layout) {
        scatter(e, t, s);
    }
    return true;
}

/* A part of the frame. */
static void evaluate_part(evaluation *e, int index) {
    const bst_twin_model *m = e->model;
    size_t n = e->layout ? (size_t)e->layout->count + 1 : 1;
    int columns = (m->width + SIDE - 1) / SIDE, rows = (m->height + SIDE - 1) / SIDE;
    tile *t = calloc(1, sizeof *t);
    if (t) {
        t->local = malloc(n * sizeof *t->local);
        t->global = malloc(n * sizeof *t->global);
        t->nonzero = malloc(n * sizeof *t->nonzero);
        t->gradient = malloc(n * sizeof *t->gradient);
    }
    e->failed[index] = !t || !t->local || !t->global || !t->nonzero || !t->gradient;
    for (int i = index * rows * columns / PARTS;
         i < (index + 1) * rows * columns / PARTS && !e->failed[index]; i++) {
        t->x0 = i % columns * SIDE;
        t->y0 = i / columns * SIDE;
        t->x1 = t->x0 + SIDE < m->width ? t->x0 + SIDE : m->width;
        t->y1 = t->y0 + SIDE < m->height ? t->y0 + SIDE : m->height;
        e->failed[index] = !evaluate_tile(e, t, &e->part[index]);
    }
    if (t) {
        free(t->local);
        free(t->global);
        free(t->nonzero);
        free(t->gradient);
        free(t->lits);
        free(t->derivative);
        free(t->matrix);
    }
    free(t);
}

static void evaluate_parts(void *user, int begin, int end) {
    for (int i = begin; i < end; i++) {
        evaluate_part(user, i);
    }
}

/* Places of all stars, and the boxes of their light. */
static bst_status place_stars(bst_ctx *ctx, evaluation *e) {
    const bst_twin_model *m = e->model;
    e->boxes = malloc(((size_t)m->count + 1) * sizeof *e->boxes);
    for (int c = 0; c < 2; c++) {
        e->places[c] =
            malloc(((size_t)m->count + 1) * (size_t)e->nodes.count[c] * sizeof *e->places[c]);
        e->reach_px[c] = BST_TWIN_REACH * bst_twin_sigma_px(&m->psf, c) + 1.0;
    }
    if (!e->boxes || !e->places[0] || !e->places[1]) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the paths of %d stars", m->count);
    }
    float reach = (float)fmax(e->reach_px[0], e->reach_px[1]);
    for (int s = 0; s < m->count; s++) {
        box *b = &e->boxes[s];
        *b = (box){INFINITY, INFINITY, -INFINITY, -INFINITY};
        for (int c = 0; c < 2; c++) {
            bst_twin_place *p = e->places[c] + (size_t)s * (size_t)e->nodes.count[c];
            bst_twin_star_places(m, &e->nodes, c, m->stars[s].apparent, p);
            for (int i = 0; i < e->nodes.count[c]; i++) {
                b->x0 = fminf(b->x0, p[i].x_px - reach);
                b->y0 = fminf(b->y0, p[i].y_px - reach);
                b->x1 = fmaxf(b->x1, p[i].x_px + reach);
                b->y1 = fmaxf(b->y1, p[i].y_px + reach);
            }
        }
    }
    return BST_OK;
}

/* Memory of the sums of the parts. */
static bst_status make_parts(bst_ctx *ctx, evaluation *e) {
    size_t n = e->layout ? (size_t)e->layout->count : 0;
    for (int i = 0; i < PARTS && n > 0; i++) {
        e->part[i].matrix = calloc(n * n, sizeof *e->part[i].matrix);
        e->part[i].gradient = calloc(n, sizeof *e->part[i].gradient);
        if (!e->part[i].matrix || !e->part[i].gradient) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a fit of %zu parameters", n);
        }
    }
    return BST_OK;
}

/* Adds the parts in their order. */
static void sum_parts(const evaluation *e, bst_twin_sums *out) {
    size_t n = e->layout ? (size_t)e->layout->count : 0;
    out->loss = 0.0;
    for (int i = 0; i < PARTS; i++) {
        out->loss += e->part[i].loss;
        for (size_t k = 0; k < n * n; k++) {
            out->matrix[k] = (i > 0 ? out->matrix[k] : 0.0) + e->part[i].matrix[k];
        }
        for (size_t k = 0; k < n; k++) {
            out->gradient[k] = (i > 0 ? out->gradient[k] : 0.0) + e->part[i].gradient[k];
        }
    }
}

bst_status bst_twin_evaluate(bst_ctx *ctx, const bst_twin_model *m, const bst_twin_layout *layout,
                             bst_parallel *pool, float *stars_e, bst_twin_sums *sums) {
    assert(m && (!layout || (sums && sums->matrix && sums->gradient)));
    evaluation e = {.model = m, .layout = layout, .stars_e = stars_e, .sums = sums != NULL};
    bst_status status = bst_twin_nodes_create(ctx, m, &e.nodes);
    if (status == BST_OK) {
        status = place_stars(ctx, &e);
    }
    if (status == BST_OK) {
        status = make_parts(ctx, &e);
    }
    if (status == BST_OK) {
        bst_parallel_for(pool, PARTS, 1, evaluate_parts, &e);
        for (int i = 0; i < PARTS && status == BST_OK; i++) {
            status = e.failed[i]
                         ? bst_fail(ctx, BST_ERR_MEMORY, "no memory for the pixels of a fit")
                         : BST_OK;
        }
        if (status == BST_OK && sums) {
            sum_parts(&e, sums);
        }
    }
    for (int i = 0; i < PARTS; i++) {
        free(e.part[i].matrix);
        free(e.part[i].gradient);
    }
    free(e.places[0]);
    free(e.places[1]);
    free(e.boxes);
    bst_twin_nodes_free(&e.nodes);
    return status;
}
