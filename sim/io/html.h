/* Writes HTML: escaped text, and bytes as base64. Errors are those of the stream: use ferror or
 * bst_draft_close. */
#ifndef BST_IO_HTML_H
#define BST_IO_HTML_H

#include <stddef.h>
#include <stdio.h>

#include "boresight/status.h"

/* Writes text for an element or a quoted attribute: & < > " ' are escaped; invalid UTF-8 and
 * control characters except tab and line feed become U+FFFD. NULL is "". */
void bst_html_text(FILE *out, const char *text);

/* Writes formatted, escaped text; at most 4095 bytes. */
void bst_html_format(FILE *out, const char *format, ...) BST_PRINTF(2, 3);

/* Base64 (RFC 4648, section 4), padded, without line breaks. */
void bst_html_base64(FILE *out, const void *data, size_t bytes);

#endif
