#include "imgproc/identify/star_quad.h"

/* Least distance of the furthest pair: below it the stars are one. */
static const double LEAST_SIZE_RAD = 1e-8;
/* Stars further than this from the common tangent point, cosine, do not fit its plane. */
static const double LEAST_COSINE = 0.5;

static void swap_code(bst_star_quad *q, int a, int b) {
    int k = q->order[a];
    q->order[a] = q->order[b];
    q->order[b] = k;
}

/* Exchanges C and D. */
static void exchange_inner(bst_star_quad *q) {
    double re = q->code[0], im = q->code[1];
    q->code[0] = q->code[2];
    q->code[1] = q->code[3];
    q->code[2] = re;
    q->code[3] = im;
    swap_code(q, 2, 3);
}

/* Exchanges A and B: z becomes 1 - z. */
static void exchange_outer(bst_star_quad *q) {
    q->code[0] = 1.0 - q->code[0];
    q->code[1] = -q->code[1];
    q->code[2] = 1.0 - q->code[2];
    q->code[3] = -q->code[3];
    swap_code(q, 0, 1);
}

bool bst_star_quad_make(const bst_vec3 v[4], bst_star_quad *out) {
    bst_vec3 centre =
        bst_vec3_unit(bst_vec3_add(bst_vec3_add(v[0], v[1]), bst_vec3_add(v[2], v[3])));
    bst_vec3 e1 = bst_vec3_perpendicular(centre), e2 = bst_vec3_cross(centre, e1);
    double x[4], y[4], furthest = 0.0;
    for (int i = 0; i < 4; i++) {
        double z = bst_vec3_dot(v[i], centre);
        if (!(z > LEAST_COSINE)) {
            return false;
        }
        x[i] = bst_vec3_dot(v[i], e1) / z;
        y[i] = bst_vec3_dot(v[i], e2) / z;
    }
    int a = 0, b = 1;
    for (int i = 0; i < 4; i++) {
        for (int j = i + 1; j < 4; j++) {
            double dx = x[j] - x[i], dy = y[j] - y[i], d2 = dx * dx + dy * dy;
            if (d2 > furthest) {
                furthest = d2;
                a = i;
                b = j;
            }
        }
    }
    if (!(furthest > LEAST_SIZE_RAD * LEAST_SIZE_RAD)) {
        return false;
    }
    int c = -1, d = -1;
    for (int i = 0; i < 4; i++) {
        if (i != a && i != b) {
            d = i;
            c = c < 0 ? i : c;
        }
    }
    double ux = (x[b] - x[a]) / furthest, uy = (y[b] - y[a]) / furthest;
    double cx = x[c] - x[a], cy = y[c] - y[a], dx = x[d] - x[a], dy = y[d] - y[a];
    *out = (bst_star_quad){
        .code = {cx * ux + cy * uy, cy * ux - cx * uy, dx * ux + dy * uy, dy * ux - dx * uy},
        .size_rad = sqrt(furthest),
        .order = {a, b, c, d}};
    if (out->code[0] + out->code[2] > 1.0) {
        exchange_outer(out);
    }
    if (out->code[0] > out->code[2]) {
        exchange_inner(out);
    }
    return true;
}

int bst_star_quad_alternatives(const bst_star_quad *quad, double tolerance, bst_star_quad out[3]) {
    int count = 0;
    bool inner = quad->code[2] - quad->code[0] < 2.0 * tolerance;
    bool outer = 1.0 - quad->code[0] - quad->code[2] < 2.0 * tolerance;
    if (inner) {
        out[count] = *quad;
        exchange_inner(&out[count++]);
    }
    if (outer) {
        out[count] = *quad;
        exchange_outer(&out[count]);
        exchange_inner(&out[count++]);
    }
    if (inner && outer) {
        out[count] = *quad;
        exchange_outer(&out[count++]);
    }
    return count;
}
