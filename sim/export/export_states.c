#include "sim/export/export_states.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/astro/frames.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/sky_clock.h"
#include "sim/astro/tle.h"
#include "sim/io/czml_writer.h"
#include "sim/io/draft_file.h"
#include "sim/io/oem_writer.h"

typedef struct states {
    const bst_export_states_request *request;
    bst_sky_clock *clock; /* NULL for TEME */
    FILE *stream;
} states;

/* A satellite, for the state series of a writer. */
typedef struct satellite {
    const states *states;
    const bst_elements *elements;
    const bst_sgp4 *sgp4;
} satellite;

static bst_time time_of(const bst_export_states_request *q, int64_t row) {
    return bst_time_at_tick(q->start, row * q->step_ticks, BST_EXPORT_STATES_TICKS_PER_SECOND);
}

/* Minutes after the element epoch; SGP4 counts uniform days of UTC. */
static double minutes_of(const bst_elements *e, bst_time t) {
    double jd1, jd2;
    bst_time_utc(t, &jd1, &jd2);
    return (jd1 - e->epoch_utc_jd1) * 1440.0 + (jd2 - e->epoch_utc_jd2) * 1440.0;
}

/* Number of rows until SGP4 fails, and the reason. */
static int64_t valid_rows(const bst_export_states_request *q, const bst_elements *e,
                          const bst_sgp4 *sgp4, bst_sgp4_error *error) {
    double r[3], v[3];
    for (int64_t row = 0; row < q->rows; row++) {
        *error = bst_sgp4_propagate(sgp4, minutes_of(e, time_of(q, row)), r, v);
        if (*error != BST_SGP4_OK) {
            return row;
        }
    }
    return q->rows;
}

/* International designator in OEM format: "13009D" becomes "2013-009D". */
static void object_id(const bst_elements *e, char *buffer, size_t bytes) {
    const char *d = e->designator;
    if (strlen(d) < 6 || strspn(d, "0123456789") < 5) {
        snprintf(buffer, bytes, "NORAD-%d", e->norad);
        return;
    }
    int year = (d[0] - '0') * 10 + (d[1] - '0');
    /* the first launch was in 1957 */
    snprintf(buffer, bytes, "%d-%s", year < 57 ? 2000 + year : 1900 + year, d + 2);
}

static void object_name(const bst_elements *e, char *buffer, size_t bytes) {
    if (*e->name) {
        snprintf(buffer, bytes, "%s", e->name);
    } else {
        snprintf(buffer, bytes, "NORAD-%d", e->norad);
    }
}

static bst_status write_file_head(bst_ctx *ctx, const bst_export_states_request *q, FILE *stream) {
    if (q->format == BST_EXPORT_STATES_CZML) {
        return bst_czml_write_head(ctx, stream, "boresight propagate", q->start,
                                   time_of(q, q->rows - 1), 60.0);
    }
    if (q->format == BST_EXPORT_STATES_CSV) {
        fputs("utc,norad,x_km,y_km,z_km,vx_kmps,vy_kmps,vz_kmps\n", stream);
        return BST_OK;
    }
    char created[32] = "";
    time_t now = time(NULL);
    struct tm utc;
    if (gmtime_r(&now, &utc)) {
        strftime(created, sizeof created, "%Y-%m-%dT%H:%M:%S", &utc);
    }
    return bst_oem_write_head(ctx, stream, created, "BORESIGHT", NULL);
}

/* State of a satellite at a row, km and km/s. */
static bst_status state_km(bst_ctx *ctx, const satellite *s, int64_t row, bst_time *t, bst_vec3 *r,
                           bst_vec3 *v) {
    double p[3] = {0}, w[3] = {0};
    *t = time_of(s->states->request, row);
    (void)bst_sgp4_propagate(s->sgp4, minutes_of(s->elements, *t), p, w);
    *r = (bst_vec3){p[0], p[1], p[2]};
    *v = (bst_vec3){w[0], w[1], w[2]};
    if (s->states->clock) {
        bst_sky_rotation sky;
        BST_TRY(bst_sky_clock_at(ctx, s->states->clock, *t, &sky));
        *r = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, *r);
        *v = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, *v);
    }
    return BST_OK;
}

