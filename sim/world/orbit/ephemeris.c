#include "sim/world/orbit/ephemeris.h"

#include <assert.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/invariant.h"
#include "sim/core/parallel.h"
#include "sim/world/orbit/ephemeris_polynomial.h"
#include "sim/world/orbit/ephemeris_search.h"

/* the bodies form groups that compute their next knot at different times */
enum { SHARES = 16 };
/* Knots kept per body; a power of two. More than CHECKED: the next knots are computed one by one,
 * and short steps back in time are free. */
enum { RING = 16, ROTATIONS = 32 };
enum { STEP_CLASSES = 5, SHORTEST_STEP_S = 16 };

/* Safety factor of the error estimate: a jump of which a tenth difference shows only a thirtieth is
 * still detected. */
#define SAFETY 16.0
#define ROUNDING_M 20e-6
/* geocentric radius below which an SGP4 orbit has decayed; SGP4 itself decides */
#define DECAYED_M 6378136.0

/* Tables of the positions of all objects, on a grid of time. */
enum { TABLE_STEP_S = 8, TABLES = 32 };
/* error of a position in a table */
#define TABLE_ERROR_M 1000.0
#define TABLE_SPAN_S 60.0 /* validity of the speed limit in a table */
#define HIGHEST_SPEED_MPS 11500.0
/* Aberration and light time shift directions by less than 3 v / c, v < 45 km/s. */
#define SHIFT_RAD 5e-4
/* Minimum number of bodies for the thread pool, and bodies per task. */
enum { BODIES_FOR_THREADS = 1024, GRAIN = 256 };

typedef struct body {
    const bst_world_orbit *orbit; /* NULL: not interpolated */
    int step_class;
    int64_t first, last; /* first and last knot in the ring; last < first: none */
    double place_m[3][RING];
} body;

/* Rotations TEME to GCRF at the knots of one step size. */
typedef struct rotations {
    int64_t knot[ROTATIONS];
    bst_mat3 gcrf_from_teme[ROTATIONS]; /* NAN: no Earth orientation data */
} rotations;

typedef struct table {
    int64_t index; /* time / TABLE_STEP_S */
    bool valid;
    int users;    /* threads that read the table without the lock */
    int64_t used; /* time of its last use: count of requests */
    bst_ephemeris_rows rows;
} table;

struct bst_ephemeris {
    const bst_world *world;
    pthread_mutex_t lock; /* protects all members below */
    bst_parallel *pool;   /* NULL: none */
    bst_sky_clock *clock_knots,
        *clock_tables; /* two clocks: each caches the time around its last call */
    double limit_m;    /* upper limit of the estimated error */
    body *bodies;
    int body_count, object_count;
    int64_t knots_made; /* by readers, not for tables */
    rotations rotations[STEP_CLASSES];
    table tables[TABLES];
    int64_t requests, tables_made;
    char *table_memory;
};

/* Knot spacing in s of a step class of the object ephemeris. */
static double step_of(int step_class) {
    return (double)(SHORTEST_STEP_S << step_class);
}

/* Checks whether a discontinuity of SGP4's deep-space integrator lies within the polynomial of an
 * orbit. */
static bool spans_jump(const bst_world_orbit *orbit, double step, int64_t first) {
    double period = 60.0 * bst_sgp4_step_minutes(orbit->sgp4);
    if (!(period > 0.0)) {
        return false;
    }
    double from = orbit->epoch_offset_s + (double)(first + 1) * step;
    double jump = ceil(from / period) * period;
    jump = jump == 0.0 ? period : jump; /* no discontinuity at the epoch itself */
    return jump <= from + (POINTS - 1) * step;
}

/* ---- knots ---- */

/* Place of a knot in its ring. */
static int slot_of(int64_t knot, int slots) {
    return (int)((uint64_t)knot & (uint64_t)(slots - 1));
}

/* Rotation TEME to GCRF at a knot of the ephemeris, from the cache. */
static const bst_mat3 *rotation_at(bst_ephemeris *e, int step_class, int64_t knot) {
    rotations *r = &e->rotations[step_class];
    int slot = slot_of(knot, ROTATIONS);
    if (r->knot[slot] != knot) {
        bst_sky_rotation sky;
        bst_time t = bst_time_add(e->world->epoch, (double)knot * step_of(step_class));
        if (bst_sky_clock_at(NULL, e->clock_knots, t, &sky) != BST_OK) {
            sky.frames.gcrf_from_teme = (bst_mat3){{{NAN, NAN, NAN}}};
        }
        r->gcrf_from_teme[slot] = sky.frames.gcrf_from_teme;
        r->knot[slot] = knot;
    }
    return &r->gcrf_from_teme[slot];
}

