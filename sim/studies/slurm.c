#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/studies/slurm.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "sim/world/child.h"

enum { NAME_BYTES = 32, TOKEN_BYTES = 32, PATH_BYTES = 4096, MOST_WORDS = 96 };

typedef struct task {
    bst_shard_job job;
    int64_t array;   /* Slurm's number of the array; 0: not submitted yet */
    int64_t index;   /* in the array */
    int batch;       /* number of the array in this driver, for its file names */
    double gone_s;   /* wall time when the queue first did not show it; 0: it does */
    bool seen, gone; /* in the latest look at the queue; gone: gone_s is set */
    bool held;       /* Slurm holds it after a failure: it would wait forever */
    char reason[64]; /* Slurm's, while it is held */
} task;

typedef struct slurm {
    bst_slurm_site site;
    char folder[PATH_BYTES]; /* the study's "slurm" */
    char name[NAME_BYTES];   /* of the study's jobs */
    char token[TOKEN_BYTES]; /* begins the names of this driver's files */
    char **program;          /* NULL-terminated copy */
    task *tasks;
    int64_t count, capacity;
    int batches;
    double looked_s, silent_s; /* wall times of the latest look, and of the last answer */
    bool cancelled;
} slurm;

static bst_status out_of_memory(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the jobs of a study");
}

static int sleep_ms(int ms) {
    struct timespec pause = {ms / 1000, (long)(ms % 1000) * 1000000L};
    return nanosleep(&pause, NULL);
}

/* The path of a file in the folder "slurm". */
static bst_status path_of(bst_ctx *ctx, const slurm *s, char out[PATH_BYTES], const char *file) {
    int length = snprintf(out, PATH_BYTES, "%s/%s", s->folder, file);
    return length < PATH_BYTES ? BST_OK
                               : bst_fail(ctx, BST_ERR_ARGUMENT,
                                          "%s: the path of the study is too long", s->folder);
}

/* The end of a text file as one line, the latest bytes that fit; "" when there is none. */
static void read_tail(const char *path, char *out, size_t out_bytes) {
    out[0] = '\0';
    FILE *file = fopen(path, "r");
    if (!file) {
        return;
    }
    if (fseek(file, 0, SEEK_END) == 0) {
        long size = ftell(file);
        long room = (long)out_bytes - 1;
        if (size >= 0 && fseek(file, size > room ? size - room : 0, SEEK_SET) == 0) {
            out[fread(out, 1, out_bytes - 1, file)] = '\0';
        }
    }
    fclose(file);
    size_t length = strlen(out);
    while (length > 0 && (out[length - 1] == '\n' || out[length - 1] == ' ')) {
        out[--length] = '\0';
    }
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)out[i] < 32) {
            out[i] = ' ';
        }
    }
}

/* ---------------------------------------------------------------- Slurm's programs */

/* Runs a program of Slurm; its output goes line by line to `take`, what it says of errors to
 * `said`. *code is its exit status. */
static bst_status run(bst_ctx *ctx, const slurm *s, const char *const argv[],
                      void (*take)(void *user, const char *line), void *user, int *code,
                      char said[BST_SHARD_TEXT_BYTES]) {
    char errors[PATH_BYTES], file[TOKEN_BYTES + 16];
    snprintf(file, sizeof file, "%s-errors", s->token);
    BST_TRY(path_of(ctx, s, errors, file));
    bst_child child;
    BST_TRY(bst_child_start(ctx, argv, NULL, true, errors, &child));
    char line[512];
    while (fgets(line, sizeof line, child.output)) {
        if (take) {
            take(user, line);
        }
    }
    *code = bst_child_wait(&child);
    read_tail(errors, said, BST_SHARD_TEXT_BYTES);
    unlink(errors);
    return BST_OK;
}

/* Whether Slurm's message is of a controller that does not answer now, not of a wrong request. */
static bool is_silence(const char *said) {
    static const char *const signs[] = {
        "contact slurm controller", "Unable to contact", "timed out",
        "onnection refused",        "try again later",   "temporarily"};
    for (size_t i = 0; i < sizeof signs / sizeof *signs; i++) {
        if (strstr(said, signs[i])) {
            return true;
        }
    }
    return false;
}

static void take_array(void *user, const char *line) {
    *(int64_t *)user = strtoll(line, NULL, 10); /* "JOB" or "JOB;CLUSTER" */
}

