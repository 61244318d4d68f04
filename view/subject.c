#include "view/subject.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/memory.h"

/* Runs whose files and data are kept; those of further ones are closed until they are asked for. */
enum { ACTIVE_MOST = 16 };

/* A run that was opened. */
typedef struct open_run {
    bst_view_run *run;
    char *path;    /* as given */
    uint64_t used; /* number of the last request for it */
    bool active;   /* its files may be open */
} open_run;

struct bst_view_subject {
    bst_view_launcher *launcher;
    char *study;          /* its folder; NULL: none */
    pthread_mutex_t lock; /* of all below */
    int runs, active;
    uint64_t requests;
    open_run *list; /* [runs] */
    size_t room;    /* bytes of the list */
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
            bst_view_run_close(subject->list[i].run);
            free(subject->list[i].path);
        }
        free(subject->list);
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
    const char *path = number >= 0 && number < subject->runs ? subject->list[number].path : "";
    pthread_mutex_unlock(&subject->lock);
    return path;
}

int64_t bst_view_subject_count(bst_view_subject *subject) {
    pthread_mutex_lock(&subject->lock);
    const int64_t count = subject->runs;
    pthread_mutex_unlock(&subject->lock);
    return count;
}

/* Notes a request for a run; where too many have open files, the one that was asked for longest ago
 * closes its own. Call it with the lock held. */
static void use_run(bst_view_subject *subject, open_run *wanted) {
    subject->active += !wanted->active;
    wanted->active = true;
    wanted->used = ++subject->requests;
    for (uint64_t from = 0; subject->active > ACTIVE_MOST;) {
        open_run *oldest = NULL;
        for (int i = 0; i < subject->runs; i++) {
            open_run *one = &subject->list[i];
            if (one->active && one->used > from && (!oldest || one->used < oldest->used)) {
                oldest = one;
            }
        }
        if (!oldest || oldest == wanted) {
            return; /* all others are busy */
        }
        from = oldest->used;
        if (bst_view_run_suspend(oldest->run)) {
            oldest->active = false;
            subject->active--;
        }
    }
}

/* Opens a folder as the next run. Call it with the lock held. */
static bst_status add_run(bst_ctx *ctx, bst_view_subject *subject, const char *path) {
    open_run added = {.path = strdup(path)};
    void *list = subject->list;
    size_t needed = ((size_t)subject->runs + 1) * sizeof *subject->list;
    bst_status status =
        added.path ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a run");
    if (status == BST_OK && subject->room < needed) {
        status = bst_memory_grow(ctx, "out of memory for a run", &list, &subject->room, 2 * needed);
        subject->list = list;
    }
    status = status == BST_OK ? bst_view_run_open(ctx, path, &added.run) : status;
    if (status != BST_OK) {
        free(added.path);
        return status;
    }
    subject->list[subject->runs++] = added;
    use_run(subject, &subject->list[subject->runs - 1]);
    return BST_OK;
}

bst_status bst_view_subject_open(bst_ctx *ctx, bst_view_subject *subject, const char *path,
                                 int64_t *number) {
    bst_status status = BST_OK;
    pthread_mutex_lock(&subject->lock);
    for (*number = 0; *number < subject->runs; ++*number) {
        if (strcmp(subject->list[*number].path, path) == 0) {
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
    open_run *found = number >= 0 && number < subject->runs ? &subject->list[number] : NULL;
    *out = found ? found->run : NULL;
    if (found) {
        use_run(subject, found);
    }
    int runs = subject->runs;
    pthread_mutex_unlock(&subject->lock);
    return *out ? BST_OK
                : bst_fail(ctx, BST_ERR_NOT_FOUND, "there is no run %lld (allowed: 0 to %d)",
                           (long long)number, runs - 1);
}
