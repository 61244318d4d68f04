/* Background per pixel where edges of discs, the limb's light or a terminator may be: squares of
 * pixels by polynomials, verified by exact values between their nodes. */
#include <math.h>

#include "sim/core/simd.h"
#include "sim/world/scene/skylight_internal.h"

enum { MOST = BST_SKYLIGHT_MOST_STEP_PX, SIDE = MOST + 1, LEAST = 4 };

static const int degrees[BST_SKYLIGHT_LEVELS] = {1, 2, 4};

/* Exact values of a cell of the lattice, by place from its corner; NAN: not computed yet. */
typedef struct cell {
    const bst_skylight_painter *p;
    int x0, y0;
    double value[SIDE * SIDE];
    unsigned sides[SIDE * SIDE]; /* of the terminators */
} cell;

/* A square of a cell, by its corner's place in the cell. */
typedef struct square {
    int i, j, size;
} square;

void bst_skylight_fill_weights(bst_skylight_weights *weights) {
    for (int level = 0; level < BST_SKYLIGHT_LEVELS; level++) {
        const int n = degrees[level];
        for (int s = 0; s < BST_SKYLIGHT_SIZES; s++) {
            const int size = MOST >> s;
            for (int k = 0; k <= n; k++) {
                for (int i = 0; i < size; i++) {
                    double t = (double)(i * n) / size, product = 1.0;
                    for (int m = 0; m <= n; m++) {
                        product *= m == k ? 1.0 : (t - m) / (k - m);
                    }
                    (*weights)[level][s][k][i] = (float)product;
                }
            }
        }
    }
}

/* Index of the exact value at a place of the cell. */
static int know(cell *c, int i, int j) {
    const int k = j * SIDE + i;
    if (isnan(c->value[k])) {
        c->value[k] = bst_skylight_paint(c->p, c->x0 + i, c->y0 + j, &c->sides[k]);
    }
    return k;
}

/* Half of the error that a polynomial may have at a value. */
static double allowed(double e) {
    return 0.5 * fmax(1e-3 * sqrt(fmax(e, 1.0)), 1e-6 * e);
}

/* Index of a square's size in the weights. */
static int size_index(const square *q) {
    int s = 0;
    while (MOST >> s > q->size) {
        s++;
    }
    return s;
}

/* Weights of the nodes of a level at a pixel of a square, up to its far corner. */
static void weights_at(const cell *c, const square *q, int level, int i, float out[]) {
    const int n = degrees[level], s = size_index(q);
    for (int k = 0; k <= n; k++) {
        out[k] = i < q->size ? c->p->b->weights[level][s][k][i] : (float)(k == n);
    }
}

/* Whether a polynomial agrees with the light at one place of the square. */
static bool agrees(cell *c, const square *q, int level, int i, int j) {
    const int n = degrees[level], apart = q->size / n;
    const double e = c->value[know(c, q->i + i, q->j + j)];
    float across[BST_SKYLIGHT_MOST_DEGREE + 1], down[BST_SKYLIGHT_MOST_DEGREE + 1];
    weights_at(c, q, level, i, across);
    weights_at(c, q, level, j, down);
    double sum = 0.0;
    for (int k = 0; k < (n + 1) * (n + 1); k++) {
        const int column = k % (n + 1), row = k / (n + 1);
        sum += (double)(across[column] * down[row]) *
               c->value[know(c, q->i + column * apart, q->j + row * apart)];
    }
    return fabs(sum - e) <= allowed(e);
}

/* Whether all nodes of a square are on one side of the terminators. */
static bool on_one_side(cell *c, const square *q, int n) {
    const unsigned side = c->sides[know(c, q->i, q->j)];
    for (int k = 0; k < (n + 1) * (n + 1); k++) {
        const int place =
            know(c, q->i + k % (n + 1) * (q->size / n), q->j + k / (n + 1) * (q->size / n));
        if (c->sides[place] != side) {
            return false;
        }
    }
    return true;
}

/* Whether a polynomial of a level has half of the error that is allowed, or less, at places where
 * its error is within 10 % of the largest: for degree 1 in the middles, else at half a node's
 * distance from the corners, where the errors along the two axes add with equal and opposite signs,
 * too. */
static bool is_right(cell *c, const square *q, int level) {
    const int n = degrees[level], near = q->size / (2 * n), far = q->size - near;
    if (!on_one_side(c, q, n)) {
        return false;
    }
    if (n > 1) {
        return agrees(c, q, level, near, near) && agrees(c, q, level, far, near) &&
               agrees(c, q, level, near, far) && agrees(c, q, level, far, far);
    }
    return agrees(c, q, level, near, near) && agrees(c, q, level, near, 0) &&
           agrees(c, q, level, 0, near) && agrees(c, q, level, near, q->size) &&
           agrees(c, q, level, q->size, near);
}

/* Level of the polynomial that is right in a square; -1: none. Where a blurred edge may cross it,
 * only degree 1 in a small square: its nine places see any edge, which is almost straight, and the
 * error within it is up to twice what they show. In a large one a disc could lie between them. */
