#include "sim/catalogue/stars.h"

#include <assert.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "boresight/rng.h"
#include "sim/astro/bodies.h"
#include "sim/astro/time.h"
#include "sim/catalogue/bright_stars.h"
#include "sim/catalogue/cell_index.h"
#include "sim/catalogue/star_index.h"
#include "sim/catalogue/variable_stars.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)1 << 33)

/* Defined in stars_embedded.S. */
extern const unsigned char bst_stars_embedded_begin[];
extern const unsigned char bst_stars_embedded_end[];

struct bst_stars {
    bst_star_view view;
    bst_cell_index *index; /* shared as the mapping is */
    void *mapping;         /* NULL: embedded */
    size_t mapping_bytes;
    char path[512];
    bool borrowed; /* another catalogue owns the mapping and the index */
    bool altered;
    bst_star_errors_config errors;
    bst_rng_key key;
};

/* Identity of the star of a record in cell c. */
static uint32_t identity(const bst_star_view *view, uint32_t c, const bst_star_record *r) {
    return c < BST_STAR_CELLS
               ? c << 16 | (r->tyc_vt & 0xFFFFu)
               : BST_STAR_TABLE_ID + (uint32_t)(r - view->records) - view->tycho2_count;
}

/* limit of normal deviates, in sigma: Box-Muller with 53 bits ends at 8.6 */
#define MOST_SIGMAS 9.0

/* largest parallax that a record holds, at the Earth's largest distance from the barycentre */
#define MOST_PARALLAX_RAD (1.04e-3 * BST_STAR_PARALLAX_MAX_MAS * BST_ARCSEC_RAD)

/* random draws per star */
enum { DRAW_DROPPED, DRAW_DISPLACED, DRAW_OFFSET };

/* Applies the errors of an onboard catalogue to a star; false: it is missing. */
static bool alter(const bst_stars *s, uint32_t id, bst_vec3 *direction) {
    const bst_star_errors_config *e = &s->errors;
    if (bst_rng_uniform(s->key, id, DRAW_DROPPED) < e->missing_fraction) {
        return false;
    }
    if (bst_rng_uniform(s->key, id, DRAW_DISPLACED) < e->position_error_fraction) {
        double offset[2], sigma = e->position_error_sigma_arcsec * BST_ARCSEC_RAD;
        bst_rng_normal2(s->key, id, DRAW_OFFSET, offset);
        bst_vec3 a = bst_vec3_perpendicular(*direction), b = bst_vec3_cross(*direction, a);
        *direction = bst_vec3_unit(
            bst_vec3_axpy(bst_vec3_axpy(*direction, sigma * offset[0], a), sigma * offset[1], b));
    }
    return true;
}

bst_status bst_stars_with_errors(bst_ctx *ctx, const bst_stars *stars,
                                 const bst_star_errors_config *errors, bst_stars **out) {
    *out = malloc(sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    **out = *stars;
    (*out)->borrowed = (*out)->altered = true;
    (*out)->errors = *errors;
    (*out)->key = bst_rng_make_key(errors->seed, 0, "knowledge", "stars");
    return BST_OK;
}

bst_status bst_stars_share(bst_ctx *ctx, const bst_stars *stars, bst_stars **out) {
    *out = malloc(sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    **out = *stars;
    (*out)->borrowed = true;
    return BST_OK;
}

bst_status bst_stars_default_path(bst_ctx *ctx, char *buffer, size_t bytes) {
    const char *data = getenv("XDG_DATA_HOME");
    const char *home = getenv("HOME");
    int n;
    /* XDG base directory specification: relative paths are ignored */
    if (data && data[0] == '/') {
        n = snprintf(buffer, bytes, "%s/boresight/tycho2.stars", data);
    } else if (home && home[0] == '/') {
        n = snprintf(buffer, bytes, "%s/.local/share/boresight/tycho2.stars", home);
    } else {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "no user's data directory: set HOME or XDG_DATA_HOME to an absolute path");
    }
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "the path of the user's data directory is longer than %zu bytes", bytes);
    }
    return BST_OK;
}

