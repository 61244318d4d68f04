/* The reader of studies on any bytes, over a small scenario that is beside them. What is accepted
 * has documents for its first and last runs and an echo. */
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/studies/study.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static const char scenario[] =
    "{\"name\": \"base\", \"a\": 2, \"b\": {\"c\": 0.1, \"list\": "
    "[1, 2, 3]}, \"word\": \"x\", \"seed\": \"0x9\"}";

static void expand(const bst_study *study, int64_t run) {
    static bst_study_value values[BST_STUDY_AXES];
    bst_study_place place = bst_study_place_of(study, run);
    if (place.run != run || place.setting < 0 || place.setting >= study->settings ||
        place.base < 0 || place.base >= study->base_count) {
        abort();
    }
    bst_study_values(study, &place, values);
    bst_ctx ctx;
    bst_json *json = NULL;
    cJSON *settings = NULL;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_study_document(&ctx, study, &place, values, &json, &settings);
    FUZZ_CHECK_REASON(ctx, status);
    bst_json_free(json);
    cJSON_Delete(settings);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    static int written;
    if (!written++) {
        fuzz_write_file("scenario.json", scenario, sizeof scenario - 1);
    }
    bst_ctx ctx;
    bst_study study;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status =
        bst_study_open(&ctx, fuzz_write_file("study.json", data, bytes), NULL, &study);
    FUZZ_CHECK_REASON(ctx, status);
    if (status == BST_OK) {
        if (study.runs < 1 || study.settings < 1 || study.axis_count > BST_STUDY_AXES) {
            abort();
        }
        for (int64_t i = 0; i < 4 && i < study.runs; i++) {
            expand(&study, i);
            expand(&study, study.runs - 1 - i);
        }
        cJSON *echo = bst_study_echo(&study);
        if (!echo) {
            abort();
        }
        cJSON_Delete(echo);
    }
    bst_study_close(&study);
    return 0;
}
