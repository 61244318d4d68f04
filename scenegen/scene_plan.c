#include "scenegen/scene_plan.h"

#include <math.h>
#include <stdlib.h>

#include "scenegen/source_order.h"
#include "sim/world/skylight.h"

_Static_assert(BST_SPECTRA == (int)BST_PSF_SPECTRA, "the deposit kernel's shares are the PSF's");

void bst_scene_plan_clear(bst_scene_plan *p) {
    free(p->sources);
    free(p->list);
    free(p->shares);
    free(p->peak_e);
    *p = (bst_scene_plan){.count = 0};
}

static bst_status reserve(bst_ctx *ctx, bst_scene_plan *p, int count, bool coloured) {
    if (count <= p->capacity) {
        return BST_OK;
    }
    size_t capacity = (size_t)(count > 2 * p->capacity ? count : 2 * p->capacity);
    bst_scene_plan_clear(p);
    p->sources = malloc(capacity * sizeof *p->sources);
    p->list = malloc(capacity * sizeof *p->list);
    p->peak_e = malloc(capacity * sizeof *p->peak_e);
    p->shares = coloured ? malloc(capacity * sizeof *p->shares) : NULL;
    if (!p->sources || !p->list || !p->peak_e || (coloured && !p->shares)) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d sources", count);
    }
    p->capacity = (int)capacity;
    return BST_OK;
}

/* Puts the drawn sources in order and counts up their blocks and boxes. Until here, first_box is
 * the source's index in the request. */
static void put_in_order(bst_scene_plan *p, const bst_camera *camera, const bst_source *all) {
    bst_source_order(camera, p->list, p->count, p->sources);
    p->blocks = p->boxes = 0;
    for (int i = 0; i < p->count; i++) {
        bst_scene_source *s = &p->sources[i];
        for (int k = 0; p->shares && k < BST_SPECTRA; k++) {
            p->shares[i][k] = (float)bst_psf_share(all[s->first_box].colour, k);
        }
        s->first_box = p->boxes;
        p->blocks += s->blocks;
        p->boxes += s->blocks > 1 ? (s->blocks + BST_BLOCK - 1) / BST_BLOCK : 0;
    }
}

bst_status bst_scene_plan_make(bst_ctx *ctx, bst_scene_plan *p, const bst_camera *camera,
                               bst_smear *smear, bst_crowd *crowd, const bst_fft_light *fft_light,
                               uint64_t most_bytes, double margin_px, const bst_render_request *q) {
    double read = camera->read_noise_e, brightest = 0.0;
    BST_TRY(reserve(ctx, p, q->count, fft_light && bst_fft_light_spectra(fft_light) > 1));
    for (int i = 0; i < q->count; i++) {
        brightest = q->sources[i].path ? brightest : fmax(brightest, q->sources[i].electrons_per_s);
    }
    double least_e = q->background_e + (q->background ? q->background->least_e : 0.0);
    double dark_e2 = fmax(least_e + read * read, 1e-2);
    bst_smear_frame frame = {q->track, q->window, margin_px, dark_e2, brightest};
    BST_TRY(bst_smear_begin(ctx, smear, &frame));
    bst_crowd_motion motion = bst_smear_motion(smear);
    bst_crowd_begin(crowd, &motion);
    const uint64_t counted = (uint64_t)INT32_MAX * sizeof(float); /* by the kernels, in int */
    uint64_t most = most_bytes < counted ? most_bytes : counted;
    /* two blocks have a whole group of boxes */
    int most_blocks = (int)(most / (BST_BLOCK / 2 * BST_BOX_BYTES));
    p->count = 0;
    for (int i = 0, blocks = 0; i < q->count; i++) {
        bst_scene_source *s = &p->list[p->count];
        bool visible;
        BST_TRY(bst_smear_source(ctx, smear, &q->sources[i], s, &visible));
        p->peak_e[i] = bst_smear_last_peak_e(smear);
        if (!visible) {
            continue;
        }
        if (s->blocks > most_blocks - blocks) {
            return bst_fail(ctx, BST_ERR_RANGE,
                            "the sources move too far in one exposure to be drawn: %d of %d need "
                            "%.0f million points already; expose for a shorter time, turn more "
                            "slowly, or draw fewer stars (v_limit)",
                            p->count, q->count, 1e-6 * BST_BLOCK * blocks);
        }
        blocks += s->blocks;
        s->first_box = i;
        p->count++;
        bst_crowd_source error = *bst_smear_last_error(smear);
        if (fft_light) { /* of its grid, on dark pixels too */
            const float *colour = q->sources[i].colour;
            double grid_e = bst_fft_light_error(fft_light) * p->peak_e[i];
            error.excess_e += (float)(grid_e * sqrt(1.0 + p->peak_e[i] / dark_e2));
            if (colour[0] != 0.0F || colour[1] != 0.0F || colour[2] != 0.0F) {
                error.excess_e += (float)(bst_fft_light_mixing_error(fft_light) * p->peak_e[i]);
            }
            bst_fft_light_stamp(fft_light, s);
        }
        BST_TRY(bst_crowd_add(ctx, crowd, &error));
    }
    put_in_order(p, camera, q->sources);
    return BST_OK;
}
