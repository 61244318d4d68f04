/* Small pictures of frames that are kept in memory: the oldest one makes room. */
#ifndef BST_VIEW_THUMBNAIL_STORE_H
#define BST_VIEW_THUMBNAIL_STORE_H

#include <stdint.h>

enum {
    BST_VIEW_THUMBNAIL_PX = 80, /* longest side at most */
    BST_VIEW_THUMBNAILS = 256   /* that are kept for a run */
};

/* A picture that is kept. */
typedef struct bst_view_thumbnail {
    int64_t sensor, fits_index;
    int width, height; /* 0: empty place */
    uint16_t data[BST_VIEW_THUMBNAIL_PX * BST_VIEW_THUMBNAIL_PX];
} bst_view_thumbnail;

typedef struct bst_view_thumbnails bst_view_thumbnails;

/* Frees the pictures; NULL is allowed. */
void bst_view_thumbnails_free(bst_view_thumbnails *thumbnails);

/* Finds a picture, which belongs to the store; NULL: it is not there. `all` may be NULL. */
const bst_view_thumbnail *bst_view_thumbnails_find(const bst_view_thumbnails *all, int64_t sensor,
                                                   int64_t fits_index);

/* Empty place for a new picture: that of the oldest one.
 *
 * Given:     store  *store NULL: it is created
 * Returned:  NULL: out of memory */
bst_view_thumbnail *bst_view_thumbnails_place(bst_view_thumbnails **store);

#endif
