/* Values of a frame's header by a keyword map. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/keyword_map.h"
#include "sim/io/tangent.h"

/* A frame whose header is read, for messages. */
typedef struct reading {
    bst_ctx *ctx;
    const bst_keyword_map *map;
    bst_fits_source *source;
    const bst_fits_source_frame *frame;
} reading;

/* Fails at a keyword: "FILE: HDU 2, frame 7: EXPTIME (exposure_s of the map MAP): WHAT". */
static bst_status wrong(const reading *r, const char *keyword, const char *key, const char *what) {
    char plane[48] = "";
    if (r->frame->plane >= 0) {
        snprintf(plane, sizeof plane, ", plane %lld", (long long)r->frame->plane + 1);
    }
    return bst_fail(r->ctx, BST_ERR_FORMAT, "%.400s: HDU %d%s: %s (%s of the map %s): %s",
                    bst_fits_source_path(r->source), r->frame->hdu, plane, keyword, key,
                    r->map ? r->map->name : "-", what);
}

/* Value of the first of several keywords "A|B" that the frame has. */
static bool find(const reading *r, const char *keywords, char value[BST_FITS_SOURCE_TEXT]) {
    char words[BST_KEYWORD_TEXT], *rest = words;
    snprintf(words, sizeof words, "%s", keywords);
    while (rest) {
        char *bar = strchr(rest, '|');
        if (bar) {
            *bar = '\0';
        }
        if (*rest && bst_fits_source_text(r->source, rest, value)) {
            return true;
        }
        rest = bar ? bar + 1 : NULL;
    }
    return false;
}

/* Reads a finite number from text; FITS also writes 1.0D0. */
static bool number_of(char *text, double *out) {
    char *end;
    for (char *d = text; *d; d++) {
        *d = *d == 'D' || *d == 'd' ? 'E' : *d;
    }
    *out = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*out);
}

/* Most entries of a history of rates, and the least that give a trend. */
enum { HISTORY_MOST = 10000, HISTORY_LEAST = 4 };

/* Keyword of an entry: the digits of its index in place of the last #'s. False: it has none. */
static bool entry_keyword(const char *pattern, int index, char out[BST_KEYWORD_TEXT]) {
    snprintf(out, BST_KEYWORD_TEXT, "%s", pattern);
    char *last = strrchr(out, '#');
    int left = index;
    bool any = last != NULL;
    for (char *c = last; c && c >= out && *c == '#'; c--) {
        *c = (char)('0' + left % 10);
        left /= 10;
    }
    return any && left == 0;
}

/* Length of a vector of one to three numbers in text. */
static bool length_of(const char *text, double *out) {
    double sum2 = 0.0;
    int n = 0;
    for (const char *at = text; n < 3; n++) {
        char *end;
        double value = strtod(at, &end);
        if (end == at || !isfinite(value)) {
            break;
        }
        sum2 += value * value;
        at = end + strspn(end, " ,;");
    }
    *out = sqrt(sum2);
    return n > 0;
}

/* A history that cannot be read is none: it is a hint. */
static void warn_of_history(const reading *r, const char *keyword, const char *key) {
    bst_log(r->ctx, BST_LOG_WARNING,
            "%.400s: HDU %d: %s (%s of the map %s): is no number: the history is not used",
            bst_fits_source_path(r->source), r->frame->hdu, keyword, key, r->map->name);
}

