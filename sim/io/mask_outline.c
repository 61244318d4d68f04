#include "sim/io/mask_outline.h"

#include <stdbool.h>
#include <stdlib.h>

typedef struct corner {
    int x, y;
} corner;

/* A closed line along pixel edges, with the source's pixels on its right. */
typedef struct loop {
    int x, y;            /* a pixel of the source below one of the loop's edges */
    size_t first, count; /* index and number of its corners */
    double area;         /* positive: an outline; negative: a hole */
    int outline;         /* of a hole: index of the enclosing outline */
    size_t outline_corner,
        own_corner; /* of a hole: corners that the seam connects, as indices in the loops */
} loop;

typedef struct tracer {
    const bst_mask_item *item;
    uint8_t *begun; /* pixels of the box whose upper edge is already part of a loop */
    corner *corners;
    size_t corner_count, corner_room;
    loop *loops;
    size_t loop_count, loop_room;
} tracer;

/* True if the mask pixel belongs to the outlined source. */
static bool has(const tracer *t, int x, int y) {
    const bst_mask_item *m = t->item;
    return x >= m->x0 && x < m->x1 && y >= m->y0 && y < m->y1 &&
           m->mask[(size_t)y * (size_t)m->width + (size_t)x] == m->item;
}

/* Makes room for one more item of a list with `count` items. */
static bst_status make_room(bst_ctx *ctx, void **list, size_t count, size_t *room, size_t bytes) {
    if (count < *room) {
        return BST_OK;
    }
    size_t wanted = *room ? 2 * *room : 64;
    void *grown = realloc(*list, wanted * bytes);
    if (!grown) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the outline of a source");
    }
    *list = grown;
    *room = wanted;
    return BST_OK;
}

/* Adds a corner of the polygon. */
static bst_status add_corner(bst_ctx *ctx, tracer *t, int x, int y) {
    BST_TRY(
        make_room(ctx, (void **)&t->corners, t->corner_count, &t->corner_room, sizeof *t->corners));
    t->corners[t->corner_count++] = (corner){x, y};
    return BST_OK;
}

/* Checks the pixel ahead of a corner, right or left of a direction: 0 right, 1 down, 2 left, 3
 * up. */
static bool has_ahead(const tracer *t, int x, int y, int direction, bool right) {
    int side = right ? direction : (direction + 3) % 4;
    return has(t, side == 1 || side == 2 ? x - 1 : x, side == 2 || side == 3 ? y - 1 : y);
}

/* Traces the loop that starts right along the upper edge of pixel (x, y). Where pixels share only a
 * corner it turns right: an outline contains pixels that share edges. */
static bst_status trace(bst_ctx *ctx, tracer *t, int x, int y) {
    static const int step_x[] = {1, 0, -1, 0}, step_y[] = {0, 1, 0, -1};
    const bst_mask_item *m = t->item;
    loop *l;
    int start_x = x, start_y = y, direction = 0;
    BST_TRY(make_room(ctx, (void **)&t->loops, t->loop_count, &t->loop_room, sizeof *t->loops));
    l = &t->loops[t->loop_count++];
    *l = (loop){.x = x, .y = y, .first = t->corner_count, .outline = -1};
    do {
        if (direction == 0) {
            t->begun[(size_t)(y - m->y0) * (size_t)(m->x1 - m->x0) + (size_t)(x - m->x0)] = 1;
        }
        x += step_x[direction];
        y += step_y[direction];
        /* shoelace formula: twice the area, y down */
        l->area += (double)(x - step_x[direction]) * y - (double)x * (y - step_y[direction]);
        int turn = !has_ahead(t, x, y, direction, true)   ? 1
                   : has_ahead(t, x, y, direction, false) ? 3
                                                          : 0;
        if (turn != 0) {
            BST_TRY(add_corner(ctx, t, x, y));
        }
        direction = (direction + turn) % 4;
    } while (x != start_x || y != start_y || direction != 0);
    l->count = t->corner_count - l->first;
    return BST_OK;
}

/* Checks whether the centre of pixel (x, y) is inside a loop: even-odd rule along a line to the
 * left. */
