#include "control/guidance/slew.h"

#include <math.h>

bool bst_slew_axis_plan(double from_rad, double from_radps, double to_rad, double to_radps,
                        double rate_limit_radps, double accel_limit_radps2, bst_slew_axis *out) {
    double a = accel_limit_radps2;
    double limit = rate_limit_radps > 0.0 ? rate_limit_radps : INFINITY;
    double d = from_rad - to_rad, w = from_radps - to_radps;
    if (!(a > 0.0) || !isfinite(d) || !isfinite(w) || !isfinite(a) || fabs(to_radps) >= limit) {
        return false;
    }
    *out = (bst_slew_axis){
        .from_rad = from_rad, .from_radps = from_radps, .to_rad = to_rad, .to_radps = to_radps};
    /* the end of immediate braking decides the direction of motion */
    double rest = d + 0.5 * w * fabs(w) / a;
    double way = rest > 0.0 ? -1.0 : 1.0;
    double distance = -way * d, start = way * w; /* remaining distance, and rate along it */
    double most = limit - way * to_radps;
    double peak = sqrt(fmax(a * distance + 0.5 * start * start, 0.0));
    peak = fmin(peak, most);
    double first = fabs(peak - start) / a;
    double gone = 0.5 * (peak + start) * first + 0.5 * peak * peak / a;
    double coast = peak > 0.0 ? fmax(distance - gone, 0.0) / peak : 0.0;
    out->accel_radps2[0] = way * copysign(a, peak - start);
    out->accel_radps2[2] = -way * a;
    out->until_s[0] = first;
    out->until_s[1] = first + coast;
    out->until_s[2] = first + coast + peak / a;
    out->duration_s = out->until_s[2];
    return true;
}

void bst_slew_axis_at(const bst_slew_axis *slew, double seconds, double *angle_rad,
                      double *rate_radps, double *accel_radps2) {
    *accel_radps2 = 0.0;
    if (seconds >= slew->duration_s) {
        *angle_rad = slew->to_rad + slew->to_radps * seconds;
        *rate_radps = slew->to_radps;
        return;
    }
    double x = slew->from_rad, v = slew->from_radps, since = 0.0;
    for (int i = 0; i < 3 && seconds > since; i++) {
        double t = fmin(seconds, slew->until_s[i]) - since;
        x += v * t + 0.5 * slew->accel_radps2[i] * t * t;
        v += slew->accel_radps2[i] * t;
        *accel_radps2 = slew->accel_radps2[i];
        since = slew->until_s[i];
    }
    *angle_rad = x;
    *rate_radps = v;
}

/* Path derivatives at a node: q' and q''. */
typedef struct slopes {
    double first[BST_SLEW_AXES], second[BST_SLEW_AXES];
} slopes;

static slopes slopes_at(const bst_slew_nodes *nodes, int axes, int j) {
    slopes out = {{0.0}, {0.0}};
    double h = nodes->step;
    /* one-sided at the ends and next to a corner, where the path has no derivative */
    int low = j > 0 && !(nodes->corner[j] && j < nodes->count - 1) ? j - 1 : j;
    int high = j < nodes->count - 1 ? j + 1 : j;
    for (int i = 0; i < axes; i++) {
        double before = nodes->angle_rad[low][i], here = nodes->angle_rad[j][i];
        double after = nodes->angle_rad[high][i];
        out.first[i] = (after - before) / ((high - low) * h);
        if (high - low == 2) {
            out.second[i] = (after - 2.0 * here + before) / (h * h);
        }
    }
    return out;
}

/* Largest z permitted by the rate limits. */
static double largest_speed(const slopes *p, const bst_slew_limits *limits) {
    double z = INFINITY;
    for (int i = 0; i < limits->axes; i++) {
        double v = limits->rate_radps[i], q = fabs(p->first[i]), bend = fabs(p->second[i]);
        if (v > 0.0 && q > 0.0) {
            z = fmin(z, v * v / (q * q));
        }
        if (q == 0.0 && bend > 0.0) {
            z = fmin(z, limits->accel_radps2[i] / bend);
        }
    }
    return z;
}