void bst_keyword_rate_trend(bst_ctx *ctx, const bst_keyword_map *map, bst_fits_source *source,
                            const bst_fits_source_frame *frame, double exposure_s, double *trend,
                            double *sigma) {
    const reading r = {ctx, map, source, frame};
    double n = 0.0, t = 0.0, v = 0.0, tt = 0.0, tv = 0.0, vv = 0.0;
    *trend = *sigma = NAN;
    for (int i = 0; i < HISTORY_MOST && *map->rate_history.time; i++) {
        char keyword[BST_KEYWORD_TEXT], text[BST_FITS_SOURCE_TEXT];
        double time, rate;
        if (!entry_keyword(map->rate_history.time, i, keyword) ||
            !bst_fits_source_text(source, keyword, text)) {
            break;
        }
        if (!number_of(text, &time)) {
            warn_of_history(&r, keyword, "rate_history.time");
            return;
        }
        if (!entry_keyword(map->rate_history.rate, i, keyword) ||
            !bst_fits_source_text(source, keyword, text)) {
            break;
        }
        if (!length_of(text, &rate)) {
            warn_of_history(&r, keyword, "rate_history.rate");
            return;
        }
        if (time >= 0.0 && time <= exposure_s) {
            n += 1.0;
            t += time;
            v += rate;
            tt += time * time;
            tv += time * rate;
            vv += rate * rate;
        }
    }
    double spread = tt - t * t / n;
    if (n >= HISTORY_LEAST && spread > 0.0 && v > 0.0) {
        double slope = (tv - t * v / n) / spread, per = exposure_s / (v / n);
        double rest = fmax(vv - v * v / n - slope * slope * spread, 0.0);
        *trend = slope * per;
        *sigma = sqrt(rest / (n - 2.0) / spread) * per;
    }
}

/* A value that is required, within [least, most]. */
typedef struct range {
    const char *key;
    double least, most;
} range;

static bst_status read_number(const reading *r, const bst_keyword_number *n, const range *allowed,
                              double *out) {
    char text[BST_FITS_SOURCE_TEXT], what[240];
    bool found = *n->keyword && find(r, n->keyword, text);
    *out = n->value;
    if (!found && isnan(n->value)) {
        return wrong(r, *n->keyword ? n->keyword : "no keyword", allowed->key,
                     "is missing (allowed: a header with it, or a map with another keyword or a "
                     "value)");
    }
    if (found && !number_of(text, out)) {
        snprintf(what, sizeof what, "is no number (found \"%.60s\")", text);
        return wrong(r, n->keyword, allowed->key, what);
    }
    *out *= found ? n->factor : 1.0;
    if (!(*out >= allowed->least && *out <= allowed->most)) {
        snprintf(what, sizeof what, "gives %.9g (allowed: %.9g to %.9g)", *out, allowed->least,
                 allowed->most);
        return wrong(r, n->keyword, allowed->key, what);
    }
    return BST_OK;
}

/* True if a map names a source for all components of a vector and the frame has them. */
static bool has_vector(const reading *r, const bst_keyword_vector *v) {
    const bst_keyword_number *const parts[] = {&v->x, &v->y, &v->z};
    char text[BST_FITS_SOURCE_TEXT];
    for (int i = 0; i < 3; i++) {
        if (isnan(parts[i]->value) && !(*parts[i]->keyword && find(r, parts[i]->keyword, text))) {
            return false;
        }
    }
    return true;
}

static bst_status read_vector(const reading *r, const bst_keyword_vector *v, const range *allowed,
                              bool *has, bst_vec3 *out) {
    *has = has_vector(r, v);
    *out = (bst_vec3){0, 0, 0};
    if (!*has) {
        return BST_OK;
    }
    BST_TRY(read_number(r, &v->x, allowed, &out->x));
    BST_TRY(read_number(r, &v->y, allowed, &out->y));
    return read_number(r, &v->z, allowed, &out->z);
}

