/* boresight propagate: positions and velocities from two-line element sets, by SGP4. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/app/app.h"
#include "sim/app/options.h"
#include "sim/astro/frames.h"
#include "sim/astro/sgp4.h"
#include "sim/astro/sky_clock.h"

static const char HELP[] =
    "boresight propagate: positions and velocities from two-line element sets, by SGP4\n"
    "\n"
    "  boresight propagate --tle FILE --start UTC --stop UTC --step S [options]\n"
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
    "Examples:\n"
    "  boresight propagate --tle scenarios/catalogue_2022-06.tle --norad 39089 \\\n"
    "      --start 2022-06-16T22:10:00Z --stop 2022-06-16T22:15:00Z --step 60 --frame gcrf\n"
    "  boresight propagate --tle scenarios/catalogue_2022-06.tle --format oem --output all.oem \\\n"
    "      --start 2022-06-16T00:00:00Z --stop 2022-06-17T00:00:00Z --step 300\n"
    "\n"
    "Exit code: 0 done; 1 failed, or SGP4 ended early for a satellite (rows before that are\n"
    "written); 2 wrong usage.\n";

enum { FRAME_TEME, FRAME_GCRF };
enum { FORMAT_CSV, FORMAT_OEM };

/* Steps are whole microseconds, so that times are ticks and nothing accumulates. */
static const int64_t TICKS_PER_SECOND = 1000000;