/* SGP4 position (m, GCRF) of an orbit; NAN if decayed. */
static bst_vec3 place_at(const bst_world_orbit *orbit, const bst_mat3 *gcrf_from_teme,
                         double seconds) {
    double r_km[3], v_kmps[3];
    if (bst_sgp4_propagate(orbit->sgp4, (orbit->epoch_offset_s + seconds) / 60.0, r_km, v_kmps) !=
        BST_SGP4_OK) {
        return (bst_vec3){NAN, NAN, NAN};
    }
    return bst_vec3_scale(bst_mat3_mul_vec(gcrf_from_teme, (bst_vec3){r_km[0], r_km[1], r_km[2]}),
                          1000.0);
}

/* Knots that are propagated together: a knot is the same whichever others it is computed with. */
enum { KNOTS = 256 };
typedef struct knot_list {
    int count;
    const bst_sgp4 *sgp4[KNOTS];
    double minutes[KNOTS];
    body *of[KNOTS];
    int64_t knot[KNOTS];
} knot_list;

/* Computes the knots of a list and empties it. */
static void fill_knots(bst_ephemeris *e, knot_list *list) {
    bst_sgp4_state states[KNOTS];
    bst_sgp4_propagate_many(list->sgp4, list->minutes, list->count, states);
    for (int i = 0; i < list->count; i++) {
        body *b = list->of[i];
        const double *r = states[i].position_teme_km;
        bst_vec3 p = {NAN, NAN, NAN};
        if (states[i].error == BST_SGP4_OK) {
            p = bst_vec3_scale(bst_mat3_mul_vec(rotation_at(e, b->step_class, list->knot[i]),
                                                (bst_vec3){r[0], r[1], r[2]}),
                               1000.0);
        }
        int slot = slot_of(list->knot[i], RING);
        b->place_m[0][slot] = p.x;
        b->place_m[1][slot] = p.y;
        b->place_m[2][slot] = p.z;
    }
    list->count = 0;
}

/* Adds the missing ones of the knots first to last of a body to the list; they are in the ring once
 * the list has been filled. */
static void list_missing_knots(bst_ephemeris *e, body *b, int64_t first, int64_t last,
                               knot_list *list) {
    for (int64_t k = first; k <= last; k++) {
        if (k < b->first || k > b->last) {
            int i = list->count++;
            double seconds = (double)k * step_of(b->step_class);
            list->sgp4[i] = b->orbit->sgp4;
            list->minutes[i] = (b->orbit->epoch_offset_s + seconds) / 60.0;
            list->of[i] = b;
            list->knot[i] = k;
            if (list->count == KNOTS) {
                fill_knots(e, list);
            }
        }
    }
    if (first > b->last + 1 || last < b->first - 1) {
        b->first = first;
        b->last = last;
    } else if (last > b->last) {
        b->last = last;
        int64_t oldest = last - (RING - 1);
        b->first = oldest > b->first ? oldest : first < b->first ? first : b->first;
    } else {
        b->first = first;
        int64_t newest = first + (RING - 1);
        b->last = newest < b->last ? newest : b->last;
    }
}

static void make_knots(bst_ephemeris *e, body *b, int64_t first, int64_t last) {
    if (first < b->first || last > b->last) {
        knot_list list;
        list.count = 0;
        list_missing_knots(e, b, first, last, &list);
        fill_knots(e, &list);
    }
}

