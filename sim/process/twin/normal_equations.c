#include "sim/process/twin/normal_equations.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Parts of the frame that are summed on their own, whatever the number of threads, and pixels of a
 * band of rows, whose derivatives are held at a time. */
enum { PARTS = 8, BAND_PIXELS = 2048 };

/* All that the parts of the frame share. */
typedef struct evaluation {
    const bst_twin_model *model;
    const bst_twin_layout *layout;
    bst_twin_nodes nodes;
    bst_twin_place *places[2]; /* [star][node] of both quadratures */
    float *rows;               /* [star][2] first and last row of its light */
    float *stars_e;
    bst_twin_sums part[PARTS];
    bool sums, failed[PARTS];
} evaluation;

/* A band of rows. */
typedef struct band {
    int y0, y1;
    double *light;      /* [y1 - y0][width] */
    double *derivative; /* [pixel][parameter]; NULL: none */
    double *column;     /* of the profiles along rows */
    int *nonzero;
} band;

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
        bool moves = m->stars[i].found && f->path;
        out->flux[i] = n++;
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
static void add_derivatives(const evaluation *e, int star, const bst_twin_node *n,
                            const bst_twin_place *p, const pixel_part *v, double *row) {
    const bst_twin_layout *l = e->layout;
    double flux = e->model->stars[star].flux_e;
    row[l->flux[star]] += v->value;
    for (int axis = 0; axis < 3; axis++) {
        if (l->angle[axis] < 0) {
            continue;
        }
        double d = flux * (v->x * (double)p->dx[axis] + v->y * (double)p->dy[axis]);
        double *to = row + l->angle[axis] + n->first[axis == 2];
        const double *b = n->basis[axis == 2];
        int most = e->model->path.count[axis == 2] - n->first[axis == 2];
        for (int k = 0; k < BST_TWIN_SUPPORT && k < most; k++) {
            to[k] += b[k] * d;
        }
    }
    if (l->log_scale >= 0) {
        const bst_camera *c = &e->model->camera;
        row[l->log_scale] += flux * (v->x * ((double)p->x_px - bst_camera_centre_x(c)) +
                                     v->y * ((double)p->y_px - bst_camera_centre_y(c)));
    }
    for (int k = 0; k < BST_TWIN_PSF && l->psf >= 0; k++) {
        row[l->psf + k] += flux * v->psf[k];
    }
    if (l->place[star] >= 0) {
        row[l->place[star]] += flux * v->x;
        row[l->place[star] + 1] += flux * v->y;
    }
}

/* Adds one node of a star to a band. */
static void add_node(const evaluation *e, int star, int component, int index, band *b) {
    const bst_twin_model *m = e->model;
    const bst_twin_node *n = &e->nodes.node[component][index];
    const bst_twin_place *p =
        &e->places[component][(size_t)star * (size_t)e->nodes.count[component] + (size_t)index];
    bst_twin_profile x, y;
    double sigma = bst_twin_sigma_px(&m->psf, component);
    if ((double)p->x_px < -8.0 * sigma || (double)p->x_px > m->width + 8.0 * sigma) {
        return;
    }
    bst_twin_profile_at((double)p->y_px, sigma, b->y0, b->y1, &y);
    if (y.count == 0) {
        return;
    }
    bst_twin_profile_at((double)p->x_px, sigma, 0, m->width, &x);
    double share = bst_twin_share(&m->psf, component), sign = component == 0 ? -1.0 : 1.0;
    double weight = n->weight, flux = m->stars[star].flux_e;
    for (int j = 0; j < y.count; j++) {
        size_t row = (size_t)(y.first + j - b->y0) * (size_t)m->width + (size_t)x.first;
        for (int i = 0; i < x.count; i++) {
            double plain = weight * x.value[i] * y.value[j];
            b->light[row + (size_t)i] += flux * share * plain;
            if (b->derivative) {
                double wider = weight * share *
                               (x.width[i] * y.value[j] + x.value[i] * y.width[j]);
                const pixel_part v = {share * plain,
                                      weight * share * x.slope[i] * y.value[j],
                                      weight * share * x.value[i] * y.slope[j],
                                      {wider, component == 1 ? wider : 0.0, sign * plain}};
                add_derivatives(e, star, n, p, &v,
                                b->derivative + (row + (size_t)i) * (size_t)e->layout->count);
            }
        }
    }
}

double bst_twin_background(const bst_twin_model *m, int x, int y) {
    double u = m->width > 1 ? 2.0 * x / (m->width - 1) - 1.0 : 0.0;
    double v = m->height > 1 ? 2.0 * y / (m->height - 1) - 1.0 : 0.0;
    const double *c = m->background_e;
    return c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v;
}

/* Adds a pixel with its derivatives to the sums. */
static void add_pixel(const evaluation *e, double residual, double variance, double *row,
                      int *nonzero, bst_twin_sums *s) {
    double u = fabs(residual) / sqrt(variance);
    bool out = u > BST_TWIN_HUBER;
    s->loss += out ? BST_TWIN_HUBER * (u - 0.5 * BST_TWIN_HUBER) : 0.5 * u * u;
    if (!row) {
        return;
    }
    double w = (out ? BST_TWIN_HUBER / u : 1.0) / variance;
    int count = 0, n = e->layout->count;
    for (int i = 0; i < n; i++) {
        if (row[i] != 0.0) {
            nonzero[count++] = i;
        }
    }
    for (int i = 0; i < count; i++) {
        double d = w * row[nonzero[i]], *to = s->matrix + (size_t)nonzero[i] * (size_t)n;
        s->gradient[nonzero[i]] += d * residual;
        for (int k = 0; k <= i; k++) {
            to[nonzero[k]] += d * row[nonzero[k]];
        }
    }
}

