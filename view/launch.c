#define _GNU_SOURCE /* pipe2 */
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
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

enum { VIEWERS_MOST = 8, START_MS = 30000 };

struct bst_view_launcher {
    pthread_mutex_t lock; /* of all below */
    pid_t viewers[VIEWERS_MOST];
    int outputs[VIEWERS_MOST]; /* kept open: the viewer prints there */
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

void bst_view_launcher_free(bst_view_launcher *launcher) {
    if (!launcher) {
        return;
    }
    for (int i = 0; i < launcher->count; i++) {
        kill(launcher->viewers[i], SIGTERM);
    }
    for (int i = 0; i < launcher->count; i++) {
        waitpid(launcher->viewers[i], NULL, 0);
        close(launcher->outputs[i]);
    }
    pthread_mutex_destroy(&launcher->lock);
    free(launcher);
}

/* Removes viewers that have ended. */
static void collect(bst_view_launcher *launcher) {
    for (int i = launcher->count - 1; i >= 0; i--) {
        if (waitpid(launcher->viewers[i], NULL, WNOHANG) != 0) {
            close(launcher->outputs[i]);
            launcher->count--;
            launcher->viewers[i] = launcher->viewers[launcher->count];
            launcher->outputs[i] = launcher->outputs[launcher->count];
        }
    }
}

/* Starts the program with its standard output in a pipe. */
static bst_status start(bst_ctx *ctx, const char *scenario, pid_t *child, int *output) {
    char self[4096], view[] = "view", quiet[] = "--no-browser", *file = strdup(scenario);
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    int ends[2];
    if (!file || length <= 0 || pipe2(ends, O_CLOEXEC) != 0) {
        free(file);
        return bst_fail(ctx, BST_ERR_IO, "another viewer cannot be started: %s", strerror(errno));
    }
    self[length] = '\0';
    char *words[] = {self, view, file, quiet, NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t own_group; /* Ctrl-C reaches it by bst_view_launcher_free alone */
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&own_group);
    posix_spawnattr_setpgroup(&own_group, 0);
    posix_spawnattr_setflags(&own_group, POSIX_SPAWN_SETPGROUP);
    posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&files, ends[1], 1);
    const int failed = posix_spawn(child, self, &files, &own_group, words, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&own_group);
    free(file);
    close(ends[1]);
    *output = ends[0];
    if (failed) {
        close(ends[0]);
        return bst_fail(ctx, BST_ERR_IO, "another viewer cannot be started: %s", strerror(failed));
    }
    return BST_OK;
}

/* Reads the first line of a viewer: its address. */
static bst_status read_address(bst_ctx *ctx, int output, char url[BST_VIEW_LAUNCH_URL_BYTES]) {
    size_t used = 0;
    struct pollfd wait = {.fd = output, .events = POLLIN};
    while (used + 1 < BST_VIEW_LAUNCH_URL_BYTES && poll(&wait, 1, START_MS) > 0 &&
           read(output, url + used, 1) == 1) {
        if (url[used] == '\n') {
            url[used] = '\0';
            return BST_OK;
        }
        used++;
    }
    return bst_fail(ctx, BST_ERR_CONFIG,
                    "the scenario cannot run: its reason is where this viewer was started");
}

bst_status bst_view_launch(bst_ctx *ctx, bst_view_launcher *launcher, const char *scenario,
                           char url[BST_VIEW_LAUNCH_URL_BYTES]) {
    pid_t child = 0;
    int output = -1;
    pthread_mutex_lock(&launcher->lock);
    collect(launcher);
    bst_status status =
        launcher->count < VIEWERS_MOST
            ? start(ctx, scenario, &child, &output)
            : bst_fail(ctx, BST_ERR_STATE,
                       "%d live runs were started here, which is the limit: end one", VIEWERS_MOST);
    if (status == BST_OK) {
        launcher->viewers[launcher->count] = child;
        launcher->outputs[launcher->count++] = output;
        status = read_address(ctx, output, url);
    }
    pthread_mutex_unlock(&launcher->lock);
    return status;
}
