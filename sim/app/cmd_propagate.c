/* boresight propagate: positions and velocities from element sets, by SGP4. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/app/app.h"
#include "sim/astro/frames.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/sky_clock.h"
#include "sim/astro/tle.h"
#include "sim/cli/options.h"
#include "sim/io/czml_writer.h"
#include "sim/io/draft_file.h"
#include "sim/io/oem_writer.h"

static const char HELP[] =
    "boresight propagate: positions and velocities from element sets, by SGP4\n"
    "\n"
    "  boresight propagate --elements FILE --start UTC --stop UTC --step S [options]\n"
    "\n";

static const char HELP_END[] =
    "\n"
    "Rows hold UTC, position in km and velocity in km/s; times run from --start in steps of "
    "--step\n"
    "SI seconds, through leap seconds, up to and with --stop. All satellites of the file come one\n"
    "after another, in the file's order; of several sets of one satellite, the one whose epoch is\n"
    "nearest to --start is taken. GCRF needs the Earth's orientation: a table of 2020 to 2025 is\n"
    "part of the program, another one is read with --eop.\n"
    "\n"
    "Element sets are read as TLE, as three lines each, and as OMM in JSON or CSV; which of them "
    "a\n"
    "file holds is seen from its content. CZML is for Cesium, and always in GCRF.\n"
    "\n"
    "Examples:\n"
    "  boresight propagate --elements scenarios/catalogue_2022-06.tle --norad 39089 \\\n"
    "      --start 2022-06-16T22:10:00Z --stop 2022-06-16T22:15:00Z --step 60 --frame gcrf\n"
    "  boresight propagate --elements scenarios/catalogue_2022-06.tle --format oem --output "
    "all.oem \\\n"
    "      --start 2022-06-16T00:00:00Z --stop 2022-06-17T00:00:00Z --step 300\n"
    "\n"
    "Exit code: 0 done; 1 failed, or SGP4 ended early for a satellite (rows before that are\n"
    "written); 2 wrong usage.\n";

enum { FRAME_DEFAULT = -1, FRAME_TEME, FRAME_GCRF };
enum { FORMAT_CSV, FORMAT_OEM, FORMAT_CZML };

/* Steps are whole microseconds, so that times are ticks and nothing accumulates. */
static const int64_t TICKS_PER_SECOND = 1000000;
/* 9 GB of CSV: more is a slip of --step */
static const double MOST_ROWS = 1e8;

typedef struct request {
    const char *elements, *start_text, *stop_text, *output, *eop_path;
    const char *norad_text;
    int norad; /* 0: all */
    double step_s;
    int frame, format, gravity, mode;
    bool help;
    bst_time start;
    int64_t step_ticks, rows;
    int time_digits;
} request;

typedef struct states {
    const request *request;
    bst_sky_clock *clock; /* NULL in TEME */
    FILE *stream;
} states;

/* One satellite, as the writers ask for its states. */
typedef struct satellite {
    const states *states;
    const bst_elements *elements;
    const bst_sgp4 *sgp4;
} satellite;

static bst_status read_time(bst_ctx *ctx, const char *option, const char *text, bst_time *out) {
    bst_status status = bst_time_from_utc(ctx, text, out);
    return status == BST_OK ? status : bst_fail_prefix(ctx, status, "--%s", option);
}

/* A number, or five characters of which the first is a letter. */
static bst_status read_norad(bst_ctx *ctx, request *q) {
    const char *text = q->norad_text;
    if (!text) {
        return BST_OK;
    }
    size_t length = strlen(text), digits = strspn(text, "0123456789");
    bool number = length > 0 && digits == length && length <= 9;
    q->norad = number ? (int)strtol(text, NULL, 10) : 0;
    if (length == 5 && digits == 0 && !bst_tle_decode_number(text, &q->norad)) {
        q->norad = 0;
    }
    return q->norad > 0 ? BST_OK
                        : bst_fail(ctx, BST_ERR_ARGUMENT,
                                   "--norad %s: give an integer from 1 to %d, or Alpha-5: a letter "
                                   "other than I and O and 4 digits",
                                   text, BST_NORAD_MAX);
}

