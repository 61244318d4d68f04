/* Signals that end a run: the first asks it to close properly. State of the process, as signals
 * are. */
#ifndef BST_CLI_STOP_SIGNALS_H
#define BST_CLI_STOP_SIGNALS_H

#include <stdbool.h>

/* From here on SIGINT, SIGTERM and SIGHUP are requests to stop; a second one ends the process. */
void bst_stop_catch_signals(void);

/* True if a signal has asked the program to stop. */
bool bst_stop_requested(void);

#endif
