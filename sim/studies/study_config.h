/* Configuration structs of the study file: scenarios, sweeps, dispersions, populations, metrics. */
#ifndef BST_STUDIES_STUDY_CONFIG_H
#define BST_STUDIES_STUDY_CONFIG_H

#include "boresight/config.h"

typedef enum bst_study_kind_id { BST_STUDY_LOOP, BST_STUDY_PD, BST_STUDY_CUBES } bst_study_kind_id;

typedef enum bst_study_keep { BST_KEEP_SUMMARY, BST_KEEP_TABLES, BST_KEEP_RUN } bst_study_keep;

typedef enum bst_study_random { BST_RANDOM_EACH, BST_RANDOM_COMMON } bst_study_random;

typedef enum bst_study_sweep_design {
    BST_SWEEP_GRID,
    BST_SWEEP_LIST,
    BST_SWEEP_LATIN_HYPERCUBE,
    BST_SWEEP_ONE_AT_A_TIME,
    BST_SWEEP_MORRIS
} bst_study_sweep_design;

typedef enum bst_spacing { BST_SPACING_LINEAR, BST_SPACING_LOG } bst_spacing;

typedef enum bst_study_distribution {
    BST_DISTRIBUTION_UNIFORM,
    BST_DISTRIBUTION_LOG_UNIFORM,
    BST_DISTRIBUTION_NORMAL,
    BST_DISTRIBUTION_TABLE
} bst_study_distribution;

typedef enum bst_apply { BST_APPLY_SET, BST_APPLY_ADD, BST_APPLY_MULTIPLY } bst_apply;

typedef struct bst_study_scenario {
    char file[512];
    char name[64];
} bst_study_scenario;

typedef enum bst_study_number_law {
    BST_NUMBER_FIXED,
    BST_NUMBER_UNIFORM,
    BST_NUMBER_POISSON
} bst_study_number_law;

/* The keys "linked_paths" and "values" are read when axes are created. */
typedef struct bst_study_axis_config {
    char path[256];
    char name[64];
    double from, to;
    int64_t count;
    int32_t spacing; /* bst_spacing */
    bool integer;
} bst_study_axis_config;

typedef struct bst_study_sweep_config {
    int32_t design; /* bst_study_sweep_design */
    int64_t points, trajectories, levels;
    bst_config_list axes; /* bst_study_axis_config */
} bst_study_sweep_config;

/* The keys "linked_paths", "values" and "weights" are read when axes are created. */
typedef struct bst_study_dispersion_config {
    char path[256];
    char name[64];
    int32_t distribution; /* bst_study_distribution */
    double from, to, mean, sigma, truncate_sigma;
    int32_t apply; /* bst_apply */
    bool integer;
} bst_study_dispersion_config;

/* Distribution of a population's number of objects per run. */
typedef struct bst_study_number_config {
    int32_t distribution; /* bst_study_number_law */
    int64_t count;        /* fixed */
    int64_t from, to;     /* uniform */
    double mean;          /* poisson */
    int64_t max;          /* poisson */
} bst_study_number_config;

/* A population of objects drawn for each run. The key "object" is read when populations are
 * created. */
typedef struct bst_study_population_config {
    char name[40];
    bst_study_number_config number;
    char elements_file[512];
    bst_config_list dispersions; /* bst_study_dispersion_config, with paths inside the object */
} bst_study_population_config;

/* Measurement settings of kind "pd", as the options of `boresight pd`. */
typedef struct bst_study_pd_config {
    char sensor[160];
    double snr_first, snr_last, snr_step;
    int64_t trials, empty_frames;
    double false_alarms_per_frame, background_e, jitter_px;
    double streak_px, star_streak_px, min_separation_px;
    bool known_rate, stars;
} bst_study_pd_config;

typedef struct bst_study_cubes_config {
    char sensor[160];
    double train, validation, test;
    bool compress, masks, part_masks;
    double box_px, star_limit_v_mag;
} bst_study_cubes_config;

typedef struct bst_study_config {
    int64_t format; /* "boresight_study" */
    char name[64];
    int32_t kind;              /* bst_study_kind_id */
    bst_config_list scenarios; /* bst_study_scenario */
    bst_config_list sweeps;    /* bst_study_sweep_config */
    bst_config_list dispersions;
    bst_config_list populations; /* bst_study_population_config */
    int64_t replicates;
    uint64_t seed;
    int32_t random; /* bst_study_random */
    int32_t keep;   /* bst_study_keep */
    int64_t resamples;
    bst_study_pd_config pd;
    bst_study_cubes_config cubes;
} bst_study_config;

extern const bst_config_desc bst_study_table[];
extern const bst_config_desc bst_population_table[];
extern const bst_config_desc bst_study_pd_table[];
extern const bst_config_desc bst_study_cubes_table[];

#endif