/* Reads the knots of a body's polynomial from the ring, and judges it. */
static void read_knots(bst_ephemeris *e, int index, int64_t first, bst_ephemeris_knots *out) {
    body *b = &e->bodies[index];
    *out = (bst_ephemeris_knots){.known = true, .body = index, .first = first};
    if (spans_jump(b->orbit, step_of(b->step_class), first)) {
        return;
    }
    pthread_mutex_lock(&e->lock);
    if (first < b->first || first + CHECKED - 1 > b->last) {
        int64_t low = first > b->first ? first : b->first;
        int64_t high = first + CHECKED - 1 < b->last ? first + CHECKED - 1 : b->last;
        e->knots_made += CHECKED - (high >= low ? high - low + 1 : 0);
    }
    make_knots(e, b, first, first + CHECKED - 1);
    for (int j = 0; j < CHECKED; j++) {
        int slot = slot_of(first + j, RING);
        for (int i = 0; i < 3; i++) {
            out->place_m[i][j] = b->place_m[i][slot];
        }
    }
    pthread_mutex_unlock(&e->lock);
    out->accurate = is_accurate(out->place_m, e->limit_m);
}

bool bst_ephemeris_at(bst_ephemeris *e, bst_ephemeris_reader *reader, int index, double seconds,
                      bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    assert(e && index >= 0 && index < e->body_count && position_m);
    const body *b = &e->bodies[index];
    if (!b->orbit || !(fabs(seconds) <= 1e9)) {
        return false;
    }
    double step = step_of(b->step_class), whole = floor(seconds / step);
    int64_t first = (int64_t)whole - BEFORE;
    bst_ephemeris_knots own, *knots = reader ? &reader->kept[index % BST_EPHEMERIS_KEPT] : &own;
    if (!reader || !knots->known || knots->body != index || knots->first != first) {
        read_knots(e, index, first, knots);
    }
    if (!knots->accurate) {
        return false;
    }
    double weight[POINTS], slope[POINTS], r[3] = {0}, v[3] = {0};
    lagrange(seconds / step - whole, weight, slope);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < POINTS; j++) {
            r[i] += weight[j] * knots->place_m[i][j + 1];
            v[i] += slope[j] * knots->place_m[i][j + 1];
        }
    }
    if (!(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] > DECAYED_M * DECAYED_M)) {
        return false;
    }
    *position_m = (bst_vec3){r[0], r[1], r[2]};
    *velocity_mps = (bst_vec3){v[0] / step, v[1] / step, v[2] / step};
    return true;
}

int64_t bst_ephemeris_knots_made(bst_ephemeris *e) {
    pthread_mutex_lock(&e->lock);
    int64_t made = e->knots_made;
    pthread_mutex_unlock(&e->lock);
    return made;
}

int64_t bst_ephemeris_tables_made(bst_ephemeris *e) {
    pthread_mutex_lock(&e->lock);
    int64_t made = e->tables_made;
    pthread_mutex_unlock(&e->lock);
    return made;
}

/* ---- tables ---- */

/* Data of a table that all bodies with the same step size share. */
typedef struct table_class {
    int64_t first;       /* first of the CHECKED knots */
    double late;         /* fraction of the current interval between knots */
    double weight[RING]; /* by ring slot; 0: the knot is not used */
    double slope[RING];  /* the same of the velocity, 1/s */
} table_class;

typedef struct table_job {
    bst_ephemeris *e;
    table *table;
    table_class classes[STEP_CLASSES];
    bst_mat3 gcrf_from_teme[3]; /* one grid step before, at and after the time of the table */
} table_job;

/* Computes the place of an object that cannot be interpolated. False: no orbit at that time. */
static bool place_directly(const table_job *job, const bst_world_orbit *orbit, double place[3]) {
    double seconds = (double)job->table->index * TABLE_STEP_S;
    bst_vec3 p = place_at(orbit, &job->gcrf_from_teme[1], seconds);
    bool none = isnan(p.x) &&
                isnan(place_at(orbit, &job->gcrf_from_teme[0], seconds - TABLE_STEP_S).x) &&
                isnan(place_at(orbit, &job->gcrf_from_teme[2], seconds + TABLE_STEP_S).x);
    place[0] = none ? 0.0 : p.x;
    place[1] = none ? 0.0 : p.y;
    place[2] = none ? 0.0 : p.z;
    return !none;
}

/* Interpolates a position without the knots of weight 0. These come from earlier requests, and
 * where the orbit has decayed at one of them, its NAN must not reach the result. */
static void sum_used_knots(const table_class *c, const body *b, double p[3]) {
    for (int j = 0; j < 3; j++) {
        p[j] = 0.0;
        for (int slot = 0; slot < RING; slot++) {
            p[j] += c->weight[slot] != 0.0 ? c->weight[slot] * b->place_m[j][slot] : 0.0;
        }
    }
}

