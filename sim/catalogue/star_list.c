#include "sim/catalogue/star_list.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/draft.h"

bst_status bst_star_list_add(bst_ctx *ctx, bst_star_list *list, const bst_star_record *record,
                             uint32_t cell) {
    if (list->count == list->room) {
        size_t room = list->room ? 2 * list->room : 1 << 14;
        bst_star_entry *grown = realloc(list->stars, room * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu stars", room);
        }
        list->stars = grown;
        list->room = room;
    }
    list->stars[list->count++] =
        (bst_star_entry){*record, cell, bst_star_record_v(record), 0.0F, 0};
    return BST_OK;
}

static int compare_u32(uint32_t a, uint32_t b) {
    return (a > b) - (a < b);
}

/* Sorts stars by cell, brightest first, ties by identity; position last, so that the order is
 * total. */
static int compare_stars(const void *pa, const void *pb) {
    const bst_star_entry *a = pa, *b = pb;
    int c = compare_u32(a->cell, b->cell);
    if (c == 0) {
        c = (a->v > b->v) - (a->v < b->v);
    }
    if (c == 0) {
        c = compare_u32(a->record.tyc_vt & 0xFFFFu, b->record.tyc_vt & 0xFFFFu);
    }
    if (c == 0) {
        c = compare_u32(a->record.ra, b->record.ra);
    }
    return c ? c : compare_u32((uint32_t)a->record.dec, (uint32_t)b->record.dec);
}

/* ---------------------------------------------------------------- cells of a table's stars */

/* bits of a triangle's number: 3 for the octant, 2 for each division */
enum { DIVISIONS = 14, STARS_PER_CELL = 512 };

/* Number of the smallest triangle that contains a direction. */
static uint32_t triangle_of(bst_vec3 u) {
    const double sx = u.x < 0.0 ? -1.0 : 1.0, sy = u.y < 0.0 ? -1.0 : 1.0,
                 sz = u.z < 0.0 ? -1.0 : 1.0;
    bst_vec3 corner[3] = {{sx, 0.0, 0.0}, {0.0, sy, 0.0}, {0.0, 0.0, sz}};
    uint32_t number = (u.x < 0.0) | (u.y < 0.0) << 1 | (u.z < 0.0) << 2;
    /* sense of the corners as seen from outside; a division keeps it */
    const double sense = sx * sy * sz;
    for (int k = 0; k < DIVISIONS; k++) {
        bst_vec3 middle[3]; /* of the side opposite to each corner */
        for (int i = 0; i < 3; i++) {
            middle[i] = bst_vec3_unit(bst_vec3_add(corner[(i + 1) % 3], corner[(i + 2) % 3]));
        }
        uint32_t piece = 3; /* that in the middle */
        for (uint32_t i = 0; i < 3 && piece == 3; i++) {
            /* beyond the arc that cuts off corner i */
            bst_vec3 normal = bst_vec3_cross(middle[(i + 2) % 3], middle[(i + 1) % 3]);
            if (sense * bst_vec3_dot(normal, u) > 0.0) {
                piece = i;
                corner[(i + 1) % 3] = middle[(i + 2) % 3];
                corner[(i + 2) % 3] = middle[(i + 1) % 3];
            }
        }
        if (piece == 3) {
            memcpy(corner, middle, sizeof corner);
        }
        number = number << 2 | piece;
    }
    return number;
}

/* Gives the stars [first, end), of one triangle with `left` divisions below it, their cells. */
static void divide(bst_star_entry *stars, size_t first, size_t end, int left, uint32_t *cells) {
    if (end - first <= STARS_PER_CELL || left == 0) {
        for (size_t i = first; i < end; i++) {
            stars[i].cell = *cells;
        }
        *cells += end > first;
        return;
    }
    for (uint32_t piece = 0; piece < 4; piece++) {
        size_t next = first;
        while (next < end && (stars[next].cell >> 2 * (left - 1) & 3u) == piece) {
            next++;
        }
        divide(stars, first, next, left - 1, cells);
        first = next;
    }
}

bst_status bst_star_list_divide(bst_ctx *ctx, bst_star_list *list, size_t first) {
    bst_star_entry *stars = list->stars;
    list->cells = BST_STAR_CELLS;
    if (first >= list->count) {
        return BST_OK;
    }
    for (size_t i = first; i < list->count; i++) {
        stars[i].cell = triangle_of(bst_star_record_direction(&stars[i].record, 0.0));
    }
    qsort(stars + first, list->count - first, sizeof *stars, compare_stars);
    uint32_t cells = BST_STAR_CELLS;
    for (uint32_t octant = 0; octant < 8; octant++) {
        size_t next = first;
        while (next < list->count && stars[next].cell >> 2 * DIVISIONS == octant) {
            next++;
        }
        divide(stars, first, next, DIVISIONS, &cells);
        first = next;
    }
    list->cells = cells;
    return cells <= BST_STAR_CELLS_MAX
               ? BST_OK
               : bst_fail(ctx, BST_ERR_RANGE, "too many stars for one catalogue (%zu)",
                          list->count);
}

/* ---------------------------------------------------------------- file */