/* One line of squeue: array, index, state, reason. */
static void take_state(void *user, const char *line) {
    slurm *s = user;
    long long array = 0, index = 0;
    char state[32] = "", reason[64] = "";
    if (sscanf(line, "%lld %lld %31s %63[^\n]", &array, &index, state, reason) < 3) {
        return;
    }
    for (int64_t i = 0; i < s->count; i++) {
        task *t = &s->tasks[i];
        if (t->array == array && t->index == index) {
            t->seen = true;
            t->held = strcmp(state, "PENDING") == 0 &&
                      (strstr(reason, "JobHeldAdmin") || strstr(reason, "requeued held") ||
                       strstr(reason, "launch failed"));
            snprintf(t->reason, sizeof t->reason, "%s", reason);
            return;
        }
    }
}

/* ---------------------------------------------------------------- submitting */

static bst_status write_table(bst_ctx *ctx, const slurm *s, const char *path) {
    FILE *file = fopen(path, "w");
    bool good = file != NULL;
    for (int64_t i = 0; i < s->count; i++) {
        const task *t = &s->tasks[i];
        if (good && t->array == 0 && t->batch == s->batches) {
            good = fprintf(file, "%lld %lld:%lld\n", (long long)t->job.id, (long long)t->job.first,
                           (long long)t->job.count) > 0;
        }
    }
    good = file && fclose(file) == 0 && good;
    return good ? BST_OK
                : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
}

/* Writes a word so that a shell reads it back as it is. */
static void quote(FILE *out, const char *word) {
    fputc('\'', out);
    for (; *word; word++) {
        if (*word == '\'') {
            fputs("'\\''", out);
        } else {
            fputc(*word, out);
        }
    }
    fputc('\'', out);
}

/* The script of a batch: finds its shard in the table, runs it, leaves its exit code behind.
 * Signals that ask the shard to end reach the script too; it outlives them. */
