#define _GNU_SOURCE /* memfd_create, prlimit, posix_spawn_file_actions_addchdir_np */
#include "view/child_command.h"

#include <errno.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "sim/core/file.h"

extern char **environ;

enum { WORDS_MOST = 12 };
/* Time between two looks at the child, s: doubled each time, up to the second one. */
static const double FIRST_WAIT_S = 1e-3, LONGEST_WAIT_S = 0.02;
/* Elapsed time over processor time of the limit: others may share the processors. */
static const double PATIENCE = 6.0;

/* Files in memory that are the child's standard input, output and error. */
typedef struct streams {
    int input, output, messages;
} streams;

static void close_streams(streams *s) {
    int *all[] = {&s->input, &s->output, &s->messages};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        if (*all[i] >= 0) {
            close(*all[i]);
        }
        *all[i] = -1;
    }
}

static bst_status open_streams(bst_ctx *ctx, const void *text, size_t bytes, streams *s) {
    s->input = memfd_create("boresight-input", MFD_CLOEXEC);
    s->output = memfd_create("boresight-output", MFD_CLOEXEC);
    s->messages = memfd_create("boresight-messages", MFD_CLOEXEC);
    if (s->input < 0 || s->output < 0 || s->messages < 0 ||
        !bst_file_write_all(s->input, text, bytes) || lseek(s->input, 0, SEEK_SET) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "no memory for the text of a command: %s",
                        strerror(errno));
    }
    return BST_OK;
}

/* Starts the child with the streams in the folder. */
static bst_status start(bst_ctx *ctx, const char *const *words, const char *directory,
                        const streams *s, pid_t *child) {
    char *argv[WORDS_MOST + 3] = {"boresight", "--no-plugins"};
    posix_spawn_file_actions_t actions;
    for (int i = 0; i < WORDS_MOST && words[i]; i++) {
        argv[i + 2] = (char *)(uintptr_t)words[i]; /* not changed: POSIX, rationale of exec */
    }
    if (posix_spawn_file_actions_init(&actions) != 0) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a command");
    }
    int error = posix_spawn_file_actions_adddup2(&actions, s->input, STDIN_FILENO);
    error = error ? error : posix_spawn_file_actions_adddup2(&actions, s->output, STDOUT_FILENO);
    error = error ? error : posix_spawn_file_actions_adddup2(&actions, s->messages, STDERR_FILENO);
    error = error ? error : posix_spawn_file_actions_addchdir_np(&actions, directory);
    error = error ? error : posix_spawn(child, "/proc/self/exe", &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    return error == 0 ? BST_OK
                      : bst_fail(ctx, BST_ERR_IO, "cannot run boresight %s: %s", words[0],
                                 strerror(error));
}

static double seconds_of(const struct timespec *t) {
    return (double)t->tv_sec + 1e-9 * (double)t->tv_nsec;
}

/* Waits for the child; kills it at the limit. */
static void wait_for(pid_t child, int limit_s, bst_view_child_result *out) {
    struct timespec begin, now;
    double wait_s = FIRST_WAIT_S;
    int status = 0;
    pid_t ended = 0;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    while ((ended = waitpid(child, &status, WNOHANG)) == 0) {
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (seconds_of(&now) - seconds_of(&begin) > PATIENCE * limit_s) {
            out->timed_out = true;
            kill(child, SIGKILL);
            ended = waitpid(child, &status, 0);
            break;
        }
        nanosleep(&(struct timespec){.tv_nsec = (long)(1e9 * wait_s)}, NULL);
        wait_s = 2.0 * wait_s < LONGEST_WAIT_S ? 2.0 * wait_s : LONGEST_WAIT_S;
    }
    bool killed = ended == child && WIFSIGNALED(status);
    out->timed_out |= killed && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL);
    out->exit_code = ended != child ? 127 : killed ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

/* Reads a whole file in memory as a text. */
static bst_status read_stream(bst_ctx *ctx, int fd, char **out) {
    struct stat info;
    if (fstat(fd, &info) != 0 || info.st_size > BST_VIEW_CHILD_BYTES) {
        return bst_fail(ctx, BST_ERR_FORMAT, "the command writes more than %d MiB",
                        BST_VIEW_CHILD_BYTES >> 20);
    }
    size_t bytes = (size_t)info.st_size;
    *out = malloc(bytes + 1);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the answer of a command");
    }
    ssize_t got = pread(fd, *out, bytes, 0);
    (*out)[got > 0 ? got : 0] = '\0';
    return BST_OK;
}

bst_status bst_view_child_run(bst_ctx *ctx, const char *const *words, const char *directory,
                              const void *text, size_t bytes, int limit_s,
                              bst_view_child_result *out) {
    streams s = {-1, -1, -1};
    pid_t child = 0;
    *out = (bst_view_child_result){.exit_code = 127};
    bst_status status = open_streams(ctx, text, bytes, &s);
    status = status == BST_OK ? start(ctx, words, directory, &s, &child) : status;
    if (status == BST_OK) {
        const struct rlimit time = {(rlim_t)limit_s, (rlim_t)limit_s + 1},
                            size = {BST_VIEW_CHILD_BYTES + 1, BST_VIEW_CHILD_BYTES + 1};
        prlimit(child, RLIMIT_CPU, &time, NULL);
        prlimit(child, RLIMIT_FSIZE, &size, NULL);
        wait_for(child, limit_s, out);
        status = read_stream(ctx, s.output, &out->output);
        status = status == BST_OK ? read_stream(ctx, s.messages, &out->messages) : status;
    }
    close_streams(&s);
    if (status != BST_OK) {
        bst_view_child_free(out);
    }
    return status;
}

void bst_view_child_free(bst_view_child_result *result) {
    free(result->output);
    free(result->messages);
    *result = (bst_view_child_result){.exit_code = 127};
}
