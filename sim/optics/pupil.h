/* The aperture of a telescope on a grid, and the autocorrelation of its field: the optical transfer
 * function of one wavelength. */
#ifndef BST_OPTICS_PUPIL_H
#define BST_OPTICS_PUPIL_H

#include "boresight/status.h"
#include "sim/optics/zernike.h"

/* An aperture of diameter 1. */
typedef struct bst_pupil {
    double inner; /* diameter of the central obstruction */
    int vanes;    /* from the rim to the centre, evenly spread */
    double vane_width;
    double vane_rad;                  /* direction of the first */
    bst_zernike_polynomial wavefront; /* m, over the unit disc */
} bst_pupil;

typedef struct bst_pupil_work bst_pupil_work;

/* Work space for apertures of at most `cells` grid cells across; single precision, as the tables.
 */
bst_status bst_pupil_work_create(bst_ctx *ctx, int cells, bst_pupil_work **out) BST_MUST_CHECK;
/* Frees a work space with its FFT plans; NULL is allowed. */
void bst_pupil_work_free(bst_pupil_work *work);

/* Share of each cell of size `cell` (in diameters) that the aperture leaves open, [side][side] with
 * its centre on the cell [side / 2][side / 2]. Exact along rows, 16 lines per cell across them. */
void bst_pupil_mask(const bst_pupil *pupil, double cell, int side, double *open);

/* An autocorrelation by shifts: rows of `stride` complex pairs; the shift of (kx, ky) cells with
 * kx >= 0 is at row (ky modulo side), column kx. */
typedef struct bst_pupil_shifts {
    const float *rows;
    int stride, side;
} bst_pupil_shifts;

/* The autocorrelation of exp(2 pi i wavefront / wavelength) over the aperture, over the aperture's
 * area: *out is lent until the next call. Conjugated so that it is the transfer
 * function of the image in which a wavefront that grows towards +x moves light to +x.
 * wavelength_m 0: as if there were no aberration. BST_ERR_MEMORY. */
bst_status bst_pupil_transfer(bst_ctx *ctx, bst_pupil_work *work, const bst_pupil *pupil,
                              double cell, double wavelength_m,
                              bst_pupil_shifts *out) BST_MUST_CHECK;

/* Largest slope of the wavefront on the aperture, m per diameter. */
double bst_pupil_slope_m(const bst_pupil *pupil);

#endif
