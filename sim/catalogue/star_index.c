#include "sim/catalogue/star_index.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "sim/catalogue/stars.h"

#define REMEDY "run `boresight stars fetch` to make it again"

static const double TURN_PER_UNIT = 1.0 / 4294967296.0;
static const double PM_UNIT_RADPYR = 1e-4 * BST_ARCSEC_RAD;

static uint32_t pack_pm(int pm) {
    return (uint32_t)pm << 14;
}

/* Unpacks the upper 18 bits as a signed number. */
static int32_t unpack_pm(uint32_t word) {
    return (int32_t)(word >> 14) - (word >> 31 ? 1 << 18 : 0);
}

bst_status bst_star_pack(bst_ctx *ctx, const bst_star_values *v, bst_star_record *out) {
    int vt = v->vt_mmag + BST_STAR_VT_OFFSET;
    int colour = v->colour_mmag + BST_STAR_COLOUR_OFFSET;
    int limit = BST_STAR_PM_LIMIT;
    if (vt < 0 || vt > 0xFFFF || colour < 0 || colour > 0x3FFF || v->pm_ra_cosdec < -limit ||
        v->pm_ra_cosdec > limit || v->pm_dec < -limit || v->pm_dec > limit) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "magnitude or proper motion outside what a star record holds: VT %d mmag, "
                        "BT-VT %d mmag, proper motion %d, %d (0.1 mas/yr)",
                        v->vt_mmag, v->colour_mmag, v->pm_ra_cosdec, v->pm_dec);
    }
    double ra_turn = v->ra_rad / (2.0 * BST_PI);
    ra_turn -= floor(ra_turn);
    /* rounding up to a whole turn wraps to 0 in the conversion */
    out->ra = (uint32_t)(uint64_t)floor(ra_turn / TURN_PER_UNIT + 0.5);
    out->dec = (int32_t)lround(v->dec_rad / (2.0 * BST_PI) / TURN_PER_UNIT);
    out->tyc_vt = (v->id & 0xFFFFu) | (uint32_t)vt << 16;
    out->pm_ra_colour = pack_pm(v->pm_ra_cosdec) | (uint32_t)colour;
    out->pm_dec_flags = pack_pm(v->pm_dec) | (v->has_colour ? 0u : BST_STAR_NO_COLOUR);
    return BST_OK;
}

bst_vec3 bst_star_record_direction(const bst_star_record *r, double years) {
    double ra = r->ra * (2.0 * BST_PI * TURN_PER_UNIT);
    double dec = r->dec * (2.0 * BST_PI * TURN_PER_UNIT);
    double sin_ra = sin(ra), cos_ra = cos(ra), sin_dec = sin(dec), cos_dec = cos(dec);
    double east = unpack_pm(r->pm_ra_colour) * PM_UNIT_RADPYR * years;
    double north = unpack_pm(r->pm_dec_flags) * PM_UNIT_RADPYR * years;
    bst_vec3 p = {cos_dec * cos_ra - east * sin_ra - north * sin_dec * cos_ra,
                  cos_dec * sin_ra + east * cos_ra - north * sin_dec * sin_ra,
                  sin_dec + north * cos_dec};
    /* u and mu are perpendicular: |u + t mu| needs no sum of squares of p */
    return bst_vec3_scale(p, 1.0 / sqrt(1.0 + east * east + north * north));
}

void bst_star_record_set_parallax(bst_star_record *record, double parallax_mas) {
    double most = BST_STAR_PARALLAX_MAX_MAS;
    uint32_t units =
        (uint32_t)lround(fmin(fmax(parallax_mas, 0.0), most) / BST_STAR_PARALLAX_UNIT_MAS);
    record->pm_dec_flags = (record->pm_dec_flags & ~BST_STAR_PARALLAX_BITS) | units << 2;
}

void bst_star_move_epoch(bst_star_values *v, double years) {
    const double unit = 1e-4 * BST_ARCSEC_RAD;
    double sa = sin(v->ra_rad), ca = cos(v->ra_rad);
    double sd = sin(v->dec_rad), cd = cos(v->dec_rad);
    bst_vec3 u = {cd * ca, cd * sa, sd};
    bst_vec3 motion =
        bst_vec3_add(bst_vec3_scale((bst_vec3){-sa, ca, 0.0}, v->pm_ra_cosdec * unit),
                     bst_vec3_scale((bst_vec3){-sd * ca, -sd * sa, cd}, v->pm_dec * unit));
    bst_vec3 moved = bst_vec3_axpy(u, years, motion);
    double length = bst_vec3_norm(moved);
    u = bst_vec3_scale(moved, 1.0 / length);
    /* d/dt of (u + t mu) / |u + t mu| */
    motion = bst_vec3_scale(bst_vec3_axpy(motion, -bst_vec3_dot(u, motion), u), 1.0 / length);
    bst_vec3_to_radec(u, &v->ra_rad, &v->dec_rad);
    sa = sin(v->ra_rad);
    ca = cos(v->ra_rad);
    sd = sin(v->dec_rad);
    cd = cos(v->dec_rad);
    v->pm_ra_cosdec = (int)lround(bst_vec3_dot(motion, (bst_vec3){-sa, ca, 0.0}) / unit);
    v->pm_dec = (int)lround(bst_vec3_dot(motion, (bst_vec3){-sd * ca, -sd * sa, cd}) / unit);
}

