/* A study: a file that defines varied parameters, expanded into runs. The values of a run follow
 * from the study and the run's index by arithmetic and counter-based random numbers: no list of
 * runs is stored, and each run can be repeated alone. */
#ifndef BST_STUDIES_STUDY_H
#define BST_STUDIES_STUDY_H

#include "sim/core/former_names.h"
#include "sim/studies/study_config.h"

struct cJSON;

enum { BST_STUDY_AXES = 320, BST_STUDY_NAME_BYTES = 64 };

/* Value of one axis in a run. */
typedef struct bst_study_value {
    bool given; /* false: the scenario's own value */
    bool is_number;
    double number;
    const struct cJSON *json; /* a value that is no number; owned by the study */
} bst_study_value;

/* A varied parameter: an axis of a sweep, a dispersion, or the number of objects of a
 * population. */
typedef struct bst_study_axis {
    char name[BST_STUDY_NAME_BYTES]; /* column name: unique; letters, digits, underscores */
    char where[64];                  /* JSON pointer for messages: "/sweeps/0/axes/1" */
    const char *path;
    const struct cJSON *linked_paths; /* pointers that get the same value; NULL: none */
    const struct cJSON *values;       /* NULL: a range */
    int value_count;
    const bst_study_axis_config *axis;             /* NULL: not part of a sweep */
    const bst_study_dispersion_config *dispersion; /* NULL: no dispersion */
    int population;     /* 1, 2, ...: population whose number of objects it is; 0: none */
    double *cumulative; /* [value_count] cumulative weights of a table; NULL: equal weights */
} bst_study_axis;

/* Axes that vary together; the settings are all combinations of the factors' levels. */
typedef struct bst_study_factor {
    int design; /* bst_study_sweep_design; -1: the scenarios */
    int sweep;  /* index of its sweep */
    int first_axis, axis_count;
    int64_t levels;
    double *unit; /* latin_hypercube, morris: [levels][axis_count] in 0..1 */
    int steps;    /* morris: grid levels per axis */
} bst_study_factor;

typedef struct bst_study_base {
    char file[512]; /* full path */
    char name[64];
    bst_json *json; /* as read, with "extends" and the study's "set" applied */
    char *text;     /* the same document as JSON text */
} bst_study_base;

/* A population: from its file, or modified by the axes of a run. */
typedef struct bst_study_population {
    bst_study_population_config config;
    const struct cJSON *object; /* values of each object; NULL: none */
    bst_study_axis *axes;       /* [config.dispersions.count], with pointers inside the object */
    char where[24];             /* "/populations/0" */
} bst_study_population;

typedef struct bst_study_population_list {
    bst_study_population *items;
    int count;
    bst_json *json; /* source document if it is not the study's own; else NULL */
} bst_study_population_list;

/* Satellites in the file of a population's element sets. */
typedef struct bst_study_population_file {
    char file[512]; /* full path; "": none */
    int *norad;     /* [count], ascending, without duplicates */
    int count;
} bst_study_population_file;

typedef struct bst_study {
    const bst_document_tables *tables; /* of scenarios; NULL: none */
    bst_study_config config;
    char file[512];
    bst_json *json;
    bst_study_base *bases;
    int base_count;
    bst_study_axis *axes; /* of sweeps, then dispersions, then populations */
    int axis_count, swept_count;
    bst_study_factor *factors; /* the last factor varies fastest */
    int factor_count;
    bst_study_population_list populations;       /* as in the study's file */
    bst_study_population_file *population_files; /* [populations.count] */
    bool populations_vary;                       /* an axis or dispersion modifies them */
    int64_t settings, runs;
    char digest[20];                    /* hash of everything that affects results */
    const struct bst_study_note *notes; /* borrowed */
    int note_count;
} bst_study;

/* An additional row of the table "about". */
typedef struct bst_study_note {
    const char *key;
    char value[640];
} bst_study_note;

/* Setting, scenario and repetition of a run. */
typedef struct bst_study_place {
    int64_t run, setting, replicate;
    int base;
    uint64_t run_number; /* the scenario's /run */
} bst_study_place;

/* Reads a study and its scenarios. Errors name file, JSON path and allowed values. Nothing is
 * written. Free with bst_study_close, also after an error. `tables`: tables of scenarios, for
 * former names of their keys; they outlive the study. NULL: none are replaced. */
bst_status bst_study_open(bst_ctx *ctx, const char *file, const bst_document_tables *tables,
                          bst_study *out) BST_MUST_CHECK;
/* Frees the content of a study and clears it. */
void bst_study_close(bst_study *study);

/* Setting of run `run`, 0 <= run < study->runs; the runs of a setting are consecutive. */
bst_study_place bst_study_place_of(const bst_study *study, int64_t run);
/* Levels of the factors of a setting, [factor_count]. */
void bst_study_levels(const bst_study *study, int64_t setting, int64_t *levels);
/* Values of the swept axes, [swept_count], at these levels. */
void bst_study_swept_values(const bst_study *study, const int64_t *levels, bst_study_value *out);
/* Values of all axes of a run, [axis_count]. Dispersions: the drawn values before they are applied;
 * populations: the number of objects. */
void bst_study_values(const bst_study *study, const bst_study_place *place, bst_study_value *out);

/* Makes the documents of a run: its scenario, and the settings of its kind (by the kind's table in
 * study->config; NULL for kind loop). The caller frees both. */
bst_status bst_study_document(bst_ctx *ctx, const bst_study *study, const bst_study_place *place,
                              const bst_study_value *values, bst_json **scenario,
                              struct cJSON **settings) BST_MUST_CHECK;

/* The study as JSON with all defaults and full paths; the caller deletes it. NULL: out of
 * memory. */
struct cJSON *bst_study_echo(const bst_study *study);

/* JSON Schema (draft 2020-12) of studies; the caller deletes it. */
struct cJSON *bst_study_schema(void);

#endif