typedef struct request {
    const char *tle, *start_text, *stop_text, *output, *eop_path;
    int64_t norad;
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

static bst_status read_time(bst_ctx *ctx, const char *option, const char *text, bst_time *out) {
    bst_status status = bst_time_from_utc(ctx, text, out);
    return status == BST_OK ? status : bst_fail_prefix(ctx, status, "--%s", option);
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
    q->rows = (int64_t)floor((span_s * (double)TICKS_PER_SECOND + 0.5) / (double)q->step_ticks) + 1;
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

static void write_file_head(const request *q, FILE *stream) {
    if (q->format == FORMAT_CSV) {
        fputs("utc,norad,x_km,y_km,z_km,vx_kmps,vy_kmps,vz_kmps\n", stream);
        return;
    }
    char created[32] = "";
    time_t now = time(NULL);
    struct tm utc;
    if (gmtime_r(&now, &utc)) {
        strftime(created, sizeof created, "%Y-%m-%dT%H:%M:%S", &utc);
    }
    fprintf(stream,
            "CCSDS_OEM_VERS = 2.0\n"
            "CREATION_DATE = %s\n"
            "ORIGINATOR = BORESIGHT\n",
            created);
}

/* Time of a row, without the Z in OEM, whose metadata name the scale. */
static void row_time(const request *q, bst_time t, char text[40]) {
    bst_time_to_utc(t, q->time_digits, text, 40);
    if (q->format == FORMAT_OEM) {
        text[strcspn(text, "Z")] = '\0';
    }
}

static void write_object_head(const request *q, const bst_elements *e, int64_t rows, FILE *stream) {
    char name[48], id[32], first[40], last[40];
    object_name(e, name, sizeof name);
    object_id(e, id, sizeof id);
    row_time(q, q->start, first);
    row_time(q, time_of(q, rows - 1), last);
    fprintf(stream,
            "\n"
            "META_START\n"
            "OBJECT_NAME = %s\n"
            "OBJECT_ID = %s\n"
            "CENTER_NAME = EARTH\n"
            "REF_FRAME = %s\n"
            "TIME_SYSTEM = UTC\n"
            "START_TIME = %s\n"
            "STOP_TIME = %s\n"
            "META_STOP\n"
            "\n"
            "COMMENT SGP4, catalogue number %d, %s, opsmode %c\n",
            name, id, q->frame == FRAME_GCRF ? "GCRF" : "TEME", first, last, e->norad,
            q->gravity == BST_SGP4_WGS84 ? "WGS-84" : "WGS-72",
            q->mode == BST_SGP4_AFSPC ? 'a' : 'i');
}

static bst_status write_row(bst_ctx *ctx, const states *s, const bst_elements *e,
                            const bst_sgp4 *sgp4, int64_t row) {
    const request *q = s->request;
    bst_time t = time_of(q, row);
    double r[3] = {0}, v[3] = {0};
    (void)bst_sgp4_propagate(sgp4, minutes_of(e, t), r, v);
    bst_vec3 position = {r[0], r[1], r[2]}, velocity = {v[0], v[1], v[2]};
    if (s->clock) {
        bst_sky sky;
        BST_TRY(bst_sky_clock_at(ctx, s->clock, t, &sky));
        position = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, position);
        velocity = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, velocity);
    }
    char text[40];
    row_time(q, t, text);
    if (q->format == FORMAT_CSV) {
        fprintf(s->stream, "%s,%d,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", text, e->norad, position.x,
                position.y, position.z, velocity.x, velocity.y, velocity.z);
    } else {
        fprintf(s->stream, "%s %.9f %.9f %.9f %.9f %.9f %.9f\n", text, position.x, position.y,
                position.z, velocity.x, velocity.y, velocity.z);
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
    if (rows > 0 && q->format == FORMAT_OEM) {
        write_object_head(q, e, rows, s->stream);
    }
    for (int64_t row = 0; row < rows && status == BST_OK && !ferror(s->stream); row++) {
        status = write_row(ctx, s, e, sgp4, row);
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

/* Whether another set of the same satellite is nearer to the start (of equals, the first holds). */
static bool is_superseded(const request *q, const bst_elements *sets, int count, int index) {
    double own = fabs(minutes_of(&sets[index], q->start));
    for (int i = 0; i < count; i++) {
        if (sets[i].norad == sets[index].norad && i != index) {
            double other = fabs(minutes_of(&sets[i], q->start));
            if (other < own || (i < index && !(own < other))) {
                return true;
            }
        }
    }
    return false;
}

static bst_status write_all(bst_ctx *ctx, const states *s, const bst_elements *sets, int count,
                            bool *complete) {
    const request *q = s->request;
    *complete = true;
    write_file_head(q, s->stream);
    for (int i = 0; i < count && !ferror(s->stream); i++) {
        if (!is_superseded(q, sets, count, i)) {
            bool whole;
            BST_TRY(write_object(ctx, s, &sets[i], &whole));
            *complete = *complete && whole;
        }
    }
    return BST_OK;
}

/* Opens what the request needs, writes, and closes everything. */
static bst_status propagate(bst_ctx *ctx, const request *q, bool *complete) {
    bst_elements *sets = NULL;
    int count = 0;
    bst_eop *eop = NULL;
    states s = {.request = q, .stream = stdout};
    const bst_elements_options only = {.norad = (int)q->norad};
    const char *name = q->output ? q->output : "standard output";
    bst_status status = bst_elements_load(ctx, q->tle, &only, &sets, &count);
    if (status == BST_OK && q->frame == FRAME_GCRF) {
        status = q->eop_path ? bst_eop_load(ctx, q->eop_path, &eop) : bst_eop_builtin(ctx, &eop);
        if (status == BST_OK) {
            status = bst_sky_clock_create(ctx, eop, &s.clock);
        }
        bst_sky sky;
        /* both ends first, so that nothing is written for dates that the table does not cover */
        for (int end = 0; end < 2 && status == BST_OK; end++) {
            status = bst_sky_clock_at(ctx, s.clock, time_of(q, end ? q->rows - 1 : 0), &sky);
            if (status == BST_ERR_RANGE) {
                bst_fail_prefix(ctx, status, "%s",
                                q->eop_path ? q->eop_path : "--frame gcrf needs --eop FILE here");
            }
        }
    }
    if (status == BST_OK && q->output) {
        s.stream = fopen(q->output, "w");
        if (!s.stream) {
            status =
                bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", q->output, strerror(errno));
        }
    }
    if (status == BST_OK) {
        status = write_all(ctx, &s, sets, count, complete);
        bool failed = ferror(s.stream) != 0;
        failed = (s.stream == stdout ? fflush(s.stream) : fclose(s.stream)) != 0 || failed;
        if (failed && status == BST_OK) {
            status = bst_fail(ctx, BST_ERR_IO, "%s: writing failed; is the disk full?", name);
        }
    }
    bst_sky_clock_free(s.clock);
    bst_eop_free(eop);
    free(sets);
    return status;
}

int bst_cmd_propagate(int argc, char **argv) {
    request q = {.gravity = BST_SGP4_WGS72, .mode = BST_SGP4_IMPROVED};
    const bst_option table[] = {
        {.name = "tle",
         .kind = BST_OPTION_TEXT,
         .target = &q.tle,
         .argument = "FILE",
         .doc = "element sets, two or three lines each",
         .required = true},
        {.name = "norad",
         .kind = BST_OPTION_INT,
         .target = &q.norad,
         .argument = "N",
         .doc = "only the satellite with this catalogue number",
         .minimum = 1,
         .maximum = 339999},
        {.name = "start",
         .kind = BST_OPTION_TEXT,
         .target = &q.start_text,
         .argument = "UTC",
         .doc = "first time, as 2022-06-16T22:10:00Z",
         .required = true},
        {.name = "stop",
         .kind = BST_OPTION_TEXT,
         .target = &q.stop_text,
         .argument = "UTC",
         .doc = "last time",
         .required = true},
        {.name = "step",
         .kind = BST_OPTION_REAL,
         .target = &q.step_s,
         .argument = "S",
         .doc = "seconds between rows, whole microseconds",
         .required = true,
         .minimum = 1e-6,
         .maximum = 1e9},
        {.name = "frame",
         .kind = BST_OPTION_CHOICE,
         .target = &q.frame,
         .argument = "teme|gcrf",
         .doc = "default: teme"},
        {.name = "format",
         .kind = BST_OPTION_CHOICE,
         .target = &q.format,
         .argument = "csv|oem",
         .doc = "comma-separated (default), or CCSDS OEM 2.0"},
        {.name = "gravity",
         .kind = BST_OPTION_CHOICE,
         .target = &q.gravity,
         .argument = "wgs72|wgs84",
         .doc = "default: wgs72, which element sets are made with"},
        {.name = "opsmode",
         .kind = BST_OPTION_CHOICE,
         .target = &q.mode,
         .argument = "i|a",
         .doc = "improved (default), or as the operational code"},
        {.name = "eop",
         .kind = BST_OPTION_TEXT,
         .target = &q.eop_path,
         .argument = "FILE",
         .doc = "Earth orientation, an IERS EOP C04 file, for gcrf"},
        {.name = "output",
         .kind = BST_OPTION_TEXT,
         .target = &q.output,
         .argument = "FILE",
         .doc = "write there instead of to the standard output"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &q.help, .doc = "this text"},
        {.name = NULL}};
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    if (bst_options_parse(&ctx, table, argc, argv, NULL) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    if (q.help) {
        fputs(HELP, stdout);
        bst_options_print(stdout, table);
        fputs(HELP_END, stdout);
        return 0;
    }
    if (read_times(&ctx, &q) != BST_OK) {
        return bst_options_misuse(&ctx, "propagate");
    }
    bool complete = true;
    if (propagate(&ctx, &q, &complete) != BST_OK) {
        fprintf(stderr, "boresight propagate: %s\n", ctx.message);
        return 1;
    }
    return complete ? 0 : 1;
}
