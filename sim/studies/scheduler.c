#define _XOPEN_SOURCE 700 /* realpath */
#include "sim/studies/scheduler.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "sim/core/subprocess.h"
#include "sim/core/wall_clock.h"
#include "sim/studies/shell_word.h"

enum {
    PATH_BYTES = 4096,
    COMMAND_BYTES = 16384,
    JOB_BYTES = 128,
    LINE_BYTES = 1024,
    JOBS_A_CALL = 200 /* names in one call of poll or cancel: 25 KiB, far below ARG_MAX */
};

const bst_config_desc bst_scheduler_table[] = {
    BST_STRING(bst_scheduler, submit, NULL,
               "Shell command that submits a job: $1 is the command line of the shard, $2 its runs "
               "as FIRST:COUNT. The last line of its output begins with the name of the job."),
    BST_STRING(bst_scheduler, poll, NULL,
               "Shell command that prints a line \"JOB STATE [REASON]\" for each of the jobs "
               "\"$@\": waiting, running, done, failed (it says why) or lost (killed)."),
    BST_STRING(bst_scheduler, cancel, NULL, "Shell command that cancels the jobs \"$@\"."),
    BST_INT(bst_scheduler, queue_size, "", 1, 4000000, "1000", "Jobs in the queue at most."),
    BST_REAL(bst_scheduler, poll_s, "s", 0.05, 3600, "5", "Time between two looks at the queue."),
    BST_REAL(bst_scheduler, grace_s, "s", 0, 3600, "30",
             "Time after which a job that poll does not name is lost."),
    BST_REAL(bst_scheduler, patience_s, "s", 1, 86400, "900",
             "Time that the commands may fail before the study stops."),
    BST_REAL(bst_scheduler, call_s, "s", 1, 86400, "300",
             "Time after which a command that has not ended is killed; it has failed then."),
    BST_CONFIG_END};

bst_status bst_scheduler_load(bst_ctx *ctx, const char *path, bst_scheduler *out) {
    bst_json *json = NULL;
    BST_TRY(bst_json_load(ctx, path, &json));
    bst_status status =
        bst_config_read(ctx, json, bst_json_root(json), "", bst_scheduler_table, out);
    bst_json_free(json);
    return status;
}

typedef struct scheduler_job {
    bst_study_shard_job job;
    char name[JOB_BYTES];     /* of the scheduler; "": not submitted yet */
    double seen_s;            /* wall time at which poll named it last */
    bst_study_shard_news end; /* kind BST_SHARD_AT_WORK: none yet */
} scheduler_job;

typedef struct scheduler_executor {
    bst_scheduler scheduler;
    char folder[PATH_BYTES], errors[PATH_BYTES];
    char program[COMMAND_BYTES]; /* quoted for the shell */
    scheduler_job *jobs;
    int64_t count, capacity;
    double looked_s, answered_s; /* wall times of the latest poll, and of the last that succeeded */
    bool cancelled;
} scheduler_executor;

/* ---------------------------------------------------------------- commands */

/* Reads the first line of the errors of a command; "": none. */
static void read_errors(const scheduler_executor *s, char said[BST_SHARD_TEXT_BYTES]) {
    said[0] = '\0';
    FILE *file = fopen(s->errors, "r");
    if (file) {
        if (!fgets(said, BST_SHARD_TEXT_BYTES, file)) {
            said[0] = '\0';
        }
        fclose(file);
        unlink(s->errors);
    }
    for (char *c = said; *c; c++) {
        *c = (unsigned char)*c < 32 ? ' ' : *c;
    }
    for (size_t n = strlen(said); n > 0 && said[n - 1] == ' '; n--) {
        said[n - 1] = '\0';
    }
}

/* A call of one of the commands. */
typedef struct command_call {
    const char *argv[JOBS_A_CALL + 5];
    int count;                            /* of argv */
    void (*take)(void *user, char *line); /* gets the lines of its output; NULL: discarded */
    void *user;
    int code;                        /* exit status */
    char said[BST_SHARD_TEXT_BYTES]; /* its first line of errors; "": none */
} command_call;

static command_call call_of(const char *command) {
    return (command_call){.argv = {"sh", "-c", command, "boresight"}, .count = 4};
}

/* Gives a call's user the lines of a text of *bytes bytes; an unfinished last line stays, unless
 * `all` is set or it fills the text. */
static void take_lines(const command_call *call, char text[LINE_BYTES], size_t *bytes, bool all) {
    char *begin = text, *const end = text + *bytes;
    while (begin < end) {
        char *stop = memchr(begin, '\n', (size_t)(end - begin));
        if (!stop && !all && !(begin == text && *bytes == LINE_BYTES - 1)) {
            break;
        }
        stop = stop ? stop : end;
        *stop = '\0';
        if (call->take) {
            call->take(call->user, begin);
        }
        begin = stop < end ? stop + 1 : end;
    }
    *bytes = (size_t)(end - begin);
    memmove(text, begin, *bytes);
}

