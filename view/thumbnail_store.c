#include "view/thumbnail_store.h"

#include <stdlib.h>

struct bst_view_thumbnails {
    int next; /* place of the next one */
    bst_view_thumbnail *kept[BST_VIEW_THUMBNAILS];
};

void bst_view_thumbnails_free(bst_view_thumbnails *thumbnails) {
    for (int i = 0; thumbnails && i < BST_VIEW_THUMBNAILS; i++) {
        free(thumbnails->kept[i]);
    }
    free(thumbnails);
}

const bst_view_thumbnail *bst_view_thumbnails_find(const bst_view_thumbnails *all, int64_t sensor,
                                                   int64_t fits_index) {
    for (int i = 0; all && i < BST_VIEW_THUMBNAILS; i++) {
        const bst_view_thumbnail *one = all->kept[i];
        if (one && one->sensor == sensor && one->fits_index == fits_index && one->width > 0) {
            return one;
        }
    }
    return NULL;
}

bst_view_thumbnail *bst_view_thumbnails_place(bst_view_thumbnails **store) {
    if (!*store) {
        *store = calloc(1, sizeof **store);
    }
    bst_view_thumbnails *all = *store;
    if (!all) {
        return NULL;
    }
    bst_view_thumbnail **one = &all->kept[all->next];
    if (!*one) {
        *one = malloc(sizeof **one);
    }
    if (*one) {
        (*one)->width = 0; /* until it is filled */
        all->next = (all->next + 1) % BST_VIEW_THUMBNAILS;
    }
    return *one;
}
