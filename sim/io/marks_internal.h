/* Colours and marks shared by the pictures of frames. */
#ifndef BST_IO_MARKS_INTERNAL_H
#define BST_IO_MARKS_INTERNAL_H

#include "sim/io/picture.h"

#define BST_WHITE \
    { 240, 243, 248 }
#define BST_SOFT \
    { 150, 160, 176 }
#define BST_TARGET_COLOUR \
    { 255, 92, 92 }
#define BST_TRACK_COLOUR \
    { 92, 220, 255 }
#define BST_OBJECT_COLOUR \
    { 255, 214, 79 }
#define BST_STAR_COLOUR \
    { 110, 190, 120 }
#define BST_REST_COLOUR \
    { 84, 134, 140 }
#define BST_CROSS_COLOUR \
    { 236, 128, 255 }

/* Draws the boresight mark: four arms from `gap` to `arm` picture pixels from the centre. */
void bst_mark_cross(bst_picture *picture, double x, double y, double gap, double arm);
/* Draws the mark of a track: a diamond, `r` picture pixels from centre to corner. */
void bst_mark_diamond(bst_picture *picture, double x, double y, double r);

#endif
