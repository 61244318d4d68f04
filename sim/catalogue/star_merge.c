#include "sim/catalogue/star_merge.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/catalogue/bright_stars.h"
#include "sim/catalogue/star_curves.h"
#include "sim/catalogue/star_list.h"
#include "sim/catalogue/stars.h"
#include "sim/catalogue/variable_stars.h"

enum { ROWS_PER_PROGRESS = 20000, NEIGHBOURS = 64 };

/* largest distance and difference in V of one star in two catalogues */
static const double SAME_RAD = 1.5 * BST_ARCSEC_RAD, SAME_MAG = 1.5;
/* the base is searched for stars up to this V: Tycho-2 ends there, with errors of half a mag */
static const double FAINTEST_TYCHO2 = 15.5;
/* mean epoch of Tycho-2's observed positions */
static const double OBSERVED_YEAR = 1991.5;
/* magnitudes have this colour if the table has none, as Tycho-2's rows do */
static const int USUAL_COLOUR_MMAG = 700;

/* The star of the table that a star of the base is; distance INFINITY: none. */
typedef struct same_star {
    size_t entry;
    double distance_rad;
} same_star;

typedef struct merge {
    const bst_star_merge_request *request;
    bst_stars *base; /* NULL: none */
    bst_star_list list;
    size_t base_count; /* first entries of the list, in the order of the base's records */
    same_star *same;   /* of each star of the base */
    bst_star_curves curves;
} merge;

/* The table's V of a star less its brightest one. */
static double table_mag(const merge *m, const bst_star_entry *star) {
    return star->variable > 0 ? (double)m->list.variables[star->variable - 1].table_mag : 0.0;
}

/* V of a star as its table has it, variable or not. */
static double table_v(const merge *m, const bst_star_entry *star) {
    return bst_star_record_v(&star->record) / 1e5 + table_mag(m, star);
}

/* Sets V of a record; its colour stays. */
static void set_v(bst_star_record *r, double v_mag) {
    int colour = (int)(r->pm_ra_colour & 0x3FFFu) - BST_STAR_COLOUR_OFFSET;
    long vt = lround(1000.0 * v_mag + 0.090 * colour) + BST_STAR_VT_OFFSET;
    r->tyc_vt = (r->tyc_vt & 0xFFFFu) | (uint32_t)(vt < 0 ? 0 : vt > 0xFFFF ? 0xFFFF : vt) << 16;
}

/* ---------------------------------------------------------------- the base */

/* Copies the base's stars to the list. */
static bst_status take_base(bst_ctx *ctx, merge *m) {
    const bst_star_view *view = bst_stars_records(m->base);
    for (uint32_t c = 0; c < view->header->cell_count; c++) {
        for (uint32_t i = 0; i < view->cells[c].count; i++) {
            BST_TRY(bst_star_list_add(ctx, &m->list, &view->records[view->cells[c].first + i], c));
        }
    }
    m->base_count = m->list.count;
    for (uint32_t i = 0; i < view->variable_count; i++) {
        const bst_star_variable *v = &view->variables[i];
        BST_TRY(bst_star_list_add_variable(ctx, &m->list, v, view->points + v->first_point,
                                           &m->list.stars[v->star].variable));
    }
    for (size_t i = view->tycho2_count; i < m->base_count; i++) {
        m->list.stars[i].source =
            bst_stars_source(m->base, BST_STAR_TABLE_ID + (uint32_t)(i - view->tycho2_count));
    }
    m->same = malloc(m->base_count * sizeof *m->same);
    if (!m->same) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu stars", m->base_count);
    }
    for (size_t i = 0; i < m->base_count; i++) {
        m->same[i] = (same_star){0, INFINITY};
    }
    return BST_OK;
}

/* Record of a star that a query of the base has found, `years` after J2000: the nearest one with
 * its identity. */