/* Reads the output of a command to its end. False: it has not ended at the wall time until_s. */
static bool read_output(const command_call *call, int output, double until_s) {
    char text[LINE_BYTES];
    size_t bytes = 0;
    struct pollfd wait = {.fd = output, .events = POLLIN};
    for (;;) {
        const double left_s = until_s - bst_wall_seconds();
        if (left_s <= 0) {
            return false;
        }
        if (poll(&wait, 1, (int)fmin(1000, 1e3 * left_s + 1)) <= 0) {
            continue;
        }
        const ssize_t got = read(output, text + bytes, LINE_BYTES - 1 - bytes);
        if (got <= 0) {
            if (got < 0 && errno == EINTR) {
                continue;
            }
            take_lines(call, text, &bytes, true);
            return true;
        }
        bytes += (size_t)got;
        take_lines(call, text, &bytes, false);
    }
}

/* Waits for a command that has closed its output. False: it has not ended at until_s. */
static bool wait_for(bst_subprocess *child, double until_s, int *code) {
    const struct timespec pause = {.tv_nsec = 1000000};
    while (!bst_subprocess_poll(child, code)) {
        if (bst_wall_seconds() > until_s) {
            return false;
        }
        nanosleep(&pause, NULL);
    }
    return true;
}

/* Executes a command to its end, or kills it after its time, which is a failure. */
static bst_status execute(bst_ctx *ctx, const scheduler_executor *s, command_call *call) {
    bst_subprocess child;
    BST_TRY(bst_subprocess_start_group(ctx, call->argv, s->folder, s->errors, &child));
    const double until_s = bst_wall_seconds() + s->scheduler.call_s;
    const bool ended =
        read_output(call, fileno(child.output), until_s) && wait_for(&child, until_s, &call->code);
    if (ended) {
        fclose(child.output);
        read_errors(s, call->said);
        return BST_OK;
    }
    bst_subprocess_kill(&child);
    call->code = bst_subprocess_wait(&child);
    call->code = call->code ? call->code : 128 + SIGKILL;
    read_errors(s, call->said);
    snprintf(call->said, sizeof call->said, "it was killed after call_s, %g s",
             s->scheduler.call_s);
    return BST_OK;
}

/* Adds the names of jobs that have not ended, from *next on, as many as a call takes. */
static void add_names(const scheduler_executor *s, command_call *call, int64_t *next) {
    for (; *next < s->count && call->count < JOBS_A_CALL + 4; ++*next) {
        const scheduler_job *job = &s->jobs[*next];
        if (job->name[0] && job->end.kind == BST_SHARD_AT_WORK) {
            call->argv[call->count++] = job->name;
        }
    }
}

/* After a command that failed: BST_OK while there is patience. */
static bst_status be_patient(bst_ctx *ctx, const scheduler_executor *s, const char *command,
                             const command_call *call) {
    double silent_s = bst_wall_seconds() - s->answered_s;
    return silent_s <= s->scheduler.patience_s
               ? BST_OK
               : bst_fail(ctx, BST_ERR_IO,
                          "the scheduler's command %s has failed for %.0f s (exit code %d%s%s); "
                          "its jobs go on where they can, and --resume continues the study",
                          command, silent_s, call->code, call->said[0] ? ": " : "", call->said);
}

/* ---------------------------------------------------------------- submission */

/* Callback: keeps the first word of a line that has one. */
static void take_name(void *user, char *line) {
    char word[JOB_BYTES];
    if (sscanf(line, "%127s", word) == 1) {
        memcpy(user, word, sizeof word);
    }
}

/* Submits waiting jobs one by one until the command fails. */
static bst_status submit(bst_ctx *ctx, scheduler_executor *s) {
    for (int64_t i = 0; i < s->count; i++) {
        scheduler_job *job = &s->jobs[i];
        if (job->name[0]) {
            continue;
        }
        char runs[64], command[COMMAND_BYTES + 64], name[JOB_BYTES] = "";
        snprintf(runs, sizeof runs, "%lld:%lld", (long long)job->job.first,
                 (long long)job->job.count);
        snprintf(command, sizeof command, "%s%s", s->program, runs);
        command_call call = call_of(s->scheduler.submit);
        call.argv[call.count++] = command;
        call.argv[call.count++] = runs;
        call.take = take_name;
        call.user = name;
        BST_TRY(execute(ctx, s, &call));
        if (call.code != 0) {
            return be_patient(ctx, s, "submit", &call);
        }
        if (!name[0]) {
            return bst_fail(ctx, BST_ERR_IO,
                            "the scheduler's command submit printed no name of a job: its last "
                            "line of output must begin with one");
        }
        memcpy(job->name, name, sizeof name);
        job->seen_s = s->answered_s = bst_wall_seconds();
    }
    return BST_OK;
}

