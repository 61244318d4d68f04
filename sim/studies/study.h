/* A study: a file that says what is varied, expanded into runs. Every run is a function of the
 * study and its index: which values it has follows by arithmetic and counter-based random numbers,
 * so that nothing is listed anywhere and any run can be made again by itself. */
#ifndef BST_STUDIES_STUDY_H
#define BST_STUDIES_STUDY_H

#include "sim/core/former_names.h"
#include "sim/studies/study_config.h"

struct cJSON;

enum { BST_STUDY_AXES = 320, BST_STUDY_NAME_BYTES = 64 };

/* What a run has on one axis. */
typedef struct bst_study_value {
    bool given; /* else the scenario's own value stays */
    bool is_number;
    double number;
    const struct cJSON *json; /* what is no number; lent by the study */
} bst_study_value;

/* One thing that is varied: an axis of a sweep, a dispersion, or the number of objects of a
 * population. */
typedef struct bst_study_axis {
    char name[BST_STUDY_NAME_BYTES]; /* of its column: unique, letters, digits, underscores */
    char where[64];                  /* "/sweeps/0/axes/1", for messages */
    const char *path;
    const struct cJSON *linked_paths; /* pointers that get the same value; NULL: none */
    const struct cJSON *values;       /* NULL: a range */
    int value_count;
    const bst_study_axis_config *axis;             /* NULL: not of a sweep */
    const bst_study_dispersion_config *dispersion; /* NULL: no dispersion */
    int population;     /* 1, 2, ...: the number of its objects; 0: none */
    double *cumulative; /* [value_count] of a table's weights; NULL: all alike */
} bst_study_axis;

/* Axes that vary together; the settings are all combinations of the factors' levels. */
typedef struct bst_study_factor {
    int design; /* bst_study_sweep_design; -1: the scenarios themselves */
    int sweep;  /* index of its sweep */
    int first_axis, axis_count;
    int64_t levels;
    double *unit; /* latin_hypercube, morris: [levels][axis_count] in 0..1 */
    int steps;    /* morris: levels of each axis */
} bst_study_factor;

typedef struct bst_study_base {
    char file[512]; /* full path */
    char name[64];
    bst_json *json; /* as read, "extends" and the study's "set" applied */
    char *text;     /* the same, as JSON */
} bst_study_base;

/* What is read of a population: its file has it, or a run's axes have changed it. */
typedef struct bst_study_population {
    bst_study_population_config config;
    const struct cJSON *object; /* what each object has; NULL: nothing */
    bst_study_axis *axes;       /* [config.dispersions.count], with pointers into the object */
    char where[24];             /* "/populations/0" */
} bst_study_population;

typedef struct bst_study_population_list {
    bst_study_population *items;
    int count;
    bst_json *json; /* what they were read from, where that is not the study's own; else NULL */
} bst_study_population_list;

/* Satellites of the file of element sets of a population. */
typedef struct bst_study_population_file {
    char file[512]; /* full path; "": none */
    int *norad;     /* [count], rising, none twice */
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
    bst_study_factor *factors; /* the last one varies fastest */
    int factor_count;
    bst_study_population_list populations;       /* as the study's file has them */
    bst_study_population_file *population_files; /* [populations.count] */
    bool populations_vary; /* some axis or dispersion changes what is in them */
    int64_t settings, runs;
    char digest[20];                    /* of all that results follow from */
    const struct bst_study_note *notes; /* lent */
    int note_count;
} bst_study;

/* A further row of the table "about". */
typedef struct bst_study_note {
    const char *key;
    char value[640];
} bst_study_note;

/* Where a run belongs. */
typedef struct bst_study_place {
    int64_t run, setting, replicate;
    int base;
    uint64_t run_number; /* the scenario's /run */
} bst_study_place;

/* Reads a study and the scenarios that it names. Errors name file, JSON path and what is allowed.
 * Nothing is written. Free with bst_study_close, also after an error. `tables`: those of scenarios,
 * for former names of their keys, which live as long as the study; NULL: none are replaced. */
bst_status bst_study_open(bst_ctx *ctx, const char *file, const bst_document_tables *tables,
                          bst_study *out) BST_MUST_CHECK;
/* Frees everything that a study holds and clears it. */
void bst_study_close(bst_study *study);

/* Run `run`, 0 <= run < study->runs: runs of a setting are neighbours. */
bst_study_place bst_study_place_of(const bst_study *study, int64_t run);
/* Levels of a setting's factors, [factor_count]. */
void bst_study_levels(const bst_study *study, int64_t setting, int64_t *levels);
/* Values on the axes of sweeps, [swept_count], at these levels. */
void bst_study_swept_values(const bst_study *study, const int64_t *levels, bst_study_value *out);
/* Values on all axes, [axis_count]. Of dispersions: what was drawn, before it is applied; of
 * populations: the number of objects. */
void bst_study_values(const bst_study *study, const bst_study_place *place, bst_study_value *out);

/* The run's documents: the scenario that it is, and the settings of its kind (an object that
 * follows study->config's table of the kind; NULL of kind loop). The caller frees both. */
bst_status bst_study_document(bst_ctx *ctx, const bst_study *study, const bst_study_place *place,
                              const bst_study_value *values, bst_json **scenario,
                              struct cJSON **settings) BST_MUST_CHECK;

/* The study as JSON with every default written out and full paths; the caller deletes it. NULL when
 * out of memory. */
struct cJSON *bst_study_echo(const bst_study *study);

/* JSON Schema (draft 2020-12) of studies; the caller deletes it. */
struct cJSON *bst_study_schema(void);

#endif
