#include "scenegen/nodes.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Moments of a stretch of path: duration, first and second moments about `origin`. */
typedef struct moments {
    double weight, first[3], second[3][3];
} moments;

/* Adds the straight, uniform stretch from a to b (relative to the origin) of duration w. */
static void add_segment(moments *m, const double a[3], const double b[3], double w) {
    m->weight += w;
    for (int i = 0; i < 3; i++) {
        m->first[i] += w * 0.5 * (a[i] + b[i]);
        for (int j = 0; j <= i; j++) {
            m->second[i][j] +=
                w * ((a[i] * a[j] + b[i] * b[j]) / 3.0 + (a[i] * b[j] + b[i] * a[j]) / 6.0);
        }
    }
}

static double spread(const moments *m) {
    double total = 0.0;
    for (int i = 0; i < 3; i++) {
        double mean = m->first[i] / m->weight;
        total += m->second[i][i] / m->weight - mean * mean;
    }
    return total;
}

/* Eigenvectors (columns of v) and eigenvalues (diagonal of a) of a symmetric matrix: cyclic Jacobi
 * (Golub and Van Loan, Matrix Computations, 8.5). */
static void eigen3(double a[3][3], double v[3][3]) {
    static const int pairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    memset(v, 0, 9 * sizeof(double));
    v[0][0] = v[1][1] = v[2][2] = 1.0;
    for (int sweep = 0; sweep < 12; sweep++) {
        for (int k = 0; k < 3; k++) {
            int p = pairs[k][0], q = pairs[k][1];
            if (fabs(a[p][q]) <= 1e-18 * (fabs(a[p][p]) + fabs(a[q][q]))) {
                continue;
            }
            double theta = 0.5 * (a[q][q] - a[p][p]) / a[p][q];
            double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
            double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
            for (int i = 0; i < 3; i++) {
                double x = a[i][p], y = a[i][q];
                a[i][p] = c * x - s * y;
                a[i][q] = s * x + c * y;
            }
            for (int i = 0; i < 3; i++) {
                double x = a[p][i], y = a[q][i];
                a[p][i] = c * x - s * y;
                a[q][i] = s * x + c * y;
                x = v[i][p];
                y = v[i][q];
                v[i][p] = c * x - s * y;
                v[i][q] = s * x + c * y;
            }
        }
    }
}

static bst_status push(bst_ctx *ctx, bst_node_list *list, const double p[3], double weight) {
    if (list->count == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 256;
        bst_node *items = realloc(list->items, (size_t)capacity * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d nodes of a smear", capacity);
        }
        list->items = items;
        list->capacity = capacity;
    }
    list->items[list->count++] = (bst_node){{p[0], p[1], p[2]}, weight};
    return BST_OK;
}

/* Replaces a group by its nodes. Axes with less than `least` px^2 of variance are left out. */
static bst_status close_group(bst_ctx *ctx, const moments *m, const double origin[3], double least,
                              bst_node_list *list) {
    double mean[3], offset[3], covariance[3][3], axes[3][3];
    for (int i = 0; i < 3; i++) {
        offset[i] = m->first[i] / m->weight;
        mean[i] = origin[i] + offset[i];
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            covariance[i][j] = covariance[j][i] =
                m->second[i][j] / m->weight - offset[i] * offset[j];
        }
    }
    eigen3(covariance, axes);
    int active = 0;
    for (int k = 0; k < 3; k++) {
        active += covariance[k][k] > least;
    }
    if (active == 0) {
        return push(ctx, list, mean, m->weight);
    }
    for (int k = 0; k < 3; k++) {
        if (!(covariance[k][k] > least)) {
            continue;
        }
        double reach = sqrt(active * covariance[k][k]), plus[3], minus[3];
        for (int i = 0; i < 3; i++) {
            plus[i] = mean[i] + reach * axes[i][k];
            minus[i] = mean[i] - reach * axes[i][k];
        }
        double w = m->weight / (2.0 * active);
        BST_TRY(push(ctx, list, minus, w));
        BST_TRY(push(ctx, list, plus, w));
    }
    return BST_OK;
}

bst_status bst_nodes_from_path(bst_ctx *ctx, const bst_path_point *path, int count,
                               double psf_sigma_px, double tolerance, bst_node_list *list) {
    double total = path[count - 1].s - path[0].s;
    if (!(total > 0.0)) {
        return push(ctx, list, path[0].p, 1.0);
    }
    /* A pair on a uniform stretch of variance v misses 0.8 v^2 of the fourth moment, the image thus
     * 0.8 v^2 / 24 times the PSF's fourth derivative, 3 / sigma^4 of its peak: 0.1 v^2 / sigma^4.
     */
    double var = psf_sigma_px * psf_sigma_px;
    double most = var * sqrt(tolerance / 0.1);
    /* Jitter makes a group of several stretches skew: a third moment of v^(3/2) that is missed
     * changes the image by up to 0.23 (v / sigma^2)^(3/2), of which a fifth is left over after the
     * signs of neighbouring groups have cancelled (measured). */
    double most_bent = fmin(most, var * pow(tolerance / 0.05, 2.0 / 3.0));
    /* a left-out variance v changes the peak by v / (2 sigma^2) */
    double least = 0.5 * tolerance * var;
    moments group = {0};
    double origin[3] = {0};
    for (int k = 0; k + 1 < count; k++) {
        const bst_path_point *a = &path[k], *b = &path[k + 1];
        double w = (b->s - a->s) / total;
        if (!(w > 0.0)) {
            continue;
        }
        double from[3], to[3], length2 = 0.0;
        for (int i = 0; i < 3; i++) {
            from[i] = a->p[i] - origin[i];
            to[i] = b->p[i] - origin[i];
            length2 += (to[i] - from[i]) * (to[i] - from[i]);
        }
        if (group.weight > 0.0) {
            moments more = group;
            add_segment(&more, from, to, w);
            if (spread(&more) <= most_bent) {
                group = more;
                continue;
            }
            BST_TRY(close_group(ctx, &group, origin, least, list));
        }
        /* a new group that starts with this segment, cut when it is too long alone */
        int pieces = (int)fmin(ceil(sqrt(length2 / (12.0 * most))), 1e6);
        pieces = pieces < 1 ? 1 : pieces;
        for (int n = 0; n < pieces; n++) {
            if (n > 0) {
                BST_TRY(close_group(ctx, &group, origin, least, list));
            }
            double u = (double)n / pieces, v = (double)(n + 1) / pieces;
            double zero[3] = {0}, step[3];
            for (int i = 0; i < 3; i++) {
                origin[i] = a->p[i] + u * (b->p[i] - a->p[i]);
                step[i] = (v - u) * (b->p[i] - a->p[i]);
            }
            memset(&group, 0, sizeof group);
            add_segment(&group, zero, step, w / pieces);
        }
    }
    return close_group(ctx, &group, origin, least, list);
}

double bst_nodes_peak_share(const bst_node *nodes, int count, double psf_sigma_px) {
    double scale = 0.5 / (psf_sigma_px * psf_sigma_px), best = 0.0;
    int stride = count / 128 + 1;
    for (int a = 0; a < count; a += stride) {
        double sum = 0.0;
        for (int n = 0; n < count; n++) {
            double dx = nodes[n].p[0] - nodes[a].p[0], dy = nodes[n].p[1] - nodes[a].p[1];
            double q = (dx * dx + dy * dy) * scale;
            sum += q < 20.0 ? nodes[n].weight * exp(-q) : 0.0;
        }
        best = fmax(best, sum);
    }
    double line = erf(0.5 / (psf_sigma_px * sqrt(2.0)));
    return best * line * line;
}
