#define _XOPEN_SOURCE 700 /* realpath */

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/fnv.h"
#include "sim/core/folder.h"
#include "sim/core/wall_clock.h"
#include "sim/studies/slurm_internal.h"

static bst_status out_of_memory(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the jobs of a study");
}

static int sleep_ms(int ms) {
    struct timespec pause = {ms / 1000, (long)(ms % 1000) * 1000000L};
    return nanosleep(&pause, NULL);
}

/* Submitted tasks, sorted by array and index, for matching the queue. */
typedef struct submitted {
    bst_slurm_task **tasks;
    size_t count;
} submitted;

static int by_number(const void *a, const void *b) {
    const bst_slurm_task *x = *(bst_slurm_task *const *)a, *y = *(bst_slurm_task *const *)b;
    int array = (x->array > y->array) - (x->array < y->array);
    return array ? array : (x->index > y->index) - (x->index < y->index);
}

static bst_status sort_submitted(bst_ctx *ctx, const bst_slurm *s, submitted *out) {
    *out = (submitted){.tasks = malloc(((size_t)s->count + 1) * sizeof *out->tasks)};
    if (!out->tasks) {
        return out_of_memory(ctx);
    }
    for (int64_t i = 0; i < s->count; i++) {
        if (s->tasks[i].array > 0) {
            out->tasks[out->count++] = &s->tasks[i];
        }
    }
    qsort(out->tasks, out->count, sizeof *out->tasks, by_number);
    return BST_OK;
}

/* Parses a line of squeue: array, index, state, reason. */
static void take_state(void *user, const char *line) {
    const submitted *s = user;
    long long array = 0, index = 0;
    char state[32] = "", reason[64] = "";
    if (sscanf(line, "%lld %lld %31s %63[^\n]", &array, &index, state, reason) < 3) {
        return;
    }
    bst_slurm_task wanted = {.array = array, .index = index}, *key = &wanted;
    bst_slurm_task **found = bsearch(&key, s->tasks, s->count, sizeof *s->tasks, by_number);
    if (found) {
        bst_slurm_task *t = *found;
        t->seen = true;
        t->held = strcmp(state, "PENDING") == 0 &&
                  (strstr(reason, "JobHeldAdmin") || strstr(reason, "requeued held") ||
                   strstr(reason, "launch failed"));
        snprintf(t->reason, sizeof t->reason, "%s", reason);
    }
}