static size_t base_record(const merge *m, const bst_star *star, double years) {
    const bst_star_view *view = bst_stars_records(m->base);
    if (star->id >= BST_STAR_TABLE_ID) {
        return star->id - BST_STAR_TABLE_ID + view->tycho2_count;
    }
    const bst_star_cell *cell = &view->cells[star->id >> 16];
    size_t best = cell->first;
    double nearest = INFINITY;
    for (uint32_t i = 0; i < cell->count; i++) {
        const bst_star_record *r = &view->records[cell->first + i];
        bst_vec3 d = bst_vec3_sub(bst_star_record_direction(r, years), star->icrs);
        if ((r->tyc_vt & 0xFFFFu) == (star->id & 0xFFFFu) && bst_vec3_dot(d, d) < nearest) {
            nearest = bst_vec3_dot(d, d);
            best = cell->first + i;
        }
    }
    return best;
}

/* Stars of the base that an entry may be. */
typedef struct candidates {
    size_t record[2 * NEIGHBOURS];
    double distance_rad[2 * NEIGHBOURS];
    int count;
} candidates;

/* Adds the stars of the base that are near a direction in a year; only those without motion if
 * `at_rest`. */
static bst_status search(bst_ctx *ctx, const merge *m, bst_vec3 at, double year, double v,
                         bool at_rest, candidates *out) {
    bst_star found[NEIGHBOURS];
    int count;
    /* variable stars are compared by the V of their table, whatever they have in that year */
    const bool vary = bst_stars_records(m->base)->variable_count > 0;
    BST_TRY(bst_stars_query(ctx, m->base, at, SAME_RAD, vary ? INFINITY : v + SAME_MAG, year, found,
                            NEIGHBOURS, &count));
    for (int i = 0; i < count && i < NEIGHBOURS; i++) {
        size_t r = base_record(m, &found[i], year - BST_STAR_EPOCH_YEAR);
        const bst_star_record *base = &m->list.stars[r].record;
        bool rests = (base->pm_ra_colour | base->pm_dec_flags) >> 14 == 0;
        double base_v = vary ? table_v(m, &m->list.stars[r]) : (double)found[i].v_mag;
        if (fabs(base_v - v) <= SAME_MAG && (!at_rest || rests)) {
            out->record[out->count] = r;
            out->distance_rad[out->count++] = bst_vec3_norm(bst_vec3_sub(found[i].icrs, at));
        }
    }
    return BST_OK;
}

/* Finds the stars of the base that an entry may be. */
static bst_status find_candidates(bst_ctx *ctx, const merge *m, const bst_star_entry *star,
                                  candidates *out) {
    const double v = table_v(m, star);
    out->count = 0;
    if (v > FAINTEST_TYCHO2 && !bst_stars_records(m->base)->sources) {
        return BST_OK;
    }
    bst_vec3 now = bst_star_record_direction(&star->record, 0.0);
    if (star->rest_year > 0.0F) { /* compared where the base's stars were then */
        return search(ctx, m, now, (double)star->rest_year, v, false, out);
    }
    BST_TRY(search(ctx, m, now, BST_STAR_EPOCH_YEAR, v, false, out));
    bst_vec3 then = bst_star_record_direction(&star->record, OBSERVED_YEAR - BST_STAR_EPOCH_YEAR);
    return bst_vec3_norm(bst_vec3_sub(now, then)) > 0.1 * SAME_RAD
               ? search(ctx, m, then, BST_STAR_EPOCH_YEAR, v, true, out)
               : BST_OK;
}

/* Gives an entry the nearest star of the base to which no other is nearer; one that loses its star
 * looks for another. Distances only fall, so it ends. */
static bst_status match(bst_ctx *ctx, merge *m, size_t entry) {
    for (bool looks = true; looks;) {
        candidates c;
        BST_TRY(find_candidates(ctx, m, &m->list.stars[entry], &c));
        int best = -1;
        for (int i = 0; i < c.count; i++) {
            if (c.distance_rad[i] < m->same[c.record[i]].distance_rad &&
                (best < 0 || c.distance_rad[i] < c.distance_rad[best])) {
                best = i;
            }
        }
        looks = false;
        if (best >= 0) {
            same_star *same = &m->same[c.record[best]];
            const same_star loser = *same;
            *same = (same_star){entry, c.distance_rad[best]};
            looks = loser.distance_rad < INFINITY;
            entry = loser.entry;
        }
    }
    return BST_OK;
}

