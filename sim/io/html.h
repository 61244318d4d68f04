/* Writing HTML: text that cannot become markup, and bytes as base64. Errors are those of the
 * stream: ask ferror, or bst_draft_close. */
#ifndef BST_IO_HTML_H
#define BST_IO_HTML_H

#include <stddef.h>
#include <stdio.h>

#include "boresight/status.h"

/* Text of an element or of a quoted attribute: & < > " ' become references; what is no UTF-8, and
 * control characters other than tab and line feed, become U+FFFD. NULL is "". */
void bst_html_text(FILE *out, const char *text);

/* The same of a formatted text; of more than 4095 bytes the rest is cut. */
void bst_html_format(FILE *out, const char *format, ...) BST_PRINTF(2, 3);

/* Base64 (RFC 4648, section 4), padded, without line breaks. */
void bst_html_base64(FILE *out, const void *data, size_t bytes);

#endif
