#include "obsgen/route.h"

#include <math.h>
#include <stdbool.h>

#include "sim/core/vec.h"

static double density(double z) {
    return exp(-0.5 * z * z) / 2.5066282746310002;
}
static double below(double z) {
    return 0.5 * erfc(-z * 0.70710678118654752);
}

/* Ends of a path that stands still: this far on, light is gone. */
static const double BEYOND_SIGMAS = 4.0;

static void add_node(bst_route_node *nodes, int *count, double x, double y, double time) {
    enum { BACK = 48 }; /* further back a path that returns is another part of the way */
    for (int i = *count - 1; i >= 0 && i >= *count - BACK; i--) {
        if (fabs(nodes[i].x - x) < 0.7 && fabs(nodes[i].y - y) < 0.7) {
            return;
        }
    }
    if (*count < BST_ROUTE_NODES) {
        nodes[(*count)++] = (bst_route_node){x, y, time, 0.0};
    }
}

/* Straight on from one node, away from another. */
static void lay_on(bst_route_node *nodes, int *count, int end, int before, double sigma_px,
                   double time) {
    const bst_route_node e = nodes[end], b = nodes[before];
    double dx = e.x - b.x, dy = e.y - b.y, length = hypot(dx, dy);
    for (int i = 1; i <= (int)ceil(BEYOND_SIGMAS * sigma_px) && length > 0.0; i++) {
        add_node(nodes, count, e.x + i * dx / length, e.y + i * dy / length, time);
    }
}

/* Light of the whole path at a place: each piece a uniform segment. */
static double light_at(const bst_route_path *p, double x, double y, double s) {
    double sum = 0.0;
    for (int k = 1; k < p->count; k++) {
        double dx = p->x_px[k] - p->x_px[k - 1], dy = p->y_px[k] - p->y_px[k - 1];
        double mx = x - 0.5 * (p->x_px[k] + p->x_px[k - 1]),
               my = y - 0.5 * (p->y_px[k] + p->y_px[k - 1]);
        double length = hypot(dx, dy), near = 6.0 * s + 0.5 * length;
        if (fabs(mx) > near || fabs(my) > near) {
            continue;
        }
        if (length < 0.3 * s) {
            sum += exp(-0.5 * (mx * mx + my * my) / (s * s));
            continue;
        }
        double u = (mx * dx + my * dy) / length, v = (my * dx - mx * dy) / length;
        sum += exp(-0.5 * v * v / (s * s)) * (s / length) * 2.5066282746310002 *
               (below((u + 0.5 * length) / s) - below((u - 0.5 * length) / s));
    }
    return sum / (p->count - 1);
}

int bst_route_lay(const bst_route_path *p, double sigma_px, bst_route_node *nodes) {
    int count = 0;
    add_node(nodes, &count, p->x_px[0], p->y_px[0], 0.0);
    for (int k = 1; k < p->count; k++) {
        double dx = p->x_px[k] - p->x_px[k - 1], dy = p->y_px[k] - p->y_px[k - 1];
        int steps = (int)fmin(ceil(hypot(dx, dy)), BST_ROUTE_NODES);
        for (int i = 1; i <= steps; i++) {
            double part = (double)i / steps;
            add_node(nodes, &count, p->x_px[k - 1] + part * dx, p->y_px[k - 1] + part * dy,
                     (k - 1 + part) / (p->count - 1));
        }
    }
    int last = count - 1;
    if (last > 0) {
        lay_on(nodes, &count, last, last > 2 ? last - 3 : 0, sigma_px, 1.0);
        /* those before the start go first, so that nodes stay in the order of the way */
        int laid = count;
        lay_on(nodes, &count, 0, last > 2 ? 3 : last, sigma_px, 0.0);
        int more = count - laid;
        for (int i = 0; i < more; i++) {
            bst_route_node moved = nodes[count - 1];
            for (int k = count - 1; k > i; k--) {
                nodes[k] = nodes[k - 1];
            }
            nodes[i] = moved;
        }
    }
    for (int i = 0; i < count; i++) {
        nodes[i].light = light_at(p, nodes[i].x, nodes[i].y, sigma_px * sqrt(2.0));
    }
    return count;
}

void bst_route_bias(const bst_route_path *p, double dx_px, double dy_px, double bend_x_px,
                    double bend_y_px, double sigma_px, double bias_px[2]) {
    double s = sigma_px * sqrt(2.0), length = hypot(dx_px, dy_px);
    double c = length > 0.0 ? dx_px / length : 1.0, n = length > 0.0 ? dy_px / length : 0.0;
    bool drawn = length > 0.3 * s;
    double along = 0.0, across = 0.0, value = 0.0;
    for (int k = 0; k < p->count; k++) {
        double t = -1.0 + 2.0 * k / (p->count - 1), bent = 0.5 * (3.0 * t * t - 1.0);
        double weight = k == 0 || k == p->count - 1 ? 0.5 : 1.0;
        double x = p->x_px[k] - bent * bend_x_px, y = p->y_px[k] - bent * bend_y_px;
        double u = x * c + y * n, v = y * c - x * n, fall = weight * exp(-0.5 * v * v / (s * s));
        if (drawn) {
            double high = (u + 0.5 * length) / s, low = (u - 0.5 * length) / s;
            double inside = fall * (below(high) - below(low));
            along += fall * (density(low) - density(high)) / s;
            across += inside * v / (s * s);
            value += inside;
        } else {
            double peak = fall * exp(-0.5 * u * u / (s * s));
            along += peak * u / (s * s);
            across += peak * v / (s * s);
            value += peak;
        }
    }
    value /= p->count - 1;
    along /= p->count - 1;
    across /= p->count - 1;
    /* information of the model, of the same norm: of a streak minus the second derivative of its
     * autocorrelation */
    double info = drawn ? 2.0 * (density(0.0) - density(length / s)) / (s * length)
                        : 1.0 / (s * s) * fmax(value, 1e-6);
    double a = fmax(-s, fmin(along / info, s));
    double b = fmax(-s, fmin(across * s * s / fmax(value, 1e-6), s));
    bias_px[0] = a * c - b * n;
    bias_px[1] = a * n + b * c;
}
