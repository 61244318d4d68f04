/* The command `boresight propagate`. */
#ifndef BST_APP_CMD_PROPAGATE_H
#define BST_APP_CMD_PROPAGATE_H

/* Runs the command; argv[0] is "propagate". Returns the exit code: 0 done, 1 failed, 2 wrong usage.
 */
int bst_cmd_propagate(int argc, char **argv);

#endif
