/* Stop signals: the first one requests an orderly end of a run. Process-wide state. */
#ifndef BST_CLI_STOP_SIGNALS_H
#define BST_CLI_STOP_SIGNALS_H

#include <stdbool.h>

/* Catches SIGINT, SIGTERM and SIGHUP as stop requests; a second signal ends the process. */
void bst_stop_catch_signals(void);

/* For commands in the process of another program, which goes on afterwards: a second signal does
 * not end the process. */
void bst_stop_share_process(bool shared);

/* True if a signal has asked the program to stop. */
bool bst_stop_requested(void);

#endif
