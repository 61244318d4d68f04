/* The telescope aperture on a grid and the autocorrelation of its field: the OTF at one
 * wavelength. */
#ifndef BST_OPTICS_PUPIL_H
#define BST_OPTICS_PUPIL_H

#include "boresight/status.h"
#include "sim/optics/zernike.h"

/* An aperture of diameter 1. */
typedef struct bst_pupil {
    double inner; /* diameter of the central obstruction */
    int vanes;    /* from rim to centre, evenly spaced */
    double vane_width;
    double vane_rad;                  /* direction of the first */
    bst_zernike_polynomial wavefront; /* m, over the unit disc */
} bst_pupil;

typedef struct bst_pupil_work bst_pupil_work;

/* Creates work space for apertures of at most `cells` grid cells across; single precision. */
bst_status bst_pupil_work_create(bst_ctx *ctx, int cells, bst_pupil_work **out) BST_MUST_CHECK;
/* Frees a work space with its FFT plans; NULL is allowed. */
void bst_pupil_work_free(bst_pupil_work *work);

/* Open fraction of each cell of size `cell` (in diameters), [side][side], centred on cell [side /
 * 2][side / 2]. Exact along rows, 16 lines per cell across. */
void bst_pupil_mask(const bst_pupil *pupil, double cell, int side, double *open);

/* An autocorrelation by shifts: rows of `stride` complex pairs; shift (kx, ky) with kx >= 0 is at
 * row (ky modulo side), column kx. */
typedef struct bst_pupil_shifts {
    const float *rows;
    int stride, side;
} bst_pupil_shifts;

/* Autocorrelation of exp(2 pi i wavefront / wavelength) over the aperture, normalised by its area;
 * *out is valid until the next call. Conjugated: a wavefront that increases towards +x moves light
 * to +x. wavelength_m 0: no aberration. BST_ERR_MEMORY. */
bst_status bst_pupil_transfer(bst_ctx *ctx, bst_pupil_work *work, const bst_pupil *pupil,
                              double cell, double wavelength_m,
                              bst_pupil_shifts *out) BST_MUST_CHECK;

/* Largest slope of the wavefront over the aperture, m per diameter. */
double bst_pupil_slope_m(const bst_pupil *pupil);

#endif
