/* Provides a sufficient stack, independent of the process's limit. */
#ifndef BST_CLI_STACK_H
#define BST_CLI_STACK_H

/* Runs a command and returns its exit code. If the stack limit (ulimit -s) is below
 * BST_THREAD_STACK_BYTES, the command runs in a thread with that stack size. Threads of libraries
 * get it too (OpenCL's compiler needs more than 256 KiB). */
int bst_cli_run_with_stack(int (*command)(int argc, char **argv), int argc, char **argv);

#endif
