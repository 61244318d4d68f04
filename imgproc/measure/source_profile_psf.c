/* Source images with the non-Gaussian PSF known on board. */
#include <math.h>
#include <string.h>

#include "imgproc/measure/source_profile_internal.h"

/* Resamples one profile about a centre that is `phase` table steps past -1/2 px. */
static void resample_profile(const bst_source_profiles *p, const double *samples, int phase,
                             float *row) {
    const bst_known_psf *k = p->known;
    int b = p->binning;
    double centre = (double)phase / BST_PROFILE_PHASES - 0.5 + p->half;
    memset(row, 0, PARTS * (size_t)p->pitch * sizeof *row);
    for (int i = 0; i < p->length; i++) {
        double v[PARTS] = {0.0};
        for (int sub = 0; sub < b; sub++) {
            bst_known_psf_taps taps;
            double d = b * (i - centre) + sub - 0.5 * (b - 1);
            int first = bst_known_psf_taps_at(k, d, taps);
            for (int part = 0; first >= 0 && part < PARTS; part++) {
                for (int q = 0; q < BST_KNOWN_PSF_POINTS; q++) {
                    v[part] += taps[part][q] * samples[first + q];
                }
            }
        }
        /* derivative by the centre, which has the opposite sign of that by the distance */
        row[i] = (float)v[0];
        row[p->pitch + i] = (float)(-b * v[1]);
        row[2 * p->pitch + i] = (float)(0.5 * b * b * v[2]);
    }
}

void bst_source_profiles_set_known(bst_source_profiles *p) {
    const bst_known_psf *k = p->known;
    if (p->made_binning == p->binning) {
        return;
    }
    p->made_binning = p->binning;
    int half = (k->reach_px + p->binning - 1) / p->binning;
    half = half < BST_LANES / 2 - 1 ? BST_LANES / 2 - 1 : half;
    p->length = bst_simd_layout_round_up(2 * half + 1);
    p->length = p->length < BST_PROFILE_LENGTH ? p->length : BST_PROFILE_LENGTH;
    p->half = (p->length - 1) / 2;
    p->pitch = p->length + BST_LANES;
    p->reach = p->half;
    size_t row = (size_t)PARTS * (size_t)p->pitch;
    int each = k->nodes * k->terms;
    for (int phase = 0; phase <= BST_PROFILE_PHASES; phase++) {
        for (int f = 0; f < each; f++) {
            resample_profile(p, k->across + (size_t)f * (size_t)k->side, phase,
                             p->rows + BST_LANES + (size_t)(phase * each + f) * row);
        }
        for (int t = 0; t < k->terms; t++) {
            resample_profile(p, k->down + (size_t)t * (size_t)k->side, phase,
                             p->down + BST_LANES + (size_t)(phase * k->terms + t) * row);
        }
    }
}

/* Field nodes of the PSF, with weights, at a source's position. */
typedef struct mix {
    int count, node[4];
    float weight[4];
} mix;

#define BST_SIMD_KERNELS "imgproc/measure/source_profile_psf_kernels.inc"
#include "sim/core/simd_each.inc"

void bst_source_profile_render_known(const bst_source_profiles *t, const bst_imgproc_gauss *psf,
                                     const bst_imgproc_shape *shape, const bst_imgproc_stamp *stamp,
                                     const double *along, float *scratch, float *planes) {
    BST_SIMD_PICK(render)(t, psf, shape, stamp, along, scratch, planes);
}
