/* The command `boresight stars`. */
#ifndef BST_APP_CMD_STARS_H
#define BST_APP_CMD_STARS_H

/* Runs the command; argv[0] is "stars". Returns the exit code: 0 done, 1 failed, 2 wrong usage. */
int bst_cmd_stars(int argc, char **argv);

#endif
