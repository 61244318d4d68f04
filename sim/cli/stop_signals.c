#include "sim/cli/stop_signals.h"

#include <signal.h>
#include <stddef.h>

static volatile sig_atomic_t stop_requested;

static const int stop_signals[] = {SIGINT, SIGTERM, SIGHUP};
enum { STOP_SIGNALS = sizeof stop_signals / sizeof *stop_signals };

static volatile sig_atomic_t process_is_shared; /* with a program that goes on afterwards */

/* The first signal requests a stop; the second one of any kind ends the process. */
static void on_signal(int number) {
    (void)number;
    stop_requested = 1;
    for (int i = 0; i < STOP_SIGNALS && !process_is_shared; i++) {
        signal(stop_signals[i], SIG_DFL);
    }
}

void bst_stop_catch_signals(void) {
    stop_requested = 0;
    for (int i = 0; i < STOP_SIGNALS; i++) {
        struct sigaction action = {.sa_handler = on_signal}, before;
        /* nohup ignores SIGHUP: keep that */
        if (stop_signals[i] != SIGHUP ||
            (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN)) {
            sigaction(stop_signals[i], &action, NULL);
        }
    }
    /* file size limits and closed pipes shall cause write errors, not end the process */
    signal(SIGXFSZ, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
}

void bst_stop_share_process(bool shared) {
    process_is_shared = shared;
}

bool bst_stop_requested(void) {
    return stop_requested != 0;
}
