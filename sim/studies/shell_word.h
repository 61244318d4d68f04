/* Words of a command line for the shell. */
#ifndef BST_STUDIES_SHELL_WORD_H
#define BST_STUDIES_SHELL_WORD_H

#include <stdio.h>

/* Writes a word in single quotes, so that a POSIX shell reads back its bytes unchanged. */
void bst_put_shell_word(FILE *out, const char *word);

#endif