/* Time of the start of the exposure. */
static bst_status read_time(const reading *r, double exposure_s, bst_time *out) {
    const bst_keyword_time *t = &r->map->time;
    char text[BST_FITS_SOURCE_TEXT], clock[BST_FITS_SOURCE_TEXT], what[240];
    char both[2 * BST_FITS_SOURCE_TEXT + 2];
    double date;
    bst_ctx unheard = {0};
    bst_status status;
    if (!find(r, t->keyword, text)) {
        return wrong(r, t->keyword, "time", "is missing (allowed: a header with it)");
    }
    if (t->format == BST_KEYWORD_UTC) {
        bool apart = !strchr(text, 'T') && *t->clock_keyword && find(r, t->clock_keyword, clock);
        snprintf(both, sizeof both, "%s%s%s", text, apart ? "T" : "", apart ? clock : "");
        status = bst_time_from_utc(&unheard, both, out);
    } else if (!number_of(text, &date)) {
        snprintf(what, sizeof what, "is no number (found \"%.60s\")", text);
        return wrong(r, t->keyword, "time", what);
    } else {
        double whole = floor(date);
        status = bst_time_from_utc_jd(
            &unheard, (t->format == BST_KEYWORD_MJD ? 2400000.5 : 0.0) + whole, date - whole, out);
    }
    if (status != BST_OK) {
        snprintf(what, sizeof what, "is no time: %.200s", unheard.message);
        return wrong(r, t->keyword, "time", what);
    }
    *out = bst_time_add(*out, -0.5 * (double)t->moment * exposure_s);
    return BST_OK;
}

bst_status bst_keyword_map_read(bst_ctx *ctx, const bst_keyword_map *map, bst_fits_source *source,
                                const bst_fits_source_frame *frame, bst_keyword_values *out) {
    assert(map && source && frame && out);
    const reading r = {ctx, map, source, frame};
    const struct {
        const bst_keyword_number *number;
        range allowed;
        double *out;
    } numbers[] = {
        {&map->exposure_s, {"exposure_s", 0.0, 86400.0}, &out->exposure_s},
        {&map->gain_e_per_dn, {"gain_e_per_dn", 1e-3, 1e4}, &out->gain_e_per_dn},
        {&map->read_noise_e, {"read_noise_e", 0.0, 1e4}, &out->read_noise_e},
        {&map->offset_dn, {"offset_dn", -1e6, 1e6}, &out->offset_dn},
        {&map->full_well_e, {"full_well_e", 1.0, 1e9}, &out->full_well_e},
        {&map->pixel_scale_arcsec, {"pixel_scale_arcsec", 0.01, 600.0}, &out->pixel_scale_arcsec},
    };
    *out = (bst_keyword_values){.exposure_id = -1};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        BST_TRY(read_number(&r, numbers[i].number, &numbers[i].allowed, numbers[i].out));
    }
    double id;
    const range ids = {"exposure_id", -1.0, 9e15};
    BST_TRY(read_number(&r, &map->exposure_id, &ids, &id));
    out->exposure_id = (int64_t)id;
    const range places = {"observer_position_gcrf_m", -1e13, 1e13};
    const range speeds = {"observer_velocity_gcrf_mps", -1e6, 1e6};
    BST_TRY(read_vector(&r, &map->observer_position_gcrf_m, &places, &out->has_position,
                        &out->position_gcrf_m));
    BST_TRY(read_vector(&r, &map->observer_velocity_gcrf_mps, &speeds, &out->has_velocity,
                        &out->velocity_gcrf_mps));
    return read_time(&r, out->exposure_s, &out->start);
}

bst_status bst_keyword_section(bst_ctx *ctx, const char *keyword, bst_fits_source *source,
                               const bst_fits_source_frame *frame, int box[4]) {
    assert(keyword && source && frame && box);
    const reading r = {.ctx = ctx, .source = source, .frame = frame};
    char text[BST_FITS_SOURCE_TEXT], what[240];
    int x1, x2, y1, y2, used = 0;
    memset(box, 0, 4 * sizeof *box);
    if (!*keyword) {
        return BST_OK;
    }
    if (!find(&r, keyword, text)) {
        return wrong(&r, keyword, "section", "is missing (allowed: [x1:x2,y1:y2])");
    }
    if (!*text) {
        return BST_OK; /* the header says that there is none */
    }
    bool good = sscanf(text, "[%6d:%6d,%6d:%6d]%n", &x1, &x2, &y1, &y2, &used) == 4 && used > 0 &&
                text[used] == '\0' && x1 >= 1 && y1 >= 1 && x2 >= x1 && y2 >= y1 &&
                x2 <= frame->width && y2 <= frame->height;
    if (!good) {
        snprintf(what, sizeof what,
                 "is no part of the image (found \"%.60s\"; allowed: [x1:x2,y1:y2] within %d x %d)",
                 text, frame->width, frame->height);
        return wrong(&r, keyword, "section", what);
    }
    box[0] = x1 - 1;
    box[1] = y1 - 1;
    box[2] = x2 - x1 + 1;
    box[3] = y2 - y1 + 1;
    return BST_OK;
}

