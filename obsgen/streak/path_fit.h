/* What filters and fits of image processing make of a star whose true path differs from the one
 * that telemetry reports, as in a slew, and of several stars fitted as one. Internal to the
 * generator. */
#ifndef BST_OBSGEN_STREAK_PATH_FIT_H
#define BST_OBSGEN_STREAK_PATH_FIT_H

#include "obsgen/model/matched_filter_theory.h"
#include "obsgen/streak/star_trail.h"

/* Streak model of image processing: uniform motion plus bend (coefficient of (3 u^2 - 1) / 2, u
 * from -1 to 1), px. */
typedef struct bst_streak_model {
    bst_obsgen_path_px path, bend;
    double sigma_px; /* of the PSF, including the pixel */
    /* light of a pixel from which on it is saturated and left out of the fit, relative to that of
     * the whole star at rest; 0: none is */
    double saturated;
} bst_streak_model;

/* Weighted squares on the fitted pixels, of one unit: of all light, and of what the model leaves;
 * fitted flux relative to the true one.
 */
typedef struct bst_path_fit_squares {
    double all, left, flux;
} bst_path_fit_squares;

/* Pixels of a grid along a streak and across, on which light is fitted. */
enum {
    BST_PATH_COLUMNS = 96,
    BST_PATH_ROWS = 32,
    BST_PATH_PIXELS = BST_PATH_COLUMNS * BST_PATH_ROWS
};

/* Light of a star on its path, on the pixels about a streak. */
typedef struct bst_path_light {
    double cosine, sine; /* of the streak's direction, along which the rows lie */
    double sigma_px;     /* of the PSF */
    double x0_px, y0_px, step_px;
    int columns, rows;
    double value[BST_PATH_PIXELS]; /* [rows][columns] */
} bst_path_light;

/* Renders the light of a star, for fits on the pixels about `stamp`.
 *
 * Given:     sigma_px  deviation of the PSF, including the pixel */
void bst_path_light_make(const bst_star_trail_path *path, double sigma_px,
                         const bst_streak_model *stamp, bst_path_light *out);

/* Fits a streak model, or a point (a model of no length), to the light of a star on its true path,
 * in the mean over noise. Free parameters are those of image processing: place, flux and width.
 * Each pixel has the weight 1 / (noise^2 + fitted light).
 *
 * Given:     model     of the PSF of that light
 *            light     brightest pixel of the fitted light over the variance of the noise
 *            place_px  start of the iterations: (0, 0) or the place for another light
 * Returned:  place_px: relative to the mean of the path, px; the fit's sums of squares */
bst_path_fit_squares bst_path_fit_light(const bst_path_light *star, const bst_streak_model *model,
                                        double light, double place_px[2]);

/* Both, for one fit on the pixels about the model. */
bst_path_fit_squares bst_path_fit(const bst_star_trail_path *path, const bst_streak_model *model,
                                  double light, double place_px[2]);

/* A point's light. */
typedef struct bst_path_point {
    double x_px, y_px, flux;
} bst_path_point;

/* A point as fitted: place, flux and widening of the PSF's variance, px^2. */
typedef struct bst_path_point_fit {
    double x_px, y_px, flux, widening_px2;
} bst_path_point_fit;

/* Most points of bst_path_fit_points. */
enum { BST_PATH_POINTS = 64 };

/* Fits one point to the light of several, as image processing does: place, flux and width are
 * free.
 *
 * Given:     points    about (0, 0), the centre of the fitted pixels and start of the iterations;
 *                      at most BST_PATH_POINTS are used
 *            image_px  deviation of a point's image, including the pixel
 *            model_px  deviation of the fitted PSF, including the pixel
 *            light     brightest pixel of a fitted point of flux 1 over the variance of the noise
 *            saturated light of a pixel from which on it is saturated and left out of the fit,
 *                      relative to the brightest pixel of a fitted point of flux 1; 0: none is */
bst_path_point_fit bst_path_fit_points(const bst_path_point *points, int count, double image_px,
                                       double model_px, double light, double saturated);

/* A streak's light: uniform along its path about (x_px, y_px). */
typedef struct bst_path_streak {
    double x_px, y_px, flux;
    bst_obsgen_path_px path;
} bst_path_streak;

/* Fits one streak to the light of several, as bst_path_fit_points: place, flux and width are free.
 *
 * Given:     streaks   about (0, 0), the centre of the fitted streak and start of the iterations
 *            image_px  deviation of a point's image, including the pixel
 *            model     fitted streak; its bend is not used
 *            light     brightest pixel of a fitted streak of flux 1 over the variance of the noise
 *            margin_px of the fitted pixels about the streak
 *            limit_px  farthest place on each axis */
bst_path_point_fit bst_path_fit_streaks(const bst_path_streak *streaks, int count, double image_px,
                                        const bst_streak_model *model, double light,
                                        double margin_px, double limit_px);

/* Widths of the images of a point, px, including the pixel: of the star, of the filters, and of
 * the product of both. */
typedef struct bst_path_widths {
    double source_px, filter_px, both_px;
} bst_path_widths;

/* Largest output of both filters for a star on its true path, relative to its SNR in the filter
 * matched to its real image. */
typedef struct bst_path_outputs {
    double point, streak; /* streak: 0 without a streak filter */
    double point_at[2];   /* of the point filter's maximum relative to the mean of the path, px */
    double streak_beside; /* output of the streak filter at the point filter's maximum */
    double point_beside; /* largest output of the point filter within 2 px of the streak filter's */
} bst_path_outputs;

/* Computes the largest outputs of the filters for a point and for the straight streak `filter`. */
bst_path_outputs bst_path_fit_outputs(const bst_star_trail_path *path, bst_obsgen_path_px filter,
                                      const bst_path_widths *widths);

#endif
