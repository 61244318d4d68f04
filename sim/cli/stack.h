/* A stack that is large enough, whatever the limit of the process is. */
#ifndef BST_CLI_STACK_H
#define BST_CLI_STACK_H

/* Runs a command and returns its exit code. Where the limit of the stack (ulimit -s) is below
 * BST_THREAD_STACK_BYTES, the command runs in a thread with a stack of that size, and threads that
 * libraries start (OpenCL's compiler needs more than 256 KiB) get it too. */
int bst_cli_run_with_stack(int (*command)(int argc, char **argv), int argc, char **argv);

#endif
