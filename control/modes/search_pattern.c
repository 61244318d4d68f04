#include "control/modes/search_pattern.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

/* Number of fields on each side of the centre. */
static int reach(double extent, double field, double step) {
    double need = ceil((extent - 0.5 * field) / (step * field) - 1e-9);
    return (int)fmin(fmax(need, 0.0), 0.5 * (BST_SEARCH_MAX_TILES - 1));
}

/* Position angle of a tile, from +x towards +y. */
static double angle_of(const bst_search_tile *t) {
    double a = atan2(t->y_rad, t->x_rad);
    return a < -1e-12 ? a + 2.0 * BST_PI : a;
}

static bool before(const bst_search_tile *a, const bst_search_tile *b) {
    double ra = hypot(a->x_rad, a->y_rad), rb = hypot(b->x_rad, b->y_rad);
    if (fabs(ra - rb) > 1e-9 * (ra + rb)) {
        return ra < rb;
    }
    return angle_of(a) < angle_of(b);
}

/* Inserts a tile in order of distance. */
static void insert(bst_search *search, bst_search_tile tile) {
    int k = search->count++;
    for (; k > 0 && before(&tile, &search->tile[k - 1]); k--) {
        search->tile[k] = search->tile[k - 1];
    }
    search->tile[k] = tile;
}

/* Lays rows (or columns) -ny to ny alternately forwards and backwards. */
static void lay_rows(bst_search *search, int nx, int ny, double dx, double dy, bool by_column) {
    assert(nx >= 0 && ny >= 0 && (2 * nx + 1) * (2 * ny + 1) <= BST_SEARCH_MAX_TILES);
    int outer = by_column ? nx : ny, inner = by_column ? ny : nx;
    for (int j = -outer; j <= outer; j++) {
        for (int i = -inner; i <= inner; i++) {
            int back = (j + outer) % 2 == 0 ? i : -i;
            int x = by_column ? j : back, y = by_column ? back : j;
            search->tile[search->count++] = (bst_search_tile){x * dx, y * dy};
        }
    }
}

/* Lays tiles in a spiral about the centre. */
static void lay_spiral(bst_search *search, int nx, int ny, double dx, double dy) {
    assert(nx >= 0 && ny >= 0 && (2 * nx + 1) * (2 * ny + 1) <= BST_SEARCH_MAX_TILES);
    static const int step[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    int total = (2 * nx + 1) * (2 * ny + 1), x = 0, y = 0;
    for (int leg = 0; search->count < total; leg++) {
        for (int k = 0; k < leg / 2 + 1; k++) {
            if (x >= -nx && x <= nx && y >= -ny && y <= ny) {
                search->tile[search->count++] = (bst_search_tile){x * dx, y * dy};
            }
            x += step[leg % 4][0];
            y += step[leg % 4][1];
        }
    }
}

void bst_search_plan(bst_search *search, bst_search_pattern pattern, const bst_search_area *area) {
    assert(search && area);
    int nx = reach(area->half_x_rad, area->field_x_rad, area->step);
    int ny = reach(area->half_y_rad, area->field_y_rad, area->step);
    double dx = area->step * area->field_x_rad, dy = area->step * area->field_y_rad;
    search->count = 0;
    search->complete = true;
    while ((2 * nx + 1) * (2 * ny + 1) > BST_SEARCH_MAX_TILES) {
        int *longer = nx > ny ? &nx : &ny;
        --*longer;
        search->complete = false;
    }
    if (pattern == BST_SEARCH_SPIRAL) {
        lay_spiral(search, nx, ny, dx, dy);
    } else if (pattern != BST_SEARCH_NEAREST_FIRST) {
        lay_rows(search, nx, ny, dx, dy, pattern == BST_SEARCH_BELT);
    } else {
        for (int j = -ny; j <= ny; j++) {
            for (int i = -nx; i <= nx; i++) {
                insert(search, (bst_search_tile){i * dx, j * dy});
            }
        }
    }
}

void bst_search_inscribe(double width_rad, double height_rad, double turn_rad, double *x_rad,
                         double *y_rad) {
    double c = fabs(cos(turn_rad)), s = fabs(sin(turn_rad));
    double a = c >= s ? width_rad : height_rad, b = c >= s ? height_rad : width_rad;
    double share = fmin(width_rad / (a * c + b * s), height_rad / (a * s + b * c));
    *x_rad = share * a;
    *y_rad = share * b;
}

double bst_search_slew_s(double angle_rad, double rate_radps, double accel_radps2) {
    double ramp = rate_radps * rate_radps / accel_radps2; /* angle of both ramps */
    return angle_rad <= ramp ? 2.0 * sqrt(angle_rad / accel_radps2)
                             : angle_rad / rate_radps + rate_radps / accel_radps2;
}

double bst_search_sweep_s(const bst_search *search, const bst_search_timing *t) {
    double periods = 0.0;
    for (int k = 0; k < search->count; k++) {
        double busy = t->exposure_s + t->latency_s;
        if (k > 0) {
            const bst_search_tile *a = &search->tile[k - 1], *b = &search->tile[k];
            double angle = fmax(fabs(b->x_rad - a->x_rad), fabs(b->y_rad - a->y_rad));
            busy += bst_search_slew_s(angle, t->rate_radps, t->accel_radps2) + t->settle_s;
        }
        periods += ceil(busy / t->period_s) + t->frames - 1;
    }
    return periods * t->period_s;
}

void bst_search_archive(bst_search *search, bst_archive *archive) {
    search->count = bst_archive_count(archive, search->count, BST_SEARCH_MAX_TILES);
    bst_archive_bool(archive, &search->complete);
    bst_archive_bytes(archive, search->tile, (size_t)search->count * sizeof *search->tile);
}
