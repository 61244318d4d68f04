#include "obsgen/model/local_sky.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"

/* Clip level of image processing, and agreement of opposite neighbour meshes in standard errors
 * (imgproc/detect/background.c): 4 of the difference between a mesh and the mean of two, whose
 * variance is 1 + 1/2 of a mesh's. */
static const double CLIP_SIGMA = 3.0, AGREEMENT = 4.0 * 1.2247449;

enum { PER_SNR = 4, PER_NOISE = 16 };

/* Normal density. */
static double density(double z) {
    return exp(-0.5 * z * z) / sqrt(2.0 * BST_PI);
}

/* Moments of order 0 to 2 of normal values about w, of which only those within the clip count. */
static void clipped_moments(double w, double out[3]) {
    double a = -CLIP_SIGMA - w, b = CLIP_SIGMA - w, p = density(a), q = density(b);
    double all = 0.5 * (erf(b / sqrt(2.0)) - erf(a / sqrt(2.0)));
    double first = p - q, second = all + a * p - b * q; /* about w */
    out[0] = all;
    out[1] = w * all + first;
    out[2] = w * w * all + 2.0 * w * first + second;
}

/* Tabulates the influence of a pixel's light. */
static void tabulate_influence(bst_local_sky *sky) {
    const double faint = 0.05; /* for the derivatives */
    double dark[3], dim[3];
    clipped_moments(0.0, dark);
    clipped_moments(faint, dim);
    double mean = dark[2] / dark[0], slope = dim[1] / faint;
    double bend = (dim[2] - mean * dim[0]) / (faint * faint);
    for (int i = 0; i < BST_LOCAL_SKY_LIGHTS; i++) {
        double at[3];
        clipped_moments((double)i / PER_NOISE, at);
        sky->influence[i][0] = (float)(at[1] / slope);
        sky->influence[i][1] = (float)((at[2] - mean * at[0]) / bend);
    }
}

/* Tabulates light and squared light of a line below the clip, by its height. */
static void tabulate(bst_local_sky *sky, double sigma_px) {
    for (int i = 0; i < BST_LOCAL_SKY_HEIGHTS; i++) {
        double height = (double)i / PER_SNR, peak = height / (sigma_px * sqrt(2.0 * BST_PI));
        double flank = -log(fmin(CLIP_SIGMA / fmax(peak, 1e-9), 1.0));
        sky->light[i] = (float)(height * erfc(sqrt(flank)));
        sky->square[i] = (float)(height * peak * sqrt(0.5) * erfc(sqrt(2.0 * flank)));
    }
    sky->sigma = sigma_px;
    tabulate_influence(sky);
}

/* Mesh and fraction of a pixel coordinate. */
static bst_local_sky_place between(double at, int mesh, int count) {
    double u = fmin(fmax((at + 0.5) / mesh - 0.5, 0.0), count - 1.0);
    int i = (int)u;
    i = i < count - 1 ? i : count > 1 ? count - 2 : 0;
    return (bst_local_sky_place){count > 1 ? u - i : 0.0, i};
}

/* Computes mesh and fraction of all pixel columns and rows. */
static bst_status set_mesh_positions(bst_ctx *ctx, bst_local_sky *sky) {
    if (sky->width + sky->height > sky->places_room) {
        int room = sky->width + sky->height;
        bst_local_sky_place *more = realloc(sky->places, (size_t)room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d rows and columns", room);
        }
        sky->places = more;
        sky->places_room = room;
    }
    for (int x = 0; x < sky->width; x++) {
        sky->places[x] = between(x, sky->mesh, sky->columns);
    }
    for (int y = 0; y < sky->height; y++) {
        sky->places[sky->width + y] = between(y, sky->mesh, sky->rows);
    }
    return BST_OK;
}

bst_status bst_local_sky_begin(bst_ctx *ctx, bst_local_sky *sky, int width, int height, int mesh_px,
                               double sigma_px) {
    assert(sky && width > 0 && height > 0 && mesh_px > 0 && sigma_px > 0.0);
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
    if (sky->mesh != mesh_px || sky->width != width || sky->height != height) {
        sky->mesh = mesh_px;
        sky->columns = columns;
        sky->rows = rows;
        sky->width = width;
        sky->height = height;
        BST_TRY(set_mesh_positions(ctx, sky));
    }
    memset(sky->level, 0, 2 * (size_t)(columns * rows) * sizeof *sky->level);
    if (sky->sigma != sigma_px) {
        tabulate(sky, sigma_px);
    }
    return BST_OK;
}