static bst_status open_file(bst_ctx *ctx, const char *path, bst_stars *s) {
    int fd;
    uint64_t bytes;
    bst_status status = bst_file_open(ctx, path, MAX_FILE_BYTES,
                                      "a star catalogue: `boresight stars fetch` makes the full "
                                      "one, and \"embedded\" names the one in the program",
                                      &fd, &bytes);
    if (status != BST_OK) {
        return bst_fail_prefix(ctx, status, "star catalogue");
    }
    if (bytes < 8) {
        /* an empty file cannot be mapped; a zero header causes the message for a foreign file */
        uint64_t none = 0;
        status = bst_star_view_init(ctx, path, &none, sizeof none, true, &s->view);
    } else {
        s->mapping_bytes = (size_t)bytes;
        void *p = mmap(NULL, s->mapping_bytes, PROT_READ, MAP_PRIVATE, fd, 0);
        if (p == MAP_FAILED) {
            status = bst_fail(ctx, BST_ERR_IO, "star catalogue %s: %s", path, strerror(errno));
        } else {
            s->mapping = p;
            status = bst_star_view_init(ctx, path, p, s->mapping_bytes, true, &s->view);
        }
    }
    close(fd);
    return status;
}

static bst_status open_embedded(bst_ctx *ctx, bst_stars *s) {
    size_t bytes = (size_t)(bst_stars_embedded_end - bst_stars_embedded_begin);
    return bst_star_view_init(ctx, "embedded in the program", bst_stars_embedded_begin, bytes,
                              false, &s->view);
}

bst_status bst_stars_open(bst_ctx *ctx, const char *name, bst_stars **out) {
    *out = NULL;
    bst_stars *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    bst_status status = BST_OK;
    bool use_default = strcmp(name, "default") == 0;
    if (use_default) {
        status = bst_stars_default_path(ctx, s->path, sizeof s->path);
        /* without a home directory there is no full catalogue */
        if (status != BST_OK || access(s->path, F_OK) != 0) {
            s->path[0] = '\0';
            status = BST_OK;
        }
    } else if (!*name) {
        status = bst_fail(ctx, BST_ERR_ARGUMENT,
                          "the star catalogue's name is empty (allowed: \"default\", "
                          "\"embedded\" or a path)");
    } else if (strcmp(name, "embedded") != 0) {
        int n = snprintf(s->path, sizeof s->path, "%s", name);
        if (n < 0 || (size_t)n >= sizeof s->path) {
            status =
                bst_fail(ctx, BST_ERR_ARGUMENT,
                         "the star catalogue's path is longer than %zu bytes", sizeof s->path - 1);
        }
    }
    if (status == BST_OK) {
        status = s->path[0] ? open_file(ctx, s->path, s) : open_embedded(ctx, s);
    }
    if (status == BST_OK) {
        status = bst_cell_index_create(ctx, &s->view, &s->index);
    }
    if (status != BST_OK) {
        bst_stars_close(s);
        return status;
    }
    if (use_default && !s->mapping) {
        bst_log(ctx, BST_LOG_WARNING,
                "the full star catalogue is not there: using the stars embedded in the program "
                "(all to V %.1f, fainter in %u patches of sky only); `boresight stars fetch` gets "
                "the full one",
                s->view.header->complete_to_v_mag, s->view.header->patch_count);
    }
    *out = s;
    return BST_OK;
}

void bst_stars_close(bst_stars *stars) {
    if (stars && !stars->borrowed) {
        bst_cell_index_free(stars->index);
        if (stars->mapping) {
            munmap(stars->mapping, stars->mapping_bytes);
        }
    }
    free(stars);
}

void bst_stars_get_info(const bst_stars *stars, bst_stars_info *out) {
    const bst_star_header *h = stars->view.header;
    memset(out, 0, sizeof *out);
    out->embedded = stars->mapping == NULL;
    if (out->embedded) {
        snprintf(out->source, sizeof out->source, "embedded default");
    } else {
        snprintf(out->source, sizeof out->source, "%.*s", (int)sizeof h->source, h->source);
    }
    snprintf(out->path, sizeof out->path, "%s", stars->path);
    out->count = (long long)h->star_count;
    out->table_count = (long long)h->star_count - stars->view.tycho2_count;
    out->variable_count = stars->view.variable_count;
    out->has_parallax = stars->view.has_parallax;
    out->complete_to_v_mag = h->complete_to_v_mag;
    out->patches = (int)h->patch_count;
}

const bst_star_view *bst_stars_records(const bst_stars *stars) {
    return &stars->view;
}

void bst_stars_patch(const bst_stars *stars, int index, bst_vec3 *centre, double *radius_rad,
                     double *v_mag) {
    const bst_star_patch *p = &stars->view.patches[index];
    *centre = bst_vec3_from_radec(p->ra_deg * BST_DEG_RAD, p->dec_deg * BST_DEG_RAD);
    *radius_rad = p->radius_deg * BST_DEG_RAD;
    *v_mag = p->v_mag;
}

