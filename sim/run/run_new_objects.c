#include "sim/run/run_new_objects.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_OBJECTS = 1 << 16 };
/* Chi-square of 6 degrees of freedom that errors as stated exceed with probability 2e-5, times 9
 * for errors three times as large. */
#define MOST_CHI2 (9.0 * 31.6)
/* Orbits farther apart than this are those of two objects, m. */
#define REACH_M 1e5
#define MOST_SIGMA_M 5000.0

static bst_status make_room(bst_ctx *ctx, bst_run_new_objects *n, int count) {
    if (count > n->room) {
        const int room = count > 2 * n->room ? count : 2 * n->room;
        bst_run_new_object *items = realloc(n->items, (size_t)room * sizeof *items);
        if (!items) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d new objects", room);
        }
        n->items = items;
        n->room = room;
    }
    return BST_OK;
}

bst_status bst_run_new_objects_add(bst_ctx *ctx, bst_run_new_objects *n,
                                   const bst_run_new_object *object) {
    if (n->count == MOST_OBJECTS) {
        return BST_OK;
    }
    BST_TRY(make_room(ctx, n, n->count + 1));
    bst_run_new_object *own = &n->items[n->count++];
    memcpy(own, object, sizeof *own); /* all bytes are in a saved state */
    own->noise_m_per_day = bst_custody_drag_noise_m_per_day(&own->orbit);
    return BST_OK;
}

void bst_run_new_objects_clear(bst_run_new_objects *n) {
    free(n->items);
    *n = (bst_run_new_objects){.count = 0};
}

void bst_run_new_object_advance(bst_run_new_object *o, double time_s) {
    const bst_custody_config config = {.noise_m_per_day = o->noise_m_per_day};
    bst_custody_add_process_noise(&config, time_s, &o->filter);
}

bool bst_run_new_object_is(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                           const bst_custody_orbit *other, const bst_custody_filter *other_filter,
                           double time_s) {
    bst_vec3 r, v, place, unused;
    bst_custody_filter own, theirs;
    double sigma_m[2];
    if (!bst_custody_state(orbit, filter->x, time_s, &r, &v) ||
        !bst_custody_state(other, other_filter->x, time_s, &place, &unused) ||
        !(bst_vec3_norm(bst_vec3_sub(place, r)) < REACH_M) ||
        !bst_custody_predict_position(orbit, filter, time_s, &unused, &sigma_m[0]) ||
        !bst_custody_predict_position(other, other_filter, time_s, &unused, &sigma_m[1]) ||
        !(hypot(sigma_m[0], sigma_m[1]) < MOST_SIGMA_M) ||
        !bst_custody_difference(orbit, filter, time_s, r, v, &own) ||
        !bst_custody_difference(other, other_filter, time_s, r, v, &theirs)) {
        return false;
    }
    for (int i = 0; i < BST_CUSTODY_STATE; i++) {
        theirs.x[i] -= own.x[i];
        for (int k = 0; k < BST_CUSTODY_STATE; k++) {
            theirs.p[i][k] += own.p[i][k];
        }
    }
    return bst_custody_nees(&theirs) < MOST_CHI2;
}

bool bst_run_new_object_carry(const bst_custody_orbit *from, const bst_custody_filter *filter,
                              const bst_custody_orbit *to, double time_s, bst_custody_filter *out) {
    enum { N = BST_CUSTODY_STATE, A = BST_CUSTODY_ALONG, D = BST_CUSTODY_DRIFT };
    const double none[N] = {0.0}, days = time_s / BST_DAY_S;
    bst_vec3 r, v;
    if (!bst_custody_state(to, none, time_s, &r, &v) ||
        !bst_custody_difference(from, filter, time_s, r, v, out)) {
        return false;
    }
    /* ALONG at time 0 */
    out->x[A] -= days * out->x[D];
    for (int k = 0; k < N; k++) {
        out->p[A][k] -= days * out->p[D][k];
    }
    for (int k = 0; k < N; k++) {
        out->p[k][A] -= days * out->p[k][D];
    }
    out->noise_until_s = filter->noise_until_s;
    return true;
}

/* Position at `time_s` against the truth: standard deviation, error, and NEES of the osculating
 * elements; NAN where there is none. */
