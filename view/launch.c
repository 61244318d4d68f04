#define _GNU_SOURCE /* pipe2, memfd_create */
#include "view/launch.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/cli/stop_signals.h"
#include "sim/core/file.h"
#include "sim/core/wall_clock.h"

extern char **environ;

enum { VIEWERS_MOST = 8, LOOK_MS = 100 };
/* Time in which a viewer prints its address: it reads the scenario and its catalogues before. */
static const double START_S = 30;
/* What each address begins with; nothing else that a program prints is followed. */
static const char address_start[] = "http://127.0.0.1:";

/* A program that was started. */
typedef struct viewer {
    pid_t pid;
    int output, messages; /* kept open: the viewer prints there */
    bool starting;        /* has not printed its address */
} viewer;

struct bst_view_launcher {
    pthread_mutex_t lock; /* of all below */
    viewer viewers[VIEWERS_MOST];
    int count;
};

bst_status bst_view_launcher_create(bst_ctx *ctx, bst_view_launcher **out) {
    bst_view_launcher *launcher = calloc(1, sizeof *launcher);
    *out = NULL;
    if (!launcher || pthread_mutex_init(&launcher->lock, NULL) != 0) {
        free(launcher);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the viewer");
    }
    *out = launcher;
    return BST_OK;
}

/* Reads the end of what a viewer printed on standard error. */
static size_t read_messages(const viewer *v, char *text, size_t bytes) {
    const off_t all = lseek(v->messages, 0, SEEK_END);
    const off_t from = all > (off_t)bytes - 1 ? all - ((off_t)bytes - 1) : 0;
    const ssize_t got = all > 0 ? pread(v->messages, text, bytes - 1, from) : 0;
    text[got > 0 ? got : 0] = '\0';
    return got > 0 ? (size_t)got : 0;
}

/* Closes the files of a viewer that has ended; its messages go to standard error. */
static void close_viewer(const viewer *v) {
    char text[4096];
    const size_t bytes = read_messages(v, text, sizeof text);
    bst_file_write_all(STDERR_FILENO, text, bytes);
    close(v->output);
    close(v->messages);
}

void bst_view_launcher_free(bst_view_launcher *launcher) {
    if (!launcher) {
        return;
    }
    for (int i = 0; i < launcher->count; i++) {
        kill(launcher->viewers[i].pid, SIGTERM);
    }
    for (int i = 0; i < launcher->count; i++) {
        waitpid(launcher->viewers[i].pid, NULL, 0);
        close_viewer(&launcher->viewers[i]);
    }
    pthread_mutex_destroy(&launcher->lock);
    free(launcher);
}

/* Removes viewers that have ended. */
static void collect(bst_view_launcher *launcher) {
    for (int i = launcher->count - 1; i >= 0; i--) {
        const viewer v = launcher->viewers[i];
        if (!v.starting && waitpid(v.pid, NULL, WNOHANG) != 0) {
            close_viewer(&v);
            launcher->viewers[i] = launcher->viewers[--launcher->count];
        }
    }
}

/* Starts this program with its standard output in a pipe and its standard error in memory. */
static int spawn(viewer *v, int output, char *scenario) {
    char self[] = "/proc/self/exe", view[] = "view", quiet[] = "--no-browser";
    char *words[] = {self, view, scenario, quiet, NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t own_group; /* Ctrl-C reaches it by bst_view_launcher_free alone */
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&own_group);
    posix_spawnattr_setpgroup(&own_group, 0);
    posix_spawnattr_setflags(&own_group, POSIX_SPAWN_SETPGROUP);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, output, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, v->messages, STDERR_FILENO);
    const int failed = posix_spawn(&v->pid, self, &files, &own_group, words, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&own_group);
    return failed;
}

