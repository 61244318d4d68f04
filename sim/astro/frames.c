#include "sim/astro/frames.h"

#include <erfa.h>
#include <erfam.h>
#include <string.h>

#include "sim/astro/frames_internal.h"

/* Rate of the Earth rotation angle, rad per SI second of UT1 (IERS Conventions 2010, eq. 5.15). */
#define EARTH_RATE_RADPS (2.0 * BST_PI * 1.00273781191135448 / 86400.0)

/* R3(angle) a: rotates the axes of a's result by angle about z. */
static bst_mat3 turn_z_mul(double angle_rad, const bst_mat3 *a) {
    double c = cos(angle_rad), s = sin(angle_rad);
    bst_mat3 r = *a;
    for (int j = 0; j < 3; j++) {
        r.m[0][j] = c * a->m[0][j] + s * a->m[1][j];
        r.m[1][j] = c * a->m[1][j] - s * a->m[0][j];
    }
    return r;
}

/* UT1 - TAI in seconds at t. */
static bst_status ut1_minus_tai(bst_ctx *ctx, bst_time t, const bst_astro_eop_values *eop,
                                double *seconds) {
    double utc1, utc2, fraction, tai_minus_utc_s = 0.0;
    int year, month, day;
    bst_time_utc(t, &utc1, &utc2);
    if (eraJd2cal(utc1, utc2, &year, &month, &day, &fraction) != 0 ||
        eraDat(year, month, day, fraction, &tai_minus_utc_s) < 0) {
        return bst_fail(ctx, BST_ERR_RANGE, "no UTC is defined at JD %.6f", utc1 + utc2);
    }
    *seconds = eop->ut1_minus_utc_s - tai_minus_utc_s;
    return BST_OK;
}

bst_status bst_astro_earth_parts_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                    bst_time read_at, bst_astro_earth_parts *out) {
    bst_astro_eop_values values;
    double tt1, tt2, ut1_minus_tai_s = 0.0, m[3][3];
    BST_TRY(bst_astro_eop_at(ctx, eop, read_at, &values));
    BST_TRY(ut1_minus_tai(ctx, read_at, &values, &ut1_minus_tai_s));
    double ut1 = t.jd1, ut2 = t.jd2 + ut1_minus_tai_s / ERFA_DAYSEC;
    bst_time_tt(t, &tt1, &tt2);
    double tio_rad = eraSp00(tt1, tt2);
    eraC2i06a(tt1, tt2, m);
    memcpy(out->cirs_from_gcrf.m, m, sizeof m);
    eraPom00(values.xp_rad, values.yp_rad, tio_rad, m);
    memcpy(out->itrf_from_tirs.m, m, sizeof m);
    out->era_rad = eraEra00(ut1, ut2);
    /* TEME to ITRF uses GMST82 and polar motion without the TIO locator; the remaining rotation to
     * CIRS is about z */
    out->teme_turn_rad = eraAnpm(eraGmst82(ut1, ut2) - out->era_rad - tio_rad);
    return BST_OK;
}

bst_astro_earth_frames bst_astro_earth_frames_from_parts(const bst_astro_earth_parts *parts) {
    bst_mat3 teme_from_gcrf = turn_z_mul(-parts->teme_turn_rad, &parts->cirs_from_gcrf);
    bst_mat3 tirs_from_gcrf = turn_z_mul(parts->era_rad, &parts->cirs_from_gcrf);
    return (bst_astro_earth_frames){bst_mat3_transpose(&teme_from_gcrf),
                                    bst_mat3_mul(&parts->itrf_from_tirs, &tirs_from_gcrf)};
}

bst_status bst_astro_earth_frames_at(bst_ctx *ctx, const bst_astro_eop *eop, bst_time t,
                                     bst_astro_earth_frames *out) {
    bst_astro_earth_parts parts;
    BST_TRY(bst_astro_earth_parts_at(ctx, eop, t, t, &parts));
    *out = bst_astro_earth_frames_from_parts(&parts);
    return BST_OK;
}

bst_vec3 bst_astro_earth_rate_gcrf(const bst_astro_earth_frames *frames) {
    /* TEME's z axis is the celestial intermediate pole. */
    const bst_mat3 *m = &frames->gcrf_from_teme;
    return (bst_vec3){EARTH_RATE_RADPS * m->m[0][2], EARTH_RATE_RADPS * m->m[1][2],
                      EARTH_RATE_RADPS * m->m[2][2]};
}
