/* Inside of the generator, shared by its files only. */
#ifndef BST_OBSGEN_GENERATOR_INTERNAL_H
#define BST_OBSGEN_GENERATOR_INTERNAL_H

#include "obsgen/generator.h"

/* A source of the truth on the frame, in pixels that are read. */
typedef struct generator_source {
    double x, y; /* middle of what of its path is on the frame */
    bst_path_px path;
    double length, flux_e;
    double sharp;     /* of its amplitude: 1 for the PSF alone */
    double amplitude; /* SNR at the filter's output, without noise */
    double peak;      /* the same with the light of neighbours */
    double noise;     /* drawn for the peak */
    uint64_t name;    /* of its draws */
    int item, head;   /* head: seen in one with this source; -1: not */
    bool star, as_streak, found, saturated;
    bool broken; /* longer than is filtered for: seen in parts */
} generator_source;

typedef struct generator_rank {
    double amplitude;
    int index;
} generator_rank;

/* Half pixels of the longest streak that is filtered for. */
enum { GENERATOR_STEPS = 258 };

struct bst_generator {
    const bst_camera *camera;
    double electrons_per_s_v0; /* onboard zero point */
    bst_generator_settings settings;
    bst_obsgen_calibration calibration;
    bst_rng_key key;
    /* of the frame */
    int64_t exposure_id;
    int binning, width, height;
    double origin_x, origin_y, exposure_s;
    double sigma, total_sigma; /* of the PSF without and with the pixel's width */
    bst_bound bound;
    bst_path_px star_path;
    double streak; /* 0: not filtered for */
    bool smeared;
    double background_e, noise_e, threshold, streak_share;
    struct generator_thresholds {
        int width, height;
        double sigma, threshold[GENERATOR_STEPS], streak_share[GENERATOR_STEPS]; /* 0: not made */
    } thresholds;
    generator_source *sources; /* by row */
    generator_rank *ranks;
    int source_count, source_capacity;
    double reach; /* of any source's light */
    bst_generated *items;
    int count, lost;
};

/* Takes a detection, in place of the faintest where there is no room. */
void bst_generator_keep(bst_generator *g, const bst_generated *item);

#endif