uint64_t bst_star_checksum(const void *data, size_t bytes) {
    const unsigned char *p = data;
    const uint64_t prime = UINT64_C(0x9E3779B185EBCA87);
    uint64_t lane[4] = {1, 2, 3, 4};
    size_t done = 0;
    for (; done + 32 <= bytes; done += 32) {
        uint64_t w[4];
        memcpy(w, p + done, 32);
        for (int i = 0; i < 4; i++) {
            uint64_t x = (lane[i] ^ w[i]) * prime;
            lane[i] = x ^ x >> 29;
        }
    }
    uint64_t tail[4] = {0, 0, 0, 0};
    memcpy(tail, p + done, bytes - done);
    uint64_t sum = (uint64_t)bytes;
    for (int i = 0; i < 4; i++) {
        uint64_t x = (lane[i] ^ tail[i]) * prime;
        sum = (sum ^ x ^ x >> 29) * prime;
    }
    return sum ^ sum >> 32;
}

/* Checks a cell's cap: a larger one or a faster star would overflow a query's box. */
static bool is_cap_valid(const bst_star_cell *c) {
    return isfinite(c->centre[0]) && isfinite(c->centre[1]) && isfinite(c->centre[2]) &&
           fabsf(c->radius_rad) <= 7.0F && fabsf(c->pm_max_radpyr) <= 1.0F;
}

static bst_status check_patches(bst_ctx *ctx, const char *label, const bst_star_view *view) {
    for (uint32_t i = 0; i < view->header->patch_count; i++) {
        const bst_star_patch *p = &view->patches[i];
        if (!(p->ra_deg >= 0.0 && p->ra_deg < 360.0 && fabs(p->dec_deg) <= 90.0 &&
              p->radius_deg > 0.0 && p->radius_deg <= 180.0 && isfinite(p->v_mag))) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "star catalogue %s is damaged (patch %" PRIu32 "): " REMEDY, label, i);
        }
    }
    return BST_OK;
}

static bst_status check_cells(bst_ctx *ctx, const char *label, const bst_star_view *view) {
    uint64_t next = 0;
    for (uint32_t i = 0; i < view->header->cell_count; i++) {
        if (view->cells[i].first != next || !is_cap_valid(&view->cells[i])) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "star catalogue %s is damaged (sky cell %" PRIu32 "): " REMEDY, label,
                            i);
        }
        next += view->cells[i].count;
    }
    if (next != view->header->star_count) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s is damaged (cells hold %" PRIu64 " stars of %" PRIu64
                        "): " REMEDY,
                        label, next, view->header->star_count);
    }
    return BST_OK;
}

/* Checks the numbers of a variable star without its light curve. */
static bool is_variable_valid(const bst_star_variable *v) {
    const bool has_period =
        v->period_d >= BST_STAR_PERIOD_MIN_D && v->period_d <= BST_STAR_PERIOD_MAX_D;
    return v->amplitude_mag >= 0.0F && v->amplitude_mag <= 40.0F && v->table_mag >= -40.0F &&
           v->table_mag <= 40.0F && fabs(v->epoch_jd) <= 1e7 &&
           (has_period || (v->period_d == 0.0 && v->point_count > 0));
}

/* Checks variables and light curves. */
static bst_status check_variables(bst_ctx *ctx, const char *label, const bst_star_view *view,
                                  uint32_t point_count) {
    uint64_t points = 0; /* no two stars share points: the work grows with the file only */
    for (uint32_t i = 0; i < view->variable_count; i++) {
        const bst_star_variable *v = &view->variables[i];
        points += v->point_count;
        bool good = v->star < view->header->star_count &&
                    (i == 0 || v->star > view->variables[i - 1].star) && points <= point_count &&
                    (uint64_t)v->first_point + v->point_count <= point_count &&
                    is_variable_valid(v);
        const float least = v->period_d > 0.0 ? 0.0F : -1e7F;
        const float most = v->period_d > 0.0 ? 1.0F : 1e7F;
        for (uint32_t k = 0; good && k < v->point_count; k++) {
            const bst_star_point *p = &view->points[v->first_point + k];
            good = p->time >= least && p->time <= most && p->mag >= 0.0F && p->mag <= 40.0F &&
                   (k == 0 || p->time > p[-1].time);
        }
        if (!good) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "star catalogue %s is damaged (variable star %" PRIu32 "): " REMEDY,
                            label, i);
        }
    }
    return BST_OK;
}

