/* Commands in the process of another program. */
#include "boresight/program.h"

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include "sim/app/app.h"
#include "sim/cli/stop_signals.h"

/* Signals whose handlers commands replace (sim/cli/stop_signals.c). */
static const int handled[] = {SIGINT, SIGTERM, SIGHUP, SIGXFSZ, SIGPIPE};
enum { HANDLED = sizeof handled / sizeof *handled };

/* Opens a stream for a copy of a file descriptor; NULL: not possible. */
static FILE *stream_of(int fd) {
    int copy = dup(fd);
    FILE *stream = copy >= 0 ? fdopen(copy, "w") : NULL;
    if (!stream && copy >= 0) {
        close(copy);
    }
    return stream;
}

/* Runs a command with other standard streams, which glibc allows: they are variables (The GNU C
 * Library Reference Manual, 12.2 Standard Streams). */
static int run_with(int argc, char **argv, FILE *output, FILE *errors) {
    FILE *former_output = stdout, *former_errors = stderr;
    struct sigaction former[HANDLED];
    for (int i = 0; i < HANDLED; i++) {
        sigaction(handled[i], NULL, &former[i]);
    }
    signal(SIGXFSZ, SIG_IGN); /* as in the program: a write beyond a limit returns an error */
    fflush(NULL);
    stdout = output;
    stderr = errors;
    bst_stop_share_process(true);
    int code = bst_app_run(argc, argv, NULL);
    bst_stop_share_process(false);
    fflush(NULL);
    stdout = former_output;
    stderr = former_errors;
    for (int i = 0; i < HANDLED; i++) {
        sigaction(handled[i], &former[i], NULL);
    }
    return code;
}

int bst_program_run(int argc, char **argv, int output, int errors) {
    static pthread_mutex_t running = PTHREAD_MUTEX_INITIALIZER; /* held during a command */
    if (pthread_mutex_trylock(&running) != 0) {
        dprintf(errors, "boresight: another command runs in this process: wait for its end\n");
        return BST_EXIT_FAILED;
    }
    int code = BST_EXIT_FAILED;
    FILE *to = stream_of(output), *errors_to = stream_of(errors);
    if (to && errors_to) {
        setvbuf(errors_to, NULL, _IONBF, 0);
        code = run_with(argc, argv, to, errors_to);
    } else {
        dprintf(errors, "boresight: the files for output and errors cannot be written\n");
    }
    if (to) {
        fclose(to);
    }
    if (errors_to) {
        fclose(errors_to);
    }
    pthread_mutex_unlock(&running);
    return code;
}

const bst_app_viewer *bst_app_page = NULL;

bst_status bst_app_open_page(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                             struct bst_view_attached **page) {
    return bst_app_page
               ? bst_app_page->attach(ctx, scenario, out, page)
               : bst_fail(ctx, BST_ERR_ARGUMENT, "--view: only the program boresight has a viewer");
}

void bst_app_close_page(struct bst_view_attached *page) {
    if (page) {
        bst_app_page->detach(page);
    }
}