/* Computes the cap around stars first to first + count - 1 of *cell. */
static void bound_cell(const bst_star_entry *stars, bst_star_cell *cell) {
    bst_vec3 sum = {0.0, 0.0, 0.0};
    for (uint32_t i = 0; i < cell->count; i++) {
        sum = bst_vec3_add(sum, bst_star_record_direction(&stars[i].record, 0.0));
    }
    bst_vec3 centre = bst_vec3_unit(sum);
    double radius = 0.0, motion = 0.0;
    for (uint32_t i = 0; i < cell->count; i++) {
        const bst_star_record *r = &stars[i].record;
        bst_vec3 now = bst_star_record_direction(r, 0.0);
        radius = fmax(radius, bst_vec3_angle(centre, now));
        /* proper motion is the tangent of the angle moved in a year */
        motion = fmax(motion, tan(bst_vec3_angle(now, bst_star_record_direction(r, 1.0))));
    }
    cell->centre[0] = (float)centre.x;
    cell->centre[1] = (float)centre.y;
    cell->centre[2] = (float)centre.z;
    /* margin for rounding to float */
    cell->radius_rad = (float)(radius + 1e-6);
    cell->pm_max_radpyr = (float)(motion * (1.0 + 1e-6));
}

/* Builds the catalogue file in memory; the caller frees *out. */
static bst_status build_image(bst_ctx *ctx, const bst_star_list *list, const bst_star_head *head,
                              unsigned char **out, size_t *out_bytes) {
    const uint32_t cell_count = list->cells ? list->cells : BST_STAR_CELLS;
    size_t patch_bytes = (size_t)head->patch_count * sizeof(bst_star_patch);
    size_t cell_bytes = cell_count * sizeof(bst_star_cell), sources = 0;
    for (size_t i = 0; i < list->count; i++) {
        sources += list->stars[i].cell >= BST_STAR_CELLS;
    }
    size_t source_bytes = sources * sizeof(int64_t);
    size_t bytes = sizeof(bst_star_header) + patch_bytes + cell_bytes +
                   list->count * sizeof(bst_star_record) + source_bytes;
    unsigned char *image = calloc(1, bytes);
    bst_star_cell *cells = calloc(cell_count, sizeof *cells);
    if (!image || !cells) {
        free(image);
        free(cells);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a catalogue of %zu bytes", bytes);
    }
    unsigned char *records = image + bytes - source_bytes - list->count * sizeof(bst_star_record);
    unsigned char *source = image + bytes - source_bytes;
    for (size_t i = 0; i < list->count; i++) {
        const bst_star_entry *star = &list->stars[i];
        cells[star->cell].count++;
        memcpy(records + i * sizeof(bst_star_record), &star->record, sizeof(bst_star_record));
        if (star->cell >= BST_STAR_CELLS) {
            memcpy(source, &star->source, sizeof star->source);
            source += sizeof star->source;
        }
    }
    uint32_t next = 0;
    for (uint32_t c = 0; c < cell_count; c++) {
        cells[c].first = next;
        bound_cell(list->stars + next, &cells[c]);
        next += cells[c].count;
    }
    bst_star_header header = {0};
    memcpy(header.magic, BST_STAR_MAGIC, sizeof header.magic);
    header.endian = BST_STAR_ENDIAN;
    header.version = list->cells ? BST_STAR_TABLE_VERSION : BST_STAR_VERSION;
    header.file_bytes = bytes;
    header.star_count = list->count;
    header.cell_count = cell_count;
    header.patch_count = (uint32_t)head->patch_count;
    header.complete_to_v_mag = head->complete_to_v_mag;
    memcpy(header.source, head->source, sizeof header.source);
    memcpy(image, &header, sizeof header);
    memcpy(image + sizeof header, head->patches, patch_bytes);
    memcpy(image + sizeof header + patch_bytes, cells, cell_bytes);
    free(cells);
    size_t skip = offsetof(bst_star_header, checksum) + sizeof header.checksum;
    header.checksum = bst_star_checksum(image + skip, bytes - skip);
    memcpy(image, &header, sizeof header);
    *out = image;
    *out_bytes = bytes;
    return BST_OK;
}

static bst_status write_atomically(bst_ctx *ctx, const char *path, const void *data, size_t bytes) {
    char temporary[4160];
    int fd;
    BST_TRY(bst_draft_make(ctx, path, temporary, sizeof temporary, &fd));
    FILE *f = fdopen(fd, "wb");
    if (!f) {
        close(fd);
        unlink(temporary);
        return bst_fail(ctx, BST_ERR_MEMORY, "%s: out of memory", path);
    }
    bool ok = fwrite(data, 1, bytes, f) == bytes && fflush(f) == 0 && fsync(fileno(f)) == 0;
    int why = errno;
    if (fclose(f) != 0 && ok) {
        ok = false;
        why = errno;
    }
    if (ok && rename(temporary, path) != 0) {
        ok = false;
        why = errno;
    }
    if (!ok) {
        unlink(temporary);
        return bst_fail(ctx, BST_ERR_IO, "cannot write %s: %s", path, strerror(why));
    }
    return BST_OK;
}

bst_status bst_star_list_write(bst_ctx *ctx, bst_star_list *list, const bst_star_head *head,
                               const char *out_path) {
    if (list->count == 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "no stars to write to %s", out_path);
    }
    qsort(list->stars, list->count, sizeof *list->stars, compare_stars);
    unsigned char *image = NULL;
    size_t bytes = 0;
    BST_TRY(build_image(ctx, list, head, &image, &bytes));
    bst_status status = write_atomically(ctx, out_path, image, bytes);
    free(image);
    return status;
}