void bst_local_sky_free(bst_local_sky *sky) {
    free(sky->level);
    free(sky->places);
    *sky = (bst_local_sky){0};
}

/* Mesh of a pixel. */
static int mesh_of(int at, int mesh, int count) {
    int i = at / mesh;
    return i < count ? i : count - 1;
}

void bst_local_sky_add(bst_local_sky *sky, int x, int y, double height, double length_px) {
    int k = mesh_of(y, sky->mesh, sky->rows) * sky->columns + mesh_of(x, sky->mesh, sky->columns);
    /* inside of the last interval of the table */
    double at = fmin(PER_SNR * height, BST_LOCAL_SKY_HEIGHTS - 1.001);
    int i = (int)at;
    float part = (float)(at - i), length = (float)length_px;
    sky->level[k] += length * (sky->light[i] + part * (sky->light[i + 1] - sky->light[i]));
    sky->noise[k] += length * (sky->square[i] + part * (sky->square[i + 1] - sky->square[i]));
}

void bst_local_sky_add_wings(bst_local_sky *sky, double x, double y, double reach_px,
                             bst_local_sky_light_fn light, const void *user) {
    assert(sky && light && reach_px > 0.0);
    enum { STEP = 2 }; /* px */
    int left = (int)fmax(x - reach_px, 0.0), top = (int)fmax(y - reach_px, 0.0);
    int right = (int)fmin(x + reach_px, sky->width - 1.0);
    int bottom = (int)fmin(y + reach_px, sky->height - 1.0);
    for (int j = top; j <= bottom; j += STEP) {
        int row = mesh_of(j, sky->mesh, sky->rows) * sky->columns;
        for (int i = left; i <= right; i += STEP) {
            double distance = hypot(i - x, j - y);
            double at = distance <= reach_px ? PER_NOISE * light(user, distance) : 0.0;
            if (!(at > 0.0 && at < BST_LOCAL_SKY_LIGHTS - 1.0)) {
                continue;
            }
            int n = (int)at, k = row + mesh_of(i, sky->mesh, sky->columns);
            float part = (float)(at - n), area = STEP * STEP;
            const float *low = sky->influence[n], *high = sky->influence[n + 1];
            sky->level[k] += area * (low[0] + part * (high[0] - low[0]));
            sky->noise[k] += area * (low[1] + part * (high[1] - low[1]));
        }
    }
}

static int side_of(int i, int mesh, int count, int pixels) {
    return i + 1 < count ? mesh : pixels - i * mesh;
}

/* Averages each mesh with the opposite neighbours that agree with it. */
static void smooth_meshes(const bst_local_sky *sky, float *values, double error) {
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
    /* standard error of a mean; that of a standard deviation is smaller */
    double error = 1.0 / sky->mesh;
    smooth_meshes(sky, sky->level, error);
    smooth_meshes(sky, sky->noise, error * sqrt(0.5));
}

static void set_sides(const float *at, int right, int below, double cell[2][2]) {
    cell[0][0] = (double)at[0];
    cell[0][1] = (double)(at[right] - at[0]);
    cell[1][0] = (double)at[below];
    cell[1][1] = (double)(at[below + right] - at[below]);
}

void bst_local_sky_enter(const bst_local_sky *sky, int column, int row, bst_local_sky_cell *cell) {
    int k = row * sky->columns + column;
    int right = sky->columns > 1, below = sky->rows > 1 ? sky->columns : 0;
    cell->column = column;
    cell->row = row;
    set_sides(sky->level + k, right, below, cell->level);
    set_sides(sky->noise + k, right, below, cell->noise);
}

void bst_local_sky_at(const bst_local_sky *sky, double x, double y, double *level, double *noise) {
    bst_local_sky_place across = between(x, sky->mesh, sky->columns);
    bst_local_sky_place down = between(y, sky->mesh, sky->rows);
    bst_local_sky_cell cell;
    bst_local_sky_enter(sky, across.first, down.first, &cell);
    *level = bst_local_sky_mix(cell.level, across.part, down.part);
    *noise = bst_local_sky_mix(cell.noise, across.part, down.part);
}
