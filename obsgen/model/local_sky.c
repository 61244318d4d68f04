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

/* MANY_PX: as in imgproc/detect/background.c, which reads half of the rows of a mesh of so many. */
enum { PER_SNR = 4, PER_NOISE = 4, MANY_PX = 4096 };

/* Normal density. */
static double density(double z) {
    return exp(-0.5 * z * z) / sqrt(2.0 * BST_PI);
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
    free(sky->pixels);
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

bst_status bst_local_sky_begin_wings(bst_ctx *ctx, bst_local_sky *sky) {
    assert(sky && sky->columns > 0);
    int room = sky->columns * sky->rows * BST_LOCAL_SKY_BINS;
    if (room > sky->pixels_room) {
        float *more = realloc(sky->pixels, (size_t)room * sizeof *more);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the light of %d meshes",
                            sky->columns * sky->rows);
        }
        sky->pixels = more;
        sky->pixels_room = room;
    }
    memset(sky->pixels, 0, (size_t)room * sizeof *sky->pixels);
    return BST_OK;
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
            if (!(at > 0.0)) {
                continue;
            }
            at = fmin(at, BST_LOCAL_SKY_BINS - 1.001);
            int n = (int)at, k = row + mesh_of(i, sky->mesh, sky->columns);
            float part = (float)(at - n), area = STEP * STEP;
            float *pixels = sky->pixels + k * BST_LOCAL_SKY_BINS + n;
            pixels[0] += area * (1.0f - part);
            pixels[1] += area * part;
        }
    }
}

/* Adds to moments of order 0 to 2 those of normal values of mean w and deviation sd, of which only
 * those from low to high count. */
static void add_clipped(double pixels, double w, double sd, const double clip[2], double out[3]) {
    double a = (clip[0] - w) / sd, b = (clip[1] - w) / sd, p = density(a), q = density(b);
    double all = 0.5 * (erf(b / sqrt(2.0)) - erf(a / sqrt(2.0)));
    double first = sd * (p - q), second = sd * sd * (all + a * p - b * q); /* about w */
    out[0] += pixels * all;
    out[1] += pixels * (w * all + first);
    out[2] += pixels * (w * w * all + 2.0 * w * first + second);
}

/* Level and noise of a mesh by iterated clipping. */
static void clip_mesh(const float bins[BST_LOCAL_SKY_BINS], double pixels, double shot,
                      double *level, double *noise) {
    enum { PASSES = 5 };
    /* variance of a normal distribution cut at three deviations */
    static const double CUT_VARIANCE = 0.97334;
    double dark = pixels;
    for (int i = 0; i < BST_LOCAL_SKY_BINS; i++) {
        dark -= (double)bins[i];
    }
    *level = 0.0;
    *noise = 1.0;
    for (int pass = 0; pass < PASSES; pass++) {
        const double clip[2] = {*level - CLIP_SIGMA * *noise, *level + CLIP_SIGMA * *noise};
        double sum[3] = {0.0};
        add_clipped(fmax(dark, 0.0), 0.0, 1.0, clip, sum);
        for (int i = 0; i < BST_LOCAL_SKY_BINS; i++) {
            double w = (double)i / PER_NOISE;
            if (bins[i] > 0.0f) {
                add_clipped((double)bins[i], w, sqrt(1.0 + shot * w), clip, sum);
            }
        }
        *level = sum[1] / sum[0];
        *noise = sqrt((sum[2] / sum[0] - *level * *level) / CUT_VARIANCE);
    }
}

static int side_of(int i, int mesh, int count, int pixels) {
    return i + 1 < count ? mesh : pixels - i * mesh;
}

/* Averages each mesh with the opposite neighbours that agree with it; error: of a mesh, in its
 * noises. */
static void smooth_meshes(const bst_local_sky *sky, float *values, double error) {
    static const int across[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    memcpy(sky->scratch, values, (size_t)(sky->columns * sky->rows) * sizeof *values);
    for (int j = 0; j < sky->rows; j++) {
        for (int i = 0; i < sky->columns; i++) {
            const float *own = sky->scratch + j * sky->columns + i;
            float sum = *own, weight = 1.0f;
            double most = AGREEMENT * error * (double)sky->noise[j * sky->columns + i];
            for (int d = 0; d < 4; d++) {
                int u = across[d][0], v = across[d][1];
                if (i - u < 0 || i + u >= sky->columns || j - abs(v) < 0 ||
                    j + abs(v) >= sky->rows) {
                    continue;
                }
                float pair = own[v * sky->columns + u] + own[-v * sky->columns - u];
                if (fabs((double)(0.5f * pair - *own)) < most) {
                    sum += pair;
                    weight += 2.0f;
                }
            }
            values[j * sky->columns + i] = sum / weight;
        }
    }
}

static double pixels_of(const bst_local_sky *sky, int i, int j) {
    return (double)side_of(i, sky->mesh, sky->columns, sky->width) *
           side_of(j, sky->mesh, sky->rows, sky->height);
}

static void smooth(const bst_local_sky *sky) {
    /* standard error of a mean of all pixels, or of half of those of a large mesh; that of a
     * standard deviation is smaller */
    double error = (sky->mesh * sky->mesh < MANY_PX ? 1.0 : sqrt(2.0)) / sky->mesh;
    smooth_meshes(sky, sky->level, error);
    smooth_meshes(sky, sky->noise, error * sqrt(0.5));
}

void bst_local_sky_settle(bst_local_sky *sky, double share, double crowding) {
    for (int j = 0; j < sky->rows; j++) {
        for (int i = 0; i < sky->columns; i++) {
            int k = j * sky->columns + i;
            double pixels = pixels_of(sky, i, j);
            sky->level[k] = (float)(share * (double)sky->level[k] / pixels);
            sky->noise[k] = (float)sqrt(1.0 + crowding * (double)sky->noise[k] / pixels);
        }
    }
    smooth(sky);
}

void bst_local_sky_settle_wings(bst_local_sky *sky, double shot) {
    for (int j = 0; j < sky->rows; j++) {
        for (int i = 0; i < sky->columns; i++) {
            int k = j * sky->columns + i;
            double level, noise;
            clip_mesh(sky->pixels + k * BST_LOCAL_SKY_BINS, pixels_of(sky, i, j), shot, &level,
                      &noise);
            sky->level[k] = (float)level;
            sky->noise[k] = (float)noise;
        }
    }
    smooth(sky);
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