double bst_stars_complete_to(const bst_stars *stars, bst_vec3 centre, double radius_rad) {
    double best = stars->view.header->complete_to_v_mag;
    for (uint32_t i = 0; i < stars->view.header->patch_count; i++) {
        bst_vec3 c;
        double radius, v;
        bst_stars_patch(stars, (int)i, &c, &radius, &v);
        if (v > best && bst_vec3_angle(c, centre) + radius_rad <= radius) {
            best = v;
        }
    }
    return best;
}

/* Box in stored right ascension and declination that contains a cone: integer comparisons reject
 * most stars of a cell before trigonometry. */
typedef struct radec_box {
    int64_t dec_min, dec_max;
    uint32_t ra_min, ra_width;
} radec_box;

static radec_box box_around(bst_vec3 centre, double radius_rad) {
    const double unit = 4294967296.0 / (2.0 * BST_PI);
    double ra, dec;
    bst_vec3_to_radec(centre, &ra, &dec);
    radius_rad += 1e-8; /* rounding of the stored positions and of the following steps */
    radec_box box = {(int64_t)floor((dec - radius_rad) * unit),
                     (int64_t)ceil((dec + radius_rad) * unit), 0, UINT32_MAX};
    if (fabs(dec) + radius_rad < BST_PI / 2.0 - 1e-6) {
        /* half width of the cone in right ascension: sin(dra) = sin(r) / cos(dec) */
        double half = asin(fmin(1.0, sin(radius_rad) / cos(dec))) * unit + 2.0;
        if (half < 2147483647.0) {
            box.ra_min = (uint32_t)(int64_t)floor(ra * unit - half);
            box.ra_width = (uint32_t)ceil(2.0 * half);
        }
    }
    return box;
}

/* largest difference of Tycho-2's V and the published one, mag */
#define MOST_WRONG_MAG 0.5

/* Unpacks a star. True: its magnitudes are from the table of bright stars, or of the observer's
 * time. */
static bool unpack(const bst_star_view *view, const bst_star_record *r, uint32_t id,
                   bst_vec3 direction, const bst_star_observer *observer, bst_star *out) {
    int colour = (int)(r->pm_ra_colour & 0x3FFFu) - BST_STAR_COLOUR_OFFSET;
    out->icrs = direction;
    out->v_mag = (float)(bst_star_record_v(r) / 1e5);
    /* B-V = 0.850 (BT-VT): Tycho-2 ReadMe, note 7. */
    out->b_minus_v = r->pm_dec_flags & BST_STAR_NO_COLOUR ? NAN : (float)(0.850 * colour / 1000.0);
    out->id = id;
    /* a file may have been imported without the table */
    bool published = (double)out->v_mag < BST_BRIGHT_STARS_V &&
                     bst_bright_star(out->id, &out->v_mag, &out->b_minus_v);
    const bst_star_variable *v = r->pm_dec_flags & BST_STAR_VARIABLE
                                     ? bst_star_variable_of(view, (uint32_t)(r - view->records))
                                     : NULL;
    if (v) {
        /* at the barycentre the light has the phase that is seen by the observer */
        double ahead_s = bst_vec3_dot(observer->barycentre_m, direction) / BST_LIGHT_SPEED_MPS;
        double mag = bst_star_variable_mag(view, v, observer->jd + ahead_s / BST_DAY_S);
        out->v_mag += (float)(published ? mag - (double)v->table_mag : mag);
    }
    return published || v;
}

/* Moves the last of count stars to its position by brightness; only stars of the table are out of
 * order. */
static void put_in_order(bst_star *stars, int count) {
    for (int k = count - 1; k > 0 && stars[k - 1].v_mag > stars[k].v_mag; k--) {
        bst_star swap = stars[k];
        stars[k] = stars[k - 1];
        stars[k - 1] = swap;
    }
}

/* State of a query. */
typedef struct star_search {
    const bst_stars *stars;
    const bst_star_query *query;
    bst_star_observer observer;
    double chord2, slack; /* slack: from where stars may enter the cone, rad */
    int32_t faintest;     /* V of the faintest record that counts, 1e-5 mag */
    radec_box box;
    double box_drift; /* proper motion that the box holds for; -1: there is none yet */
    bst_star *out;
    int capacity, found;
} star_search;

/* V of the faintest record that may be within v_limit, 1e-5 mag: published magnitudes of bright
 * stars differ from those of records. */
static int32_t faintest_record(double v_limit) {
    const double most = v_limit >= BST_BRIGHT_STARS_V
                            ? fmin(v_limit, 1e4)
                            : fmax(fmin(BST_BRIGHT_STARS_V, v_limit + MOST_WRONG_MAG), -1e4);
    int32_t v = (int32_t)floor(most * 1e5);
    while ((v + 1) / 1e5 <= most) {
        v++;
    }
    while (v / 1e5 > most) {
        v--;
    }
    return v;
}

