/* Convex outline of an extended target, and its measures. */
#ifndef BST_IMGPROC_EXTENDED_OUTLINE_H
#define BST_IMGPROC_EXTENDED_OUTLINE_H

/* A point of the image, px. */
typedef struct bst_outline_point {
    double x_px, y_px;
} bst_outline_point;

/* Corners of an outline, at most. */
enum { BST_OUTLINE_CORNERS = 128 };

/* Convex outline: corners in the order of rising angle from +x towards +y. */
typedef struct bst_outline {
    bst_outline_point corner[BST_OUTLINE_CORNERS];
    int count;
} bst_outline;

/* Makes the convex hull of points.
 *
 * Given:     points  [count]; sorted in place
 * Returned:  *out  at most BST_OUTLINE_CORNERS corners; of more, those are left out that change
 *                  the area least
 *            hull  [2 * count], work space
 * Reference: Andrew, Inf. Proc. Lett. 9, 216 (1979) */
void bst_outline_make(bst_outline_point *points, int count, bst_outline_point *hull,
                      bst_outline *out);

/* Area, px^2, and centroid of an outline; an outline without area has its mean corner as centroid.
 */
double bst_outline_centroid(const bst_outline *outline, double *x_px, double *y_px);

/* Bounding box of an outline, px; an outline without corners has none: infinities. */
void bst_outline_bounds(const bst_outline *outline, double *x0_px, double *y0_px, double *x1_px,
                        double *y1_px);

/* Largest and smallest extent of an outline.
 *
 * Returned:  *length_px  largest distance of two corners (diameter of the outline)
 *            *angle_rad  direction of that distance, from +x towards +y
 *            *width_px   smallest distance of two parallel lines that enclose the outline */
void bst_outline_extent(const bst_outline *outline, double *length_px, double *angle_rad,
                        double *width_px);

/* Where the centre of a body that looks the same from both sides is imaged, from perspective.
 *
 * Given:     angle_rad  angle that the outline's largest extent spans
 * Returned:  *x_px, *y_px  the outline's centroid if there is no perspective (angle 0)
 * Notes:     opposite corners of a body that is symmetric about its centre lie on a line through
 *            that centre, and so do their images at any range, whereas the centroid moves towards
 *            the nearer half: by size * angle * tan(tilt) / 4 for a rod. The place is where the
 *            lines through opposite points of support meet, each weighted with the range of
 *            directions in which the two support the outline and less the farther it misses the
 *            place; the centroid has a standard deviation of half of size * angle. A target without
 *            symmetry moves by no more than some of these. */
void bst_outline_centre(const bst_outline *outline, double angle_rad, double *x_px, double *y_px);

/* Extent of an outline along a direction, px.
 *
 * Given:     x, y  the direction, of length 1 */
double bst_outline_extent_along(const bst_outline *outline, double x, double y);

#endif