/* Interpolates the objects' positions for the table; run in parallel. */
static void table_rows(void *user, int begin, int end) {
    const table_job *job = user;
    table *t = job->table;
    knot_list missing;
    missing.count = 0;
    for (int i = begin; i < end; i++) {
        body *b = &job->e->bodies[i];
        if (b->orbit) {
            const table_class *c = &job->classes[b->step_class];
            int ahead = c->late + (double)(i % SHARES) / SHARES >= 1.0;
            int64_t last = c->first + CHECKED - 1 + ahead;
            if (c->first < b->first || last > b->last) {
                list_missing_knots(job->e, b, c->first, last, &missing);
            }
        }
    }
    fill_knots(job->e, &missing);
    for (int i = begin; i < end; i++) {
        const body *b = &job->e->bodies[i];
        if (!b->orbit) {
            const double unknown[3] = {NAN, NAN, NAN};
            bst_ephemeris_rows_set(&t->rows, i, unknown, NULL, 0.0);
            continue;
        }
        const table_class *c = &job->classes[b->step_class];
        double p[3] = {0}, v[3] = {0};
        for (int slot = 0; slot < RING; slot++) {
            for (int j = 0; j < 3; j++) {
                p[j] += c->weight[slot] * b->place_m[j][slot];
                v[j] += c->slope[slot] * b->place_m[j][slot];
            }
        }
        if (isnan(p[0])) {
            sum_used_knots(c, b, p);
        }
        if (isnan(p[0]) && !place_directly(job, b->orbit, p)) {
            bst_ephemeris_rows_set(&t->rows, i, p, NULL, -INFINITY);
            continue;
        }
        /* at most the escape speed at the lowest radius that it can reach */
        double low = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) -
                     (TABLE_SPAN_S * HIGHEST_SPEED_MPS + TABLE_ERROR_M);
        double speed = 1.02 * sqrt(2.0 * BST_EARTH_MU_M3PS2 / fmax(low, 6.2e6));
        bst_ephemeris_rows_set(&t->rows, i, p, v, fmin(speed, HIGHEST_SPEED_MPS));
    }
}

/* The table of a time, NULL: it is not there. */
static table *find_table(bst_ephemeris *e, int64_t index) {
    for (int i = 0; i < TABLES; i++) {
        if (e->tables[i].valid && e->tables[i].index == index) {
            return &e->tables[i];
        }
    }
    return NULL;
}

/* Makes the table of all objects' positions at one time. */
static void make_table(bst_ephemeris *e, table *t, int64_t index) {
    table_job job = {.e = e, .table = t};
    double seconds = (double)index * TABLE_STEP_S;
    for (int c = 0; c < STEP_CLASSES; c++) {
        double step = step_of(c), whole = floor(seconds / step), weight[POINTS], slope[POINTS];
        table_class *out = &job.classes[c];
        out->first = (int64_t)whole - BEFORE;
        lagrange(seconds / step - whole, weight, slope);
        for (int j = 0; j < POINTS; j++) {
            out->weight[slot_of(out->first + 1 + j, RING)] = weight[j];
            out->slope[slot_of(out->first + 1 + j, RING)] = slope[j] / step;
        }
        out->late = seconds / step - whole;
        int ahead = out->late + (double)(SHARES - 1) / SHARES >= 1.0;
        for (int j = 0; j < CHECKED + ahead; j++) {
            (void)rotation_at(e, c, out->first + j); /* the worker threads only read rotations */
        }
    }
    for (int i = 0; i < 3; i++) {
        bst_sky_rotation sky;
        bst_time time = bst_time_add(e->world->epoch, seconds + (i - 1) * TABLE_STEP_S);
        if (bst_sky_clock_at(NULL, e->clock_tables, time, &sky) != BST_OK) {
            sky.frames.gcrf_from_teme = (bst_mat3){{{NAN, NAN, NAN}}};
        }
        job.gcrf_from_teme[i] = sky.frames.gcrf_from_teme;
    }
    /* the next consecutive table needs few new knots: one thread is faster */
    bst_parallel *pool = find_table(e, index - 1) ? NULL : e->pool;
    t->index = index;
    e->tables_made++;
    bst_parallel_for(pool, e->object_count, GRAIN, table_rows, &job);
    t->valid = true;
}

