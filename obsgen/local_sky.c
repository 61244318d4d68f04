#include "obsgen/local_sky.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/vec.h"

/* As image processing clips pixels, and when opposite neighbours agree with a mesh, standard
 * errors. */
static const double CLIP_SIGMA = 3.0, AGREEMENT = 4.0 * 1.2247449;

enum { PER_SNR = 4 };

static void tabulate(bst_local_sky *sky, double sigma_px) {
    for (int i = 0; i < BST_LOCAL_SKY_HEIGHTS; i++) {
        double height = (double)i / PER_SNR, peak = height / (sigma_px * sqrt(2.0 * BST_PI));
        double flank = -log(fmin(CLIP_SIGMA / fmax(peak, 1e-9), 1.0));
        sky->light[i] = (float)(height * erfc(sqrt(flank)));
        sky->square[i] = (float)(height * peak * sqrt(0.5) * erfc(sqrt(2.0 * flank)));
    }
    sky->sigma = sigma_px;
}

bst_status bst_local_sky_begin(bst_ctx *ctx, bst_local_sky *sky, int width, int height, int mesh_px,
                               double sigma_px) {
    int half = mesh_px / 2, columns = (width + half) / mesh_px, rows = (height + half) / mesh_px;
    columns = columns > 0 ? columns : 1;
    rows = rows > 0 ? rows : 1;
    if (columns * rows > sky->room) {
        float *more = realloc(sky->level, 3 * (size_t)(columns * rows) * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d meshes", columns * rows);
        }
        sky->level = more;
        sky->room = columns * rows;
    }
    sky->noise = sky->level + columns * rows;
    sky->scratch = sky->noise + columns * rows;
    sky->mesh = mesh_px;
    sky->columns = columns;
    sky->rows = rows;
    sky->width = width;
    sky->height = height;
    memset(sky->level, 0, 2 * (size_t)(columns * rows) * sizeof *sky->level);
    if (sky->sigma != sigma_px) {
        tabulate(sky, sigma_px);
    }
    return BST_OK;
}

void bst_local_sky_free(bst_local_sky *sky) {
    free(sky->level);
    *sky = (bst_local_sky){0};
}

static int mesh_of(int at, int mesh, int count) {
    int i = at / mesh;
    return i < count ? i : count - 1;
}

void bst_local_sky_add(bst_local_sky *sky, int x, int y, double height, double length_px) {
    int k = mesh_of(y, sky->mesh, sky->rows) * sky->columns + mesh_of(x, sky->mesh, sky->columns);
    double at = fmin(PER_SNR * height, BST_LOCAL_SKY_HEIGHTS - 1.001);
    int i = (int)at;
    float part = (float)(at - i), length = (float)length_px;
    sky->level[k] += length * (sky->light[i] + part * (sky->light[i + 1] - sky->light[i]));
    sky->noise[k] += length * (sky->square[i] + part * (sky->square[i + 1] - sky->square[i]));
}

static int side_of(int i, int mesh, int count, int pixels) {
    return i + 1 < count ? mesh : pixels - i * mesh;
}

/* Means with the pairs of opposite neighbours whose mean is that of the mesh. */
static void average(const bst_local_sky *sky, float *values, double error) {
    static const int across[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    memcpy(sky->scratch, values, (size_t)(sky->columns * sky->rows) * sizeof *values);
    for (int j = 0; j < sky->rows; j++) {
        for (int i = 0; i < sky->columns; i++) {
            const float *own = sky->scratch + j * sky->columns + i;
            float sum = *own, weight = 1.0f;
            for (int d = 0; d < 4; d++) {
                int u = across[d][0], v = across[d][1];
                if (i - u < 0 || i + u >= sky->columns || j - abs(v) < 0 ||
                    j + abs(v) >= sky->rows) {
                    continue;
                }
                float pair = own[v * sky->columns + u] + own[-v * sky->columns - u];
                if (fabs((double)(0.5f * pair - *own)) < AGREEMENT * error) {
                    sum += pair;
                    weight += 2.0f;
                }
            }
            values[j * sky->columns + i] = sum / weight;
        }
    }
}

void bst_local_sky_settle(bst_local_sky *sky, double share, double crowding) {
    for (int j = 0; j < sky->rows; j++) {
        for (int i = 0; i < sky->columns; i++) {
            int k = j * sky->columns + i;
            double pixels = (double)side_of(i, sky->mesh, sky->columns, sky->width) *
                            side_of(j, sky->mesh, sky->rows, sky->height);
            sky->level[k] = (float)(share * (double)sky->level[k] / pixels);
            sky->noise[k] = (float)sqrt(1.0 + crowding * (double)sky->noise[k] / pixels);
        }
    }
    /* of a mean; that of a standard deviation is less */
    double error = 1.0 / sky->mesh;
    average(sky, sky->level, error);
    average(sky, sky->noise, error * sqrt(0.5));
}

static int between(double at, int mesh, int count, double *part) {
    double u = fmin(fmax((at + 0.5) / mesh - 0.5, 0.0), count - 1.0);
    int i = (int)u;
    i = i < count - 1 ? i : count > 1 ? count - 2 : 0;
    *part = count > 1 ? u - i : 0.0;
    return i;
}

static double mixed(const float *at, int right, int below, double x, double y) {
    double top = (double)at[0] + x * (double)(at[right] - at[0]);
    double bottom = (double)at[below] + x * (double)(at[below + right] - at[below]);
    return top + y * (bottom - top);
}

void bst_local_sky_at(const bst_local_sky *sky, double x, double y, double *level, double *noise) {
    double u, v;
    int k = between(y, sky->mesh, sky->rows, &v) * sky->columns;
    k += between(x, sky->mesh, sky->columns, &u);
    int right = sky->columns > 1, below = sky->rows > 1 ? sky->columns : 0;
    *level = mixed(sky->level + k, right, below, u, v);
    *noise = mixed(sky->noise + k, right, below, u, v);
}
