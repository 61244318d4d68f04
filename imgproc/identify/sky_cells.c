#include "imgproc/identify/sky_cells.h"

#include <assert.h>
#include <string.h>

#include "sim/core/pages.h"

/* Declination of the border between two bands, rad. */
static double border(const bst_sky_cells *sky, int band) {
    return -0.5 * BST_PI + BST_PI * band / sky->bands;
}

static int clamp(int v, int most) {
    return v < 0 ? 0 : v > most ? most : v;
}

static int band_of(const bst_sky_cells *sky, double declination) {
    return clamp((int)floor((declination + 0.5 * BST_PI) / BST_PI * sky->bands), sky->bands - 1);
}

static int cell_of(const bst_sky_cells *sky, bst_vec3 v) {
    double ra, dec;
    bst_vec3_to_radec(v, &ra, &dec);
    int band = band_of(sky, dec);
    int cells = sky->band_first[band + 1] - sky->band_first[band];
    return sky->band_first[band] + clamp((int)floor(ra / (2.0 * BST_PI) * cells), cells - 1);
}

bst_status bst_sky_cells_open(bst_ctx *ctx, bst_sky_cells *sky, double side_rad, int room) {
    assert(sky && side_rad > 0.0 && room >= 0);
    *sky = (bst_sky_cells){.bands = (int)ceil(BST_PI / side_rad), .room = room};
    sky->band_first = bst_pages_zero((size_t)sky->bands + 1, sizeof *sky->band_first);
    sky->next = bst_pages_zero((size_t)room + 1, sizeof *sky->next);
    sky->place = bst_pages_zero((size_t)room + 1, sizeof *sky->place);
    for (int b = 0; sky->band_first && b < sky->bands; b++) {
        double widest = fmax(cos(border(sky, b)), cos(border(sky, b + 1)));
        int cells = (int)floor(2.0 * BST_PI * widest / side_rad);
        sky->band_first[b + 1] = sky->band_first[b] + (cells < 1 ? 1 : cells);
    }
    int cells = sky->band_first ? sky->band_first[sky->bands] : 0;
    sky->head = bst_pages_zero((size_t)cells + 1, sizeof *sky->head);
    if (!sky->band_first || !sky->next || !sky->place || !sky->head) {
        bst_sky_cells_close(sky);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars in cells of the sky", room);
    }
    for (int i = 0; i < cells; i++) {
        sky->head[i] = -1;
    }
    return BST_OK;
}

void bst_sky_cells_close(bst_sky_cells *sky) {
    bst_pages_free(sky->band_first);
    bst_pages_free(sky->next);
    bst_pages_free(sky->place);
    bst_pages_free(sky->head);
    *sky = (bst_sky_cells){0};
}

void bst_sky_cells_add(bst_sky_cells *sky, bst_vec3 v) {
    assert(sky->count < sky->room);
    int star = sky->count++, cell = cell_of(sky, v);
    sky->place[star][0] = (float)v.x;
    sky->place[star][1] = (float)v.y;
    sky->place[star][2] = (float)v.z;
    sky->next[star] = sky->head[cell];
    sky->head[cell] = star;
}

bst_status bst_sky_cells_sort(bst_ctx *ctx, bst_sky_cells *sky) {
    float(*sorted)[3] = bst_pages_zero((size_t)sky->count + 1, sizeof *sorted);
    if (!sorted) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for %d stars in cells of the sky",
                        sky->count);
    }
    int count = 0;
    for (int cell = 0; cell < sky->band_first[sky->bands]; cell++) {
        int first = count;
        for (int star = sky->head[cell]; star >= 0; star = sky->next[star]) {
            memcpy(sorted[count++], sky->place[star], sizeof *sorted);
        }
        sky->head[cell] = count > first ? first : -1;
    }
    for (int star = 0; star < count; star++) {
        sky->next[star] = star + 1;
    }
    for (int cell = 0; cell < sky->band_first[sky->bands]; cell++) {
        if (sky->head[cell] > 0) { /* the star before is its cell's last */
            sky->next[sky->head[cell] - 1] = -1;
        }
    }
    if (count > 0) {
        sky->next[count - 1] = -1;
    }
    bst_pages_free(sky->place);
    sky->place = sorted;
    sky->room = count; /* full */
    return BST_OK;
}

/* Right ascensions that a circle reaches to either side of its centre, rad; pi: all. */
static double reach_ra(double declination, double radius_rad) {
    double c = cos(declination), s = sin(radius_rad);
    if (radius_rad >= 0.5 * BST_PI || fabs(declination) + radius_rad >= 0.5 * BST_PI || s >= c) {
        return BST_PI;
    }
    return asin(s / c);
}

int bst_sky_cells_near(const bst_sky_cells *sky, bst_vec3 v, double radius_rad, int most,
                       uint32_t *out) {
    double ra, dec;
    bst_vec3_to_radec(v, &ra, &dec);
    /* the stars are kept in single precision */
    const double reach = radius_rad + 1e-6;
    const double half = reach_ra(dec, reach), chord = 2.0 * sin(0.5 * fmin(radius_rad, BST_PI));
    int last = band_of(sky, dec + reach), found = 0;
    for (int band = band_of(sky, dec - reach); band <= last; band++) {
        int cells = sky->band_first[band + 1] - sky->band_first[band];
        int a = (int)floor((ra - half) / (2.0 * BST_PI) * cells);
        int b = (int)floor((ra + half) / (2.0 * BST_PI) * cells);
        if (b - a >= cells) {
            a = 0;
            b = cells - 1;
        }
        for (int k = a; k <= b; k++) {
            int cell = sky->band_first[band] + ((k % cells) + cells) % cells;
            for (int star = sky->head[cell]; star >= 0; star = sky->next[star]) {
                double dx = (double)sky->place[star][0] - v.x;
                double dy = (double)sky->place[star][1] - v.y;
                double dz = (double)sky->place[star][2] - v.z;
                if (dx * dx + dy * dy + dz * dz > chord * chord) {
                    continue;
                }
                if (out) {
                    out[found] = (uint32_t)star;
                }
                if (++found == most) {
                    return found;
                }
            }
        }
    }
    return found;
}
