#include "imgproc/detect/psf_wings.h"

#include <math.h>
#include <stdlib.h>

#include "sim/optics/psf_image.h"

enum { REACH = BST_WINGS_REACH_PX, SIDE = 2 * REACH + 1, STARS = 64, MOST_NODES = 64 };

/* Within this distance of a star its light is part of the fit; the wings begin here. */
static const double NEAR_PX = 8.0;
/* Safety factor on the wings' light, for errors of star magnitude and PSF. */
static const double DOUBT = 1.5;
/* A detection this near to a star, with at least this share of its flux, is the star itself. */
static const double OWN_PX = 4.0, OWN_SHARE = 0.2;
/* Share of a detection's flux below which wing light is negligible. */
static const double MATTERS = 0.25;

typedef struct bright {
    double x_px, y_px, flux_e;
} bright;

struct bst_psf_wings {
    float *peak;      /* [SIDE][SIDE]: largest share of light within one pixel of each offset */
    double near_peak; /* largest value of it beyond NEAR_PX */
    double area_px2;  /* noise-equivalent area, 1 / sum p^2 */
    double dx_px, dy_px;
    bright stars[STARS];
    int count;
};

/* Sets w->peak: the local maximum of the PSF within one pixel of each offset. */
static void set_local_peaks(const double *image, bst_psf_wings *w) {
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double most = 0.0;
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < SIDE; v++) {
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < SIDE; u++) {
                    most = fmax(most, image[v * SIDE + u]);
                }
            }
            w->peak[y * SIDE + x] = (float)most;
            if (hypot(x - REACH, y - REACH) >= NEAR_PX) {
                w->near_peak = fmax(w->near_peak, most);
            }
        }
    }
}

/* Renders the field-averaged PSF and its wings. */
static bst_status render_wings(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                               double blur_px, bst_psf_wings *w) {
    size_t count = (size_t)SIDE * SIDE;
    double *one = malloc(2 * count * sizeof *one), *mean = one ? one + count : NULL, square = 0.0;
    w->peak = malloc(count * sizeof *w->peak);
    if (!one || !w->peak) {
        free(one);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the wings of stars");
    }
    int node[4];
    double weight[4];
    int nodes = bst_psf_weights(psf, 0.5 * (width_px - 1.0), 0.5 * (height_px - 1.0), node, weight);
    bst_status status = BST_OK;
    for (size_t i = 0; i < count; i++) {
        mean[i] = 0.0;
    }
    for (int n = 0; n < nodes && status == BST_OK; n++) {
        status = bst_psf_image(ctx, psf, node[n], blur_px, 1, REACH, one);
        for (size_t i = 0; i < count && status == BST_OK; i++) {
            mean[i] += weight[n] * one[i];
        }
    }
    for (size_t i = 0; i < count && status == BST_OK; i++) {
        square += mean[i] * mean[i];
    }
    if (status == BST_OK) {
        w->area_px2 = 1.0 / square;
        set_local_peaks(mean, w);
    }
    free(one);
    return status;
}

bst_status bst_psf_wings_create(bst_ctx *ctx, const bst_psf *psf, double width_px, double height_px,
                                double blur_px, bst_psf_wings **out) {
    *out = NULL;
    bst_psf_wings *w = calloc(1, sizeof *w);
    if (!w) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the wings of stars");
    }
    bst_status status = render_wings(ctx, psf, width_px, height_px, blur_px, w);
    if (status != BST_OK) {
        bst_psf_wings_free(w);
        return status;
    }
    *out = w;
    return BST_OK;
}

void bst_psf_wings_free(bst_psf_wings *w) {
    if (w) {
        free(w->peak);
        free(w);
    }
}

double bst_psf_wings_bright_e(const bst_psf_wings *w, double noise_e, double threshold_snr) {
    return MATTERS * threshold_snr * noise_e / (w->near_peak * sqrt(w->area_px2));
}

void bst_psf_wings_begin(bst_psf_wings *w, double dx_px, double dy_px) {
    w->count = 0;
    w->dx_px = dx_px;
    w->dy_px = dy_px;
}

void bst_psf_wings_add(bst_psf_wings *w, double x_px, double y_px, double flux_e) {
    if (w->count < STARS) {
        w->stars[w->count++] = (bright){x_px, y_px, flux_e};
    }
}

bool bst_psf_wings_holds(const bst_psf_wings *w, double x_px, double y_px, double radius_px) {
    for (int i = 0; i < w->count; i++) {
        if (hypot(w->stars[i].x_px - x_px, w->stars[i].y_px - y_px) <= radius_px) {
            return true;
        }
    }
    return false;
}

/* True if a detection is one of the bright stars itself. */
static bool is_star(const bst_psf_wings *w, const bst_detection *d) {
    for (int i = 0; i < w->count; i++) {
        const bright *s = &w->stars[i];
        if (hypot(s->x_px - d->x_px, s->y_px - d->y_px) < OWN_PX &&
            d->flux_e > OWN_SHARE * s->flux_e) {
            return true;
        }
    }
    return false;
}

/* Light of the bright stars' wings in a sensor pixel, e-. */
static double wing_light_at(const bst_psf_wings *w, double x_px, double y_px) {
    double length = hypot(w->dx_px, w->dy_px), sum = 0.0;
    int nodes = 1 + (int)fmin(length, MOST_NODES - 1);
    for (int i = 0; i < w->count; i++) {
        const bright *s = &w->stars[i];
        for (int k = 0; k < nodes; k++) {
            double u = (k + 0.5) / nodes - 0.5;
            double x = x_px - s->x_px - u * w->dx_px, y = y_px - s->y_px - u * w->dy_px;
            if (fabs(x) < REACH && fabs(y) < REACH) {
                int at = ((int)lround(y) + REACH) * SIDE + (int)lround(x) + REACH;
                sum += s->flux_e / nodes * (double)w->peak[at];
            }
        }
    }
    return sum;
}

void bst_psf_wings_label(const bst_psf_wings *w, bst_psf_wings_ground_fn ground, const void *user,
                         int binning, bst_detections *detections) {
    double noise_e = detections->noise_e, threshold = detections->threshold_snr;
    for (int i = 0; i < detections->count && w->count > 0; i++) {
        bst_detection *d = &detections->items[i];
        double light = d->label == BST_LABEL_UNKNOWN && d->snr > 0.0 && noise_e > 0.0
                           ? binning * binning * wing_light_at(w, d->x_px, d->y_px)
                           : 0.0;
        if (!(light > 0.0) || is_star(w, d)) {
            continue;
        }
        bst_psf_wings_ground here;
        ground(user, d->x_px, d->y_px, &here);
        double area = pow(d->flux_e / (d->snr * here.noise_e), 2.0);
        double noise2 = fmin(here.noise_e, noise_e) * fmin(here.noise_e, noise_e);
        double above = fmax(light - fmax(here.level_e - detections->background_e, 0.0), 0.0);
        double own = DOUBT * area * above, noise = sqrt(area * (noise2 + light));
        double more = threshold * (noise - sqrt(area * noise2));
        if (own + more > MATTERS * d->flux_e && d->flux_e - own < threshold * noise) {
            d->label = BST_LABEL_ARTEFACT;
            d->label_probability = 0.9;
        }
    }
}