/* ---------------------------------------------------------------- states */

typedef struct polled {
    scheduler_executor *s;
    char wrong[BST_SHARD_TEXT_BYTES]; /* first line that is no state; "": none */
} polled;

static scheduler_job *find(scheduler_executor *s, const char *name) {
    for (int64_t i = 0; i < s->count; i++) {
        if (strcmp(s->jobs[i].name, name) == 0) {
            return &s->jobs[i];
        }
    }
    return NULL;
}

/* Callback: takes a line "JOB STATE [REASON]". Lines of other jobs are skipped. */
static void take_state(void *user, char *line) {
    polled *p = user;
    char name[JOB_BYTES], state[16] = "";
    int rest = 0;
    line[strcspn(line, "\r\n")] = '\0';
    if (sscanf(line, "%127s %15s %n", name, state, &rest) < 1) {
        return;
    }
    scheduler_job *job = find(p->s, name);
    if (!job) {
        return;
    }
    const char *reason = rest > 0 ? line + rest : "";
    bool failed = strcmp(state, "failed") == 0, lost = strcmp(state, "lost") == 0;
    if (failed || lost || strcmp(state, "done") == 0) {
        job->end.kind = lost ? BST_SHARD_LOST : BST_SHARD_ENDED;
        snprintf(job->end.text, sizeof job->end.text, "%s",
                 *reason  ? reason
                 : failed ? "its job failed, and the scheduler does not say why"
                 : lost   ? "its job was killed or has disappeared"
                          : "");
        if (!failed && !lost) {
            job->end.text[0] = '\0';
        }
    } else if (strcmp(state, "waiting") != 0 && strcmp(state, "running") != 0 && !p->wrong[0]) {
        snprintf(p->wrong, sizeof p->wrong, "%.400s", line);
    }
    job->seen_s = bst_wall_seconds();
}

/* Marks jobs as lost that poll has not named for the time of grace. */
static void lose_forgotten(scheduler_executor *s) {
    for (int64_t i = 0; i < s->count; i++) {
        scheduler_job *job = &s->jobs[i];
        if (job->name[0] && job->end.kind == BST_SHARD_AT_WORK &&
            s->answered_s - job->seen_s > s->scheduler.grace_s + s->scheduler.poll_s) {
            job->end.kind = BST_SHARD_LOST;
            snprintf(job->end.text, sizeof job->end.text,
                     "the scheduler no longer names its job %s", job->name);
        }
    }
}

/* Asks for the state of all submitted jobs. */
static bst_status look(bst_ctx *ctx, scheduler_executor *s) {
    s->looked_s = bst_wall_seconds();
    for (int64_t next = 0; next < s->count;) {
        polled p = {.s = s};
        command_call call = call_of(s->scheduler.poll);
        add_names(s, &call, &next);
        if (call.count == 4) {
            break; /* no job is in the queue */
        }
        call.take = take_state;
        call.user = &p;
        BST_TRY(execute(ctx, s, &call));
        if (p.wrong[0]) {
            return bst_fail(ctx, BST_ERR_IO,
                            "the scheduler's command poll printed \"%s\": the second word must be "
                            "waiting, running, done, failed or lost",
                            p.wrong);
        }
        if (call.code != 0) {
            return be_patient(ctx, s, "poll", &call);
        }
        s->answered_s = bst_wall_seconds();
    }
    lose_forgotten(s);
    return BST_OK;
}

/* ---------------------------------------------------------------- the executor */

static int64_t scheduler_room(void *self) {
    const scheduler_executor *s = self;
    return s->cancelled ? 0 : s->scheduler.queue_size - s->count;
}

/* Executor interface: queues shards for the next submission. */
static bst_status scheduler_start(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs,
                                  int64_t count) {
    scheduler_executor *s = self;
    if (s->count + count > s->capacity) {
        int64_t capacity = 2 * (s->count + count);
        scheduler_job *more = realloc(s->jobs, (size_t)capacity * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the jobs of a study");
        }
        s->jobs = more;
        s->capacity = capacity;
    }
    for (int64_t i = 0; i < count; i++) {
        s->jobs[s->count++] = (scheduler_job){
            .job = jobs[i],
            .end = {
                .id = jobs[i].id, .runs_done = -1, .runs_failed = -1, .kind = BST_SHARD_AT_WORK}};
    }
    return BST_OK;
}

