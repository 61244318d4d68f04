#include "obsgen/model/psf_bound.h"

#include <math.h>
#include <stdlib.h>

#include "boresight/vec.h"

/* Sampling grid of images, read-out px: step, margin beyond a streak's ends, longest sampled
 * streak. */
static const double STEP_PX = 1.0 / 3.0, MARGIN_PX = 11.0, LONGEST_PX = 40.0;
/* Frequency, cycles per sensor pixel, beyond which no pixel-integrated OTF is significant. */
static const double MOST_FREQUENCY = 3.0;
static const double FIRST_RATIO = -1.0, PER_DECADE = 4.0; /* as in crlb_table.c */

/* Streak image and its gradient on the grid, share per pixel. */
typedef struct sampled_image {
    int width, height;
    float *value, *by_x, *by_y;
} sampled_image;

/* Partial sums of the OTF along y, and the image. */
typedef struct work_space {
    double *column[2]; /* [frequencies of x][height], real and imaginary; of the image */
    double *slope[2];  /* of its derivative by y */
    float *planes;
} work_space;

static void free_space(work_space *w) {
    for (int k = 0; k < 2; k++) {
        free(w->column[k]);
        free(w->slope[k]);
    }
    free(w->planes);
}

/* Fourier sum of the OTF over the frequencies of y at one frequency of x. */
static void sum_column(const bst_response_side *side, const bst_response_nodes *nodes, int binning,
                       double fx, double smear, double df_y, int count_y, int height,
                       double *const column[2], double *const slope[2]) {
    for (int j = 0; j < height; j++) {
        column[0][j] = column[1][j] = slope[0][j] = slope[1][j] = 0.0;
    }
    for (int n = -count_y; n <= count_y; n++) {
        double fy = n * df_y, otf[2];
        bst_response_otf(side, nodes, binning, fx / binning, fy / binning, otf);
        double re = otf[0] * smear * df_y, im = otf[1] * smear * df_y;
        double angle = 2.0 * BST_PI * fy * STEP_PX, turn_c = cos(angle), turn_s = sin(angle);
        double c = cos(-angle * (height / 2)), s = sin(-angle * (height / 2));
        double omega = 2.0 * BST_PI * fy;
        for (int j = 0; j < height; j++) {
            double a = re * c - im * s, b = re * s + im * c, next = c * turn_c - s * turn_s;
            column[0][j] += a;
            column[1][j] += b;
            slope[0][j] -= omega * b;
            slope[1][j] += omega * a;
            s = s * turn_c + c * turn_s;
            c = next;
        }
    }
}

/* Renders a streak along x by Fourier sums. */
static bst_status render_streak(bst_ctx *ctx, const bst_response_side *side,
                                const bst_response_nodes *nodes, int binning, double length,
                                sampled_image *out, work_space *w) {
    double limit = fmin(bst_response_cutoff(side), MOST_FREQUENCY) * binning;
    out->width = (int)ceil((length + 2.0 * MARGIN_PX) / STEP_PX);
    out->height = (int)ceil(2.0 * MARGIN_PX / STEP_PX);
    double df_x = 1.0 / (out->width * STEP_PX), df_y = 1.0 / (out->height * STEP_PX);
    int count_x = (int)ceil(limit / df_x), count_y = (int)ceil(limit / df_y);
    size_t pixels = (size_t)out->width * (size_t)out->height;
    size_t column = (size_t)out->height;
    *w = (work_space){.planes = calloc(3 * pixels, sizeof *w->planes)};
    for (int k = 0; k < 2; k++) {
        w->column[k] = malloc(column * sizeof *w->column[k]);
        w->slope[k] = malloc(column * sizeof *w->slope[k]);
        if (!w->planes || !w->column[k] || !w->slope[k]) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the image of a PSF");
        }
    }
    out->value = w->planes;
    out->by_x = w->planes + pixels;
    out->by_y = w->planes + 2 * pixels;
    for (int m = 0; m <= count_x; m++) { /* half plane: the image is real */
        double fx = m * df_x, drawn = BST_PI * fx * length;
        double smear = fabs(drawn) < 1e-9 ? 1.0 : sin(drawn) / drawn;
        sum_column(side, nodes, binning, fx, smear, df_y, count_y, out->height, w->column,
                   w->slope);
        double both = (m == 0 ? 1.0 : 2.0) * df_x, omega = 2.0 * BST_PI * fx;
        for (int i = 0; i < out->width; i++) {
            double angle = omega * (i - out->width / 2) * STEP_PX;
            double c = both * cos(angle), s = both * sin(angle);
            for (int j = 0; j < out->height; j++) {
                size_t at = (size_t)j * (size_t)out->width + (size_t)i;
                out->value[at] += (float)(w->column[0][j] * c - w->column[1][j] * s);
                out->by_x[at] -= (float)(omega * (w->column[0][j] * s + w->column[1][j] * c));
                out->by_y[at] += (float)(w->slope[0][j] * c - w->slope[1][j] * s);
            }
        }
    }
    return BST_OK;
}

/* Fisher information of the image for all flux-to-noise ratios: along, across, flux. */
static void add_information(const sampled_image *image, double share,
                            double sums[BST_BOUND_RATIOS][3], double *squared) {
    size_t pixels = (size_t)image->width * (size_t)image->height;
    double area = STEP_PX * STEP_PX;
    *squared = 0.0;
    for (size_t i = 0; i < pixels; i++) {
        *squared += area * (double)(image->value[i] * image->value[i]);
    }
    for (int r = 0; r < BST_BOUND_RATIOS; r++) {
        float ratio = (float)(share * pow(10.0, FIRST_RATIO + r / PER_DECADE));
        double x = 0.0, y = 0.0, flux = 0.0;
        for (size_t i = 0; i < pixels; i++) {
            float p = fmaxf(image->value[i], 0.0f), w = 1.0f / (1.0f + ratio * p);
            x += (double)(w * image->by_x[i] * image->by_x[i]);
            y += (double)(w * image->by_y[i] * image->by_y[i]);
            flux += (double)(w * p * p);
        }
        sums[r][0] = x * area;
        sums[r][1] = y * area;
        sums[r][2] = flux * area;
    }
}

bst_status bst_psf_bound_init(bst_ctx *ctx, const bst_response_side *side, int binning, double x_px,
                              double y_px, double sigma_px, bst_crlb_table *out) {
    bst_response_nodes nodes;
    bst_response_nodes_at(side, x_px, y_px, &nodes);
    /* as in imgproc/detect/detect.c */
    out->sigma_px = fmax(sigma_px, 0.2);
    for (int n = 0; n < BST_BOUND_LENGTHS; n++) {
        double length = n == 0 ? 0.0 : ldexp(out->sigma_px, n - 1);
        /* a longer streak is cut in the middle, as in crlb_table.c */
        double shown = fmin(length, LONGEST_PX), share = length > 0.0 ? shown / length : 1.0;
        double sums[BST_BOUND_RATIOS][3], squared;
        sampled_image image = {.width = 0};
        work_space space;
        bst_status status = render_streak(ctx, side, &nodes, binning, shown, &image, &space);
        if (status == BST_OK) {
            add_information(&image, share, sums, &squared);
        }
        free_space(&space);
        BST_TRY(status);
        for (int r = 0; r < BST_BOUND_RATIOS; r++) {
            out->along[n][r] = (float)log(sums[r][0] * share * share);
            out->across[n][r] = (float)log(sums[r][1] * share);
            out->flux[n][r] = (float)log(sums[r][2] * share);
        }
        out->squared[n] = (float)log(squared * share);
    }
    return BST_OK;
}
