/* Reads a curve from a CSV file of two columns: spectral responses, light
 * curves, angles of joints. */
#ifndef BST_ASTRO_CURVE_FILE_H
#define BST_ASTRO_CURVE_FILE_H

#include "boresight/status.h"

enum { BST_CURVE_POINTS_MAX = 100000 };

/* Allowed content of a curve file. The first line that is neither empty nor a comment (#) names the
 * columns. */
typedef struct bst_curve_format {
    const char *what;           /* description for messages: "a table of spectral response" */
    const char *const *x_names; /* of the first column, NULL-terminated */
    const char *const *y_names; /* of the second */
    double x_min, x_max, y_min, y_max;
} bst_curve_format;

/* x ascends strictly. */
typedef struct bst_curve {
    double *x, *y; /* [count] */
    int count;
    int x_column, y_column; /* indices of the names in the format */
} bst_curve;

/* Reads a file of 1 to BST_CURVE_POINTS_MAX rows. BST_ERR_NOT_FOUND, BST_ERR_IO, or BST_ERR_FORMAT
 * with file, line, problem and expected form. The caller frees with bst_curve_free, also after an
 * error. */
bst_status bst_curve_load(bst_ctx *ctx, const char *path, const bst_curve_format *format,
                          bst_curve *out) BST_MUST_CHECK;
/* Frees the memory of a curve and clears the struct, which belongs to the caller. */
void bst_curve_free(bst_curve *curve);

/* Value of a curve: linear between points, constant beyond. */
double bst_curve_at(const bst_curve *curve, double x);

#endif
