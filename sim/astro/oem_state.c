#include <string.h>

#include "sim/astro/oem_internal.h"

/* tolerance outside a time span: epochs in files are rounded */
#define SLACK_S 1e-6

int bst_oem_object_count(const bst_oem *oem) {
    return oem->object_count;
}
const char *bst_oem_object_name(const bst_oem *oem, int object) {
    return oem->objects[object].name;
}
const char *bst_oem_object_id(const bst_oem *oem, int object) {
    return oem->objects[object].id;
}

bst_status bst_oem_find(bst_ctx *ctx, const bst_oem *oem, const char *name, int *object) {
    int found = -1, matches = 0;
    for (int i = 0; i < oem->object_count; i++) {
        if (!*name || strcmp(oem->objects[i].name, name) == 0 ||
            strcmp(oem->objects[i].id, name) == 0) {
            found = i;
            matches++;
        }
    }
    if (matches == 1) {
        *object = found;
        return BST_OK;
    }
    const bst_oem_object *first = &oem->objects[found < 0 ? 0 : found];
    if (matches == 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND,
                        "%.400s: no object \"%.100s\" by name or identifier among %d (the first: "
                        "\"%s\", %s)",
                        oem->name, name, oem->object_count, first->name, first->id);
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND,
                    "%.400s: %d objects fit \"%.100s\" (the last: \"%s\", %s); give the name or "
                    "identifier of one",
                    oem->name, matches, name, first->name, first->id);
}

void bst_oem_span(const bst_oem *oem, int object, bst_time *start, bst_time *stop) {
    const bst_oem_object *o = &oem->objects[object];
    const bst_oem_segment_rows *first = &oem->segments[o->first], *last = first + o->count - 1;
    *start = bst_time_add(first->base, first->from_s);
    *stop = bst_time_add(last->base, last->to_s);
}

/* Last segment of the object that starts at or before t, else the first one. */
static const bst_oem_segment_rows *segment_at(const bst_oem *oem, const bst_oem_object *o,
                                              bst_time t) {
    int low = o->first, high = o->first + o->count;
    while (high - low > 1) {
        int middle = low + (high - low) / 2;
        const bst_oem_segment_rows *s = &oem->segments[middle];
        if (bst_time_diff(t, s->base) >= s->from_s) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return &oem->segments[low];
}

static bool within(const bst_oem_segment_rows *s, bst_time t) {
    double seconds = bst_time_diff(t, s->base);
    return seconds >= s->from_s - SLACK_S && seconds <= s->to_s + SLACK_S;
}

bool bst_oem_covers(const bst_oem *oem, int object, bst_time from, bst_time to) {
    const bst_oem_object *o = &oem->objects[object];
    const bst_oem_segment_rows *s = segment_at(oem, o, from);
    const bst_oem_segment_rows *end = oem->segments + o->first + o->count;
    if (!within(s, from)) {
        return false;
    }
    while (!within(s, to)) {
        bst_time joint = bst_time_add(s->base, s->to_s);
        s++;
        if (s == end || bst_time_diff(to, joint) < 0.0 || !within(s, joint)) {
            return false;
        }
    }
    return true;
}

static bst_status fail_outside(bst_ctx *ctx, const bst_oem *oem, int object, bst_time t) {
    bst_time start, stop;
    char texts[3][40];
    bst_oem_span(oem, object, &start, &stop);
    bst_time_to_utc(t, 3, texts[0], sizeof texts[0]);
    bst_time_to_utc(start, 3, texts[1], sizeof texts[1]);
    bst_time_to_utc(stop, 3, texts[2], sizeof texts[2]);
    const bst_oem_object *o = &oem->objects[object];
    return bst_fail(ctx, BST_ERR_NUMERIC,
                    "%.400s: no state of \"%s\" at %s: the file covers %s to %s%s", oem->name,
                    o->name, texts[0], texts[1], texts[2],
                    bst_time_diff(t, start) > 0.0 && bst_time_diff(stop, t) > 0.0
                        ? ", with a gap there between two segments"
                        : "");
}

bst_status bst_oem_state(bst_ctx *ctx, const bst_oem *oem, int object, bst_sky_clock *clock,
                         bst_time t, bst_vec3 *position_m, bst_vec3 *velocity_mps) {
    const bst_oem_object *o = &oem->objects[object];
    const bst_oem_segment_rows *s = segment_at(oem, o, t);
    if (!within(s, t)) {
        /* a segment may start within the tolerance */
        bool last = s == oem->segments + o->first + o->count - 1;
        if (last || !within(s + 1, t)) {
            return fail_outside(ctx, oem, object, t);
        }
        s++;
    }
    bst_vec3 r, v;
    bst_interpolate(oem->rows + s->first, s->rows, bst_time_diff(t, s->base), s->points, s->hermite,
                    &r, &v);
    if (s->axes == BST_OEM_GCRF) {
        *position_m = r;
        *velocity_mps = v;
        return BST_OK;
    }
    if (!clock) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%.400s: TEME and ITRF need Earth orientation",
                        oem->name);
    }
    bst_sky_rotation sky;
    BST_TRY(bst_sky_clock_at(ctx, clock, t, &sky));
    if (s->axes == BST_OEM_TEME) {
        *position_m = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, r);
        *velocity_mps = bst_mat3_mul_vec(&sky.frames.gcrf_from_teme, v);
        return BST_OK;
    }
    *position_m = bst_mat3_transpose_mul_vec(&sky.frames.itrf_from_gcrf, r);
    *velocity_mps =
        bst_vec3_add(bst_mat3_transpose_mul_vec(&sky.frames.itrf_from_gcrf, v),
                     bst_vec3_cross(bst_astro_earth_rate_gcrf(&sky.frames), *position_m));
    return BST_OK;
}