/* Adds the pixels of a band. */
static void add_band(const evaluation *e, band *b, bst_twin_sums *s) {
    const bst_twin_model *m = e->model;
    for (int y = b->y0; y < b->y1; y++) {
        double v = m->height > 1 ? 2.0 * y / (m->height - 1) - 1.0 : 0.0;
        for (int x = 0; x < m->width; x++) {
            size_t at = (size_t)y * (size_t)m->width + (size_t)x;
            size_t here = (size_t)(y - b->y0) * (size_t)m->width + (size_t)x;
            double data = (double)m->data_e[at];
            if (e->stars_e) {
                e->stars_e[at] = (float)b->light[here];
            }
            if (!e->sums || !isfinite(data)) {
                continue;
            }
            double *row = NULL;
            if (b->derivative) {
                double u = m->width > 1 ? 2.0 * x / (m->width - 1) - 1.0 : 0.0;
                const double terms[BST_TWIN_BACKGROUND] = {1.0, u, v, u * u, u * v, v * v};
                row = b->derivative + here * (size_t)e->layout->count;
                memcpy(row + e->layout->background, terms, sizeof terms);
            }
            double residual = data - b->light[here] - bst_twin_background(m, x, y);
            add_pixel(e, residual, (double)m->variance_e2[at], row, b->nonzero, s);
        }
    }
}

/* Stars of a band. */
static void add_stars(const evaluation *e, band *b) {
    for (int star = 0; star < e->model->count; star++) {
        if ((double)e->rows[2 * star] >= b->y1 || (double)e->rows[2 * star + 1] < b->y0) {
            continue;
        }
        for (int c = 0; c < 2; c++) {
            bool none = c == 1 && e->model->psf.wide <= 0.0 && !b->derivative;
            for (int i = 0; i < e->nodes.count[c] && !none; i++) {
                add_node(e, star, c, i, b);
            }
        }
    }
}

/* A part of the frame. */
static void evaluate_part(evaluation *e, int index) {
    const bst_twin_model *m = e->model;
    size_t n = e->layout ? (size_t)e->layout->count : 0, width = (size_t)m->width;
    int rows = BAND_PIXELS / m->width > 0 ? BAND_PIXELS / m->width : 1;
    int y0 = index * m->height / PARTS, y1 = (index + 1) * m->height / PARTS;
    band b = {.light = malloc((size_t)rows * width * sizeof *b.light),
              .derivative = n ? malloc((size_t)rows * width * n * sizeof *b.derivative) : NULL,
              .nonzero = malloc((n + 1) * sizeof *b.nonzero)};
    e->failed[index] = !b.light || !b.nonzero || (n > 0 && !b.derivative);
    for (int y = y0; y < y1 && !e->failed[index]; y += rows) {
        b.y0 = y;
        b.y1 = y + rows < y1 ? y + rows : y1;
        memset(b.light, 0, (size_t)rows * width * sizeof *b.light);
        if (b.derivative) {
            memset(b.derivative, 0, (size_t)rows * width * n * sizeof *b.derivative);
        }
        add_stars(e, &b);
        add_band(e, &b, &e->part[index]);
    }
    free(b.light);
    free(b.derivative);
    free(b.nonzero);
}

static void evaluate_parts(void *user, int begin, int end) {
    for (int i = begin; i < end; i++) {
        evaluate_part(user, i);
    }
}

/* Places of all stars, and the rows of their light. */
static bst_status place_stars(bst_ctx *ctx, evaluation *e) {
    const bst_twin_model *m = e->model;
    e->rows = malloc(((size_t)m->count + 1) * 2 * sizeof *e->rows);
    for (int c = 0; c < 2; c++) {
        e->places[c] = malloc(((size_t)m->count + 1) * (size_t)e->nodes.count[c] *
                              sizeof *e->places[c]);
    }
    if (!e->rows || !e->places[0] || !e->places[1]) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the paths of %d stars", m->count);
    }
    float reach = (float)(5.0 * fmax(m->psf.sigma_px, bst_twin_sigma_px(&m->psf, 1)) + 2.0);
    for (int s = 0; s < m->count; s++) {
        float low = INFINITY, high = -INFINITY;
        for (int c = 0; c < 2; c++) {
            bst_twin_place *p = e->places[c] + (size_t)s * (size_t)e->nodes.count[c];
            bst_twin_star_places(m, &e->nodes, c, m->stars[s].apparent, p);
            for (int i = 0; i < e->nodes.count[c]; i++) {
                low = fminf(low, p[i].y_px);
                high = fmaxf(high, p[i].y_px);
            }
        }
        e->rows[2 * s] = low - reach;
        e->rows[2 * s + 1] = high + reach;
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
            status = e.failed[i] ? bst_fail(ctx, BST_ERR_MEMORY, "no memory for rows of a fit")
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
    free(e.rows);
    bst_twin_nodes_free(&e.nodes);
    return status;
}