static void score_object(bst_run_new_object *o, const bst_world *world, double time_s,
                         double *sigma_m, double *error_m, double *nees) {
    const double none[BST_CUSTODY_STATE] = {0.0};
    double offset_s;
    bst_ctx quiet = {0};
    bst_vec3 place, r, v;
    bst_custody_orbit truth;
    bst_custody_filter difference;
    bst_run_new_object_advance(o, time_s);
    *error_m = *nees = NAN;
    const bst_elements *elements =
        o->true_object >= 0 ? bst_world_elements(world, (int)o->true_object, &offset_s) : NULL;
    if (!bst_custody_predict_position(&o->orbit, &o->filter, time_s, &place, sigma_m)) {
        *sigma_m = NAN;
    } else if (elements &&
               bst_custody_orbit_init(&quiet, elements, offset_s, 0.0, &truth) == BST_OK &&
               bst_custody_state(&truth, none, time_s, &r, &v)) {
        *error_m = bst_vec3_norm(bst_vec3_sub(place, r));
        if (bst_custody_difference(&o->orbit, &o->filter, time_s, r, v, &difference)) {
            *nees = bst_custody_nees(&difference);
        }
    }
}

/* Whether a new object is of tracks of different objects or of none, of a catalogued one, or a
 * second one of its object. */
static bool is_wrong(const bst_run_new_objects *n, const bst_custody_orbit *catalogue, int index) {
    const int64_t object = n->items[index].true_object;
    bool wrong = object < 0 || catalogue[object].a_m > 0.0;
    for (int i = 0; i < index && !wrong; i++) {
        wrong = n->items[i].true_object == object;
    }
    return wrong;
}

bst_status bst_run_new_objects_finish(bst_ctx *ctx, bst_run_new_objects *n, const bst_world *world,
                                      const bst_custody_orbit *catalogue, bst_io_table *table,
                                      double end_s, bst_run_new_figures *out) {
    double *sigmas = calloc((size_t)n->count + 1, sizeof *sigmas), nees_sum = 0.0;
    int known = 0, nees_count = 0;
    bst_status status =
        sigmas ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d objects", n->count);
    *out = (bst_run_new_figures){.wrong = 0};
    for (int i = 0; i < n->count && status == BST_OK; i++) {
        bst_run_new_object *o = &n->items[i];
        double sigma, error, nees;
        char name[32];
        score_object(o, world, end_s, &sigma, &error, &nees);
        out->wrong += is_wrong(n, catalogue, i);
        nees_sum += isnan(nees) ? 0.0 : nees;
        nees_count += !isnan(nees);
        if (!isnan(sigma)) {
            sigmas[known++] = sigma;
        }
        (void)snprintf(name, sizeof name, "new %d", i + 1);
        const bst_custody_row row = {-1, o->true_object, name, 0, sigma, error, nees};
        status = table ? bst_run_custody_add_object(ctx, table, &row, &o->score, end_s) : BST_OK;
    }
    out->sigma_median_m = sigmas ? bst_custody_quantile(sigmas, known, 0.5) : NAN;
    out->nees_mean = nees_count > 0 ? nees_sum / nees_count : NAN;
    free(sigmas);
    return status;
}

/* Whether a restored object has an orbit and times that a run may have. */
static bool is_possible(const bst_run_new_object *o) {
    const double e = o->orbit.elements.eccentricity;
    return fabs(o->orbit.epoch_offset_s) <= BST_OD_LONGEST_S && o->orbit.a_m > 0.0 && e >= 0.0 &&
           e < 1.0 && isfinite(o->filter.noise_until_s) && isfinite(o->score.last_s);
}

bst_status bst_run_new_objects_archive(bst_run_new_objects *n, int world_objects,
                                       bst_archive *archive) {
    n->count = bst_archive_count(archive, n->count, MOST_OBJECTS);
    BST_TRY(make_room(bst_archive_ctx(archive), n, n->count));
    for (int i = 0; i < n->count; i++) {
        bst_run_new_object *o = &n->items[i];
        BST_ARCHIVE(archive, *o);
        if (!is_possible(o)) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state has new object %d on no ellipse (semi-major axis %g "
                            "m, eccentricity %g), or with times that no run has (elements %g s "
                            "before the epoch, allowed are %g; noise until %g s, updated at %g s)",
                            i + 1, o->orbit.a_m, o->orbit.elements.eccentricity,
                            o->orbit.epoch_offset_s, BST_OD_LONGEST_S, o->filter.noise_until_s,
                            o->score.last_s);
        }
        o->true_object = bst_archive_integer(archive, o->true_object, -1, world_objects - 1);
    }
    return BST_OK;
}
