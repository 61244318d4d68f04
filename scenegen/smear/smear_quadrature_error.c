#include <math.h>
#include <string.h>

#include "boresight/vec.h"
#include "scenegen/smear/motion.h"
#include "scenegen/smear/smear_quadrature.h"
#include "scenegen/smear/smear_quadrature_internal.h"

/* Principal axis by repeated squaring of the matrix until one column dominates. */
void bst_smear_nodes_main_axis(double a[3][3], double axis[3]) {
    double p[3][3];
    memcpy(p, a, sizeof p);
    for (int round = 0; round < 6; round++) {
        double q[3][3], trace = p[0][0] + p[1][1] + p[2][2], scale = 1.0 / (trace * trace);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                q[i][j] = (p[i][0] * p[0][j] + p[i][1] * p[1][j] + p[i][2] * p[2][j]) * scale;
            }
        }
        memcpy(p, q, sizeof p);
    }
    int most = p[1][1] > p[0][0] ? 1 : 0;
    most = p[2][2] > p[most][most] ? 2 : most;
    double length = 0.0;
    for (int i = 0; i < 3; i++) {
        axis[i] = p[i][most];
        length += axis[i] * axis[i];
    }
    for (int i = 0; i < 3; i++) {
        axis[i] /= sqrt(length);
    }
}

/* Directions of the image, from `angle` to within `range`, that the table has. */
static bool within(double angle, double range, int d) {
    double step = BST_PI / BST_NODE_DIRECTIONS;
    double off = fabs(remainder(angle - d * step, BST_PI));
    return off <= range + step; /* those on both sides */
}

bst_smear_direction_parts bst_smear_find_direction_parts(const bst_smear_maker *m,
                                                         const double axis[3], int nodes) {
    bst_smear_direction_parts out = {1.0, 1.0, 1.0, {false}};
    if (!m->direction_part) {
        return out;
    }
    /* tilts about x and y move the image along -y and x, and a roll by as much in any direction */
    double x = m->turns ? axis[1] : axis[0], y = m->turns ? -axis[0] : axis[1];
    double shift = sqrt(x * x + y * y), roll = fabs(axis[2]);
    double range = roll < shift ? asin(roll / shift) + m->unlike_rad : BST_PI, angle = atan2(y, x);
    double any[3] = {0.0}, along[3] = {0.0};
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        for (int k = 0; k < 3; k++) {
            double part = m->direction_part[d][k];
            any[k] = fmax(any[k], part);
            along[k] = within(angle, range, d) ? fmax(along[k], part) : along[k];
        }
        out.in_range[d] = within(angle, range, d);
    }
    /* covariance and higher moments across the axis too: all directions, orders 2 to 4 */
    out.second = fmin(any[0] / m->pixel_part[0], 1.0);
    out.higher = fmin(fmax(any[0], any[1]) / m->pixel_part[0], 1.0);
    out.missed = nodes > 1 ? fmin(along[nodes - 1] / m->pixel_part[nodes - 1], 1.0) : 1.0;
    return out;
}

/* Ripple between two steps. */
static double ripple_at(const double ripple[BST_ROW_STEPS], double at) {
    int n = (int)fmin(at, BST_ROW_STEPS - 2.0);
    return ripple[n] + (at - n) * (ripple[n + 1] - ripple[n]);
}

/* Greatest product of ripple and power of the frequency about one, of a row in direction d: groups
 * beside others of unlike speed are no even row, which has a range of frequencies. */
static double row_error(const double ripple[BST_ROW_STEPS], double at, bool even, int power) {
    enum { STEPS = 2 };
    static const double RANGE = 0.15;
    double worst = 0.0;
    for (int k = even ? 0 : -STEPS; k <= (even ? 0 : STEPS); k++) {
        double part = 1.0 + RANGE * k / STEPS, step = part * at;
        double error = step < BST_ROW_STEPS - 1 ? ripple_at(ripple, step) : 0.0;
        worst = fmax(worst, error * (power == 4 ? part * part : part * part * part) *
                                (power == 4 ? part * part : part * part * part));
    }
    return worst;
}

double bst_smear_row_part(const bst_smear_maker *m, const bst_smear_direction_parts *parts,
                          const bst_smear_rule *r, double scale, bool even, int *pattern) {
    /* factor by the Peano kernel of a group of uniform motion: its variance is 0.0198 (two nodes)
     * and 0.0152 (three) of the length squared, so that exp(-w^2 variance / 2) is the same for all
     */
    static const double kernel[2] = {0.68, 0.74}, gaussian[2] = {3.0, 15.0};
    *pattern = BST_PATTERN_ROW;
    if (!m->direction_part || r->nodes < 2) {
        return 0.0;
    }
    double low = r->node[0], high = r->node[0], worst = 0.0;
    for (int i = 1; i < r->nodes; i++) {
        low = fmin(low, r->node[i]);
        high = fmax(high, r->node[i]);
    }
    /* outer nodes of Gauss-Legendre quadrature: 0.577 and 0.775 of the length apart */
    double length = (high - low) / (r->nodes == 2 ? 0.57735027 : 0.77459667) * scale;
    double at = BST_ROW_STEPS / fmax(m->most_per_px * length, 1e-9);
    for (int d = 0; d < BST_NODE_DIRECTIONS; d++) {
        if (parts->in_range[d]) {
            worst = fmax(worst, row_error(m->row_ripple[d], at, even, 2 * r->nodes));
        }
    }
    double sigma = sqrt(m->variance), w = 2.0 * BST_PI * sigma / fmax(length, 1e-9),
           w4 = w * w * w * w;
    *pattern = BST_PATTERN_ROW + bst_row_length(length / sigma);
    worst *= kernel[r->nodes - 2] * (r->nodes == 2 ? w4 : w4 * w * w);
    return worst / (gaussian[r->nodes - 2] * m->pixel_part[r->nodes - 1]);
}