/* ---------------------------------------------------------------- the table */

/* Adds the variability of a row to the list.
 *
 * Returned:  *index  for bst_star_entry.variable; 0: it is not variable */
static bst_status add_variability(bst_ctx *ctx, merge *m, const bst_star_table_row *row,
                                  uint32_t *index) {
    int count = 0;
    const bst_star_curve_row *curve =
        row->source != 0 ? bst_star_curves_of(&m->curves, row->source, &count) : NULL;
    bst_star_variable v = {.period_d = row->period_d, .epoch_jd = row->maximum_jd};
    *index = 0;
    if (!curve) {
        v.amplitude_mag = (float)row->amplitude_mag;
        v.table_mag = 0.5F * v.amplitude_mag;
        return row->period_d > 0.0 && row->amplitude_mag > 0.0
                   ? bst_star_list_add_variable(ctx, &m->list, &v, NULL, index)
                   : BST_OK;
    }
    m->curves.rows[curve - m->curves.rows].used = true;
    if (!m->curves.by_phase) {
        v.period_d = 0.0;
        v.epoch_jd = curve->time;
    } else if (!(v.period_d > 0.0)) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "source_id %lld has a light curve by phase and no period (allowed: a "
                        "column %s, or a light curve by time_jd)",
                        (long long)row->source, "period_d");
    }
    double brightest = INFINITY;
    for (int i = 0; i < count; i++) {
        brightest = fmin(brightest, curve[i].mag);
    }
    bst_star_point *points = malloc((size_t)count * sizeof *points);
    if (!points) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a light curve");
    }
    for (int i = 0; i < count; i++) {
        double begin = m->curves.by_phase ? 0.0 : v.epoch_jd;
        points[i] =
            (bst_star_point){(float)(curve[i].time - begin), (float)(curve[i].mag - brightest)};
    }
    v.table_mag = (float)-brightest;
    v.point_count = (uint32_t)count;
    bst_status status = bst_star_list_add_variable(ctx, &m->list, &v, points, index);
    free(points);
    return status;
}

/* Adds a row to the list. */
static bst_status add_row(bst_ctx *ctx, merge *m, const bst_star_table_row *row) {
    bst_star_values v = {.ra_rad = row->ra_deg * BST_DEG_RAD,
                         .dec_rad = row->dec_deg * BST_DEG_RAD,
                         .pm_ra_cosdec = (int)lround(10.0 * row->pm_ra_cosdec_masyr),
                         .pm_dec = (int)lround(10.0 * row->pm_dec_masyr),
                         .has_colour = isfinite(row->b_minus_v)};
    v.colour_mmag = v.has_colour ? (int)lround(1000.0 / 0.850 * row->b_minus_v) : USUAL_COLOUR_MMAG;
    uint32_t variable;
    BST_TRY(add_variability(ctx, m, row, &variable));
    const bst_star_entry none = {.variable = variable};
    const double brightest = row->v_mag - table_mag(m, &none);
    v.vt_mmag = (int)lround(1000.0 * brightest + 0.090 * v.colour_mmag);
    if (row->has_motion) {
        bst_star_move_epoch(&v, BST_STAR_EPOCH_YEAR - row->epoch_year);
    }
    bst_star_record record;
    BST_TRY(bst_star_pack(ctx, &v, &record));
    bst_star_record_set_parallax(&record, row->parallax_mas);
    BST_TRY(bst_star_list_add(ctx, &m->list, &record, BST_STAR_CELLS));
    bst_star_entry *added = &m->list.stars[m->list.count - 1];
    added->source = row->source;
    added->variable = variable;
    added->rest_year = row->has_motion ? 0.0F : (float)row->epoch_year;
    return BST_OK;
}