static bool encloses(const tracer *t, const loop *l, int x, int y) {
    const corner *c = t->corners + l->first;
    bool inside = false;
    for (size_t i = 0, before = l->count - 1; i < l->count; before = i++) {
        bool crosses = c[i].x == c[before].x && c[i].x <= x && (c[i].y <= y) != (c[before].y <= y);
        inside = inside != crosses;
    }
    return inside;
}

/* Assigns a hole to the smallest enclosing outline; the seam connects their nearest corners. */
static void join(tracer *t, loop *hole) {
    const corner *own = t->corners + hole->first;
    double least = -1.0;
    for (size_t i = 0; i < t->loop_count; i++) {
        const loop *l = &t->loops[i];
        if (l->area > 0.0 && encloses(t, l, hole->x, hole->y) &&
            (hole->outline < 0 || l->area < t->loops[hole->outline].area)) {
            hole->outline = (int)i;
        }
    }
    const loop *l = &t->loops[hole->outline];
    for (size_t i = 0; i < l->count; i++) {
        for (size_t k = 0; k < hole->count; k++) {
            const corner *a = &t->corners[l->first + i], *b = &own[k];
            double dx = a->x - b->x, dy = a->y - b->y, d = dx * dx + dy * dy;
            if (least < 0.0 || d < least) {
                least = d;
                hole->outline_corner = i;
                hole->own_corner = k;
            }
        }
    }
}

static void write_corner(FILE *stream, const corner *c, bool first) {
    fprintf(stream, "%s%d,%d", first ? "" : ",", c->x, c->y);
}

/* Writes an outline with its holes as one polygon. */
static void write_polygon(const tracer *t, size_t index, FILE *stream) {
    const loop *l = &t->loops[index];
    for (size_t i = 0; i < l->count; i++) {
        write_corner(stream, &t->corners[l->first + i], i == 0);
        for (size_t h = 0; h < t->loop_count; h++) {
            const loop *hole = &t->loops[h];
            if (hole->outline != (int)index || hole->outline_corner != i) {
                continue;
            }
            for (size_t k = 0; k <= hole->count; k++) {
                size_t at = (hole->own_corner + k) % hole->count;
                write_corner(stream, &t->corners[hole->first + at], false);
            }
            write_corner(stream, &t->corners[l->first + i], false);
        }
    }
}

/* Traces all outlines of the source; holes are joined to their outer polygon. */
static bst_status trace_all(bst_ctx *ctx, tracer *t) {
    const bst_mask_item *m = t->item;
    int width = m->x1 - m->x0;
    for (int y = m->y0; y < m->y1; y++) {
        for (int x = m->x0; x < m->x1; x++) {
            bool begun = t->begun[(size_t)(y - m->y0) * (size_t)width + (size_t)(x - m->x0)];
            if (!begun && has(t, x, y) && !has(t, x, y - 1)) {
                BST_TRY(trace(ctx, t, x, y));
            }
        }
    }
    for (size_t i = 0; i < t->loop_count; i++) {
        if (t->loops[i].area < 0.0) {
            join(t, &t->loops[i]);
        }
    }
    return BST_OK;
}

bst_status bst_mask_outline_write(bst_ctx *ctx, const bst_mask_item *item, FILE *stream) {
    tracer t = {.item = item};
    bool empty = item->x1 <= item->x0 || item->y1 <= item->y0, comma = false;
    size_t pixels = empty ? 1 : (size_t)(item->x1 - item->x0) * (size_t)(item->y1 - item->y0);
    t.begun = calloc(pixels, 1);
    bst_status status =
        t.begun ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for an outline");
    if (status == BST_OK && !empty) {
        status = trace_all(ctx, &t);
    }
    if (status == BST_OK) {
        fputc('[', stream);
        for (size_t i = 0; i < t.loop_count; i++) {
            if (t.loops[i].area > 0.0) {
                fputs(comma ? ",[" : "[", stream);
                comma = true;
                write_polygon(&t, i, stream);
                fputc(']', stream);
            }
        }
        fputc(']', stream);
    }
    free(t.begun);
    free(t.corners);
    free(t.loops);
    return status;
}
