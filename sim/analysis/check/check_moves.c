#include "sim/analysis/check/check_moves.h"

#include <math.h>
#include <stdio.h>

typedef struct limits {
    double rate_radps, accel_radps2; /* INFINITY: none */
} limits;

/* Lowest limits of the axes needed to reach a direction. */
static limits lowest(const bst_mount_status *mount) {
    limits low = {INFINITY, INFINITY};
    for (int a = 0; a < mount->axes; a++) {
        const bst_mount_axis *axis = &mount->axis[a];
        if (axis->redundant) {
            continue;
        }
        if (axis->rate_limit_radps > 0.0) {
            low.rate_radps = fmin(low.rate_radps, axis->rate_limit_radps);
        }
        if (axis->accel_limit_radps2 > 0.0) {
            low.accel_radps2 = fmin(low.accel_radps2, axis->accel_limit_radps2);
        }
    }
    return low;
}

double bst_check_mount_slew_s(const bst_mount_status *mount, double angle_rad) {
    limits low = lowest(mount);
    if (isinf(low.accel_radps2)) {
        return isinf(low.rate_radps) ? 0.0 : angle_rad / low.rate_radps;
    }
    return isinf(low.rate_radps) ? 2.0 * sqrt(angle_rad / low.accel_radps2)
                                 : bst_search_slew_s(angle_rad, low.rate_radps, low.accel_radps2);
}

/* Largest step of a search pattern; 0: it has one position. */
static double step_of(const bst_check_mount_moves *m) {
    double side = fmax(m->width_rad, m->height_rad), least = fmin(m->width_rad, m->height_rad);
    double reach = fmin(m->control->search_sigmas * m->cue_sigma_rad,
                        m->control->search_max_deg * BST_DEG_RAD);
    bool one = m->region.kind == BST_REGION_NONE && reach <= 0.5 * least;
    return m->control->strategy != BST_CONTROL_TRACK || one ? 0.0 : m->control->search_step * side;
}

static double dwell_of(const bst_check_mount_moves *m) {
    /* the first complete frame at rest begins up to a period after arrival */
    return (double)m->control->dwell_frames * m->period_s + m->exposure_s;
}

/* Formats seconds with three digits, without exponent: "0.25 s", "1709 s". */
static const char *seconds_text(double seconds, char out[32]) {
    snprintf(out, 32, seconds < 100.0 ? "%.3g s" : "%.0f s", seconds);
    return out;
}

double bst_check_search_place_s(const bst_check_mount_moves *moves) {
    double step = step_of(moves);
    return step > 0.0 ? bst_check_mount_slew_s(moves->mount, step) + dwell_of(moves) : 0.0;
}

static int check_search(bst_ctx *ctx, const char *name, const bst_check_mount_moves *m) {
    double step = step_of(m), allowed = m->control->dwell_timeout_s;
    /* a time too short for the frames alone is reported by the rule short_times */
    if (step == 0.0 || bst_check_search_place_s(m) <= allowed || dwell_of(m) > allowed) {
        return 0;
    }
    limits low = lowest(m->mount);
    char text[32];
    double slew = bst_check_mount_slew_s(m->mount, step);
    bst_log(ctx, BST_LOG_WARNING,
            "%s: the mount takes %s for a step of the search (%.3g deg at %.3g deg/s^2 and at "
            "most %.3g deg/s): with dwell_frames of %lld, dwell_timeout_s of %g s is over first; "
            "raise its limits, or give control a dwell_timeout_s of %.0f s",
            name, seconds_text(slew, text), step / BST_DEG_RAD, low.accel_radps2 / BST_DEG_RAD,
            low.rate_radps / BST_DEG_RAD, (long long)m->control->dwell_frames, allowed,
            ceil(slew + dwell_of(m) + m->period_s));
    return 1;
}

static int check_scan(bst_ctx *ctx, const char *name, const bst_check_mount_moves *m) {
    double rate = fabs(m->control->scan_rate_arcsec_per_s) * BST_ARCSEC_RAD;
    if (m->control->strategy != BST_CONTROL_SCAN || m->region.kind == BST_REGION_NONE) {
        return 0;
    }
    limits low = lowest(m->mount);
    double length = 2.0 * m->region.half_length_rad, turn = 2.0 * rate / low.accel_radps2;
    if (rate > low.rate_radps) {
        bst_log(ctx, BST_LOG_WARNING,
                "%s: scan_rate_arcsec_per_s of %g is faster than the mount turns (%.4g arcsec/s); "
                "lower it or raise the mount's rate limit",
                name, rate / BST_ARCSEC_RAD, low.rate_radps / BST_ARCSEC_RAD);
        return 1;
    }
    if (turn * rate > length) {
        char text[2][32];
        bst_log(ctx, BST_LOG_WARNING,
                "%s: the mount takes %s to turn a scan round at its ends (%.3g deg/s^2), longer "
                "than the scan from end to end (%s); lower scan_rate_arcsec_per_s or raise the "
                "mount's acceleration limit",
                name, seconds_text(turn, text[0]), low.accel_radps2 / BST_DEG_RAD,
                seconds_text(length / rate, text[1]));
        return 1;
    }
    return 0;
}

int bst_check_moves(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves) {
    return check_search(ctx, name, moves) + check_scan(ctx, name, moves);
}

int bst_check_first_slew(bst_ctx *ctx, const char *name, const bst_check_mount_moves *moves,
                         double angle_rad) {
    limits low = lowest(moves->mount);
    double slew = bst_check_mount_slew_s(moves->mount, angle_rad);
    if (slew <= moves->duration_s) {
        return 0;
    }
    char text[32];
    bst_log(ctx, BST_LOG_WARNING,
            "%s: the slew to the cue, %.3g deg, takes %s at the mount's %.3g deg/s^2 and at "
            "most %.3g deg/s, and the run %g s; raise its limits, or start nearer to the cue",
            name, angle_rad / BST_DEG_RAD, seconds_text(slew, text), low.accel_radps2 / BST_DEG_RAD,
            low.rate_radps / BST_DEG_RAD, moves->duration_s);
    return 1;
}