/* Adds the stars of a cell that are in the cone. */
static void search_cell(star_search *q, uint32_t c) {
    const bst_stars *stars = q->stars;
    const double v_limit = q->query->v_limit;
    const radec_box box = q->box;
    bool out_of_order = false;
    const int first = q->found;
    const bst_star_record *r = stars->view.records + stars->view.cells[c].first;
    for (const bst_star_record *end = r + stars->view.cells[c].count; r < end; r++) {
        const int32_t v = bst_star_record_v(r);
        if (v > q->faintest) {
            break; /* sorted brightest first */
        }
        /* one branch: either comparison alone is hard to predict */
        if ((r->dec < box.dec_min) | (r->dec > box.dec_max) | (r->ra - box.ra_min > box.ra_width)) {
            continue;
        }
        bst_vec3 direction = bst_star_record_seen(r, &q->observer);
        const uint32_t id = identity(&stars->view, c, r);
        if (stars->altered && !alter(stars, id, &direction)) {
            continue;
        }
        bst_vec3 d = bst_vec3_sub(direction, q->query->centre);
        bst_star star;
        if (bst_vec3_dot(d, d) > q->chord2) {
            continue;
        }
        bool reordered = unpack(&stars->view, r, id, direction, &q->observer, &star);
        if (reordered ? (double)star.v_mag > v_limit : v / 1e5 > v_limit) {
            continue;
        }
        if (q->found < q->capacity) {
            q->out[q->found] = star;
            out_of_order = out_of_order || reordered;
            if (out_of_order) {
                put_in_order(q->out + first, q->found - first + 1);
            }
        }
        q->found++;
    }
}

/* Adds the stars in the cone of cells [count]. */
static void search_cells(star_search *q, const uint32_t *cells, uint32_t count) {
    const bst_star_view *view = &q->stars->view;
    for (uint32_t i = 0; i < count; i++) {
        /* the cells are far apart: memory gets their brightest stars while others are looked at */
        const char *record = (const char *)(view->records + view->cells[cells[i]].first);
        __builtin_prefetch(record);
        __builtin_prefetch(record + 64);
    }
    for (uint32_t i = 0; i < count; i++) {
        const double drift = view->cells[cells[i]].pm_max_radpyr * fabs(q->observer.years);
        if (drift > q->box_drift) { /* it holds for less motion, too */
            q->box = box_around(q->query->centre, q->query->radius_rad + drift + q->slack);
            q->box_drift = drift;
        }
        search_cell(q, cells[i]);
    }
}

bst_status bst_stars_query_seen(bst_ctx *ctx, const bst_stars *stars, const bst_star_query *query,
                                bst_star *out, int capacity, int *count) {
    assert(stars && query && count);
    const bst_vec3 centre = query->centre;
    const double radius_rad = query->radius_rad;
    *count = 0;
    if (!(radius_rad >= 0.0 && radius_rad <= BST_PI) || isnan(query->v_limit) ||
        !isfinite(query->epoch.julian_year) || !(fabs(bst_vec3_norm(centre) - 1.0) < 1e-6) ||
        capacity < 0 || (!out && capacity > 0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "star query: radius %g rad (0 to pi), limit V %g, year %g, |centre| %g "
                        "(1), room for %d stars",
                        radius_rad, query->v_limit, query->epoch.julian_year, bst_vec3_norm(centre),
                        capacity);
    }
    star_search q = {
        .stars = stars, .query = query, .box_drift = -1.0, .out = out, .capacity = capacity};
    bst_star_observer_at(&stars->view, &query->epoch, &q.observer);
    double chord = 2.0 * sin(radius_rad / 2.0);
    /* rounding must not exclude the antipode */
    q.chord2 = radius_rad >= BST_PI - 1e-9 ? 5.0 : chord * chord;
    /* displaced stars and those with a parallax may come from outside */
    q.slack = stars->altered && stars->errors.position_error_fraction > 0.0
                  ? MOST_SIGMAS * stars->errors.position_error_sigma_arcsec * BST_ARCSEC_RAD
                  : 0.0;
    q.slack += q.observer.at_barycentre ? 0.0 : MOST_PARALLAX_RAD;
    q.faintest = faintest_record(query->v_limit);
    const bst_cell_cone cone = {centre, radius_rad + q.slack, fabs(q.observer.years), q.faintest};
    bst_cell_search search;
    bst_cell_search_begin(stars->index, &cone, &search);
    uint32_t cells[4 * BST_CELL_BRANCHES], cell_count;
    while ((cell_count = bst_cell_search_next(&search, cells, 4 * BST_CELL_BRANCHES)) > 0) {
        search_cells(&q, cells, cell_count);
    }
    *count = q.found;
    return BST_OK;
}

