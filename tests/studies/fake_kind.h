/* A kind of runs that is arithmetic, and fails as its scenario says. */
#ifndef BST_TESTS_STUDIES_FAKE_KIND_H
#define BST_TESTS_STUDIES_FAKE_KIND_H

#include <cjson/cJSON.h>
#include <signal.h>

#include "tests/studies/study_fixture.h"

/* What happens to runs that a file in the study's folder names: "kill-3" kills the worker that
 * executes run 3, and stays; "once-3" kills it and is gone; "io-3" fails it for reasons of the
 * place; "own-3" by itself. */
static inline bool fake_has(const bst_study_run *run, const char *what) {
    char path[600];
    snprintf(path, sizeof path, "%s/%s-%lld", run->out, what, (long long)run->place.run);
    return access(path, F_OK) == 0;
}

static inline bst_status fake_run(bst_ctx *ctx, void *worker, const bst_study_run *run,
                                  bst_study_result *out) {
    (void)worker;
    if (fake_has(run, "once")) {
        char path[600];
        snprintf(path, sizeof path, "%s/once-%lld", run->out, (long long)run->place.run);
        unlink(path);
        raise(SIGKILL);
    }
    if (fake_has(run, "kill")) {
        raise(SIGKILL);
    }
    if (fake_has(run, "io")) {
        return bst_fail(ctx, BST_ERR_IO, "no room");
    }
    if (fake_has(run, "own")) {
        return bst_fail(ctx, BST_ERR_NUMERIC, "diverged\nat once");
    }
    const cJSON *a = cJSON_GetObjectItem(bst_json_root(run->scenario), "a");
    out->metrics[0] = a->valuedouble / 3.0;
    out->metrics[1] = run->place.run % 3 == 0 ? 1.0 : 0.0;
    out->metrics[2] = run->place.run % 5 == 0 ? NAN : (double)run->place.run;
    out->rows = 2;
    out->series = malloc(2 * 3 * sizeof *out->series);
    for (int i = 0; i < 2; i++) {
        out->series[3 * i] = i;
        out->series[3 * i + 1] = 10.0;
        out->series[3 * i + 2] = (double)((run->place.run + i) % 10);
    }
    return BST_OK;
}

static inline bst_status fake_open(bst_ctx *ctx, void *user, const bst_study_worker_place *place,
                                   void **worker) {
    static char kept;
    (void)ctx;
    (void)user;
    (void)place;
    *worker = &kept;
    return BST_OK;
}
static inline void fake_close(void *worker) {
    (void)worker;
}
static inline bool fake_stop(void *user) {
    (void)user;
    return false;
}

static const bst_study_metric fake_metrics[] = {{"third", "s", "A third.", BST_METRIC_VALUE},
                                                {"flag", "", "A flag.", BST_METRIC_FLAG},
                                                {"gaps", "", "With gaps.", BST_METRIC_VALUE}};
static const bst_study_metric fake_series[] = {{"key", "", "Key.", BST_METRIC_KEY},
                                               {"trials", "", "Trials.", BST_METRIC_TRIALS},
                                               {"hits", "", "Hits.", BST_METRIC_HITS}};
static const bst_study_kind fake_kind = {.name = "loop",
                                         .metrics = fake_metrics,
                                         .metric_count = 3,
                                         .series_name = "parts",
                                         .series = fake_series,
                                         .series_count = 3,
                                         .open = fake_open,
                                         .close = fake_close,
                                         .run = fake_run,
                                         .stop_requested = fake_stop};

#endif
