/* Parts of a point spread function: tables of optical transfer functions. */
#ifndef BST_OPTICS_PSF_INTERNAL_H
#define BST_OPTICS_PSF_INTERNAL_H

#include <stdatomic.h>

#include "sim/optics/psf.h"

/* A real, circular OTF: values at f = limit (i / (BST_RADIAL_NODES - 1))^2, which follow a power of
 * the frequency at 0, as that of every PSF with wings has it. */
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
/* Value at f >= 0: cubic between nodes. */
double bst_optics_radial_at(const bst_optics_radial_otf *table, double f);

/* A complex OTF (or a part of one) with the symmetry of a real image, on the half-plane of a square
 * grid: rows fy = -reach .. reach, columns fx = 0 .. reach, in steps of `step` cycles/px. */
typedef struct bst_optics_grid_otf {
    double step; /* 0: no table, nothing to add */
    int reach;   /* nodes to either side of 0 */
    int stride;  /* complex numbers per row */
    float *node; /* complex pairs; BST_GRID_MARGIN more on each side than reach says */
} bst_optics_grid_otf;

/* What the interpolation reaches over. */
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
/* The node (column kx >= -BST_GRID_MARGIN, row ky) as {real, imaginary}. */
static inline float *bst_optics_grid_otf_node(const bst_optics_grid_otf *t, int kx, int ky) {
    return t->node + 2 * ((size_t)(ky + t->reach + BST_GRID_MARGIN) * (size_t)t->stride +
                          (size_t)(kx + BST_GRID_MARGIN));
}
/* Fills the columns left of fx = 0 from the symmetry, once all others are set. */
void bst_optics_grid_otf_mirror(bst_optics_grid_otf *table);
/* Adds the value at (fx, fy): sextic (six-point Lagrange) along both axes; nothing beyond. */
void bst_optics_grid_otf_add(const bst_optics_grid_otf *table, double fx, double fy, double out[2]);

/* Gaussians that a node's squared OTF is the sum of. */
enum { BST_PSF_GAUSSIANS = 8 };

/* One node of the field grid. */
typedef struct bst_psf_node {
    /* squared OTF: sum of weight exp(-4 pi^2 variance f^2), of PSFs that are no Gaussians */
    double gaussian_px2[BST_PSF_GAUSSIANS], gaussian_weight[BST_PSF_GAUSSIANS];
    double equivalent_fwhm_px;
    double centroid_px[2];               /* of a point's image, from its place */
    double sigma_px;                     /* Gaussian part: the profile itself, or 0 */
    const bst_optics_radial_otf *radial; /* NULL: none; lent by the PSF */
    bst_optics_radial_otf own_radial;    /* where nodes differ in it */
    bst_optics_grid_otf grid;
} bst_psf_node;

/* Wavelengths of a band's average at most. */
enum { BST_PSF_WAVELENGTHS = 64 };
/* The average as a sum: the integral of f is that of weight * f(wavelength). */
typedef struct bst_psf_rule {
    int count;
    double wavelength_m[BST_PSF_WAVELENGTHS], weight[BST_PSF_WAVELENGTHS];
    double response[BST_PSF_WAVELENGTHS]; /* of the band */
    bool thermal;
} bst_psf_rule;

/* Shares of the spectra by temperature, and the error of mixing for an obstruction of diameter
 * `inner`. q: wavelength times focal ratio over pixel pitch at each wavelength. */
typedef struct bst_psf_colours bst_psf_colours;
bst_status bst_psf_colours_create(bst_ctx *ctx, const bst_psf_rule *rule, const double *q,
                                  double inner,
                                  bst_psf_colours **out) BST_MUST_CHECK; /* free() it */
/* Temperature of the black body of a spectrum. */
double bst_psf_anchor_k(bool thermal, int spectrum);

struct bst_psf {
    atomic_int owners;
    int32_t model;
    int columns, rows, spectra;
    double fwhm_px; /* the camera's */
    double width_px, height_px;
    double diffusion_px, fill[2];
    double cutoff, reach_px;
    bst_psf *base; /* NULL, or the PSF that lends its tables to this wider one */
    bst_optics_radial_otf shared[BST_PSF_SPECTRA]; /* diffraction: unaberrated annulus, the same at
                                               all nodes of a spectrum */
    bst_psf_colours *colours;                      /* NULL: one spectrum */
    bst_psf_node *nodes;                           /* [spectra][rows][columns] */
};

static inline int bst_psf_node_count(const bst_psf *psf) {
    return psf->columns * psf->rows * psf->spectra;
}

/* What fills psf->nodes and psf->cutoff for the models that need more than a formula. */
bst_status bst_psf_make_diffraction(bst_ctx *ctx, const bst_camera *camera,
                                    const bst_psf_spectrum *spectrum, bst_psf *psf) BST_MUST_CHECK;

/* Makes a PSF from samples, one plane per node of the field grid.
 *
 * Given:     samples  NULL: an error, as optics/psf_file needs them
 * Errors:    BST_ERR_CONFIG for sizes or planes that do not fit, BST_ERR_MEMORY */
bst_status bst_psf_make_sampled(bst_ctx *ctx, const bst_camera *camera,
                                const bst_psf_samples *samples, bst_psf *psf) BST_MUST_CHECK;

/* Sets the Gaussians of a node. */
void bst_psf_fit_gaussians(const bst_psf *psf, int node, bst_psf_node *out);

/* OTF of the profile (1 + (r / alpha)^2)^-beta at f >= 0. */
double bst_optics_moffat_otf(double alpha_px, double beta, double f);
/* OTF of a circular aperture of diameter 1 with a concentric obstruction of diameter `inner` at a
 * shift s of pupils, in diameters (O'Neill 1956, J. Opt. Soc. Am. 46, 285). */
double bst_optics_annulus_otf(double inner, double s);

#endif