/* The table that was not used for the longest time and that no one reads; NULL: all are read. */
static table *oldest_table(bst_ephemeris *e) {
    table *oldest = NULL;
    for (int i = 0; i < TABLES; i++) {
        table *t = &e->tables[i];
        if (t->users == 0 && (!oldest || t->used < oldest->used)) {
            oldest = t;
        }
    }
    return oldest;
}

/* The table of positions at a time; computes it if it is missing. With the lock held. */
static table *table_at(bst_ephemeris *e, int64_t index) {
    table *t, *oldest;
    while (!(t = find_table(e, index))) {
        if ((oldest = oldest_table(e)) != NULL) {
            make_table(e, oldest, index);
        } else { /* another thread reads each of them; this is short */
            pthread_mutex_unlock(&e->lock);
            sched_yield();
            pthread_mutex_lock(&e->lock);
        }
    }
    t->used = ++e->requests;
    return t;
}

int bst_ephemeris_near(bst_ephemeris *e, double seconds, const bst_ephemeris_cone *cone,
                       int *indices) {
    assert(e && cone && indices && bst_is_unit_vec3(cone->axis, 1e-6));
    int count = 0;
    if (!(fabs(seconds) <= 1e9)) {
        for (int i = 0; i < e->object_count; i++) {
            indices[count++] = i;
        }
        return count;
    }
    int64_t index = llround(seconds / TABLE_STEP_S);
    double span = fabs(seconds - (double)index * TABLE_STEP_S) + cone->half_span_s + 1e-3;
    bst_ephemeris_search search = {
        .cone = *cone,
        .after_s = seconds - (double)index * TABLE_STEP_S,
        .error_m = TABLE_ERROR_M,
        .shift_rad = SHIFT_RAD,
        .least_mps = span < TABLE_SPAN_S ? 0.0f : (float)HIGHEST_SPEED_MPS};
    search.cone.half_span_s += 1e-3;
    pthread_mutex_lock(&e->lock);
    table *t = table_at(e, index);
    t->users++;
    pthread_mutex_unlock(&e->lock);
    count = bst_ephemeris_rows_near(&t->rows, e->object_count, &search, indices);
    pthread_mutex_lock(&e->lock);
    t->users--;
    pthread_mutex_unlock(&e->lock);
    return count;
}

static int64_t table_index(double seconds) {
    return llround(fmax(fmin(seconds, 1e9), -1e9) / TABLE_STEP_S);
}

double bst_ephemeris_places_time(double seconds) {
    return (double)table_index(seconds) * TABLE_STEP_S;
}

double bst_ephemeris_places(bst_ephemeris *e, double seconds, double *x_m, double *y_m,
                            double *z_m) {
    int64_t index = table_index(seconds);
    size_t bytes = (size_t)e->object_count * sizeof *x_m;
    pthread_mutex_lock(&e->lock);
    const table *t = table_at(e, index);
    memcpy(x_m, t->rows.x_m, bytes);
    memcpy(y_m, t->rows.y_m, bytes);
    memcpy(z_m, t->rows.z_m, bytes);
    pthread_mutex_unlock(&e->lock);
    return (double)index * TABLE_STEP_S;
}

/* ---- making it ---- */

/* The longest step between knots that is accurate at perigee, where the curvature is largest. */
static int choose_class(const bst_ephemeris *e, const bst_world_orbit *orbit) {
    double r_km[3], v_kmps[3];
    if (bst_sgp4_propagate(orbit->sgp4, orbit->epoch_offset_s / 60.0, r_km, v_kmps) !=
        BST_SGP4_OK) {
        return 0;
    }
    bst_vec3 r = {1e3 * r_km[0], 1e3 * r_km[1], 1e3 * r_km[2]};
    bst_vec3 v = {1e3 * v_kmps[0], 1e3 * v_kmps[1], 1e3 * v_kmps[2]};
    const double mu = BST_EARTH_MU_M3PS2;
    double a = 1.0 / (2.0 / bst_vec3_norm(r) - bst_vec3_dot(v, v) / mu);
    bst_vec3 h = bst_vec3_cross(r, v);
    double eccentricity = sqrt(fmax(1.0 - bst_vec3_dot(h, h) / (mu * a), 0.0));
    if (!(a > 0.0 && eccentricity < 1.0)) {
        return 0;
    }
    double rate = sqrt(mu / a) / a;
    int c = STEP_CLASSES - 1;
    /* limit the step also for perturbations at two and three times the orbital rate */
    while (c > 0 && !(rate * step_of(c) < 0.5 &&
                      a * perigee_error(eccentricity, rate * step_of(c)) < 0.05 * e->limit_m)) {
        c--;
    }
    return c;
}

