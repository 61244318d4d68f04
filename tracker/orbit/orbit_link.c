#include "tracker/orbit/orbit_link.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* standard deviations of chi-square beyond its expectation, up to which an arc fits */
static const double MOST_SIGMAS = 5.0;

/* Fits of pairs, most of which are hopeless: least_gain, as chi-square is compared with a limit;
 * most_iterations and most_failures. */
static const double LEAST_GAIN = 1e-3;
enum { MOST_ITERATIONS = 25, MOST_FAILURES = 4 };

/* Largest chi-square of directions that fit an orbit. */
static double most_chi2(int count) {
    const double dof = 2.0 * count - 6.0;
    return dof + MOST_SIGMAS * sqrt(2.0 * dof);
}

/* Appends a direction, whose shared error has changed by `change` since the one before. */
static void append(bst_od_observation *out, int *n, const bst_od_observation *z, double change) {
    out[*n] = *z;
    out[(*n)++].shared_change = change;
}

/* Joins the directions of an item and of an arc in order of time; every second one of the item's
 * is left out until there is room. Those of the item and of the arc share no errors. Returns their
 * number. */
static int join(const bst_od_linked *item, const bst_od_observation *arc, int count,
                bst_od_observation out[BST_OD_LINK_DIRECTIONS]) {
    int every = 1, n = 0, k = 0;
    while ((item->count + every - 1) / every + count > BST_OD_LINK_DIRECTIONS) {
        every *= 2;
    }
    bool from_arc = false;
    for (int i = 0; i < item->count; i += every) {
        double change = item->directions[i].shared_change;
        for (int left = i > 0 ? i - every + 1 : i; left < i; left++) {
            change += item->directions[left].shared_change;
        }
        for (; k < count && arc[k].observer.time_s < item->directions[i].observer.time_s; k++) {
            append(out, &n, &arc[k], from_arc ? arc[k].shared_change : INFINITY);
            from_arc = true;
        }
        append(out, &n, &item->directions[i], from_arc ? INFINITY : change);
        from_arc = false;
    }
    for (; k < count; k++) {
        append(out, &n, &arc[k], from_arc ? arc[k].shared_change : INFINITY);
        from_arc = true;
    }
    return n;
}

/* Whether an arc and one that waits are of two tracks which a sensor had at the same time, and so
 * of two objects. */
static bool is_beside(const bst_od_linked *item, int64_t sensor, const bst_od_observation *arc,
                      int count) {
    const bst_od_observation *own = item->directions;
    return item->arcs == 1 && item->sensor == sensor &&
           arc[0].observer.time_s <= own[item->count - 1].observer.time_s &&
           arc[count - 1].observer.time_s >= own[0].observer.time_s;
}

/* Fits an orbit to an item's directions and those of an arc. False: they do not fit. */
static bool fits(const bst_od_linked *item, const bst_od_motion *motion,
                 const bst_od_observation *arc, int count, bst_od_linked *out) {
    const bst_od_options options = {.motion = *motion,
                                    .least_gain = LEAST_GAIN,
                                    .most_iterations = MOST_ITERATIONS,
                                    .most_failures = MOST_FAILURES};
    bst_ctx quiet = {0};
    bst_od_solution found;
    out->count = join(item, arc, count, out->directions);
    const bst_status status =
        item->arcs > 1
            ? bst_od_fit(&quiet, out->directions, out->count, &options, &item->state, NULL, &found)
            : bst_od_determine(&quiet, out->directions, out->count, &options, NULL, &found, NULL);
    if (status != BST_OK || !(found.chi2 < most_chi2(out->count))) {
        return false;
    }
    out->arcs = item->arcs + 1;
    out->state = found.state;
    out->chi2 = found.chi2;
    out->id = item->id;
    out->sensor = item->sensor;
    return true;
}

/* Index of the item that gives its place to a new one. */
static int place_of(bst_od_linker *l) {
    int oldest = 0;
    if (l->count < BST_OD_LINK_ORBITS) {
        return l->count++;
    }
    for (int i = 1; i < l->count; i++) {
        const bool waits = l->items[i].arcs == 1, kept = l->items[oldest].arcs == 1;
        if (waits == kept ? l->items[i].id < l->items[oldest].id : waits) {
            oldest = i;
        }
    }
    return oldest;
}

int bst_od_link_arc(bst_od_linker *l, const bst_od_motion *motion, int64_t sensor,
                    const bst_od_observation *directions, int count, double within_s) {
    assert(l && motion && directions && count >= BST_OD_LEAST &&
           count <= BST_OD_LINK_DIRECTIONS / 2);
    bst_od_linked best = {.arcs = 0};
    int chosen = -1;
    /* first the orbits, then the arcs that wait */
    for (int waiting = 0; waiting < 2 && chosen < 0; waiting++) {
        for (int i = 0; i < l->count; i++) {
            const bst_od_linked *item = &l->items[i];
            const double last_s = item->directions[item->count - 1].observer.time_s;
            bst_od_linked now = {.arcs = 0}; /* all bytes are in a saved state */
            if ((item->arcs == 1) == (waiting == 1) &&
                directions[0].observer.time_s - last_s <= within_s &&
                !is_beside(item, sensor, directions, count) &&
                fits(item, motion, directions, count, &now) &&
                (chosen < 0 || now.chi2 - 2.0 * now.count < best.chi2 - 2.0 * best.count)) {
                best = now;
                chosen = i;
            }
        }
    }
    if (chosen < 0) {
        chosen = place_of(l);
        best = (bst_od_linked){.arcs = 1, .count = count, .id = ++l->made, .sensor = sensor};
        memcpy(best.directions, directions, (size_t)count * sizeof *directions);
    }
    l->items[chosen] = best;
    return chosen;
}

void bst_od_linker_drop(bst_od_linker *l, int index) {
    assert(l && index >= 0 && index < l->count);
    l->items[index] = l->items[--l->count];
}

/* Whether an item's times are those of a run. */
static bool is_possible(const bst_od_linked *item) {
    bool possible = fabs(item->state.time_s) <= BST_OD_LONGEST_S;
    for (int i = 0; i < item->count; i++) {
        possible = possible && fabs(item->directions[i].observer.time_s) <= BST_OD_LONGEST_S;
    }
    return possible;
}

bst_status bst_od_linker_archive(bst_od_linker *l, bst_archive *archive) {
    l->count = bst_archive_count(archive, l->count, BST_OD_LINK_ORBITS);
    BST_ARCHIVE(archive, l->made);
    for (int i = 0; i < l->count; i++) {
        BST_ARCHIVE(archive, l->items[i]);
        if (l->items[i].count < 1 || l->items[i].count > BST_OD_LINK_DIRECTIONS ||
            l->items[i].arcs < 1) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state has %d directions of %d arcs of an unknown object",
                            (int)l->items[i].count, (int)l->items[i].arcs);
        }
        if (!is_possible(&l->items[i])) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state has an unknown object at a time more than %g s from "
                            "the epoch",
                            BST_OD_LONGEST_S);
        }
    }
    return BST_OK;
}
