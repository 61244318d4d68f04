/* Text helpers: nearest words for messages, numbers, file names. */
#ifndef BST_CORE_TEXT_H
#define BST_CORE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Levenshtein distance of two words (1966): single-byte insertions, deletions and replacements; 64
 * if one is longer than 64 bytes. */
size_t bst_text_distance(const char *a, const char *b);

/* True if `candidate` is close enough to the mistyped `word` for a suggestion, and closer than
 * *best, which is updated. Start with *best = SIZE_MAX. A word without its unit ("rate" for
 * "rate_hz") has distance 1. */
bool bst_text_is_nearer(const char *word, const char *candidate, size_t *best);

/* Bytes of the text of bst_text_of_count. */
enum { BST_COUNT_TEXT = 64 };

/* Formats a count with its noun: "1 frame", "3 frames".
 *
 * Given:     one, many  noun in the singular and in the plural
 * Returned:  text */
const char *bst_text_of_count(char text[BST_COUNT_TEXT], int64_t count, const char *one,
                              const char *many);

/* Formats a finite number as the shortest text that is recovered exactly, which cJSON's printing
 * (15 digits with a tolerance) does not guarantee. */
void bst_text_of_number(double value, char *buffer, size_t bytes);

/* True if a word is allowed as a file or folder name: 1 to 255 bytes without "/" and control
 * characters, not beginning with "." (which excludes "." and ".."). */
bool bst_text_is_file_name(const char *word);

/* True if a text ends in `ending`, in capitals or not, and is longer: "a.FITS" ends in ".fits". */
bool bst_text_ends_in(const char *text, const char *ending);

#ifdef __cplusplus
}
#endif

#endif
