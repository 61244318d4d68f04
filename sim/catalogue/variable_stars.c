#include "sim/catalogue/variable_stars.h"

#include <erfa.h>
#include <erfam.h>
#include <math.h>

static const double AU_M = 149597870700.0;

void bst_star_observer_at(const bst_star_view *view, const bst_star_epoch *epoch,
                          bst_star_observer *out) {
    const bst_vec3 s = epoch->sun_m;
    *out = (bst_star_observer){.years = epoch->julian_year - BST_STAR_EPOCH_YEAR,
                               .at_barycentre = true};
    out->jd = ERFA_DJ00 + out->years * ERFA_DJY;
    if ((view->has_parallax || view->variable_count > 0) && bst_vec3_dot(s, s) > 0.0) {
        double helio[2][3], bary[2][3];
        (void)eraEpv00(ERFA_DJ00, out->jd - ERFA_DJ00, helio, bary);
        const bst_vec3 sun = {AU_M * (bary[0][0] - helio[0][0]), AU_M * (bary[0][1] - helio[0][1]),
                              AU_M * (bary[0][2] - helio[0][2])};
        out->barycentre_m = bst_vec3_sub(sun, s);
        out->at_barycentre = false;
    }
}

bst_vec3 bst_star_record_seen(const bst_star_record *r, const bst_star_observer *o) {
    bst_vec3 u = bst_star_record_direction(r, o->years);
    if (o->at_barycentre || !(r->pm_dec_flags & BST_STAR_PARALLAX_BITS)) {
        return u;
    }
    double parallax = bst_star_record_parallax_mas(r) * 1e-3 * BST_ARCSEC_RAD;
    return bst_vec3_unit(bst_vec3_axpy(u, -parallax / AU_M, o->barycentre_m));
}

/* Value of a light curve between its points; `wrap`: its times are phases. */
static double curve_mag(const bst_star_point *p, uint32_t count, double t, bool wrap) {
    const bst_star_point *last = &p[count - 1];
    if (t < (double)p->time || t >= (double)last->time) {
        if (!wrap) {
            return (double)(t < (double)p->time ? p->mag : last->mag);
        }
        /* from the last point over phase 1 to the first one */
        double gap = (double)p->time + 1.0 - (double)last->time;
        double along = t < (double)p->time ? t + 1.0 - (double)last->time : t - (double)last->time;
        double share = gap > 0.0 ? along / gap : 0.0;
        return (double)last->mag + share * (double)(p->mag - last->mag);
    }
    uint32_t low = 0, high = count - 1;
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        *((double)p[middle].time <= t ? &low : &high) = middle;
    }
    double share = (t - (double)p[low].time) / (double)(p[high].time - p[low].time);
    return (double)p[low].mag + share * (double)(p[high].mag - p[low].mag);
}

double bst_star_variable_mag(const bst_star_view *view, const bst_star_variable *v, double jd) {
    double days = jd - v->epoch_jd;
    if (v->period_d > 0.0) {
        double phase = days / v->period_d;
        phase -= floor(phase);
        return v->point_count == 0
                   ? 0.5 * (double)v->amplitude_mag * (1.0 - cos(2.0 * BST_PI * phase))
                   : curve_mag(view->points + v->first_point, v->point_count, phase, true);
    }
    return curve_mag(view->points + v->first_point, v->point_count, days, false);
}

const bst_star_variable *bst_star_variable_of(const bst_star_view *view, uint32_t star) {
    uint32_t low = 0, high = view->variable_count;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (view->variables[middle].star < star) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low < view->variable_count && view->variables[low].star == star ? &view->variables[low]
                                                                           : NULL;
}
