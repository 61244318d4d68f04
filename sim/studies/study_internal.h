/* Internal functions of sim/studies: expansion of a study into runs. */
#ifndef BST_STUDIES_STUDY_INTERNAL_H
#define BST_STUDIES_STUDY_INTERNAL_H

#include "boresight/rng.h"
#include "sim/studies/study.h"

/* Replaces the former names in a study's document and in its pointers into scenarios, with a
 * warning for each. Errors: BST_ERR_CONFIG if both names are given, BST_ERR_MEMORY. */
bst_status bst_study_rename(bst_ctx *ctx, const bst_study *study) BST_MUST_CHECK;
/* Reads the scenarios of a study; relative paths start at the folder of `file`. */
bst_status bst_study_read_bases(bst_ctx *ctx, bst_study *study, const char *file) BST_MUST_CHECK;
/* Computes the points of a latin_hypercube or morris design: factor->unit, levels and steps. */
bst_status bst_study_place_points(bst_ctx *ctx, const bst_study *study,
                                  const bst_study_sweep_config *sweep,
                                  bst_study_factor *factor) BST_MUST_CHECK;

/* Reads pointers and values of an axis or dispersion; axis->where is set before. */
bst_status bst_study_read_axis(bst_ctx *ctx, const bst_study *study, const struct cJSON *node,
                               bst_study_axis *axis) BST_MUST_CHECK;
/* Checks the range "from" .. "to"; `log`: logarithmic; `down`: descending is allowed. */
bst_status bst_study_check_range(bst_ctx *ctx, const bst_study *study, const char *where,
                                 double from, double to, bool log, bool down) BST_MUST_CHECK;
/* Value `index` of an axis that lists its values. */
bst_study_value bst_study_listed(const bst_study_axis *axis, int64_t index);

/* Reads the pointers and parameters of a dispersion; axis->where is set before. The caller frees
 * axis->cumulative, also after an error. */
bst_status bst_study_read_dispersion(bst_ctx *ctx, const bst_study *study, const struct cJSON *node,
                                     const bst_study_dispersion_config *config,
                                     bst_study_axis *axis) BST_MUST_CHECK;
/* Draws the value of a dispersion at the counters (a, b), (a, b + 1), ... */
bst_study_value bst_study_draw(const bst_study_axis *axis, bst_rng_key key, uint64_t a, uint64_t b);
/* Inserts a value of an axis at a JSON pointer of a document. */
bst_status bst_study_put(bst_ctx *ctx, const bst_study *study, const bst_study_axis *axis,
                         const bst_study_value *value, const char *pointer,
                         bst_json *json) BST_MUST_CHECK;
/* Inserts all values of axes and dispersions into a scenario, or into the populations of a copy of
 * the study. */
bst_status bst_study_put_all(bst_ctx *ctx, const bst_study *study, const bst_study_value *values,
                             bool populations, bst_json *json) BST_MUST_CHECK;

/* Replaces the value of one dispersion in the first object of a population, for checks. */
typedef struct bst_study_population_probe {
    int population, dispersion;
    bst_study_value value;
} bst_study_population_probe;

/* True if a JSON pointer refers to the study's populations. */
bool bst_study_population_pointer(const char *pointer);
/* Reads the populations of a document; free them with bst_study_populations_free. */
bst_status bst_study_populations_read(bst_ctx *ctx, const bst_study *study, const bst_json *json,
                                      bst_study_population_list *out) BST_MUST_CHECK;
/* Frees the memory of a list of populations and clears the struct, which belongs to the caller. */
void bst_study_populations_free(bst_study_population_list *list);
/* Reads the study's own populations, after its axes; `study_file`: full path. */
bst_status bst_study_populations_open(bst_ctx *ctx, bst_study *study,
                                      const char *study_file) BST_MUST_CHECK;
/* Frees the populations of a study and their files. */
void bst_study_populations_close(bst_study *study);
/* Populations of a run after its values are inserted: *out is the study's own list or *own; free
 * *own with bst_study_populations_free in both cases. */
bst_status bst_study_populations_of(bst_ctx *ctx, const bst_study *study,
                                    const bst_study_value *values, bst_study_population_list *own,
                                    const bst_study_population_list **out) BST_MUST_CHECK;
/* Draws the numbers of objects into the last of a run's values; counter: the run number. */
void bst_study_population_numbers(const bst_study *study, uint64_t counter,
                                  bst_study_value *values);
/* Smallest and largest number of objects of a population. */
void bst_study_population_reach(const bst_study_population *population, double ends[2]);
/* Adds the drawn objects of a run to its scenario. probe NULL: none. */
bst_status bst_study_populations_add(bst_ctx *ctx, const bst_study *study,
                                     const bst_study_place *place, const bst_study_value *values,
                                     const bst_study_population_probe *probe,
                                     bst_json *json) BST_MUST_CHECK;
/* As bst_study_document, with a probe. */
bst_status bst_study_document_probed(bst_ctx *ctx, const bst_study *study,
                                     const bst_study_place *place, const bst_study_value *values,
                                     const bst_study_population_probe *probe, bst_json **scenario,
                                     struct cJSON **settings) BST_MUST_CHECK;

/* Shortest text of a number that is recovered exactly. */
void bst_study_number_text(double value, char text[40]);

/* Node at a JSON pointer; NULL: none. */
const struct cJSON *bst_study_at(const struct cJSON *node, const char *pointer);

#endif
