#include "sim/catalogue/star_groups.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Cap around one cell; radius below 0: it has no stars. */
static bst_star_group cap_of_cell(const bst_star_view *view, uint32_t c) {
    const bst_star_cell *cell = &view->cells[c];
    return (bst_star_group){
        {cell->centre[0], cell->centre[1], cell->centre[2]},
        cell->count > 0 ? (double)cell->radius_rad : -1.0,
        cell->pm_max_radpyr,
        cell->count > 0 ? bst_star_record_v(&view->records[cell->first]) : INT32_MAX};
}

/* Cap around other caps. */
static bst_star_group enclose(const bst_star_group *caps, uint32_t count) {
    bst_star_group out = {.radius = -1.0, .brightest = INT32_MAX}; /* no stars */
    int filled = 0;
    for (uint32_t c = 0; c < count; c++) {
        filled += caps[c].radius >= 0.0;
        for (int k = 0; k < 3 && caps[c].radius >= 0.0; k++) {
            out.centre[k] += caps[c].centre[k];
        }
    }
    for (int k = 0; k < 3 && filled > 0; k++) {
        out.centre[k] /= filled;
    }
    for (uint32_t c = 0; c < count; c++) {
        if (caps[c].radius >= 0.0) {
            double dx = caps[c].centre[0] - out.centre[0], dy = caps[c].centre[1] - out.centre[1],
                   dz = caps[c].centre[2] - out.centre[2];
            double away = sqrt(dx * dx + dy * dy + dz * dz);
            out.radius = fmax(out.radius, away + caps[c].radius + 1e-9);
            out.pm_max_radpyr = fmax(out.pm_max_radpyr, caps[c].pm_max_radpyr);
            out.brightest = caps[c].brightest < out.brightest ? caps[c].brightest : out.brightest;
        }
    }
    return out;
}

bst_status bst_star_groups_make(bst_ctx *ctx, const bst_star_view *view, bst_star_groups *s) {
    assert(view && s);
    const uint32_t cells = view->header->cell_count;
    const uint32_t groups = cells / BST_STAR_GROUP + 1, regions = groups / BST_STAR_GROUP + 1;
    s->groups = calloc(1, (groups + regions) * sizeof *s->groups + cells * sizeof *s->brightest);
    if (!s->groups) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the star catalogue");
    }
    s->regions = s->groups + groups;
    s->brightest = (int32_t *)(s->regions + regions);
    for (uint32_t g = 0; g < groups; g++) {
        bst_star_group caps[BST_STAR_GROUP];
        uint32_t count = 0;
        for (uint32_t c = g * BST_STAR_GROUP; c < cells && count < BST_STAR_GROUP; c++) {
            caps[count] = cap_of_cell(view, c);
            s->brightest[c] = caps[count++].brightest;
        }
        s->groups[g] = enclose(caps, count);
    }
    for (uint32_t r = 0; r < regions; r++) {
        uint32_t first = r * BST_STAR_GROUP, left = groups > first ? groups - first : 0;
        s->regions[r] = enclose(s->groups + first, left < BST_STAR_GROUP ? left : BST_STAR_GROUP);
    }
    return BST_OK;
}

void bst_star_groups_free(bst_star_groups *groups) {
    free(groups->groups);
    *groups = (bst_star_groups){0};
}