static bst_status read_table(bst_ctx *ctx, merge *m, bst_star_table *table,
                             bst_star_merge_counts *counts) {
    const bst_star_merge_request *q = m->request;
    for (bool end = false; !end;) {
        bst_star_table_row row;
        BST_TRY(bst_star_table_next(ctx, table, &row, &end));
        bst_star_table_counts(table, &counts->rows, &counts->skipped);
        if (!end) {
            counts->at_rest += !row.has_motion;
            bst_status status = add_row(ctx, m, &row);
            if (status == BST_OK && m->base) {
                status = match(ctx, m, m->list.count - 1);
            }
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s: row %lld", q->table,
                                       (long long)counts->rows);
            }
        }
        if (q->progress && (end || counts->rows % ROWS_PER_PROGRESS == 0)) {
            q->progress(q->progress_user, "importing", counts->rows, end ? counts->rows : 0);
        }
    }
    return BST_OK;
}

/* What the table says of a star of the base, of which *from is the row. */
static bst_star_entry united(const merge *m, const bst_star_entry *from, const bst_star_entry *to) {
    bst_star_record r = from->record;
    const uint32_t identity = to->record.tyc_vt & 0xFFFFu;
    double v = table_v(m, from);
    if (table_v(m, to) < BST_BRIGHT_STARS_V) { /* place and magnitudes stay the base's */
        r = to->record;
        v = table_v(m, to);
    } else if (r.pm_dec_flags & BST_STAR_NO_COLOUR) { /* the base's colour, with the table's V */
        r.pm_ra_colour = (r.pm_ra_colour & ~0x3FFFu) | (to->record.pm_ra_colour & 0x3FFFu);
        r.pm_dec_flags =
            (r.pm_dec_flags & ~BST_STAR_NO_COLOUR) | (to->record.pm_dec_flags & BST_STAR_NO_COLOUR);
    }
    r.tyc_vt = (r.tyc_vt & 0xFFFF0000u) | identity;
    if (from->rest_year > 0.0F) { /* place and motion stay the base's */
        r.ra = to->record.ra;
        r.dec = to->record.dec;
        r.pm_ra_colour = (r.pm_ra_colour & 0x3FFFu) | (to->record.pm_ra_colour & ~0x3FFFu);
        r.pm_dec_flags = (r.pm_dec_flags & 0x3FFFu) | (to->record.pm_dec_flags & ~0x3FFFu);
    }
    const bst_star_record *measured =
        from->record.pm_dec_flags & BST_STAR_PARALLAX_BITS ? &from->record : &to->record;
    r.pm_dec_flags = (r.pm_dec_flags & ~BST_STAR_PARALLAX_BITS) |
                     (measured->pm_dec_flags & BST_STAR_PARALLAX_BITS);
    const int64_t source = from->source != 0 ? from->source : to->source;
    bst_star_entry out = {r, to->cell, from->variable > 0 ? from->variable : to->variable, 0.0F,
                          to->cell < BST_STAR_CELLS ? 0 : source};
    if (fabs(table_v(m, &out) - v) > 1e-9) {
        set_v(&out.record, v - table_mag(m, &out));
    }
    return out;
}

/* Gives the base's stars what the table says of them, and takes those rows out of the list. */
static void unite(merge *m, bst_star_merge_counts *counts) {
    bst_star_entry *stars = m->list.stars;
    enum { TAKEN = UINT32_MAX };
    for (size_t i = 0; i < m->base_count; i++) {
        if (m->same[i].distance_rad < INFINITY) {
            bst_star_entry *from = &stars[m->same[i].entry];
            stars[i] = united(m, from, &stars[i]);
            from->cell = TAKEN;
            counts->same++;
        }
    }
    size_t kept = m->base_count;
    for (size_t i = m->base_count; i < m->list.count; i++) {
        if (stars[i].cell != TAKEN) {
            stars[kept++] = stars[i];
        }
    }
    m->list.count = kept;
    for (size_t i = 0; i < kept; i++) {
        counts->parallaxes += (stars[i].record.pm_dec_flags & BST_STAR_PARALLAX_BITS) != 0;
        counts->variables += stars[i].variable > 0;
    }
}