/* The grid of times from the texts. */
static bst_status read_times(bst_ctx *ctx, request *q) {
    bst_time stop;
    BST_TRY(read_time(ctx, "start", q->start_text, &q->start));
    BST_TRY(read_time(ctx, "stop", q->stop_text, &stop));
    double span_s = bst_time_diff(stop, q->start);
    if (span_s < 0.0) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--stop %s is before --start %s: exchange them",
                        q->stop_text, q->start_text);
    }
    double ticks = q->step_s * (double)TICKS_PER_SECOND;
    q->step_ticks = llround(ticks);
    if (fabs(ticks - (double)q->step_ticks) > 1e-9 * ticks) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "--step %.15g: give whole microseconds", q->step_s);
    }
    /* half a tick of room: the span is exact to 1e-10 s only */
    double steps = floor((span_s * (double)TICKS_PER_SECOND + 0.5) / (double)q->step_ticks);
    if (steps >= MOST_ROWS) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--step %.15g: from --start to --stop that is %.4g rows of each satellite "
                        "(allowed: %.0f); give a longer step or a shorter time",
                        q->step_s, steps + 1.0, MOST_ROWS);
    }
    q->rows = (int64_t)steps + 1;
    char text[40];
    bst_time_to_utc(q->start, 9, text, sizeof text);
    bool whole_ms = q->step_ticks % 1000 == 0 && strstr(text, "000000Z");
    q->time_digits = whole_ms ? 3 : 9;
    return BST_OK;
}

static bst_time time_of(const request *q, int64_t row) {
    return bst_time_at_tick(q->start, row * q->step_ticks, TICKS_PER_SECOND);
}

/* Minutes from the element set's epoch, days of UTC counted as uniform, as the theory does. */
static double minutes_of(const bst_elements *e, bst_time t) {
    double jd1, jd2;
    bst_time_utc(t, &jd1, &jd2);
    return (jd1 - e->epoch_utc_jd1) * 1440.0 + (jd2 - e->epoch_utc_jd2) * 1440.0;
}

/* Number of rows before SGP4 ends, and why it does. */
static int64_t valid_rows(const request *q, const bst_elements *e, const bst_sgp4 *sgp4,
                          bst_sgp4_error *error) {
    double r[3], v[3];
    for (int64_t row = 0; row < q->rows; row++) {
        *error = bst_sgp4_propagate(sgp4, minutes_of(e, time_of(q, row)), r, v);
        if (*error != BST_SGP4_OK) {
            return row;
        }
    }
    return q->rows;
}

/* The designator of the launch as OEM writes it: "13009D" becomes "2013-009D". */
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