static bst_status start(bst_ctx *ctx, const char *scenario, viewer *v) {
    int ends[2] = {-1, -1};
    char *file = strdup(scenario);
    *v = (viewer){.output = -1, .messages = memfd_create("boresight-viewer", MFD_CLOEXEC)};
    int failed = file && v->messages >= 0 && pipe2(ends, O_CLOEXEC) == 0 ? 0 : errno;
    failed = failed ? failed : spawn(v, ends[1], file);
    free(file);
    if (ends[1] >= 0) {
        close(ends[1]);
    }
    if (failed) {
        close(ends[0]);
        close(v->messages);
        return bst_fail(ctx, BST_ERR_IO, "another viewer cannot be started: %s", strerror(failed));
    }
    v->output = ends[0];
    v->starting = true;
    return BST_OK;
}

/* Why a viewer did not start: the last line of its messages, or `otherwise`. */
static bst_status fail_with_reason(bst_ctx *ctx, const viewer *v, const char *otherwise) {
    static const char program[] = "boresight: ";
    char text[2048];
    size_t bytes = read_messages(v, text, sizeof text);
    while (bytes > 0 && text[bytes - 1] == '\n') {
        text[--bytes] = '\0';
    }
    const char *line = strrchr(text, '\n');
    line = line ? line + 1 : text;
    line += strncmp(line, program, sizeof program - 1) == 0 ? sizeof program - 1 : 0;
    return bst_fail(ctx, BST_ERR_CONFIG, "the scenario cannot run: %.1000s",
                    *line ? line : otherwise);
}

/* Reads the first line of a viewer: its address. */
static bst_status read_address(bst_ctx *ctx, const viewer *v, char url[BST_VIEW_LAUNCH_URL_BYTES]) {
    const double until_s = bst_wall_seconds() + START_S;
    struct pollfd wait = {.fd = v->output, .events = POLLIN};
    size_t used = 0;
    while (used + 1 < BST_VIEW_LAUNCH_URL_BYTES) {
        const int ready = poll(&wait, 1, LOOK_MS);
        if (ready <= 0 && (bst_wall_seconds() > until_s || bst_stop_requested())) {
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "the scenario was not ready within %.0f s and was ended: run boresight "
                            "view with it in a terminal",
                            START_S);
        }
        if (ready <= 0) {
            continue;
        }
        if (read(v->output, url + used, 1) != 1) {
            return fail_with_reason(ctx, v, "its viewer ended without a message");
        }
        if (url[used] == '\n') {
            break;
        }
        used++;
    }
    url[used] = '\0';
    return strncmp(url, address_start, sizeof address_start - 1) == 0
               ? BST_OK
               : fail_with_reason(ctx, v, "its viewer printed no address");
}

/* Starts a viewer and notes it, while there is room. */
static bst_status add_viewer(bst_ctx *ctx, bst_view_launcher *launcher, const char *scenario,
                             viewer *v) {
    pthread_mutex_lock(&launcher->lock);
    collect(launcher);
    bst_status status =
        launcher->count < VIEWERS_MOST
            ? start(ctx, scenario, v)
            : bst_fail(ctx, BST_ERR_STATE,
                       "%d live runs were started here, which is the limit: end one", VIEWERS_MOST);
    if (status == BST_OK) {
        launcher->viewers[launcher->count++] = *v;
    }
    pthread_mutex_unlock(&launcher->lock);
    return status;
}

/* Notes that a viewer has printed its address, or ends it. */
static void settle(bst_view_launcher *launcher, pid_t pid, bool started) {
    pthread_mutex_lock(&launcher->lock);
    for (int i = 0; i < launcher->count; i++) {
        viewer *v = &launcher->viewers[i];
        if (v->pid == pid) {
            v->starting = false;
            if (!started) {
                kill(pid, SIGKILL);
                waitpid(pid, NULL, 0);
                close_viewer(v);
                *v = launcher->viewers[--launcher->count];
            }
            break;
        }
    }
    pthread_mutex_unlock(&launcher->lock);
}

bst_status bst_view_launch(bst_ctx *ctx, bst_view_launcher *launcher, const char *scenario,
                           char url[BST_VIEW_LAUNCH_URL_BYTES]) {
    viewer v;
    BST_TRY(add_viewer(ctx, launcher, scenario, &v));
    bst_status status = read_address(ctx, &v, url); /* others may start meanwhile */
    settle(launcher, v.pid, status == BST_OK);
    return status;
}