bst_status bst_stars_query(bst_ctx *ctx, const bst_stars *stars, bst_vec3 centre, double radius_rad,
                           double v_limit, double julian_year, bst_star *out, int capacity,
                           int *count) {
    const bst_star_query query = {centre, radius_rad, v_limit, {.julian_year = julian_year}};
    return bst_stars_query_seen(ctx, stars, &query, out, capacity, count);
}

double bst_stars_year_after(const bst_stars *stars, double julian_year, double seconds) {
    const bool in_time = stars->view.has_parallax || stars->view.variable_count > 0;
    return in_time ? julian_year + seconds / (BST_DAY_S * 365.25) : julian_year;
}

/* Record of a star; NULL: not in the catalogue. */
static const bst_star_record *find_record(const bst_star_view *view, uint32_t id) {
    if (id >= BST_STAR_TABLE_ID) {
        uint64_t index = (uint64_t)(id - BST_STAR_TABLE_ID) + view->tycho2_count;
        return id - BST_STAR_TABLE_ID < BST_STAR_TABLE_IDS && index < view->header->star_count
                   ? &view->records[index]
                   : NULL;
    }
    if (id >> 16 >= BST_STAR_CELLS) {
        return NULL;
    }
    const bst_star_cell *cell = &view->cells[id >> 16];
    for (uint32_t i = 0; i < cell->count; i++) {
        if ((view->records[cell->first + i].tyc_vt & 0xFFFFu) == (id & 0xFFFFu)) {
            return &view->records[cell->first + i];
        }
    }
    return NULL;
}

bst_status bst_stars_find_seen(bst_ctx *ctx, const bst_stars *stars, uint32_t id,
                               const bst_star_epoch *epoch, bst_star *out) {
    const bst_star_record *r = isfinite(epoch->julian_year) ? find_record(&stars->view, id) : NULL;
    if (r) {
        bst_star_observer observer;
        bst_star_observer_at(&stars->view, epoch, &observer);
        bst_vec3 direction = bst_star_record_seen(r, &observer);
        if (!stars->altered || alter(stars, id, &direction)) {
            (void)unpack(&stars->view, r, id, direction, &observer, out);
            return BST_OK;
        }
    }
    if (id >= BST_STAR_TABLE_ID) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "star %" PRIu32 " is not in the catalogue", id);
    }
    unsigned tyc1, tyc2, tyc3;
    bst_star_id_split(id, &tyc1, &tyc2, &tyc3);
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "star TYC %u-%u-%u is not in the catalogue", tyc1, tyc2,
                    tyc3);
}

bst_status bst_stars_find(bst_ctx *ctx, const bst_stars *stars, uint32_t id, double julian_year,
                          bst_star *out) {
    const bst_star_epoch epoch = {.julian_year = julian_year};
    return bst_stars_find_seen(ctx, stars, id, &epoch, out);
}

int64_t bst_stars_source(const bst_stars *stars, uint32_t id) {
    const bst_star_view *view = &stars->view;
    int64_t source = 0;
    if (id >= BST_STAR_TABLE_ID && view->sources && find_record(view, id)) {
        memcpy(&source, view->sources + (size_t)(id - BST_STAR_TABLE_ID) * sizeof source,
               sizeof source);
    }
    return source;
}

void bst_stars_change(const bst_stars *stars, uint32_t id, bst_star_change *out) {
    const bst_star_view *view = &stars->view;
    const bst_star_record *r = find_record(view, id);
    *out = (bst_star_change){.parallax_mas = r ? bst_star_record_parallax_mas(r) : 0.0};
    const bst_star_variable *v = r && r->pm_dec_flags & BST_STAR_VARIABLE
                                     ? bst_star_variable_of(view, (uint32_t)(r - view->records))
                                     : NULL;
    if (!v) {
        return;
    }
    double range = v->point_count > 0 ? 0.0 : (double)v->amplitude_mag;
    for (uint32_t i = 0; i < v->point_count; i++) {
        range = fmax(range, (double)view->points[v->first_point + i].mag);
    }
    out->varies = true;
    out->brightest_v_mag = bst_star_record_v(r) / 1e5;
    out->faintest_v_mag = out->brightest_v_mag + range;
    out->period_d = v->period_d;
    out->epoch_jd = v->epoch_jd;
    out->points = (int)v->point_count;
}
