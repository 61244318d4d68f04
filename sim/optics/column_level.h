/* Whether image processing takes the level of each column off a frame. */
#ifndef BST_OPTICS_COLUMN_LEVEL_H
#define BST_OPTICS_COLUMN_LEVEL_H

#include <stdbool.h>

#include "boresight/camera.h"

/* The configuration's choice, and its words in this order. */
enum { BST_COLUMN_LEVEL_AUTO, BST_COLUMN_LEVEL_ON, BST_COLUMN_LEVEL_OFF };
extern const char *const bst_column_level_words[];

/* Rows of which the level of a column is measured, at least and at most. */
enum { BST_COLUMN_LEVEL_LEAST_ROWS = 31, BST_COLUMN_LEVEL_MOST_ROWS = 1024 };

/* Whether the levels are to be taken off: `choice` says so, or leaves it to the onboard camera and
 * that has a frame transfer, or offsets of its columns above a fifth of the read noise. */
bool bst_column_level_wanted(int choice, const bst_camera *camera);

#endif
