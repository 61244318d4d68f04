/* Decides whether image processing subtracts the level of each detector column. */
#ifndef BST_OPTICS_COLUMN_LEVEL_H
#define BST_OPTICS_COLUMN_LEVEL_H

#include <stdbool.h>

#include "boresight/camera.h"

/* choices of the configuration, in this order */
enum { BST_COLUMN_LEVEL_AUTO, BST_COLUMN_LEVEL_ON, BST_COLUMN_LEVEL_OFF };
extern const char *const bst_column_level_words[];

/* minimum and maximum number of rows for measuring a column's level */
enum { BST_COLUMN_LEVEL_LEAST_ROWS = 31, BST_COLUMN_LEVEL_MOST_ROWS = 1024 };

/* True if column levels are subtracted: by `choice`, or, with auto, if the onboard camera has frame
 * transfer or column offsets above a fifth of the read noise. */
bool bst_column_level_wanted(int choice, const bst_camera *camera);

#endif