static int level_of(cell *c, const square *q) {
    enum { SMALL = 8 };
    const bst_camera *camera = c->p->b->camera;
    const double x = c->x0 + q->i + 0.5 * q->size, y = c->y0 + q->j + 0.5 * q->size;
    double edge = bst_skylight_vignetting_edge_px(camera, x, y);
    if (bst_discs_any(&c->p->discs)) {
        const bst_vec3 middle = bst_camera_unproject(camera, x, y);
        edge = fmin(edge, bst_discs_sharp_edge_px(&c->p->discs, middle));
    }
    /* half a diagonal, with a margin for larger pixels off axis and for edges that bend */
    const bool crossed = !(edge > 0.75 * q->size / bst_camera_shrink(camera));
    const int levels = !crossed ? BST_SKYLIGHT_LEVELS : q->size <= SMALL ? 1 : 0;
    for (int level = 0; level < levels; level++) {
        if (is_right(c, q, level)) {
            return level;
        }
    }
    return -1;
}

/* Sums weighted values of the nodes of a row of pixels. */
BST_CLONES static void sum_row(const float *node, int count,
                               const float (*weight)[BST_SKYLIGHT_MOST_STEP_PX], float *row,
                               int from, int to) {
    if (count == 2) {
        for (int i = from; i < to; i++) {
            row[i] = node[0] * weight[0][i] + node[1] * weight[1][i];
        }
    } else if (count == 3) {
        for (int i = from; i < to; i++) {
            row[i] = node[0] * weight[0][i] + node[1] * weight[1][i] + node[2] * weight[2][i];
        }
    } else {
        for (int i = from; i < to; i++) {
            row[i] = node[0] * weight[0][i] + node[1] * weight[1][i] + node[2] * weight[2][i] +
                     node[3] * weight[3][i] + node[4] * weight[4][i];
        }
    }
}

/* The part of a square that is in the window, from its corner. */
typedef struct part {
    int i0, i1, j0, j1;
} part;

static part part_in(const cell *c, const square *q, const bst_skylight_lattice *out) {
    const int right = c->x0 + q->i - out->x0, down = c->y0 + q->j - out->y0;
    return (part){right < 0 ? -right : 0,
                  out->columns - right < q->size ? out->columns - right : q->size,
                  down < 0 ? -down : 0, out->rows - down < q->size ? out->rows - down : q->size};
}

/* First pixel of a row of a square in the map; before the map where the square begins there. */
static float *row_of(const cell *c, const square *q, const bst_skylight_lattice *out, int j) {
    const ptrdiff_t row = (ptrdiff_t)(c->y0 + q->j + j - out->y0) * out->columns;
    return out->value + (row + (c->x0 + q->i - out->x0));
}

/* Fills the pixels of a square in the window by the polynomial of a level. */
static void interpolate(cell *c, const square *q, int level, part in,
                        const bst_skylight_lattice *out) {
    const int n = degrees[level], apart = q->size / n;
    const float(*weight)[MOST] = c->p->b->weights[level][size_index(q)];
    for (int j = in.j0; j < in.j1; j++) {
        float node[BST_SKYLIGHT_MOST_DEGREE + 1];
        for (int column = 0; column <= n; column++) {
            double sum = 0.0;
            for (int row = 0; row <= n; row++) {
                sum += (double)weight[row][j] *
                       c->value[know(c, q->i + column * apart, q->j + row * apart)];
            }
            node[column] = (float)sum;
        }
        sum_row(node, n + 1, weight, row_of(c, q, out, j), in.i0, in.i1);
    }
}

/* Fills the pixels of a square in the window: by a polynomial, by smaller squares, or exactly. */
static void fill_square(cell *c, const square *q, const bst_skylight_lattice *out) {
    const part in = part_in(c, q, out);
    if (in.i0 >= in.i1 || in.j0 >= in.j1) {
        return;
    }
    const int level = q->size > LEAST ? level_of(c, q) : -1;
    if (level >= 0) {
        interpolate(c, q, level, in, out);
        return;
    }
    if (q->size > LEAST) {
        const int half = q->size / 2;
        for (int k = 0; k < 4; k++) {
            const square quarter = {q->i + (k & 1) * half, q->j + (k >> 1) * half, half};
            fill_square(c, &quarter, out);
        }
        return;
    }
    for (int j = in.j0; j < in.j1; j++) {
        float *row = row_of(c, q, out, j);
        for (int i = in.i0; i < in.i1; i++) {
            row[i] = (float)c->value[know(c, q->i + i, q->j + j)];
        }
    }
}

void bst_skylight_fill_cells(const bst_skylight_painter *p, bst_skylight *b) {
    const bst_skylight_lattice *out = &b->pixels;
    const int step = b->step;
    for (int y = out->y0 / step * step; y < out->y0 + out->rows; y += step) {
        for (int x = out->x0 / step * step; x < out->x0 + out->columns; x += step) {
            cell c;
            c.p = p;
            c.x0 = x;
            c.y0 = y;
            for (int k = 0; k < SIDE * SIDE; k++) {
                c.value[k] = NAN;
            }
            const square whole = {0, 0, step};
            fill_square(&c, &whole, out);
        }
    }
}
