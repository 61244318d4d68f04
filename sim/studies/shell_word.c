#include "sim/studies/shell_word.h"

void bst_put_shell_word(FILE *out, const char *word) {
    fputc('\'', out);
    for (; *word; word++) {
        if (*word == '\'') {
            fputs("'\\''", out);
        } else {
            fputc(*word, out);
        }
    }
    fputc('\'', out);
}