/* Range of accelerations u permitted by the limits at z; false if it is empty. */
static bool range_of(const slopes *p, const bst_slew_limits *limits, double z, double *least,
                     double *most) {
    *least = -INFINITY;
    *most = INFINITY;
    for (int i = 0; i < limits->axes; i++) {
        double q = p->first[i], a = limits->accel_radps2[i], bend = p->second[i] * z;
        if (q == 0.0) {
            continue;
        }
        double x = (-a - bend) / q, y = (a - bend) / q;
        *least = fmax(*least, fmin(x, y));
        *most = fmin(*most, fmax(x, y));
    }
    return *least <= *most;
}

/* True if the next node can be reached with z between low and high. */
static bool leads(const slopes *p, const bst_slew_limits *limits, double h, double z, double low,
                  double high) {
    double least, most;
    return range_of(p, limits, z, &least, &most) && z + 2.0 * h * most >= low &&
           z + 2.0 * h * least <= high;
}

/* Checks number of nodes, step, limits and angles. */
static bool well_formed(const bst_slew_nodes *nodes, const bst_slew_limits *limits) {
    bool good = nodes->count >= 2 && nodes->count <= BST_SLEW_NODES && nodes->step > 0.0 &&
                limits->axes >= 1 && limits->axes <= BST_SLEW_AXES;
    for (int i = 0; good && i < limits->axes; i++) {
        good = limits->accel_radps2[i] > 0.0 && isfinite(limits->accel_radps2[i]);
        for (int j = 0; good && j < nodes->count; j++) {
            good = isfinite(nodes->angle_rad[j][i]);
        }
    }
    return good;
}

bool bst_slew_path_plan(const bst_slew_nodes *nodes, const bst_slew_limits *limits,
                        double start_rate, double end_rate, bst_slew_path *out) {
    if (!well_formed(nodes, limits)) {
        return false;
    }
    int last = nodes->count - 1;
    double h = nodes->step;
    double *most = out->square; /* first the largest z from which the remaining path is feasible */
    for (int j = last; j >= 0; j--) {
        slopes p = slopes_at(nodes, limits->axes, j);
        double top = largest_speed(&p, limits);
        if (nodes->corner[j] && j > 0 && j < last) {
            most[j] = 0.0;
            continue;
        }
        if (j == last) {
            most[j] = fmin(end_rate * end_rate, top);
            continue;
        }
        /* bounds the search if no axis has a limit */
        top = fmin(top, 1e12);
        double low = 0.0, high = top;
        if (leads(&p, limits, h, top, 0.0, most[j + 1])) {
            low = top;
        } else {
            for (int k = 0; k < 60; k++) {
                double z = 0.5 * (low + high);
                if (leads(&p, limits, h, z, 0.0, most[j + 1])) {
                    low = z;
                } else {
                    high = z;
                }
            }
        }
        most[j] = low;
    }
    double z = fmin(start_rate * start_rate, most[0]), time = 0.0;
    out->count = nodes->count;
    out->step = h;
    out->square[0] = z;
    out->time_s[0] = 0.0;
    for (int j = 0; j < last; j++) {
        slopes p = slopes_at(nodes, limits->axes, j);
        double least = 0.0, up = 0.0;
        if (!range_of(&p, limits, z, &least, &up)) {
            up = 0.0;
        }
        double next = fmin(fmax(z + 2.0 * h * up, 0.0), most[j + 1]);
        double sum = sqrt(z) + sqrt(next);
        if (!(sum > 0.0)) {
            return false; /* two adjacent corners */
        }
        time += 2.0 * h / sum;
        z = next;
        out->square[j + 1] = z;
        out->time_s[j + 1] = time;
    }
    out->duration_s = time;
    return isfinite(time);
}

void bst_slew_path_at(const bst_slew_path *path, double seconds, double *s, double *rate,
                      double *accel) {
    int last = path->count - 1;
    *accel = 0.0;
    if (seconds <= 0.0 || seconds >= path->duration_s) {
        bool before = seconds <= 0.0;
        *s = before ? 0.0 : path->step * last;
        *rate = before && seconds < 0.0 ? 0.0 : sqrt(path->square[before ? 0 : last]);
        return;
    }
    int low = 0, high = last;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (path->time_s[middle] <= seconds) {
            low = middle;
        } else {
            high = middle;
        }
    }
    double t = seconds - path->time_s[low], v = sqrt(path->square[low]);
    *accel = (path->square[low + 1] - path->square[low]) / (2.0 * path->step);
    *s = path->step * low + v * t + 0.5 * *accel * t * t;
    *rate = v + *accel * t;
}
