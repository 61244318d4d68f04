/* Studies written to a scratch folder, over a scenario that is any JSON. */
#ifndef BST_TESTS_STUDIES_STUDY_FIXTURE_H
#define BST_TESTS_STUDIES_STUDY_FIXTURE_H

#include <sys/stat.h>
#include <unistd.h>

#include "sim/studies/kind.h"
#include "tests/test_support.h"

static inline void fixture_write(const char *folder, const char *name, const char *text) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* A new folder with scenario.json. */
static inline void fixture_folder(char folder[BST_TEST_PATH]) {
    bst_test_template(folder, "studies");
    assert_non_null(mkdtemp(folder));
    fixture_write(folder, "scenario.json",
                  "{\"name\": \"base\", \"a\": 2, \"b\": {\"c\": 0.1, \"list\": [1, 2, 3]}, "
                  "\"word\": \"x\", \"seed\": \"0x9\"}");
}

static inline void fixture_remove(const char *folder) {
    char command[BST_TEST_PATH + 16];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    assert_int_equal(system(command), 0);
}

/* Opens a study whose file has `body` beside what every study needs. */
static inline bst_status fixture_open(bst_ctx *ctx, const char *folder, const char *body,
                                      bst_study *study) {
    char path[512], text[4096];
    snprintf(text, sizeof text,
             "{\"boresight_study\": 1, \"name\": \"test\", \"scenarios\": [{\"file\": "
             "\"scenario.json\"}]%s%s}",
             *body ? ", " : "", body);
    fixture_write(folder, "study.json", text);
    snprintf(path, sizeof path, "%s/study.json", folder);
    return bst_study_open(ctx, path, NULL, study);
}

#endif