/* Smallest pixel scale (rad) of all cameras of the world. */
static double sharpest_pixel(const bst_world *world) {
    double sharpest = INFINITY;
    for (int i = 0; i < world->observer_count; i++) {
        for (int k = 0; k < world->observers[i].sensor_count; k++) {
            sharpest =
                fmin(sharpest, bst_camera_scale_rad(&world->observers[i].sensors[k].config.camera));
        }
    }
    return sharpest;
}

static void set_body(const bst_ephemeris *e, const bst_world_orbit *orbit, body *b) {
    if (orbit->source == BST_ORBIT_SGP4 && orbit->burn_count == 0 && !orbit->external) {
        b->orbit = orbit;
        b->step_class = choose_class(e, orbit);
    }
    b->first = 0;
    b->last = -1;
}

bst_status bst_ephemeris_create(bst_ctx *ctx, const bst_world *world, bst_ephemeris **out) {
    *out = NULL;
    bst_ephemeris *e = calloc(1, sizeof *e);
    if (!e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an ephemeris");
    }
    pthread_mutex_init(&e->lock, NULL);
    e->world = world;
    e->object_count = world->object_count;
    e->body_count = world->object_count + world->observer_count;
    double tolerance = fmin(1e-3 * sharpest_pixel(world) * BST_EPHEMERIS_NEAREST_M, 1.0);
    e->limit_m = fmax(tolerance, ROUNDING_M) / SAFETY;
    const size_t table_bytes = (bst_ephemeris_rows_bytes(e->object_count) + 63) / 64 * 64;
    e->bodies = calloc((size_t)e->body_count + 1, sizeof *e->bodies);
    e->table_memory = calloc(TABLES, table_bytes);
    bst_status status =
        e->bodies && e->table_memory
            ? bst_sky_clock_create_on(ctx, world->sky_grid, &e->clock_knots)
            : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an ephemeris of %d", e->body_count);
    if (status == BST_OK) {
        status = bst_sky_clock_create_on(ctx, world->sky_grid, &e->clock_tables);
    }
    if (status != BST_OK) {
        bst_ephemeris_free(e);
        return status;
    }
    for (int i = 0; i < TABLES; i++) {
        e->tables[i].rows =
            bst_ephemeris_rows_in(e->table_memory + table_bytes * (size_t)i, e->object_count);
    }
    for (int c = 0; c < STEP_CLASSES; c++) {
        for (int slot = 0; slot < ROTATIONS; slot++) {
            e->rotations[c].knot[slot] = INT64_MIN;
        }
    }
    for (int i = 0; i < world->object_count; i++) {
        set_body(e, &world->objects[i].orbit, &e->bodies[i]);
    }
    for (int i = 0; i < world->observer_count; i++) {
        set_body(e, &world->observers[i].orbit, &e->bodies[world->object_count + i]);
    }
    *out = e;
    return BST_OK;
}

bst_status bst_ephemeris_prepare(bst_ctx *ctx, bst_ephemeris *e, int threads) {
    pthread_mutex_lock(&e->lock);
    bst_status status = BST_OK;
    if (!e->pool && e->object_count >= BODIES_FOR_THREADS) {
        status = bst_parallel_create(ctx, threads, &e->pool);
    }
    if (status == BST_OK) {
        make_table(e, &e->tables[0], 0);
    }
    pthread_mutex_unlock(&e->lock);
    return status;
}

void bst_ephemeris_free(bst_ephemeris *e) {
    if (e) {
        bst_parallel_free(e->pool);
        bst_sky_clock_free(e->clock_knots);
        bst_sky_clock_free(e->clock_tables);
        free(e->bodies);
        free(e->table_memory);
        pthread_mutex_destroy(&e->lock);
        free(e);
    }
}