double bst_smear_nodes_error(const double error[BST_NODE_SCALES], double scale) {
    double k = 2.0 * log2(fmax(scale, 1e-9)) + BST_NODE_SCALES - 2;
    if (k <= 0.0) {
        return error[0];
    }
    int n = (int)fmin(k, BST_NODE_SCALES - 1.0);
    if (n == BST_NODE_SCALES - 1) { /* nor faster than the sixth power */
        return error[n] * exp2(3.0 * (k - n));
    }
    /* sums of powers are log-convex: a chord is an upper bound */
    return error[n] > 0.0 ? error[n] * pow(error[n + 1] / error[n], k - n) : error[n + 1];
}

void bst_smear_nodes_clear(bst_smear_node_list *list) {
    list->count = 0;
    memset(list->error, 0, sizeof list->error);
    memset(list->predicted, 0, sizeof list->predicted);
    memset(list->higher, 0, sizeof list->higher);
    memset(list->missed, 0, sizeof list->missed);
    list->directions = 0U;
    list->rests = false;
}

void bst_smear_nodes_parts(const bst_smear_node *nodes, int count, double psf_sigma_px,
                           bool widening, double part[BST_NODE_PARTS]) {
    enum { ANCHORS = 24 };
    double scale = 0.5 / (psf_sigma_px * psf_sigma_px), worst[BST_NODE_PARTS] = {0.0};
    double least = INFINITY, narrowest = INFINITY, light = 0.0, sum[BST_NODE_PARTS] = {0.0};
    int brightest[2] = {0, 0}; /* by the bound, and by the predicted error */
    for (int n = 0; n < count; n++) {
        const bst_smear_node *at = &nodes[n];
        const bst_smear_node *most[2] = {&nodes[brightest[0]], &nodes[brightest[1]]};
        if (at->error * at->weight > most[0]->error * most[0]->weight) {
            brightest[0] = n;
        }
        if (at->predicted * at->weight > most[1]->predicted * most[1]->weight) {
            brightest[1] = n;
        }
        const double value[BST_NODE_PARTS] = {at->error, at->predicted, at->variance};
        for (int i = 0; i < BST_NODE_PARTS; i++) {
            worst[i] = value[i] > worst[i] ? value[i] : worst[i];
        }
        least = at->error < least ? at->error : least;
        narrowest = at->variance < narrowest ? at->variance : narrowest;
    }
    for (int i = 0; i < BST_NODE_PARTS; i++) {
        part[i] = 1.0;
    }
    bool alike = !(worst[BST_PART_BOUND] > 0.0) || least > 0.9 * worst[BST_PART_BOUND];
    if (alike && (!widening || narrowest >= 0.9 * worst[BST_PART_WIDENING])) {
        return;
    }
    int stride = count / ANCHORS + 1;
    for (int a = -2; a < count; a += a < 0 ? 1 : stride) {
        const bst_smear_node *at = &nodes[a < 0 ? brightest[a + 2] : a];
        double here = 0.0, missed = 0.0, predicted = 0.0, widened = 0.0;
        for (int n = 0; n < count; n++) {
            const double *p = nodes[n].p;
            double dx = p[0] - at->p[0], dy = p[1] - at->p[1], dz = p[2] - at->p[2];
            double q = (dx * dx + dy * dy + dz * dz) * scale;
            double share = q < 20.0 ? nodes[n].weight * exp(-q) : 0.0;
            here += share;
            missed += share * nodes[n].error;
            predicted += share * nodes[n].predicted;
            widened += share * nodes[n].variance;
        }
        light = fmax(light, here);
        sum[BST_PART_BOUND] = fmax(sum[BST_PART_BOUND], missed);
        sum[BST_PART_PREDICTED] = fmax(sum[BST_PART_PREDICTED], predicted);
        sum[BST_PART_WIDENING] = fmax(sum[BST_PART_WIDENING], widened);
    }
    for (int i = alike ? BST_PART_PREDICTED : BST_PART_BOUND; i < BST_NODE_PARTS; i++) {
        part[i] = worst[i] > 0.0 ? fmin(sum[i] / (worst[i] * light), 1.0) : 1.0;
    }
}
