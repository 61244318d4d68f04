/* Files of the viewer's page, embedded into the program. */
#ifndef BST_VIEW_PAGE_FILES_H
#define BST_VIEW_PAGE_FILES_H

#include <stddef.h>

/* A file of the page. */
typedef struct bst_view_page_file {
    const char *name; /* without folder; NULL ends the list */
    const char *data;
    size_t bytes;
} bst_view_page_file;

/* All files of the page; made by cmake/embed.c from view/page. */
extern const bst_view_page_file bst_view_page_files[];

#endif