/* Number of stars whose light curve no row of the table has. */
static int64_t count_unused(const bst_star_curves *c) {
    int64_t stars = 0;
    for (int i = 0; i < c->count; i++) {
        bool first = i == 0 || c->rows[i].source != c->rows[i - 1].source;
        stars += first && !c->rows[i].used;
    }
    return stars;
}

/* ---------------------------------------------------------------- the catalogue */

/* Completeness of the base, as far as its stars reach, and that of the table. */
static bst_status make_head(bst_ctx *ctx, const merge *m, bst_star_head *head) {
    const bst_star_merge_request *q = m->request;
    *head = (bst_star_head){.complete_to_v_mag = BST_STAR_BRIGHTER_THAN_ALL};
    snprintf(head->source, sizeof head->source, "a table");
    if (m->base) {
        const bst_star_view *view = bst_stars_records(m->base);
        snprintf(head->source, sizeof head->source, "%s",
                 view->tycho2_count > 0 ? "Tycho-2 and a table" : "tables");
        /* patches of Tycho-2 alone say which of its stars are there, not that all stars are */
        const double most = view->sources ? INFINITY : BST_STAR_TYCHO2_COMPLETE_V;
        head->complete_to_v_mag = fmin(view->header->complete_to_v_mag, most);
        head->patch_count = (int)view->header->patch_count;
        for (int i = 0; i < head->patch_count; i++) {
            head->patches[i] = view->patches[i];
            head->patches[i].v_mag = fmin(head->patches[i].v_mag, most);
        }
    }
    if (isnan(q->complete_to_v_mag)) {
        return BST_OK;
    }
    if (!q->has_cone) {
        head->complete_to_v_mag = fmax(head->complete_to_v_mag, q->complete_to_v_mag);
        return BST_OK;
    }
    if (head->patch_count == (int)BST_STAR_PATCHES_MAX) {
        return bst_fail(ctx, BST_ERR_RANGE, "the base catalogue has %u cones already, no more fit",
                        BST_STAR_PATCHES_MAX);
    }
    head->patches[head->patch_count] = q->cone;
    head->patches[head->patch_count++].v_mag = q->complete_to_v_mag;
    return BST_OK;
}

static bst_status write_stars(bst_ctx *ctx, merge *m) {
    bst_star_head head;
    BST_TRY(make_head(ctx, m, &head));
    /* stars of Tycho-2 come first */
    size_t tycho2 = m->base ? bst_stars_records(m->base)->tycho2_count : 0;
    BST_TRY(bst_star_list_divide(ctx, &m->list, tycho2));
    if (m->list.count - tycho2 > BST_STAR_TABLE_IDS) {
        return bst_fail(ctx, BST_ERR_RANGE, "%zu stars are more than a catalogue holds (%u)",
                        m->list.count - tycho2, BST_STAR_TABLE_IDS);
    }
    return bst_star_list_write(ctx, &m->list, &head, m->request->out);
}

bst_status bst_star_merge(bst_ctx *ctx, const bst_star_merge_request *request,
                          bst_star_merge_counts *counts) {
    merge m = {.request = request};
    bst_star_table *table = NULL;
    *counts = (bst_star_merge_counts){0};
    bst_status status = bst_star_table_open(ctx, request->table, &request->options, &table);
    if (status == BST_OK && request->base) {
        status = bst_stars_open(ctx, request->base, &m.base);
        if (status == BST_OK) {
            status = take_base(ctx, &m);
        }
        counts->base = (int64_t)m.base_count;
    }
    if (status == BST_OK && request->curves) {
        status = bst_star_curves_read(ctx, request->curves, &m.curves);
    }
    if (status == BST_OK) {
        status = read_table(ctx, &m, table, counts);
    }
    if (status == BST_OK) {
        unite(&m, counts);
        status = write_stars(ctx, &m);
        counts->written = (int64_t)m.list.count;
        counts->curves_left = count_unused(&m.curves);
    }
    bst_star_table_close(table);
    bst_stars_close(m.base);
    free(m.same);
    bst_star_list_free(&m.list);
    bst_star_curves_free(&m.curves);
    return status;
}
