/* Small helpers on text. */
#ifndef BST_CORE_TEXT_H
#define BST_CORE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The number of single-byte insertions, deletions and replacements that turn one word into the
 * other (Levenshtein 1966); 64 when either is longer than 64 bytes. */
size_t bst_text_distance(const char *a, const char *b);

/* Whether `candidate` is near enough to the mistyped `word` to be suggested for it, and nearer than
 * *best; then *best becomes its distance. Start with *best = SIZE_MAX. A word that lacks only the
 * unit ("rate" for "rate_hz") counts as 1. */
bool bst_text_is_nearer(const char *word, const char *candidate, size_t *best);

/* Bytes of the text of bst_text_of_count. */
enum { BST_COUNT_TEXT = 64 };

/* Writes a count and its noun: "1 frame", "3 frames".
 *
 * Given:     one, many  noun in the singular and in the plural
 * Returned:  text */
const char *bst_text_of_count(char text[BST_COUNT_TEXT], int64_t count, const char *one,
                              const char *many);

/* A finite number as the shortest text that reads back as the same bits, which cJSON's own printing
 * (15 digits, compared with a tolerance) does not promise. */
void bst_text_of_number(double value, char *buffer, size_t bytes);

/* Whether a word can be the name of a file or folder that is made: 1 to 255 bytes without "/" and
 * control characters, not beginning with "." (which also refuses "." and ".."). */
bool bst_text_is_file_name(const char *word);

#ifdef __cplusplus
}
#endif

#endif
