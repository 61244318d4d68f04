#include "imgproc/calibrate/calibrate_pixels.h"

#include "imgproc/detect/background.h"

/* Dark subtraction, flat-field correction and bad-pixel masking of part of a binned row, from the
 * full-sensor calibration maps. */
static void apply_calibration_maps(const bst_calibrate_pixels *e, int y, int first, int count,
                                   float *out) {
    const bst_imgproc_frame *frame = e->frame;
    int b = frame->binning;
    size_t stride = (size_t)e->camera->width_px;
    float share = 1.0f / (float)(b * b);
    for (int x = 0; x < count; x++) {
        float dark = 0.0f, flat = 0.0f;
        bool bad = false;
        for (int j = 0; j < b; j++) {
            size_t k = (size_t)(frame->window.y0 + y * b + j) * stride +
                       (size_t)(frame->window.x0 + (first + x) * b);
            for (int i = 0; i < b; i++, k++) {
                dark += e->maps->dark_e_per_s ? e->maps->dark_e_per_s[k] : 0.0f;
                flat += e->maps->flat ? e->maps->flat[k] : 1.0f;
                bad = bad || (e->bad && e->bad[k]);
            }
        }
        bad = bad || !(flat > 0.0f);
        out[x] = bad ? BST_PIXEL_BAD : (out[x] - dark * (float)frame->exposure_s) / (flat * share);
    }
}

bool bst_calibrate_pixels_plain(const bst_calibrate_pixels *e, bst_row_gain *gain) {
    *gain = (bst_row_gain){(float)e->camera->offset_dn, (float)e->camera->gain_e_per_dn};
    return !e->maps->dark_e_per_s && !e->maps->flat && !e->bad && !e->columns;
}

void bst_calibrate_pixels_read(const void *electrons, int y, int x, int count, float *out) {
    const bst_calibrate_pixels *e = electrons;
    bst_row_gain gain;
    (void)bst_calibrate_pixels_plain(e, &gain);
    int width = e->frame->window.width / e->frame->binning;
    bst_row_electrons(e->frame->pixels + (size_t)y * (size_t)width + (size_t)x, count, gain.offset,
                      gain.gain, out);
    for (int i = 0; e->columns && i < count; i++) {
        out[i] -= e->columns->level_e[e->first_column + x + i];
    }
    if (e->maps->dark_e_per_s || e->maps->flat || e->bad) {
        apply_calibration_maps(e, y, x, count, out);
    }
    if (e->learned && e->learned->count > 0) {
        const bst_bad_rows_run run = {&e->frame->window, e->frame->binning, y, x, count};
        bst_bad_rows_mask(e->learned, &run, BST_PIXEL_BAD, out);
    }
}
