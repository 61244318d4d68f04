#include "view/subject.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* Runs that are open at the same time. */
enum { RUNS_MOST = 64 };

struct bst_view_subject {
    bst_view_launcher *launcher;
    char *study;          /* its folder; NULL: none */
    pthread_mutex_t lock; /* of all below */
    int runs;
    bst_view_run *run[RUNS_MOST];
    char *path[RUNS_MOST]; /* as given */
};

bst_status bst_view_subject_create(bst_ctx *ctx, bst_view_subject **out) {
    bst_view_subject *subject = calloc(1, sizeof *subject);
    *out = NULL;
    if (!subject || pthread_mutex_init(&subject->lock, NULL) != 0) {
        free(subject);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the viewer");
    }
    bst_status status = bst_view_launcher_create(ctx, &subject->launcher);
    if (status != BST_OK) {
        bst_view_subject_free(subject);
        return status;
    }
    *out = subject;
    return BST_OK;
}

void bst_view_subject_free(bst_view_subject *subject) {
    if (subject) {
        for (int i = 0; i < subject->runs; i++) {
            bst_view_run_close(subject->run[i]);
            free(subject->path[i]);
        }
        bst_view_launcher_free(subject->launcher);
        pthread_mutex_destroy(&subject->lock);
        free(subject->study);
        free(subject);
    }
}

bst_view_launcher *bst_view_subject_launcher(bst_view_subject *subject) {
    return subject->launcher;
}

bst_status bst_view_subject_set_study(bst_ctx *ctx, bst_view_subject *subject, const char *folder) {
    free(subject->study);
    subject->study = strdup(folder);
    return subject->study ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a study");
}

const char *bst_view_subject_study(const bst_view_subject *subject) {
    return subject->study;
}

const char *bst_view_subject_path(bst_view_subject *subject, int64_t number) {
    pthread_mutex_lock(&subject->lock);
    const char *path = number >= 0 && number < subject->runs ? subject->path[number] : "";
    pthread_mutex_unlock(&subject->lock);
    return path;
}

int64_t bst_view_subject_count(bst_view_subject *subject) {
    pthread_mutex_lock(&subject->lock);
    const int64_t count = subject->runs;
    pthread_mutex_unlock(&subject->lock);
    return count;
}

/* Opens a folder as the next run. Call it with the lock held. */
static bst_status add_run(bst_ctx *ctx, bst_view_subject *subject, const char *path) {
    if (subject->runs == RUNS_MOST) {
        return bst_fail(
            ctx, BST_ERR_STATE,
            "%d runs are open, which a viewer has at most: end this one (Ctrl-C) and start it "
            "again",
            RUNS_MOST);
    }
    char *copy = strdup(path);
    bst_status status = copy ? bst_view_run_open(ctx, path, &subject->run[subject->runs])
                             : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    if (status != BST_OK) {
        free(copy);
        return status;
    }
    subject->path[subject->runs++] = copy;
    return BST_OK;
}

bst_status bst_view_subject_open(bst_ctx *ctx, bst_view_subject *subject, const char *path,
                                 int64_t *number) {
    bst_status status = BST_OK;
    pthread_mutex_lock(&subject->lock);
    for (*number = 0; *number < subject->runs; ++*number) {
        if (strcmp(subject->path[*number], path) == 0) {
            break;
        }
    }
    if (*number == subject->runs) {
        status = add_run(ctx, subject, path);
    }
    pthread_mutex_unlock(&subject->lock);
    return status;
}

bst_status bst_view_subject_run(bst_ctx *ctx, bst_view_subject *subject, int64_t number,
                                bst_view_run **out) {
    pthread_mutex_lock(&subject->lock);
    *out = number >= 0 && number < subject->runs ? subject->run[number] : NULL;
    int runs = subject->runs;
    pthread_mutex_unlock(&subject->lock);
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no run %lld (allowed: 0 to %d)",
                           (long long)number, runs - 1);
}