static bst_status damaged_header(bst_ctx *ctx, const char *label) {
    return bst_fail(ctx, BST_ERR_FORMAT,
                    "star catalogue %s is damaged (numbers in the header): " REMEDY, label);
}

/* Checks what a file says of itself, its length and its checksum. */
static bst_status check_header(bst_ctx *ctx, const char *label, const void *data, uint64_t bytes,
                               bool sum) {
    const bst_star_header *h = data;
    if (bytes < sizeof h->magic || memcmp(h->magic, BST_STAR_MAGIC, sizeof h->magic) != 0) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s is not a Boresight star catalogue: run `boresight stars fetch` to make "
                        "one",
                        label);
    }
    if (bytes < sizeof *h) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s is truncated (%" PRIu64 " bytes): " REMEDY, label,
                        bytes);
    }
    if (h->endian != BST_STAR_ENDIAN) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s was written on a machine of the other byte "
                        "order: " REMEDY,
                        label);
    }
    if (h->version < BST_STAR_VERSION || h->version > BST_STAR_TIME_VERSION) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s has format version %" PRIu32
                        ", this program reads %u to %u: " REMEDY,
                        label, h->version, BST_STAR_VERSION, BST_STAR_TIME_VERSION);
    }
    if (bytes != h->file_bytes) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s is truncated or overlong (%" PRIu64 " bytes of %" PRIu64
                        "): " REMEDY,
                        label, bytes, h->file_bytes);
    }
    size_t skip = offsetof(bst_star_header, checksum) + sizeof h->checksum;
    uint64_t found =
        sum ? bst_star_checksum((const unsigned char *)data + skip, (size_t)(bytes - skip))
            : h->checksum;
    if (found != h->checksum) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "star catalogue %s is damaged (checksum %016" PRIx64
                        ", expected %016" PRIx64 "): " REMEDY,
                        label, found, h->checksum);
    }
    return BST_OK;
}

bst_status bst_star_view_init(bst_ctx *ctx, const char *label, const void *data, uint64_t bytes,
                              bool sum, bst_star_view *out) {
    const bst_star_header *h = data;
    BST_TRY(check_header(ctx, label, data, bytes, sum));
    bst_star_extension more = {0};
    const bool in_time = h->version == BST_STAR_TIME_VERSION;
    const size_t extension = in_time ? sizeof more : 0;
    if (in_time && bytes >= sizeof *h + sizeof more) {
        memcpy(&more, h + 1, sizeof more);
    }
    uint64_t whole = sizeof *h + extension + h->patch_count * (uint64_t)sizeof(bst_star_patch) +
                     more.variable_count * (uint64_t)sizeof(bst_star_variable) +
                     more.point_count * (uint64_t)sizeof(bst_star_point) +
                     h->cell_count * (uint64_t)sizeof(bst_star_cell);
    bool counts_fit = h->patch_count <= BST_STAR_PATCHES_MAX && h->star_count <= UINT32_MAX &&
                      h->cell_count >= BST_STAR_CELLS && h->cell_count <= BST_STAR_CELLS_MAX &&
                      (h->cell_count == BST_STAR_CELLS || h->version != BST_STAR_VERSION);
    whole += h->star_count * (uint64_t)sizeof(bst_star_record);
    if (!counts_fit || !isfinite(h->complete_to_v_mag) || bytes < whole) {
        return damaged_header(ctx, label);
    }
    out->header = h;
    const unsigned char *after = (const unsigned char *)(h + 1) + extension;
    out->patches = (const bst_star_patch *)(const void *)after;
    out->variables = (const bst_star_variable *)(const void *)(out->patches + h->patch_count);
    out->variable_count = more.variable_count;
    out->points = (const bst_star_point *)(out->variables + more.variable_count);
    out->cells = (const bst_star_cell *)(const void *)(out->points + more.point_count);
    out->records = (const bst_star_record *)(out->cells + h->cell_count);
    out->has_parallax = in_time;
    BST_TRY(check_patches(ctx, label, out));
    BST_TRY(check_cells(ctx, label, out));
    BST_TRY(check_variables(ctx, label, out, more.point_count));
    const bst_star_cell *last = &out->cells[BST_STAR_CELLS - 1];
    out->tycho2_count = last->first + last->count;
    uint64_t table = h->star_count - out->tycho2_count;
    if (bytes != whole + table * sizeof(int64_t) || table > BST_STAR_TABLE_IDS) {
        return damaged_header(ctx, label);
    }
    out->sources = h->version != BST_STAR_VERSION ? (const unsigned char *)data + whole : NULL;
    return BST_OK;
}