/* Asks squeue for the state of the study's tasks; fails after patience_s without answer. */
static bst_status query_queue(bst_ctx *ctx, bst_slurm *s) {
    for (int64_t i = 0; i < s->count; i++) {
        s->tasks[i].seen = false;
    }
    char name[64];
    snprintf(name, sizeof name, "--name=%s", s->name);
    const char *argv[] = {"squeue", "--noheader",           "--array", "--me",
                          name,     "--format=%F %K %T %r", NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    submitted list;
    BST_TRY(sort_submitted(ctx, s, &list));
    bst_status asked = bst_slurm_run(ctx, s, argv, take_state, &list, &code, said);
    free(list.tasks);
    BST_TRY(asked);
    double now = bst_wall_seconds();
    s->looked_s = now;
    if (code != 0) {
        if (now - s->silent_s > s->site.patience_s) {
            return bst_fail(ctx, BST_ERR_IO,
                            "Slurm's controller has not answered for %.0f s (squeue: %s); its jobs "
                            "go on where they can, and --resume continues the study",
                            now - s->silent_s, said);
        }
        return BST_OK;
    }
    s->silent_s = now;
    for (int64_t i = 0; i < s->count; i++) {
        bst_slurm_task *t = &s->tasks[i];
        if (t->array > 0 && t->seen) {
            t->gone = false;
        } else if (t->array > 0 && !t->gone) {
            t->gone = true;
            t->gone_s = now;
        }
    }
    return BST_OK;
}

/* Reads the exit code file of a task; false: none (yet). */
static bool has_ended(const bst_slurm *s, const bst_slurm_task *t, int *code, char node[64]) {
    char path[BST_SLURM_PATH_BYTES], file[BST_SLURM_TOKEN_BYTES + 40];
    snprintf(file, sizeof file, "%s-ended-%lld", s->token, (long long)t->job.id);
    if (bst_slurm_path(NULL, s, path, file) != BST_OK) {
        return false;
    }
    FILE *ended = fopen(path, "r");
    if (!ended) {
        return false;
    }
    node[0] = '\0';
    bool good = fscanf(ended, "%d %63s", code, node) >= 1;
    fclose(ended);
    if (good) {
        unlink(path);
    }
    return good;
}

/* Cancels the study's jobs: "running" (SIGTERM), "pending" or "all". */
static void scancel(const bst_slurm *s, const char *which) {
    char name[64];
    snprintf(name, sizeof name, "--name=%s", s->name);
    const char *running[] = {"scancel",       "--me",   name, "--state=RUNNING",
                             "--signal=TERM", "--full", NULL};
    const char *pending[] = {"scancel", "--me", name, "--state=PENDING", NULL};
    const char *all[] = {"scancel", "--me", name, NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    const char *const *argv = strcmp(which, "running") == 0   ? running
                              : strcmp(which, "pending") == 0 ? pending
                                                              : all;
    /* if the controller does not answer, the tasks end by themselves */
    bst_status ignored = bst_slurm_run(NULL, s, argv, NULL, NULL, &code, said);
    (void)ignored;
}

/* Cancels one task of a job array. */
static void cancel_task(const bst_slurm *s, const bst_slurm_task *t) {
    char job[48];
    snprintf(job, sizeof job, "%lld_%lld", (long long)t->array, (long long)t->index);
    const char *argv[] = {"scancel", job, NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    bst_status ignored = bst_slurm_run(NULL, s, argv, NULL, NULL, &code, said);
    (void)ignored;
}

/* Appends the end of a task's log to `text`. */
static void add_log(const bst_slurm *s, const bst_slurm_task *t, char text[BST_SHARD_TEXT_BYTES]) {
    char path[BST_SLURM_PATH_BYTES], file[BST_SLURM_TOKEN_BYTES + 64],
        tail[BST_SHARD_TEXT_BYTES / 2];
    snprintf(file, sizeof file, "%s-batch-%d-%lld.log", s->token, t->batch, (long long)t->index);
    if (bst_slurm_path(NULL, s, path, file) != BST_OK) {
        return;
    }
    bst_slurm_read_tail(path, tail, sizeof tail);
    size_t length = strlen(text);
    if (tail[0]) {
        snprintf(text + length, BST_SHARD_TEXT_BYTES - length, "%s%s", length ? ": " : "", tail);
    }
}

/* Makes the news of a task; false: none. */
static bool task_news(const bst_slurm *s, const bst_slurm_task *t, double now,
                      bst_study_shard_news *news) {
    *news = (bst_study_shard_news){.id = t->job.id, .runs_done = -1, .runs_failed = -1};
    int code;
    char node[64];
    if (t->array == 0) {
        news->kind = BST_SHARD_LOST;
        snprintf(news->text, sizeof news->text, "cancelled before it was submitted");
        return s->cancelled;
    }
    if (has_ended(s, t, &code, node)) {
        news->kind = code < 128 ? BST_SHARD_ENDED : BST_SHARD_LOST;
        if (code >= 128) {
            snprintf(news->text, sizeof news->text, "%s by signal %d on %s",
                     code == 128 + SIGKILL ? "killed" : "ended", code - 128,
                     node[0] ? node : "its node");
        }
        if (code != 0) {
            add_log(s, t, news->text);
        }
        return true;
    }
    if (t->held) {
        cancel_task(s, t);
        news->kind = BST_SHARD_LOST;
        snprintf(news->text, sizeof news->text, "Slurm holds job %lld_%lld (%s)",
                 (long long)t->array, (long long)t->index, t->reason);
        return true;
    }
    if (t->gone && now - t->gone_s >= s->site.grace_s) {
        news->kind = BST_SHARD_LOST;
        snprintf(news->text, sizeof news->text,
                 "job %lld_%lld is gone from the queue and left no exit code", (long long)t->array,
                 (long long)t->index);
        add_log(s, t, news->text);
        return true;
    }
    return false;
}

/* Collects the news of all tasks; removes tasks that have ended. */
static int collect_news(bst_slurm *s, bst_study_shard_news *news, int capacity) {
    double now = bst_wall_seconds();
    int collected = 0;
    int64_t kept = 0;
    for (int64_t i = 0; i < s->count; i++) {
        if (collected < capacity && task_news(s, &s->tasks[i], now, &news[collected])) {
            collected++;
        } else {
            s->tasks[kept++] = s->tasks[i];
        }
    }
    s->count = kept;
    return collected;
}

/* ---------------------------------------------------------------- the executor */

/* Number of further tasks that the site's queue accepts. */
static int64_t slurm_room(void *self) {
    const bst_slurm *s = self;
    return s->cancelled ? 0 : s->site.queue_size - s->count;
}

/* Executor interface: queues shards for the next submission. */
static bst_status slurm_start(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs,
                              int64_t count) {
    bst_slurm *s = self;
    if (s->count + count > s->capacity) {
        int64_t capacity = 2 * (s->count + count);
        bst_slurm_task *more = realloc(s->tasks, (size_t)capacity * sizeof *more);
        if (!more) {
            return out_of_memory(ctx);
        }
        s->tasks = more;
        s->capacity = capacity;
    }
    for (int64_t i = 0; i < count; i++) {
        s->tasks[s->count++] = (bst_slurm_task){.job = jobs[i], .batch = -1};
    }
    return BST_OK;
}

/* Executor interface: submits waiting tasks and waits for news. */
static bst_status slurm_poll(bst_ctx *ctx, void *self, int timeout_ms, bst_study_shard_news *news,
                             int capacity, int *count) {
    bst_slurm *s = self;
    double until = bst_wall_seconds() + 1e-3 * timeout_ms;
    for (;;) {
        double now = bst_wall_seconds();
        *count = 0;
        bool look_now = now - s->looked_s >= s->site.poll_s;
        bool waiting = false;
        for (int64_t i = 0; i < s->count; i++) {
            waiting = waiting || s->tasks[i].array == 0;
        }
        if (waiting && !s->cancelled && (look_now || now - s->silent_s < s->site.poll_s)) {
            BST_TRY(bst_slurm_submit(ctx, s));
        }
        if (look_now) {
            BST_TRY(query_queue(ctx, s));
        }
        *count = collect_news(s, news, capacity);
        now = bst_wall_seconds();
        if (*count > 0 || now >= until) {
            return BST_OK;
        }
        double left_ms = 1e3 * (until - now);
        if (sleep_ms(left_ms < 200 ? (int)left_ms + 1 : 200) != 0) {
            return BST_OK; /* interrupted by a signal: the driver handles it */
        }
    }
}

/* Executor interface: stops pending and running jobs; all at once if `now`. */
static void slurm_cancel(void *self, bool now) {
    bst_slurm *s = self;
    s->cancelled = true;
    if (now) {
        scancel(s, "all");
    } else {
        scancel(s, "pending");
        scancel(s, "running");
    }
    s->looked_s = 0;
}

static void destroy(bst_slurm *s) {
    if (!s) {
        return;
    }
    for (char **word = s->program; word && *word; word++) {
        free(*word);
    }
    free(s->program);
    free(s->tasks);
    free(s);
}

static void slurm_close(void *self) {
    bst_slurm *s = self;
    if (s->count > 0) {
        scancel(s, "all");
    }
    destroy(s);
}

/* Copies the command line of the worker program. */
static bst_status copy_program(bst_ctx *ctx, bst_slurm *s, const char *const program[]) {
    size_t words = 0;
    while (program[words]) {
        words++;
    }
    s->program = calloc(words + 1, sizeof *s->program);
    for (size_t i = 0; s->program && i < words; i++) {
        s->program[i] = strdup(program[i]);
        if (!s->program[i]) {
            return out_of_memory(ctx);
        }
    }
    return s->program ? BST_OK : out_of_memory(ctx);
}

/* Makes the folder and job name of the study; cancels jobs of an earlier driver. */
static bst_status prepare(bst_ctx *ctx, bst_slurm *s, const char *study_folder) {
    char full[BST_SLURM_PATH_BYTES];
    if (!realpath(study_folder, full)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", study_folder, strerror(errno));
    }
    if (snprintf(s->folder, sizeof s->folder, "%s/slurm", full) >= (int)sizeof s->folder) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path of the study is too long", full);
    }
    BST_TRY(bst_folder_make(ctx, s->folder));
    snprintf(s->name, sizeof s->name, "boresight-%012llx",
             (unsigned long long)(bst_fnv(BST_FNV_START, full, strlen(full)) & 0xffffffffffffu));
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    snprintf(s->token, sizeof s->token, "%llx-%x", (unsigned long long)now.tv_sec,
             (unsigned)getpid());

    char name[64];
    snprintf(name, sizeof name, "--name=%s", s->name);
    const char *argv[] = {"squeue", "--noheader", "--array", "--me", name, "--format=%F", NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    int64_t left = 0;
    BST_TRY(bst_slurm_run(ctx, s, argv, bst_slurm_take_array, &left, &code, said));
    if (code != 0) {
        return bst_fail(ctx, BST_ERR_IO, "squeue cannot ask Slurm: %s", said);
    }
    if (left > 0) {
        bst_log(ctx, BST_LOG_INFO,
                "cancelling the jobs that an earlier driver of this study left in the queue");
        scancel(s, "all");
    }
    return BST_OK;
}

bst_status bst_slurm_create(bst_ctx *ctx, const bst_slurm_site *site, const char *study_folder,
                            const char *const program[], bst_executor *out) {
    bst_slurm *s = calloc(1, sizeof *s);
    if (!s) {
        return out_of_memory(ctx);
    }
    s->site = *site;
    s->silent_s = bst_wall_seconds();
    bst_status status = copy_program(ctx, s, program);
    if (status == BST_OK) {
        status = prepare(ctx, s, study_folder);
    }
    if (status != BST_OK) {
        destroy(s);
        return status == BST_ERR_NOT_FOUND
                   ? bst_fail_prefix(ctx, status, "--slurm needs Slurm's programs on this machine")
                   : status;
    }
    *out = (bst_executor){.self = s,
                          .name = "Slurm",
                          .room = slurm_room,
                          .start = slurm_start,
                          .poll = slurm_poll,
                          .cancel = slurm_cancel,
                          .close = slurm_close};
    return BST_OK;
}