/* Moves the news of ended jobs to `news`. */
static int collect(scheduler_executor *s, bst_study_shard_news *news, int capacity) {
    int collected = 0;
    int64_t kept = 0;
    for (int64_t i = 0; i < s->count; i++) {
        scheduler_job *job = &s->jobs[i];
        if (s->cancelled && !job->name[0]) {
            job->end.kind = BST_SHARD_LOST;
            snprintf(job->end.text, sizeof job->end.text, "cancelled before it was submitted");
        }
        if (job->end.kind != BST_SHARD_AT_WORK && collected < capacity) {
            news[collected++] = job->end;
        } else {
            s->jobs[kept++] = *job;
        }
    }
    s->count = kept;
    return collected;
}

/* Executor interface: submits waiting jobs and waits for news. */
static bst_status scheduler_poll(bst_ctx *ctx, void *self, int timeout_ms,
                                 bst_study_shard_news *news, int capacity, int *count) {
    scheduler_executor *s = self;
    double until = bst_wall_seconds() + 1e-3 * timeout_ms;
    *count = 0;
    for (;;) {
        double now = bst_wall_seconds();
        /* after a command that failed, the next attempt is made with the next poll */
        bool due = now - s->looked_s >= s->scheduler.poll_s;
        if (!s->cancelled && (due || now - s->answered_s < s->scheduler.poll_s)) {
            BST_TRY(submit(ctx, s));
        }
        if (due) {
            BST_TRY(look(ctx, s));
        }
        *count = collect(s, news, capacity);
        now = bst_wall_seconds();
        if (*count > 0 || now >= until) {
            return BST_OK;
        }
        double left_s = fmin(until - now, 0.05);
        struct timespec pause = {0, (long)(left_s * 1e9) + 1};
        if (nanosleep(&pause, NULL) != 0) {
            return BST_OK; /* interrupted by a signal: the driver handles it */
        }
    }
}

/* Executor interface: cancels all jobs. `now`: does not wait for the scheduler to confirm. */
static void scheduler_cancel(void *self, bool now) {
    scheduler_executor *s = self;
    s->cancelled = true;
    for (int64_t next = 0; next < s->count;) {
        command_call call = call_of(s->scheduler.cancel);
        add_names(s, &call, &next);
        if (call.count > 4) {
            /* if it fails, the jobs end by themselves */
            bst_status ignored = execute(NULL, s, &call);
            (void)ignored;
        }
    }
    for (int64_t i = 0; now && i < s->count; i++) {
        if (s->jobs[i].end.kind == BST_SHARD_AT_WORK) {
            s->jobs[i].end.kind = BST_SHARD_LOST;
            snprintf(s->jobs[i].end.text, sizeof s->jobs[i].end.text, "cancelled");
        }
    }
    s->looked_s = 0;
}

static void scheduler_close(void *self) {
    scheduler_executor *s = self;
    if (s->count > 0 && !s->cancelled) {
        scheduler_cancel(s, true);
    }
    free(s->jobs);
    free(s);
}

/* Quotes the words of a command line for the shell, each followed by a blank. */
static bst_status quote_program(bst_ctx *ctx, const char *const program[],
                                char out[COMMAND_BYTES]) {
    FILE *text = fmemopen(out, COMMAND_BYTES, "w");
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the command line of a shard");
    }
    for (; *program; program++) {
        bst_put_shell_word(text, *program);
        fputc(' ', text);
    }
    bool whole = fputc('\0', text) == '\0' && fflush(text) == 0 && !ferror(text);
    fclose(text);
    return whole ? BST_OK
                 : bst_fail(ctx, BST_ERR_ARGUMENT, "the command line of a shard is too long");
}

static bst_status prepare(bst_ctx *ctx, scheduler_executor *s, const char *study_folder,
                          const char *const program[]) {
    if (!realpath(study_folder, s->folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: %s", study_folder, strerror(errno));
    }
    int n =
        snprintf(s->errors, sizeof s->errors, "%s/scheduler-errors.%d", s->folder, (int)getpid());
    return n < (int)sizeof s->errors ? quote_program(ctx, program, s->program)
                                     : bst_fail(ctx, BST_ERR_ARGUMENT,
                                                "%s: the path of the study is too long", s->folder);
}

bst_status bst_scheduler_create(bst_ctx *ctx, const bst_scheduler *scheduler,
                                const char *study_folder, const char *const program[],
                                bst_executor *out) {
    scheduler_executor *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the jobs of a study");
    }
    s->scheduler = *scheduler;
    s->answered_s = bst_wall_seconds();
    bst_status status = prepare(ctx, s, study_folder, program);
    if (status != BST_OK) {
        free(s);
        return status;
    }
    *out = (bst_executor){.self = s,
                          .name = "scheduler",
                          .room = scheduler_room,
                          .start = scheduler_start,
                          .poll = scheduler_poll,
                          .cancel = scheduler_cancel,
                          .close = scheduler_close};
    return BST_OK;
}
