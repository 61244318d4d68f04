/* Path that all stars of a frame follow during the exposure, and their light along it. */
#ifndef BST_IMGPROC_STREAK_STAR_PATH_H
#define BST_IMGPROC_STREAK_STAR_PATH_H

#include <stdbool.h>

enum { BST_STAR_PATH_ROOM = 1024 };

/* Samples of the path, BST_STAR_PATH_STEP_PX apart, as places relative to a star's own place at the
 * middle one. A path of one sample is that of a point. */
typedef struct bst_star_path {
    int count;
    double place[BST_STAR_PATH_ROOM][2]; /* px, for a star at the frame's middle */
    double light[BST_STAR_PATH_ROOM];    /* of a sample, mean 1 over the path */
    double ends[2][2];                   /* where the light ends; the one further left first, of a
                                            known motion the one that came first */
    double margin[2]; /* logarithm of the likelihood of each end over that of ends elsewhere: see
                         bst_star_path_refine */
    double centre[2]; /* px, of the frame */
    double tangent_per_px; /* of the gnomonic projection; 0: all paths are equal */
} bst_star_path;

#define BST_STAR_PATH_STEP_PX 2.0

/* Map from the path at the frame's middle to that at a place: dx = m[0] u + m[1] v,
 * dy = m[1] u + m[2] v.
 *
 * The camera turns about axes across its boresight. In tangent coordinates (x, y) a star then moves
 * by [1 + x^2, x y; x y, 1 + y^2] times the motion at the boresight. */
void bst_star_path_map(const bst_star_path *path, double x_px, double y_px, double m[3]);

/* An image of unit noise that is convolved with a Gaussian PSF. */
typedef struct bst_star_path_image {
    const float *values; /* [height][width], of unit noise after the convolution */
    int width, height;
} bst_star_path_image;

/* Value of an image at a place, bilinear; 0 outside. */
double bst_star_path_image_at(const bst_star_path_image *image, double x_px, double y_px);

/* Makes the path of a connected source.
 *
 * Its centre line is a polynomial along the longer principal axis; the path ends where the light
 * falls to half of that nearby. A path that turns by more than about 90 degrees does not fit.
 *
 * Given:     path           centre and tangent_per_px set
 *            pixels, count  indices of the source's pixels in the image
 * Returned:  *path          the rest
 *            x_px, y_px     place of the source's middle
 *            false: the source is longer than the room */
bool bst_star_path_fit(bst_star_path *path, const bst_star_path_image *image, const int *pixels,
                       int count, double *x_px, double *y_px);

/* Makes the path of a point. */
void bst_star_path_point(bst_star_path *path);

/* Place of a star's image at a time of the exposure. */
typedef struct bst_star_path_node {
    double time; /* any unit, ascending */
    double x_px, y_px;
} bst_star_path_node;

/* Makes the path of a known motion. Its origin is the mean place over the exposure, and its light
 * the time that the star spends along it.
 *
 * Given:     path          centre and tangent_per_px set
 *            nodes, count  of a star at the frame's middle, at least 2; straight between them
 * Returned:  *path         the rest
 *            false: no time passes, or the path has less than two samples or more than the room */
bool bst_star_path_of_motion(bst_star_path *path, const bst_star_path_node *nodes, int count);

/* A star on the image. */
typedef struct bst_star_path_star {
    double x_px, y_px;
    double amplitude; /* of the image's values along its streak */
} bst_star_path_star;

/* Measures centre line and light of the path on the median of several stars, and its ends by the
 * likelihood of all of them together.
 *
 * Returned:  path->margin  logarithm of the likelihood of each end over that of the best one more
 *                          than 8 px away */
void bst_star_path_refine(bst_star_path *path, const bst_star_path_image *image,
                          const bst_star_path_star *stars, int count);

/* Most stars that vote. */
enum { BST_STAR_PATH_VOTERS = 64 };

/* Asks stars that are surely right whether their light ends where the path does.
 *
 * Each star has one vote of at most ln 4, however bright it is: another's light may lie along its
 * streak. The path is continued along a parabola through it, and a little to both sides.
 *
 * Returned:  votes  for each end the greatest logarithm of the likelihood of one more than 8 px
 *                   away, up to half the path, over that of this one; -HUGE_VAL: none is far enough, as of
 *                   a path of fewer than ten samples */
void bst_star_path_vote(const bst_star_path *path, const bst_star_path_image *image,
                        const bst_star_path_star *stars, int count, double votes[2]);

/* Moves the ends of a path to where the stars vote for: see bst_star_path_vote. The path's origin
 * is then its middle, and its ends have no margin.
 *
 * Returned:  false: they vote for its ends, or it would become too short or too long */
bool bst_star_path_move_ends(bst_star_path *path, const bst_star_path_image *image,
                             const bst_star_path_star *stars, int count);

#endif
