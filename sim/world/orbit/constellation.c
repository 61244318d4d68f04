#include "sim/world/orbit/constellation.h"

#include <math.h>
#include <stdio.h>

#include "boresight/vec.h"

/* WGS-72 constants of SGP4: m^3/s^2, m. */
static const double MU_72 = 3.986008e14, RADIUS_72_M = 6378135.0;
/* lowest perigee height of a constellation: below it no orbit lasts */
static const double LEAST_HEIGHT_M = 100e3;

bst_status bst_constellation_check(bst_ctx *ctx, const bst_constellation_config *c) {
    if (c->satellites % c->planes != 0) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "satellites: %lld do not divide into %lld planes; give a multiple of planes",
            (long long)c->satellites, (long long)c->planes);
    }
    if (c->phasing >= c->planes) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "phasing: %lld is not below the number of planes, %lld (allowed: 0 to %lld)",
            (long long)c->phasing, (long long)c->planes, (long long)c->planes - 1);
    }
    double height = c->semi_major_axis_m * (1.0 - c->eccentricity) - RADIUS_72_M;
    if (!(height >= LEAST_HEIGHT_M)) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "semi_major_axis_m: the perigee is at a height of %.1f km (allowed: from "
                        "%.0f km on)",
                        1e-3 * height, 1e-3 * LEAST_HEIGHT_M);
    }
    return BST_OK;
}

/* Converts an angle in degrees to radians in [0, 2 pi). */
static double turned_rad(double deg) {
    double d = fmod(deg, 360.0);
    return (d < 0.0 ? d + 360.0 : d) * BST_DEG_RAD;
}

bst_elements bst_constellation_elements(const bst_constellation_config *c, bst_time epoch,
                                        int plane, int slot) {
    double planes = (double)c->planes, all = (double)c->satellites, per_plane = all / planes;
    double spread_deg = c->pattern == BST_WALKER_STAR ? 180.0 : 360.0, k = plane - 1;
    double a = c->semi_major_axis_m;
    bst_elements out = {
        .inclination_rad = c->inclination_deg * BST_DEG_RAD,
        .raan_rad = turned_rad(c->raan_deg + spread_deg * k / planes),
        .eccentricity = c->eccentricity,
        .arg_perigee_rad = turned_rad(c->arg_perigee_deg),
        .mean_anomaly_rad = turned_rad(c->mean_anomaly_deg + 360.0 * (slot - 1) / per_plane +
                                       360.0 * (double)c->phasing * k / all),
        .mean_motion_radpmin = 60.0 * sqrt(MU_72 / (a * a * a))};
    bst_time_utc(bst_time_add(epoch, c->at_s), &out.epoch_utc_jd1, &out.epoch_utc_jd2);
    return out;
}

void bst_constellation_name(const bst_constellation_config *c, int plane, int slot, char name[64]) {
    snprintf(name, 64, "%s %d-%d", c->name, plane, slot);
}