static bst_status write_script(bst_ctx *ctx, const slurm *s, const char *path, const char *table) {
    FILE *file = fopen(path, "w");
    if (file) {
        fputs(
            "#!/bin/sh\n# One task: the shard in line SLURM_ARRAY_TASK_ID + 1 of the table.\n"
            "trap : INT TERM\ncd ",
            file);
        quote(file, s->folder);
        fputs(" || exit 1\nset -- $(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" ", file);
        quote(file, table);
        fputs(")\nended=", file);
        quote(file, s->token);
        fputs("-ended-$1 runs=$2\n", file);
        if (s->site.setup[0]) {
            fputs(". ", file);
            quote(file, s->site.setup);
            fputc('\n', file);
        }
        for (char **word = s->program; *word; word++) {
            quote(file, *word);
            fputc(' ', file);
        }
        fputs(
            "\"$runs\"\ncode=$?\n"
            "echo \"$code ${SLURMD_NODENAME:-}\" >\"$ended.$$\" && mv \"$ended.$$\" \"$ended\"\n"
            "exit $code\n",
            file);
    }
    bool good = file && !ferror(file);
    good = file && fclose(file) == 0 && good;
    return good ? BST_OK
                : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
}

static void add_option(const char *argv[MOST_WORDS], int *words, char *text, size_t text_bytes,
                       const char *option, const char *value) {
    if (value[0] && *words < MOST_WORDS - 2) {
        snprintf(text, text_bytes, "%s=%s", option, value);
        argv[(*words)++] = text;
    }
}

static void add_number(const char *argv[MOST_WORDS], int *words, char *text, size_t text_bytes,
                       const char *option, int64_t value) {
    char digits[24];
    snprintf(digits, sizeof digits, "%lld", (long long)value);
    add_option(argv, words, text, text_bytes, option, value > 0 ? digits : "");
}

/* Submits the tasks of the batch `s->batches`, `count` of them; *array is 0 when the controller is
 * silent. */
static bst_status submit_batch(bst_ctx *ctx, slurm *s, int64_t count, int64_t *array) {
    char file[TOKEN_BYTES + 32], script[PATH_BYTES], table[PATH_BYTES], log[PATH_BYTES];
    snprintf(file, sizeof file, "%s-batch-%d.sh", s->token, s->batches);
    BST_TRY(path_of(ctx, s, script, file));
    snprintf(file, sizeof file, "%s-batch-%d.txt", s->token, s->batches);
    BST_TRY(path_of(ctx, s, table, file));
    snprintf(file, sizeof file, "%s-batch-%d-%%a.log", s->token, s->batches);
    BST_TRY(path_of(ctx, s, log, file));
    BST_TRY(write_table(ctx, s, table));
    BST_TRY(write_script(ctx, s, script, table));

    const char *argv[MOST_WORDS] = {"sbatch", "--parsable", "--requeue", "--open-mode=append"};
    int words = 4;
    char name[64], range[128], output[PATH_BYTES + 16], account[128], partition[128], qos[128],
        gres[128], time[64], memory[64], cpus[64], options[sizeof s->site.options];
    add_option(argv, &words, name, sizeof name, "--job-name", s->name);
    snprintf(file, sizeof file, "0-%lld", (long long)(count - 1));
    add_option(argv, &words, range, sizeof range, "--array", file);
    add_option(argv, &words, output, sizeof output, "--output", log);
    add_option(argv, &words, account, sizeof account, "--account", s->site.account);
    add_option(argv, &words, partition, sizeof partition, "--partition", s->site.partition);
    add_option(argv, &words, qos, sizeof qos, "--qos", s->site.qos);
    add_option(argv, &words, gres, sizeof gres, "--gres", s->site.gres);
    add_number(argv, &words, time, sizeof time, "--time", s->site.time_min);
    add_number(argv, &words, memory, sizeof memory, "--mem", s->site.memory_mib);
    add_number(argv, &words, cpus, sizeof cpus, "--cpus-per-task", s->site.cpus_per_task);
    memcpy(options, s->site.options, sizeof options);
    char *rest = NULL;
    for (char *word = strtok_r(options, " \t", &rest); word && words < MOST_WORDS - 2;
         word = strtok_r(NULL, " \t", &rest)) {
        argv[words++] = word;
    }
    argv[words] = script;

    int code;
    char said[BST_SHARD_TEXT_BYTES];
    *array = 0;
    BST_TRY(run(ctx, s, argv, take_array, array, &code, said));
    if (code == 0 && *array > 0) {
        return BST_OK;
    }
    *array = 0;
    return is_silence(said) ? BST_OK
                            : bst_fail(ctx, BST_ERR_IO, "sbatch refuses the job array: %s", said);
}

/* Submits what waits, as arrays of at most the site's size; stops where the controller is silent.
 */
static bst_status submit(bst_ctx *ctx, slurm *s) {
    for (;;) {
        int64_t count = 0;
        for (int64_t i = 0; i < s->count && count < s->site.array_size; i++) {
            task *t = &s->tasks[i];
            if (t->array == 0) {
                t->index = count++;
                t->batch = s->batches;
            }
        }
        if (count == 0) {
            return BST_OK;
        }
        int64_t array;
        BST_TRY(submit_batch(ctx, s, count, &array));
        for (int64_t i = 0; i < s->count; i++) {
            task *t = &s->tasks[i];
            if (t->array == 0) {
                if (array > 0 && t->batch == s->batches) {
                    t->array = array;
                    t->gone = t->held = false;
                }
                if (array == 0) {
                    t->batch = -1;
                }
            }
        }
        if (array == 0) {
            return BST_OK;
        }
        s->silent_s = bst_wall_seconds();
        s->batches++;
    }
}

/* ---------------------------------------------------------------- watching */

static bst_status look(bst_ctx *ctx, slurm *s) {
    for (int64_t i = 0; i < s->count; i++) {
        s->tasks[i].seen = false;
    }
    char name[64];
    snprintf(name, sizeof name, "--name=%s", s->name);
    const char *argv[] = {"squeue", "--noheader",           "--array", "--me",
                          name,     "--format=%F %K %T %r", NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    BST_TRY(run(ctx, s, argv, take_state, s, &code, said));
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
        task *t = &s->tasks[i];
        if (t->array > 0 && t->seen) {
            t->gone = false;
        } else if (t->array > 0 && !t->gone) {
            t->gone = true;
            t->gone_s = now;
        }
    }
    return BST_OK;
}

/* Reads the exit code that a task left; false when there is none (yet). */
static bool has_ended(const slurm *s, const task *t, int *code, char node[64]) {
    char path[PATH_BYTES], file[TOKEN_BYTES + 40];
    snprintf(file, sizeof file, "%s-ended-%lld", s->token, (long long)t->job.id);
    if (path_of(NULL, s, path, file) != BST_OK) {
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

static void scancel(const slurm *s, const char *which) {
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
    /* a controller that does not answer cannot be asked; the tasks then end by themselves */
    bst_status ignored = run(NULL, s, argv, NULL, NULL, &code, said);
    (void)ignored;
}

static void cancel_task(const slurm *s, const task *t) {
    char job[48];
    snprintf(job, sizeof job, "%lld_%lld", (long long)t->array, (long long)t->index);
    const char *argv[] = {"scancel", job, NULL};
    int code;
    char said[BST_SHARD_TEXT_BYTES];
    bst_status ignored = run(NULL, s, argv, NULL, NULL, &code, said);
    (void)ignored;
}

/* The end of a task's log, after `text`. */
static void add_log(const slurm *s, const task *t, char text[BST_SHARD_TEXT_BYTES]) {
    char path[PATH_BYTES], file[TOKEN_BYTES + 64], tail[BST_SHARD_TEXT_BYTES / 2];
    snprintf(file, sizeof file, "%s-batch-%d-%lld.log", s->token, t->batch, (long long)t->index);
    if (path_of(NULL, s, path, file) != BST_OK) {
        return;
    }
    read_tail(path, tail, sizeof tail);
    size_t length = strlen(text);
    if (tail[0]) {
        snprintf(text + length, BST_SHARD_TEXT_BYTES - length, "%s%s", length ? ": " : "", tail);
    }
}

/* What is to be told of a task now; false when nothing. */
static bool tell(const slurm *s, const task *t, double now, bst_shard_news *news) {
    *news = (bst_shard_news){.id = t->job.id, .runs_done = -1, .runs_failed = -1};
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

static int tell_all(slurm *s, bst_shard_news *news, int capacity) {
    double now = bst_wall_seconds();
    int told = 0;
    int64_t kept = 0;
    for (int64_t i = 0; i < s->count; i++) {
        if (told < capacity && tell(s, &s->tasks[i], now, &news[told])) {
            told++;
        } else {
            s->tasks[kept++] = s->tasks[i];
        }
    }
    s->count = kept;
    return told;
}

/* ---------------------------------------------------------------- the executor */

static int64_t slurm_room(void *self) {
    const slurm *s = self;
    return s->cancelled ? 0 : s->site.queue_size - s->count;
}

static bst_status slurm_start(bst_ctx *ctx, void *self, const bst_shard_job *jobs, int64_t count) {
    slurm *s = self;
    if (s->count + count > s->capacity) {
        int64_t capacity = 2 * (s->count + count);
        task *more = realloc(s->tasks, (size_t)capacity * sizeof *more);
        if (!more) {
            return out_of_memory(ctx);
        }
        s->tasks = more;
        s->capacity = capacity;
    }
    for (int64_t i = 0; i < count; i++) {
        s->tasks[s->count++] = (task){.job = jobs[i], .batch = -1};
    }
    return BST_OK;
}

static bst_status slurm_poll(bst_ctx *ctx, void *self, int timeout_ms, bst_shard_news *news,
                             int capacity, int *count) {
    slurm *s = self;
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
            BST_TRY(submit(ctx, s));
        }
        if (look_now) {
            BST_TRY(look(ctx, s));
        }
        *count = tell_all(s, news, capacity);
        now = bst_wall_seconds();
        if (*count > 0 || now >= until) {
            return BST_OK;
        }
        double left_ms = 1e3 * (until - now);
        if (sleep_ms(left_ms < 200 ? (int)left_ms + 1 : 200) != 0) {
            return BST_OK; /* a signal came: the driver sees to it */
        }
    }
}

static void slurm_cancel(void *self, bool now) {
    slurm *s = self;
    s->cancelled = true;
    if (now) {
        scancel(s, "all");
    } else {
        scancel(s, "pending");
        scancel(s, "running");
    }
    s->looked_s = 0;
}

static void destroy(slurm *s) {
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
    slurm *s = self;
    if (s->count > 0) {
        scancel(s, "all");
    }
    destroy(s);
}

/* FNV-1a, 64 bits. */
static uint64_t hash_of(const char *text) {
    uint64_t hash = 0xcbf29ce484222325u;
    for (; *text; text++) {
        hash = (hash ^ (unsigned char)*text) * 0x100000001b3u;
    }
    return hash;
}

static bst_status copy_program(bst_ctx *ctx, slurm *s, const char *const program[]) {
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

static bst_status prepare(bst_ctx *ctx, slurm *s, const char *study_folder) {
    char full[PATH_BYTES];
    if (!realpath(study_folder, full)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", study_folder, strerror(errno));
    }
    if (snprintf(s->folder, sizeof s->folder, "%s/slurm", full) >= (int)sizeof s->folder) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path of the study is too long", full);
    }
    if (mkdir(s->folder, 0777) != 0 && errno != EEXIST) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", s->folder, strerror(errno));
    }
    snprintf(s->name, sizeof s->name, "boresight-%012llx",
             (unsigned long long)(hash_of(full) & 0xffffffffffffu));
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
    BST_TRY(run(ctx, s, argv, take_array, &left, &code, said));
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
    slurm *s = calloc(1, sizeof *s);
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