static bst_status state_m(void *user, bst_ctx *ctx, int64_t row, bst_time *t, bst_vec3 *r,
                          bst_vec3 *v) {
    BST_TRY(state_km(ctx, user, row, t, r, v));
    *r = bst_vec3_scale(*r, 1000.0);
    *v = bst_vec3_scale(*v, 1000.0);
    return BST_OK;
}

static bst_status write_rows(bst_ctx *ctx, satellite *s, int64_t rows) {
    const bst_export_states_request *q = s->states->request;
    const bst_elements *e = s->elements;
    FILE *stream = s->states->stream;
    const bst_state_series series = {.rows = rows, .state = state_m, .user = s};
    char name[48], id[32], text[120];
    object_name(e, name, sizeof name);
    if (q->format == BST_EXPORT_STATES_OEM) {
        object_id(e, id, sizeof id);
        snprintf(text, sizeof text, "SGP4, catalogue number %d, %s, opsmode %c", e->norad,
                 q->gravity == BST_SGP4_WGS84 ? "WGS-84" : "WGS-72",
                 q->mode == BST_SGP4_AFSPC ? 'a' : 'i');
        const bst_oem_segment segment = {
            .object_name = name,
            .object_id = id,
            .ref_frame = q->frame == BST_EXPORT_STATES_GCRF ? "GCRF" : "TEME",
            .comment = text,
            .series = series};
        return bst_oem_write_segment(ctx, stream, &segment);
    }
    if (q->format == BST_EXPORT_STATES_CZML) {
        snprintf(id, sizeof id, "%d", e->norad);
        const bst_czml_object object = {
            .id = id, .name = name, .label = true, .path_s = 86400.0, .series = series};
        return bst_czml_write_object(ctx, stream, &object);
    }
    for (int64_t row = 0; row < rows && !ferror(stream); row++) {
        bst_time t;
        bst_vec3 r, v;
        BST_TRY(state_km(ctx, s, row, &t, &r, &v));
        bst_time_to_utc(t, q->time_digits, text, sizeof text);
        fprintf(stream, "%s,%d,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", text, e->norad, r.x, r.y, r.z, v.x,
                v.y, v.z);
    }
    return BST_OK;
}

/* Writes one satellite. *complete false: SGP4 did not reach the end; a message goes to standard
 * error and the other satellites continue. */
static bst_status write_object(bst_ctx *ctx, const states *s, const bst_elements *e,
                               bool *complete) {
    const bst_export_states_request *q = s->request;
    char name[48];
    object_name(e, name, sizeof name);
    bst_sgp4 *sgp4 = NULL;
    bst_status status =
        bst_sgp4_create(ctx, e, (bst_sgp4_gravity)q->gravity, (bst_sgp4_mode)q->mode, &sgp4);
    *complete = status == BST_OK;
    if (status != BST_OK) {
        fprintf(stderr, "boresight propagate: %s (%d): %s\n", name, e->norad, ctx->message);
        return status == BST_ERR_MEMORY ? status : BST_OK;
    }
    bst_sgp4_error error = BST_SGP4_OK;
    int64_t rows = valid_rows(q, e, sgp4, &error);
    if (rows > 0) {
        status = write_rows(ctx, &(satellite){s, e, sgp4}, rows);
    }
    if (status == BST_OK && rows < q->rows) {
        char text[40];
        bst_time_to_utc(time_of(q, rows), q->time_digits, text, sizeof text);
        fflush(s->stream);
        fprintf(stderr, "boresight propagate: %s (%d) at %s: SGP4 error %d: %s\n", name, e->norad,
                text, (int)error, bst_sgp4_error_text(error));
        *complete = false;
    }
    bst_sgp4_free(sgp4);
    return status;
}

typedef struct candidate {
    int norad, index;
    double age_minutes;
} candidate;

