/* A scene for the observation generator: sources of known places and brightness on one sensor. */
#ifndef BST_TESTS_OBSGEN_GENERATOR_SCENE_H
#define BST_TESTS_OBSGEN_GENERATOR_SCENE_H

#include "boresight/vec.h"
#include "obsgen/generator.h"
#include "tests/test_support.h"

enum { SIDE = 1024, MOST = 1200 };

typedef struct scene {
    bst_ctx ctx;
    bst_camera camera;
    bst_generator_settings settings;
    bst_obsgen_calibration calibration;
    bst_truth *truth;
    bst_generator_frame frame;
    bst_generator *generator;
} scene;

static inline void open_scene(scene *s) {
    memset(s, 0, sizeof *s);
    s->camera = (bst_camera){.width_px = SIDE,
                             .height_px = SIDE,
                             .pixel_scale_arcsec = 3.0,
                             .aperture_m = 0.15,
                             .throughput = 0.7,
                             .quantum_efficiency = 0.7,
                             .photon_flux_v0_per_s_m2 = 3.6e10,
                             .psf_fwhm_px = 2.0,
                             .read_noise_e = 8.0,
                             .full_well_e = 1e5,
                             .gain_e_per_dn = 1.6,
                             .bits = 16};
    s->settings = (bst_generator_settings){.capacity = 2048,
                                           .false_alarms_per_frame = 1e-6,
                                           .streak_min_px = 1.5,
                                           .streak_max_px = 64.0};
    bst_obsgen_calibration_theory(&s->calibration);
    s->truth = calloc(1, sizeof *s->truth + MOST * sizeof s->truth->items[0]);
    assert_non_null(s->truth);
    s->truth->background_e = 36.0;
    s->frame = (bst_generator_frame){.truth = s->truth,
                                     .window = {0, 0, SIDE, SIDE},
                                     .binning = 1,
                                     .exposure_s = 0.5,
                                     .sigma_px = 2.0 / 2.3548200450309493};
}

static inline void start(scene *s) {
    bst_generator_free(s->generator);
    bst_assert_ok(
        &s->ctx,
        bst_generator_create(&s->ctx, &s->camera, &s->camera, &s->settings, &s->calibration,
                             bst_rng_make_key(7, 0, "a/b/obsgen", "observations"), &s->generator));
}

static inline void close_scene(scene *s) {
    bst_generator_free(s->generator);
    free(s->truth);
}

/* Electrons of a point source of this SNR. */
static inline double electrons_of(const scene *s, double snr) {
    static bst_crlb_table bound;
    static double sigma_px; /* that `bound` is of: some scenes ask for each of a thousand sources */
    if (sigma_px != s->frame.sigma_px) {
        sigma_px = s->frame.sigma_px;
        bst_crlb_table_init(&bound, sigma_px);
    }
    const bst_camera *c = &s->camera;
    double noise = sqrt(s->truth->background_e + c->read_noise_e * c->read_noise_e +
                        c->gain_e_per_dn * c->gain_e_per_dn / 12.0);
    return snr * noise / bst_crlb_table_norm(&bound, 0.0);
}

static inline bst_truth_item *add_source(scene *s, uint32_t id, double x, double y,
                                         double electrons) {
    bst_truth_item *item = &s->truth->items[s->truth->count++];
    *item = (bst_truth_item){.kind = BST_SOURCE_STAR,
                             .id = id,
                             .flags = BST_TRUTH_IN_FIELD,
                             .x_start_px = x,
                             .x_mid_px = x,
                             .x_end_px = x,
                             .x_centroid_px = x,
                             .y_start_px = y,
                             .y_mid_px = y,
                             .y_end_px = y,
                             .y_centroid_px = y,
                             .electrons = electrons};
    return item;
}

/* 900 sources, kept apart, all of one SNR, at many places in the pixel. */
static inline void fill(scene *s, double snr) {
    s->truth->count = 0;
    double electrons = electrons_of(s, snr);
    for (int i = 0; i < 900; i++) {
        add_source(s, (uint32_t)i + 1, 20.0 + 33.0 * (i % 30) + 0.37 * (i % 7),
                   20.0 + 33.0 * (i / 30) + 0.29 * (i % 11), electrons);
    }
}

static inline bst_generator_result run(scene *s, int64_t exposure) {
    bst_generator_result result;
    s->truth->exposure_id = exposure;
    bst_assert_ok(&s->ctx, bst_generator_run(&s->ctx, s->generator, &s->frame, &result));
    return result;
}

#endif
