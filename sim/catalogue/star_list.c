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
    list->stars[list->count++] = (bst_star_entry){*record, cell, 0, 0.0F, 0};
    return BST_OK;
}

/* Makes room for `more` items behind *count. */
static bst_status make_room(bst_ctx *ctx, void **items, size_t size, size_t count, size_t more,
                            size_t *room) {
    if (count + more > UINT32_MAX) {
        return bst_fail(ctx, BST_ERR_RANGE,
                        "%zu variable stars or points of light curves are more "
                        "than a catalogue holds",
                        count + more);
    }
    if (count + more > *room) {
        size_t wanted = 2 * (count + more);
        void *grown = realloc(*items, wanted * size);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu variable stars", wanted);
        }
        *items = grown;
        *room = wanted;
    }
    return BST_OK;
}

bst_status bst_star_list_add_variable(bst_ctx *ctx, bst_star_list *list,
                                      const bst_star_variable *variable,
                                      const bst_star_point *points, uint32_t *index) {
    void *variables = list->variables, *curve = list->points;
    bst_status status =
        make_room(ctx, &variables, sizeof *variable, list->variable_count, 1, &list->variable_room);
    list->variables = variables;
    if (status == BST_OK) {
        status = make_room(ctx, &curve, sizeof *points, list->point_count, variable->point_count,
                           &list->point_room);
        list->points = curve;
    }
    BST_TRY(status);
    bst_star_variable *v = &list->variables[list->variable_count++];
    *v = *variable;
    v->first_point = (uint32_t)list->point_count;
    if (v->point_count > 0) {
        memcpy(list->points + list->point_count, points, v->point_count * sizeof *points);
        list->point_count += v->point_count;
    }
    *index = (uint32_t)list->variable_count;
    return BST_OK;
}

