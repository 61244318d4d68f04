/* Values of a frame's header by a keyword map. */
#include <assert.h>
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/ccsds_time.h"
#include "sim/io/keyword_values_internal.h"

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
static void warn_of_history(const bst_keyword_reading *r, const char *keyword, const char *key) {
    char where[BST_FRAME_WHERE_TEXT];
    bst_log(r->ctx, BST_LOG_WARNING,
            "%s: %s%s (%s of the map %s): is no number: the history is not used",
            bst_frame_where(bst_frame_source_path(r->source), r->frame, where),
            bst_frame_source_noun(r->source), keyword, key, r->map->name);
}

void bst_keyword_rate_trend(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                            const bst_frame_place *frame, double exposure_s, double *trend,
                            double *sigma) {
    const bst_keyword_reading r = {ctx, map, source, frame};
    double n = 0.0, t = 0.0, v = 0.0, tt = 0.0, tv = 0.0, vv = 0.0;
    *trend = *sigma = NAN;
    for (int i = 0; i < HISTORY_MOST && *map->rate_history.time; i++) {
        char keyword[BST_KEYWORD_TEXT], text[BST_FITS_SOURCE_TEXT];
        double time, rate;
        if (!entry_keyword(map->rate_history.time, i, keyword) ||
            !bst_frame_source_text(source, keyword, text)) {
            break;
        }
        if (!bst_keyword_number_of(text, &time)) {
            warn_of_history(&r, keyword, "rate_history.time");
            return;
        }
        if (!entry_keyword(map->rate_history.rate, i, keyword) ||
            !bst_frame_source_text(source, keyword, text)) {
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

/* True if a map names a source for all components of a vector and the frame has them. */
static bool has_vector(const bst_keyword_reading *r, const bst_keyword_vector *v) {
    const bst_keyword_number *const parts[] = {&v->x, &v->y, &v->z};
    char text[BST_FITS_SOURCE_TEXT];
    for (int i = 0; i < 3; i++) {
        if (isnan(parts[i]->value) &&
            !(*parts[i]->keyword && bst_keyword_find(r, parts[i]->keyword, text))) {
            return false;
        }
    }
    return true;
}

static bst_status read_vector(const bst_keyword_reading *r, const bst_keyword_vector *v,
                              const bst_keyword_range *allowed, bool *has, bst_vec3 *out) {
    *has = has_vector(r, v);
    *out = (bst_vec3){0, 0, 0};
    if (!*has) {
        return BST_OK;
    }
    BST_TRY(bst_keyword_read_number(r, &v->x, allowed, &out->x));
    BST_TRY(bst_keyword_read_number(r, &v->y, allowed, &out->y));
    return bst_keyword_read_number(r, &v->z, allowed, &out->z);
}

/* Time scale of the dates. TIMESYS by FITS 4.0, section 9.2.1 and table 30: a realisation may
 * follow in parentheses, TT has the former names TDT and ET, TAI the former IAT, UTC the former UT
 * and GMT.
 */
static bst_status read_scale(const bst_keyword_reading *r, const char *date,
                             bst_astro_time_system *out) {
    static const char *const former[][2] = {
        {"TDT", "TT"}, {"ET", "TT"}, {"IAT", "TAI"}, {"UT", "UTC"}, {"GMT", "UTC"}};
    const bst_keyword_time *t = &r->map->time;
    char text[BST_FITS_SOURCE_TEXT], what[240];
    *out = t->scale == BST_KEYWORD_TIMESYS ? BST_TIME_UTC : (bst_astro_time_system)(t->scale - 1);
    size_t length = strlen(date);
    if (t->scale != BST_KEYWORD_TIMESYS || t->format == BST_KEYWORD_UNIX ||
        (length > 0 && date[length - 1] == 'Z') || !bst_keyword_find(r, "TIMESYS", text) ||
        !*text) {
        return BST_OK;
    }
    snprintf(
        what, sizeof what,
        "names a time scale that is not read (found \"%.40s\"; allowed: UTC, TAI, TT, TDB, GPS, "
        "or a map with time/scale)",
        text);
    text[strcspn(text, "(")] = '\0';
    for (char *c = text; *c; c++) {
        *c = *c == ' ' ? '\0' : (char)toupper((unsigned char)*c);
    }
    const char *name = text;
    for (size_t i = 0; i < sizeof former / sizeof *former; i++) {
        name = strcmp(text, former[i][0]) == 0 ? former[i][1] : name;
    }
    return bst_astro_time_system_find(name, strlen(name), out)
               ? BST_OK
               : bst_keyword_wrong(r, "TIMESYS", "time", what);
}

/* Time of a date in text. */
static bst_status time_of_date(bst_ctx *ctx, const char *date, bst_astro_time_system scale,
                               bst_time *out) {
    return scale == BST_TIME_UTC ? bst_time_from_utc(ctx, date, out)
                                 : bst_ccsds_time(ctx, date, strlen(date), scale, out);
}

/* Whether a time lies in the years for which UTC is accepted. */
static bst_status check_years(bst_ctx *ctx, bst_time t) {
    double jd1, jd2;
    bst_time same;
    bst_time_utc(t, &jd1, &jd2);
    return bst_time_from_utc_jd(ctx, jd1, jd2, &same);
}

/* Time of the start of the exposure. */
static bst_status read_time(const bst_keyword_reading *r, double exposure_s, bst_time *out) {
    const bst_keyword_time *t = &r->map->time;
    char text[BST_FITS_SOURCE_TEXT], clock[BST_FITS_SOURCE_TEXT], what[240];
    char both[2 * BST_FITS_SOURCE_TEXT + 2];
    double date;
    bst_ctx unheard = {0};
    bst_status status;
    bst_astro_time_system scale;
    if (!bst_keyword_find(r, t->keyword, text)) {
        return bst_keyword_wrong(r, t->keyword, "time",
                                 "is missing (allowed: a header or side table with it)");
    }
    if (t->format == BST_KEYWORD_UTC) {
        if (strlen(text) > 11 && text[10] == ' ') {
            text[10] = 'T'; /* as spreadsheets and other programs write it */
        }
        bool apart =
            !strchr(text, 'T') && *t->clock_keyword && bst_keyword_find(r, t->clock_keyword, clock);
        snprintf(both, sizeof both, "%s%s%s", text, apart ? "T" : "", apart ? clock : "");
        BST_TRY(read_scale(r, both, &scale));
        status = time_of_date(&unheard, both, scale, out);
    } else if (!bst_keyword_number_of(text, &date)) {
        snprintf(what, sizeof what, "is no number (found \"%.60s\")", text);
        return bst_keyword_wrong(r, t->keyword, "time", what);
    } else if (t->format == BST_KEYWORD_UNIX) { /* day and second apart, for their digits */
        double days = floor(date / BST_DAY_S);
        status = bst_time_from_utc_jd(&unheard, 2440587.5 + days,
                                      (date - BST_DAY_S * days) / BST_DAY_S, out);
    } else {
        double whole = floor(date);
        BST_TRY(read_scale(r, "", &scale));
        status = bst_time_from_jd(&unheard, scale,
                                  (t->format == BST_KEYWORD_MJD ? 2400000.5 : 0.0) + whole,
                                  date - whole, out);
    }
    if (status == BST_OK) {
        status = check_years(&unheard, *out);
    }
    if (status != BST_OK) {
        snprintf(what, sizeof what, "is no time: %.200s", unheard.message);
        return bst_keyword_wrong(r, t->keyword, "time", what);
    }
    *out = bst_time_add(*out, -0.5 * (double)t->moment * exposure_s);
    return BST_OK;
}

bst_status bst_keyword_map_read(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                                const bst_frame_place *frame, bst_keyword_values *out) {
    assert(map && source && frame && out);
    const bst_keyword_reading r = {ctx, map, source, frame};
    const struct {
        const bst_keyword_number *number;
        bst_keyword_range allowed;
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
        BST_TRY(
            bst_keyword_read_number(&r, numbers[i].number, &numbers[i].allowed, numbers[i].out));
    }
    double id;
    const bst_keyword_range ids = {"exposure_id", -1.0, 9e15};
    BST_TRY(bst_keyword_read_number(&r, &map->exposure_id, &ids, &id));
    if (id != floor(id)) {
        char what[80];
        snprintf(what, sizeof what, "gives %.9g (allowed: a whole number)", id);
        return bst_keyword_wrong(&r, map->exposure_id.keyword, ids.key, what);
    }
    out->exposure_id = (int64_t)id;
    const bst_keyword_range places = {"observer_position_gcrf_m", -1e13, 1e13};
    const bst_keyword_range speeds = {"observer_velocity_gcrf_mps", -1e6, 1e6};
    BST_TRY(read_vector(&r, &map->observer_position_gcrf_m, &places, &out->has_position,
                        &out->position_gcrf_m));
    BST_TRY(read_vector(&r, &map->observer_velocity_gcrf_mps, &speeds, &out->has_velocity,
                        &out->velocity_gcrf_mps));
    double period_s;
    const bst_keyword_range periods = {"plane_period_s", 0.0, 1e6};
    BST_TRY(bst_keyword_read_number(&r, &map->plane_period_s, &periods, &period_s));
    BST_TRY(read_time(&r, out->exposure_s, &out->start));
    if (frame->plane > 0) {
        out->start = bst_time_add(out->start, period_s * (double)frame->plane);
    }
    return BST_OK;
}

bst_status bst_keyword_section(bst_ctx *ctx, const char *keyword, bst_frame_source *source,
                               const bst_frame_place *frame, int box[4]) {
    assert(keyword && source && frame && box);
    const bst_keyword_reading r = {.ctx = ctx, .source = source, .frame = frame};
    char text[BST_FITS_SOURCE_TEXT], what[240];
    int x1, x2, y1, y2, used = 0;
    memset(box, 0, 4 * sizeof *box);
    if (!*keyword) {
        return BST_OK;
    }
    if (bst_keyword_is_empty(&r, keyword)) {
        return BST_OK; /* the frame says that there is none */
    }
    if (!bst_keyword_find(&r, keyword, text)) {
        return bst_keyword_wrong(&r, keyword, "section", "is missing (allowed: [x1:x2,y1:y2])");
    }
    bool good = sscanf(text, "[%6d:%6d,%6d:%6d]%n", &x1, &x2, &y1, &y2, &used) == 4 && used > 0 &&
                text[used] == '\0' && x1 >= 1 && y1 >= 1 && x2 >= x1 && y2 >= y1 &&
                x2 <= frame->width && y2 <= frame->height;
    if (!good) {
        snprintf(what, sizeof what,
                 "is no part of the image (found \"%.60s\"; allowed: [x1:x2,y1:y2] within %d x %d)",
                 text, frame->width, frame->height);
        return bst_keyword_wrong(&r, keyword, "section", what);
    }
    box[0] = x1 - 1;
    box[1] = y1 - 1;
    box[2] = x2 - x1 + 1;
    box[3] = y2 - y1 + 1;
    return BST_OK;
}