static bst_status write_file_head(bst_ctx *ctx, const request *q, FILE *stream) {
    if (q->format == FORMAT_CZML) {
        return bst_czml_write_head(ctx, stream, "boresight propagate", q->start,
                                   time_of(q, q->rows - 1), 60.0);
    }
    if (q->format == FORMAT_CSV) {
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

/* State at a row, km and km/s. */
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
    const request *q = s->states->request;
    const bst_elements *e = s->elements;
    FILE *stream = s->states->stream;
    const bst_state_series series = {.rows = rows, .state = state_m, .user = s};
    char name[48], id[32], text[120];
    object_name(e, name, sizeof name);
    if (q->format == FORMAT_OEM) {
        object_id(e, id, sizeof id);
        snprintf(text, sizeof text, "SGP4, catalogue number %d, %s, opsmode %c", e->norad,
                 q->gravity == BST_SGP4_WGS84 ? "WGS-84" : "WGS-72",
                 q->mode == BST_SGP4_AFSPC ? 'a' : 'i');
        const bst_oem_segment segment = {.object_name = name,
                                         .object_id = id,
                                         .ref_frame = q->frame == FRAME_GCRF ? "GCRF" : "TEME",
                                         .comment = text,
                                         .series = series};
        return bst_oem_write_segment(ctx, stream, &segment);
    }
    if (q->format == FORMAT_CZML) {
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

/* Writes one satellite. *complete is false when SGP4 could not go to the end, which is told on the
 * standard error at once and does not stop the other satellites. */
static bst_status write_object(bst_ctx *ctx, const states *s, const bst_elements *e,
                               bool *complete) {
    const request *q = s->request;
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

/* By satellite, then nearest to the start (of equals, the first in the file). */
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

/* Marks the one set of each satellite that is taken. */
static bst_status choose(bst_ctx *ctx, const request *q, const bst_elements *sets, int count,
                         bool *taken) {
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
    const request *q = s->request;
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
    if (status == BST_OK && q->format == FORMAT_CZML) {
        status = bst_czml_write_tail(ctx, s->stream);
    }
    return status;
}

/* Opens what the request needs, writes, and closes everything. */
static bst_status propagate(bst_ctx *ctx, const request *q, bool *complete) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_astro_eop *eop = NULL;
    states s = {.request = q, .stream = stdout};
    bst_draft draft = {.stream = NULL};
    const bst_elements_options only = {.norad = q->norad};
    const char *name = q->output ? q->output : "standard output";
    bst_status status = bst_elements_load(ctx, q->elements, &only, &sets, &count);
    if (status == BST_OK && q->frame == FRAME_GCRF) {
        status = q->eop_path ? bst_astro_eop_load(ctx, q->eop_path, &eop)
                             : bst_astro_eop_builtin(ctx, &eop);
        if (status == BST_OK) {
            status = bst_sky_clock_create(ctx, eop, &s.clock);
        }
        bst_sky_rotation sky;
        /* both ends first, so that nothing is written for dates that the table does not cover */
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

static const bst_option OPTIONS[] = {
    {.name = "elements",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "element sets: TLE, or OMM as JSON or CSV (required)"},
    {.name = "tle",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, elements),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "the same"},
    {.name = "norad",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, norad_text),
     .argument = "N",
     .doc = "only the satellite with this catalogue number, also as Alpha-5"},
    {.name = "start",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, start_text),
     .argument = "UTC",
     .doc = "first time, as 2022-06-16T22:10:00Z",
     .required = true},
    {.name = "stop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, stop_text),
     .argument = "UTC",
     .doc = "last time",
     .required = true},
    {.name = "step",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(request, step_s),
     .argument = "S",
     .doc = "seconds between rows, whole microseconds",
     .required = true,
     .minimum = 1e-6,
     .maximum = 1e9},
    {.name = "frame",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(request, frame),
     .argument = "teme|gcrf",
     .doc = "default: teme"},
    {.name = "format",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(request, format),
     .argument = "csv|oem|czml",
     .doc = "comma-separated (default), CCSDS OEM 2.0, or CZML"},
    {.name = "gravity",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(request, gravity),
     .argument = "wgs72|wgs84",
     .doc = "default: wgs72, which element sets are made with"},
    {.name = "opsmode",
     .kind = BST_OPTION_CHOICE,
     .offset = offsetof(request, mode),
     .argument = "i|a",
     .doc = "improved (default), or as the operational code"},
    {.name = "eop",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, eop_path),
     .path = BST_PATH_INPUT,
     .argument = "FILE",
     .doc = "Earth orientation, an IERS EOP C04 file, for gcrf"},
    {.name = "output",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(request, output),
     .path = BST_PATH_OUTPUT,
     .argument = "FILE",
     .doc = "write there instead of to the standard output"},
    {.name = "help",
     .kind = BST_OPTION_FLAG,
     .offset = offsetof(request, help),
     .doc = "this text"},
    {.name = NULL},
};

int bst_cmd_propagate(int argc, char **argv) {
    request q = {.frame = FRAME_DEFAULT, .gravity = BST_SGP4_WGS72, .mode = BST_SGP4_IMPROVED};
    bst_option table[sizeof OPTIONS / sizeof *OPTIONS];
    bst_options_bind(OPTIONS, &q, table);
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    if (bst_options_parse(&ctx, table, argc, argv, NULL) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.help) {
        fputs(HELP, stdout);
        bst_options_print(stdout, table);
        fputs(HELP_END, stdout);
        return 0;
    }
    if (!q.elements) {
        (void)bst_fail(&ctx, BST_ERR_ARGUMENT, "--elements is missing: add --elements FILE");
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.format == FORMAT_CZML && q.frame == FRAME_TEME) {
        bst_fail(&ctx, BST_ERR_ARGUMENT, "--format czml is always in GCRF: leave --frame teme out");
        return bst_options_misuse(&ctx, "propagate");
    }
    q.frame =
        q.frame == FRAME_DEFAULT ? (q.format == FORMAT_CZML ? FRAME_GCRF : FRAME_TEME) : q.frame;
    if (q.eop_path && q.frame == FRAME_TEME) {
        bst_fail(&ctx, BST_ERR_ARGUMENT,
                 "--eop has no effect in TEME: add --frame gcrf or leave "
                 "--eop out");
        return bst_options_misuse(&ctx, "propagate");
    }
    if (read_norad(&ctx, &q) != BST_OK || read_times(&ctx, &q) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    bool complete = true;
    if (propagate(&ctx, &q, &complete) != BST_OK) {
        fprintf(stderr, "boresight propagate: %s\n", ctx.message);
        return 1;
    }
    return complete ? 0 : 1;
}
