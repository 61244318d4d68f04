/* Internal types of the PSF: tables of optical transfer functions. */
#ifndef BST_OPTICS_PSF_INTERNAL_H
#define BST_OPTICS_PSF_INTERNAL_H

#include <stdatomic.h>

#include "sim/optics/psf.h"

/* A real, circular OTF: values at f = limit (i / (BST_RADIAL_NODES - 1))^2, dense at 0, where PSF
 * wings cause a power law. */
enum { BST_RADIAL_NODES = 16384 };
typedef struct bst_optics_radial_otf {
    double limit;  /* cycles/px; 0 beyond */
    double *value; /* [BST_RADIAL_NODES] */
} bst_optics_radial_otf;

/* Allocates a table of a radial OTF.
 *
 * Given:     limit  highest frequency of the table
 * Errors:    BST_ERR_MEMORY */
bst_status bst_optics_radial_create(bst_ctx *ctx, double limit,
                                    bst_optics_radial_otf *out) BST_MUST_CHECK;
/* Frequency of node i of a table that ends at `limit`. */
double bst_optics_radial_frequency(double limit, int i);
/* Value of a radial OTF at f >= 0: cubic interpolation. */
double bst_optics_radial_at(const bst_optics_radial_otf *table, double f);

/* A complex OTF (or part of one) with the symmetry of a real image, on the half-plane of a square
 * grid: rows fy = -reach .. reach, columns fx = 0 .. reach, in steps of `step` cycles/px. */
typedef struct bst_optics_grid_otf {
    double step; /* 0: no table */
    int reach;   /* number of nodes on either side of 0 */
    int stride;  /* complex numbers per row */
    float *node; /* complex pairs, with BST_GRID_MARGIN additional nodes on each side */
} bst_optics_grid_otf;

/* margin for interpolation */
enum { BST_GRID_MARGIN = 3 };

/* Allocates a table of an OTF on a half plane of frequencies.
 *
 * Given:     step   spacing of the nodes
 *            reach  nodes on either side of the origin
 * Errors:    BST_ERR_MEMORY
 * Ownership: free with bst_optics_grid_otf_free */
bst_status bst_optics_grid_otf_create(bst_ctx *ctx, double step, int reach,
                                      bst_optics_grid_otf *out) BST_MUST_CHECK;
/* Frees the memory of a table and clears the struct, which belongs to the caller. */
void bst_optics_grid_otf_free(bst_optics_grid_otf *table);
/* Node (column kx >= -BST_GRID_MARGIN, row ky) of an OTF table as {real, imaginary}. */
static inline float *bst_optics_grid_otf_node(const bst_optics_grid_otf *t, int kx, int ky) {
    return t->node + 2 * ((size_t)(ky + t->reach + BST_GRID_MARGIN) * (size_t)t->stride +
                          (size_t)(kx + BST_GRID_MARGIN));
}
/* Fills the columns left of fx = 0 by symmetry, after all others. */
void bst_optics_grid_otf_mirror(bst_optics_grid_otf *table);
/* Adds the value at (fx, fy), by six-point Lagrange interpolation along both axes; nothing beyond
 * the table. */
void bst_optics_grid_otf_add(const bst_optics_grid_otf *table, double fx, double fy, double out[2]);

/* number of Gaussians that approximate a node's squared OTF */
enum { BST_PSF_GAUSSIANS = 8 };

/* One node of the field grid. */
typedef struct bst_psf_node {
    /* squared OTF of a non-Gaussian PSF: sum of weight exp(-4 pi^2 variance f^2) */
    double gaussian_px2[BST_PSF_GAUSSIANS], gaussian_weight[BST_PSF_GAUSSIANS];
    double equivalent_fwhm_px;
    double centroid_px[2];               /* centroid of a point's image relative to its chief ray */
    double sigma_px;                     /* Gaussian part: the whole profile, or 0 */
    const bst_optics_radial_otf *radial; /* NULL: none; borrowed from the PSF */
    bst_optics_radial_otf own_radial;    /* if it differs between nodes */
    bst_optics_grid_otf grid;
} bst_psf_node;

/* maximum number of wavelengths of a band average */
enum { BST_PSF_WAVELENGTHS = 64 };
/* Quadrature over the band: the integral of f is the sum of weight * f(wavelength). */
typedef struct bst_psf_rule {
    int count;
    double wavelength_m[BST_PSF_WAVELENGTHS], weight[BST_PSF_WAVELENGTHS];
    double response[BST_PSF_WAVELENGTHS]; /* of the band */
    bool thermal;
} bst_psf_rule;

/* Fractions of the spectra by temperature, and the mixing error, for an obstruction of diameter
 * `inner`. q: wavelength times focal ratio over pixel pitch. */
typedef struct bst_psf_colours bst_psf_colours;
bst_status bst_psf_colours_create(bst_ctx *ctx, const bst_psf_rule *rule, const double *q,
                                  double inner,
                                  bst_psf_colours **out) BST_MUST_CHECK; /* free() it */
/* Black-body temperature of a spectrum of the PSF. */
double bst_psf_anchor_k(bool thermal, int spectrum);

struct bst_psf {
    atomic_int owners;
    int32_t model;
    int columns, rows, spectra;
    double fwhm_px; /* of the camera */
    double width_px, height_px;
    double diffusion_px, fill[2];
    double cutoff;
    /* light below 1e-9 of the peak: reach of the optics, whose light per pixel decreases with this
     * power of the distance (0: faster than any), and what pixel and diffusion add */
    double reach_px, wing_power, wider_px;
    bst_psf *base; /* NULL, or the PSF whose tables this widened one borrows */
    bst_optics_radial_otf shared[BST_PSF_SPECTRA]; /* diffraction: annulus without aberrations,
                                                      common to all nodes of a spectrum */
    bst_psf_colours *colours;                      /* NULL: one spectrum */
    bst_psf_node *nodes;                           /* [spectra][rows][columns] */
};

static inline int bst_psf_node_count(const bst_psf *psf) {
    return psf->columns * psf->rows * psf->spectra;
}

/* Fill psf->nodes and psf->cutoff for models without closed form. */
bst_status bst_psf_make_diffraction(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_psf_spectrum *spectrum, bst_psf *psf) BST_MUST_CHECK;

/* Makes a PSF from samples, one plane per node of the field grid.
 *
 * Given:     samples  NULL: an error, as optics/psf_file needs them
 * Errors:    BST_ERR_CONFIG for sizes or planes that do not fit, BST_ERR_MEMORY */
bst_status bst_psf_make_sampled(bst_ctx *ctx, const bst_camera *camera,
                                const bst_psf_samples *samples, bst_psf *psf) BST_MUST_CHECK;

/* Fits the Gaussians of a node's squared OTF. */
void bst_psf_fit_gaussians(const bst_psf *psf, int node, bst_psf_node *out);

/* OTF of the Moffat profile (1 + (r / alpha)^2)^-beta at f >= 0. */
double bst_optics_moffat_otf(double alpha_px, double beta, double f);
/* OTF of a circular aperture of diameter 1 with a concentric obstruction of diameter `inner` at a
 * shift s of pupils, in diameters (O'Neill 1956, J. Opt. Soc. Am. 46, 285). */
double bst_optics_annulus_otf(double inner, double s);

#endif