void bst_star_list_free(bst_star_list *list) {
    free(list->stars);
    free(list->variables);
    free(list->points);
    *list = (bst_star_list){0};
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
        int32_t va = bst_star_record_v(&a->record), vb = bst_star_record_v(&b->record);
        c = (va > vb) - (va < vb);
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
enum { DIVISIONS = 14 };

/* Most stars of a cell: larger cells for so many stars that a file could not have all the cells. */
static size_t cell_size(size_t stars) {
    return stars <= 100000000 ? 128 : 512;
}

/* Stars of a table are divided by brightness first, V in 1e-5 mag: a query of bright stars passes
 * the cells of the faint ones, and finds bright ones in a few cells that lie close in the file.
 * Each step costs a query of all stars the same again: steps of 3 mag with cells of 128 stars were
 * faster than those of 1.5 and 2 mag and cells of 512 (docs/results/star_catalogue.md). */
static const int32_t SHELL_LIMITS[] = {1200000, 1500000, 1800000, 2100000, INT32_MAX};

/* Number of the smallest triangle that contains a direction. */
static uint32_t triangle_of(bst_vec3 u) {
    const double sx = u.x < 0.0 ? -1.0 : 1.0, sy = u.y < 0.0 ? -1.0 : 1.0,
                 sz = u.z < 0.0 ? -1.0 : 1.0;
    bst_vec3 corner[3] = {{sx, 0.0, 0.0}, {0.0, sy, 0.0}, {0.0, 0.0, sz}};
    uint32_t number = (u.x < 0.0 ? 1u : 0u) | (u.y < 0.0 ? 2u : 0u) | (u.z < 0.0 ? 4u : 0u);
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

/* Gives the stars [first, end), of one triangle with `left` divisions below it, their cells of up
 * to `most` stars. */
static void divide(bst_star_entry *stars, size_t first, size_t end, size_t most, int left,
                   uint32_t *cells) {
    if (end - first <= most || left == 0) {
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
        divide(stars, first, next, most, left - 1, cells);
        first = next;
    }
}

/* Puts the stars [first, end) that are up to a V before the others; returns their end. */
static size_t part_by_brightness(bst_star_entry *stars, size_t first, size_t end, int32_t v) {
    for (size_t i = first; i < end; i++) {
        if (bst_star_record_v(&stars[i].record) <= v) {
            bst_star_entry swap = stars[first];
            stars[first++] = stars[i];
            stars[i] = swap;
        }
    }
    return first;
}

/* Divides the stars [first, end) into cells by their places, of up to `most` stars, and orders them
 * by cell. */
static void divide_shell(bst_star_entry *stars, size_t first, size_t end, size_t most,
                         uint32_t *cells) {
    for (size_t i = first; i < end; i++) {
        stars[i].cell = triangle_of(bst_star_record_direction(&stars[i].record, 0.0));
    }
    qsort(stars + first, end - first, sizeof *stars, compare_stars);
    for (uint32_t octant = 0; octant < 8; octant++) {
        size_t next = first;
        while (next < end && stars[next].cell >> 2 * DIVISIONS == octant) {
            next++;
        }
        divide(stars, first, next, most, DIVISIONS, cells);
        first = next;
    }
}

bst_status bst_star_list_divide(bst_ctx *ctx, bst_star_list *list, size_t first) {
    list->cells = BST_STAR_CELLS;
    const size_t most = cell_size(list->count - first);
    for (size_t k = 0; first < list->count; k++) {
        size_t end = part_by_brightness(list->stars, first, list->count, SHELL_LIMITS[k]);
        divide_shell(list->stars, first, end, most, &list->cells);
        first = end;
    }
    return list->cells <= BST_STAR_CELLS_MAX
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

/* Where the parts of a file begin, and its version. */
typedef struct layout {
    uint32_t version, cells;
    size_t patches, variables, points, cell, records, sources, bytes;
} layout;

static layout lay_out(const bst_star_list *list, const bst_star_head *head) {
    layout l = {.version = list->cells ? BST_STAR_TABLE_VERSION : BST_STAR_VERSION,
                .cells = list->cells ? list->cells : BST_STAR_CELLS};
    size_t of_table = 0, variables = 0;
    for (size_t i = 0; i < list->count; i++) {
        const bst_star_entry *star = &list->stars[i];
        of_table += star->cell >= BST_STAR_CELLS;
        variables += star->variable > 0;
        if (star->variable > 0 || star->record.pm_dec_flags & BST_STAR_PARALLAX_BITS) {
            l.version = BST_STAR_TIME_VERSION;
        }
    }
    const bool in_time = l.version == BST_STAR_TIME_VERSION;
    l.patches = sizeof(bst_star_header) + (in_time ? sizeof(bst_star_extension) : 0);
    l.variables = l.patches + (size_t)head->patch_count * sizeof(bst_star_patch);
    l.points = l.variables + variables * sizeof(bst_star_variable);
    l.cell = l.points + (variables > 0 ? list->point_count * sizeof(bst_star_point) : 0);
    l.records = l.cell + l.cells * sizeof(bst_star_cell);
    l.sources = l.records + list->count * sizeof(bst_star_record);
    l.bytes = l.sources + of_table * sizeof(int64_t);
    return l;
}

/* Copies records, sources and variables, and counts the stars of each cell. */
static void copy_stars(const bst_star_list *list, const layout *l, unsigned char *image,
                       bst_star_cell *cells) {
    unsigned char *source = image + l->sources, *variable = image + l->variables;
    for (size_t i = 0; i < list->count; i++) {
        const bst_star_entry *star = &list->stars[i];
        bst_star_record r = star->record;
        r.pm_dec_flags &= ~BST_STAR_VARIABLE;
        r.pm_dec_flags |= star->variable > 0 ? BST_STAR_VARIABLE : 0;
        cells[star->cell].count++;
        memcpy(image + l->records + i * sizeof r, &r, sizeof r);
        if (star->cell >= BST_STAR_CELLS) {
            memcpy(source, &star->source, sizeof star->source);
            source += sizeof star->source;
        }
        if (star->variable > 0) {
            bst_star_variable v = list->variables[star->variable - 1];
            v.star = (uint32_t)i;
            memcpy(variable, &v, sizeof v);
            variable += sizeof v;
        }
    }
    if (l->cell > l->points) {
        memcpy(image + l->points, list->points, l->cell - l->points);
    }
}

/* Builds the catalogue file in memory; the caller frees *out. */
static bst_status build_image(bst_ctx *ctx, const bst_star_list *list, const bst_star_head *head,
                              unsigned char **out, size_t *out_bytes) {
    const layout l = lay_out(list, head);
    unsigned char *image = calloc(1, l.bytes);
    bst_star_cell *cells = calloc(l.cells, sizeof *cells);
    if (!image || !cells) {
        free(image);
        free(cells);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a catalogue of %zu bytes", l.bytes);
    }
    copy_stars(list, &l, image, cells);
    uint32_t next = 0;
    for (uint32_t c = 0; c < l.cells; c++) {
        cells[c].first = next;
        bound_cell(list->stars + next, &cells[c]);
        next += cells[c].count;
    }
    bst_star_header header = {0};
    memcpy(header.magic, BST_STAR_MAGIC, sizeof header.magic);
    header.endian = BST_STAR_ENDIAN;
    header.version = l.version;
    header.file_bytes = l.bytes;
    header.star_count = list->count;
    header.cell_count = l.cells;
    header.patch_count = (uint32_t)head->patch_count;
    header.complete_to_v_mag = head->complete_to_v_mag;
    memcpy(header.source, head->source, sizeof header.source);
    memcpy(image, &header, sizeof header);
    if (l.version == BST_STAR_TIME_VERSION) {
        const bst_star_extension more = {
            (uint32_t)((l.points - l.variables) / sizeof(bst_star_variable)),
            (uint32_t)((l.cell - l.points) / sizeof(bst_star_point))};
        memcpy(image + sizeof header, &more, sizeof more);
    }
    memcpy(image + l.patches, head->patches, l.variables - l.patches);
    memcpy(image + l.cell, cells, l.records - l.cell);
    free(cells);
    size_t skip = offsetof(bst_star_header, checksum) + sizeof header.checksum;
    header.checksum = bst_star_checksum(image + skip, l.bytes - skip);
    memcpy(image, &header, sizeof header);
    *out = image;
    *out_bytes = l.bytes;
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