/* Orders element sets by satellite, then by nearest epoch (then file order). */
static int compare_candidates(const void *x, const void *y) {
    const candidate *a = x, *b = y;
    if (a->norad != b->norad) {
        return a->norad < b->norad ? -1 : 1;
    }
    if (a->age_minutes != b->age_minutes) {
        return a->age_minutes < b->age_minutes ? -1 : 1;
    }
    return a->index - b->index;
}

/* Selects one element set per satellite. */
static bst_status choose(bst_ctx *ctx, const bst_export_states_request *q, const bst_elements *sets,
                         int count, bool *taken) {
    candidate *list = malloc((size_t)count * sizeof *list);
    if (!list) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d element sets", count);
    }
    for (int i = 0; i < count; i++) {
        list[i] = (candidate){sets[i].norad, i, fabs(minutes_of(&sets[i], q->start))};
    }
    qsort(list, (size_t)count, sizeof *list, compare_candidates);
    for (int i = 0; i < count; i++) {
        taken[list[i].index] = i == 0 || list[i].norad != list[i - 1].norad;
    }
    free(list);
    return BST_OK;
}

static bst_status write_all(bst_ctx *ctx, const states *s, const bst_elements *sets, int count,
                            bool *complete) {
    const bst_export_states_request *q = s->request;
    bool *taken = calloc((size_t)count, sizeof *taken);
    bst_status status =
        taken ? choose(ctx, q, sets, count, taken) : bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    *complete = true;
    if (status == BST_OK) {
        status = write_file_head(ctx, q, s->stream);
    }
    for (int i = 0; i < count && status == BST_OK && !ferror(s->stream); i++) {
        if (taken[i]) {
            bool whole;
            status = write_object(ctx, s, &sets[i], &whole);
            *complete = *complete && whole;
        }
    }
    free(taken);
    if (status == BST_OK && q->format == BST_EXPORT_STATES_CZML) {
        status = bst_czml_write_tail(ctx, s->stream);
    }
    return status;
}

/* Opens files and Earth orientation, writes all satellites, closes everything. */
bst_status bst_export_states(bst_ctx *ctx, const bst_export_states_request *q, bool *complete) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_astro_eop *eop = NULL;
    states s = {.request = q, .stream = stdout};
    bst_draft draft = {.stream = NULL};
    const bst_elements_options only = {.norad = q->norad};
    const char *name = q->output ? q->output : "standard output";
    bst_status status = bst_elements_load(ctx, q->elements, &only, &sets, &count);
    if (status == BST_OK && q->frame == BST_EXPORT_STATES_GCRF) {
        status = q->eop_path ? bst_astro_eop_load(ctx, q->eop_path, &eop)
                             : bst_astro_eop_builtin(ctx, &eop);
        if (status == BST_OK) {
            status = bst_sky_clock_create(ctx, eop, &s.clock);
        }
        bst_sky_rotation sky;
        /* check both ends first: write nothing for dates outside the table */
        for (int end = 0; end < 2 && status == BST_OK; end++) {
            status = bst_sky_clock_at(ctx, s.clock, time_of(q, end ? q->rows - 1 : 0), &sky);
            if (status == BST_ERR_RANGE) {
                bst_fail_prefix(ctx, status, "%s",
                                q->eop_path ? q->eop_path : "--frame gcrf needs --eop FILE here");
            }
        }
        if (status == BST_OK) {
            bst_astro_eop_warn(ctx, eop, time_of(q, q->rows - 1), "");
        }
    }
    if (status == BST_OK && q->output) {
        status = bst_draft_open(ctx, q->output, &draft);
        s.stream = draft.stream;
    }
    if (status == BST_OK) {
        status = write_all(ctx, &s, sets, count, complete);
        bool failed = ferror(s.stream) != 0 || (s.stream == stdout && fflush(stdout) != 0);
        if (failed && (status == BST_OK || status == BST_ERR_IO)) {
            status = bst_fail(ctx, BST_ERR_IO, "%s: writing failed; is the disk full?", name);
        }
        if (q->output) {
            status = bst_draft_close(ctx, &draft, status);
        }
    }
    bst_sky_clock_free(s.clock);
    bst_astro_eop_free(eop);
    free(sets);
    return status;
}
