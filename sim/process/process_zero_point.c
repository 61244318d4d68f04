/* Photometric zero point of a frame. */
#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "sim/core/compare.h"
#include "sim/process/process_internal.h"

/* Largest distance of a matched star from its predicted place. */
static const double NEAR_PX = 4.0;

/* V of the brightest predicted star at a place; NAN: none. */
static double v_mag_at(const bst_predicted_stars *sky, int count, double x_px, double y_px) {
    double v = NAN;
    for (int i = 0; i < count; i++) {
        const bst_imgproc_expected_star *e = &sky->expected[i];
        if (hypot(e->x_px - x_px, e->y_px - y_px) < NEAR_PX && !(e->v_mag >= v)) {
            v = e->v_mag;
        }
    }
    return v;
}

bst_status bst_process_zero_point(bst_ctx *ctx, bst_predicted_stars *sky, const bst_light *light,
                                  const bst_plate_solve_result *result, double v_limit,
                                  bst_process_frame *f) {
    assert(sky && light && result && f);
    double values[BST_PLATE_SOLVE_STARS];
    int expected, n = 0;
    const bst_predicted_stars_query query = {
        f->q_middle,
        light,
        {0, 0, (int)sky->camera->width_px, (int)sky->camera->height_px},
        NEAR_PX,
        v_limit + 2.0};
    f->zero_point_mag = NAN;
    BST_TRY(bst_predicted_stars_expect(ctx, sky, &query, &expected));
    for (int i = 0; i < result->matched_count; i++) {
        const bst_plate_solve_star *s = &result->matched[i];
        double v = v_mag_at(sky, expected, s->x_px, s->y_px);
        double rate = s->flux * f->values.gain_e_per_dn / fmax(f->values.exposure_s, 1e-9);
        if (isfinite(v) && rate > 0.0) {
            values[n++] = v + 2.5 * log10(rate);
        }
    }
    qsort(values, (size_t)n, sizeof *values, bst_compare_doubles);
    f->zero_point_mag = n > 0 ? values[n / 2] : NAN;
    return BST_OK;
}