/* Reads a number that a header must have. */
static bool header_number(bst_fits_source *source, const char *keyword, double *out) {
    char text[BST_FITS_SOURCE_TEXT];
    return bst_fits_source_text(source, keyword, text) && number_of(text, out);
}

/* The matrix of a WCS, deg per pixel (Calabretta and Greisen 2002, section 6). */
static bool header_matrix(bst_fits_source *source, double cd[2][2]) {
    if (header_number(source, "CD1_1", &cd[0][0]) && header_number(source, "CD1_2", &cd[0][1]) &&
        header_number(source, "CD2_1", &cd[1][0]) && header_number(source, "CD2_2", &cd[1][1])) {
        return true;
    }
    double dx, dy, angle = 0.0;
    if (!header_number(source, "CDELT1", &dx) || !header_number(source, "CDELT2", &dy)) {
        return false;
    }
    (void)header_number(source, "CROTA2", &angle);
    double c = cos(angle * BST_DEG_RAD), s = sin(angle * BST_DEG_RAD);
    cd[0][0] = dx * c;
    cd[0][1] = -dy * s;
    cd[1][0] = dx * s;
    cd[1][1] = dy * c;
    return true;
}

bool bst_keyword_wcs(bst_fits_source *source, const bst_fits_source_frame *frame, bool flip_rows,
                     bst_quat *q_cam_from_gcrf, double *scale_arcsec) {
    double cd[2][2], pix[2], val[2];
    if (!header_matrix(source, cd) || !header_number(source, "CRPIX1", &pix[0]) ||
        !header_number(source, "CRPIX2", &pix[1]) || !header_number(source, "CRVAL1", &val[0]) ||
        !header_number(source, "CRVAL2", &val[1])) {
        return false;
    }
    double det = cd[0][0] * cd[1][1] - cd[0][1] * cd[1][0];
    double up = flip_rows ? -1.0 : 1.0;
    /* with z along the boresight, x right and y down are right-handed: the determinant is positive
     */
    if (!(up * det > 0.0) || !isfinite(det) || fabs(val[1]) > 90.0) {
        return false;
    }
    const bst_io_sky_plane plane = bst_io_sky_plane_at(val[0] * BST_DEG_RAD, val[1] * BST_DEG_RAD);
    bst_vec3 at[2];
    for (int k = 0; k < 2; k++) { /* the middle of the frame, and a pixel to the right of it */
        double x = 0.5 * (frame->width + 1) + k - pix[0], y = 0.5 * (frame->height + 1) - pix[1];
        at[k] = bst_io_sky_from_plane(&plane, (cd[0][0] * x + cd[0][1] * y) * BST_DEG_RAD,
                                      (cd[1][0] * x + cd[1][1] * y) * BST_DEG_RAD);
    }
    bst_vec3 z = at[0], right = bst_vec3_axpy(at[1], -bst_vec3_dot(at[1], z), z);
    if (!(bst_vec3_norm(right) > 0.0)) {
        return false;
    }
    bst_vec3 x = bst_vec3_unit(right), y = bst_vec3_cross(z, x);
    const bst_mat3 m = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    *q_cam_from_gcrf = bst_quat_from_mat3(&m);
    *scale_arcsec = sqrt(fabs(det)) * 3600.0;
    return true;
}
