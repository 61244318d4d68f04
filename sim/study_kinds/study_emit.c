#include "sim/study_kinds/study_emit.h"

#include <cjson/cJSON.h>
#include <inttypes.h>
#include <stdlib.h>

bst_status bst_study_emit(bst_ctx *ctx, const bst_study *study, const bst_study_kind *kind,
                          int64_t number, FILE *stream, FILE *notes) {
    if (number >= study->runs) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "--emit %" PRId64 ": the study has runs 0 to %" PRId64, number,
                        study->runs - 1);
    }
    bst_study_value *values = calloc(BST_STUDY_AXES, sizeof *values);
    cJSON *settings = NULL;
    bst_study_run run = {.study = study, .place = bst_study_place_of(study, number)};
    if (!values) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    }
    bst_study_values(study, &run.place, values);
    bst_status status =
        bst_study_document(ctx, study, &run.place, values, &run.scenario, &settings);
    run.settings = settings;
    if (status == BST_OK) {
        status = kind->emit(ctx, kind->user, &run, stream, notes);
    }
    bst_json_free(run.scenario);
    cJSON_Delete(settings);
    free(values);
    return status;
}
