#include "sim/catalogue/star_import.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/catalogue/bright_stars.h"
#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "sim/core/subprocess.h"

#define ROWS_PER_PROGRESS 20000
/* V to which a catalogue of one field is complete over the whole sky */
#define BRIGHTER_THAN_ALL (-2.0)

typedef struct import_star {
    bst_star_record record;
    uint32_t cell;
    int32_t v;
} import_star;

typedef struct import_list {
    import_star *stars;
    size_t count, room;
} import_list;

bst_star_import_options bst_star_import_all(void) {
    bst_star_import_options o = {0};
    o.subset.v_limit = INFINITY;
    o.expected_rows = BST_STAR_TYCHO2_COUNT;
    return o;
}

/* Parses a non-empty line of a subset description, without its comment. */
static bool read_subset_line(const char *line, int *sky_lines, bst_star_subset *out) {
    bst_star_patch p;
    double v;
    char rest[2];
    if (sscanf(line, " sky %lf %1s", &v, rest) == 1 && isfinite(v) && *sky_lines == 0) {
        out->v_limit = v;
        ++*sky_lines;
        return true;
    }
    if (sscanf(line, " cone %lf %lf %lf %lf %1s", &p.ra_deg, &p.dec_deg, &p.radius_deg, &p.v_mag,
               rest) == 4 &&
        p.ra_deg >= 0.0 && p.ra_deg < 360.0 && fabs(p.dec_deg) <= 90.0 && p.radius_deg > 0.0 &&
        p.radius_deg <= 180.0 && isfinite(p.v_mag) &&
        out->patch_count < (int)BST_STAR_PATCHES_MAX) {
        out->patches[out->patch_count++] = p;
        return true;
    }
    return false;
}

bst_status bst_star_subset_read_buffer(bst_ctx *ctx, const char *name, const char *data,
                                       size_t bytes, bst_star_subset *out) {
    memset(out, 0, sizeof *out);
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    int number = 0, sky_lines = 0;
    for (const char *next = data, *end = data + bytes; next < end;) {
        char line[256];
        number++;
        const char *stop = memchr(next, '\n', (size_t)(end - next));
        size_t length = (size_t)((stop ? stop : end) - next);
        bool fits = length < sizeof line;
        memcpy(line, next, fits ? length : sizeof line - 1);
        line[fits ? length : sizeof line - 1] = '\0';
        line[strcspn(line, "#\r")] = '\0';
        next = stop ? stop + 1 : end;
        if (fits && line[strspn(line, " \t")] == '\0') {
            continue;
        }
        if (!fits || !read_subset_line(line, &sky_lines, out)) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "%.400s:%d: expected one \"sky V\" and up to %u \"cone RA DEC RADIUS "
                            "V\" (degrees; RA 0 to 360), found \"%s\"",
                            name, number, BST_STAR_PATCHES_MAX, line);
        }
    }
    return sky_lines ? BST_OK : bst_fail(ctx, BST_ERR_FORMAT, "%.400s: no line \"sky V\"", name);
}

bst_status bst_star_subset_read(bst_ctx *ctx, const char *path, bst_star_subset *out) {
    char *data;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, 1 << 20, "a file with lines \"sky V\" and \"cone ...\"", &data,
                          &bytes));
    bst_status status = bst_star_subset_read_buffer(ctx, path, data, bytes, out);
    free(data);
    return status;
}

static bool keeps(const bst_star_subset *subset, const bst_star_record *record) {
    double v = bst_star_record_v(record) / 1e5;
    if (v <= subset->v_limit) {
        return true;
    }
    bst_vec3 u = bst_star_record_direction(record, 0.0);
    for (int i = 0; i < subset->patch_count; i++) {
        const bst_star_patch *p = &subset->patches[i];
        bst_vec3 c = bst_vec3_from_radec(p->ra_deg * BST_DEG_RAD, p->dec_deg * BST_DEG_RAD);
        if (v <= p->v_mag && bst_vec3_angle(c, u) <= p->radius_deg * BST_DEG_RAD) {
            return true;
        }
    }
    return false;
}

static bst_status append(bst_ctx *ctx, import_list *list, const bst_star_record *record,
                         uint32_t cell) {
    if (list->count == list->room) {
        size_t room = list->room ? 2 * list->room : 1 << 14;
        import_star *grown = realloc(list->stars, room * sizeof *grown);
        if (!grown) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %zu stars", room);
        }
        list->stars = grown;
        list->room = room;
    }
    list->stars[list->count++] = (import_star){*record, cell, bst_star_record_v(record)};
    return BST_OK;
}

static bst_status read_rows(bst_ctx *ctx, FILE *rows, const bst_star_import_options *options,
                            import_list *list) {
    char line[512];
    long long count = 0;
    while (fgets(line, sizeof line, rows)) {
        if (++count > options->expected_rows && options->expected_rows) {
            return bst_fail(ctx, BST_ERR_FORMAT,
                            "found more than %lld stars, all that Tycho-2 has: this is not the "
                            "catalogue; run `boresight stars fetch`",
                            options->expected_rows);
        }
        size_t bytes = strcspn(line, "\r\n");
        bst_star_values values;
        bst_star_record record;
        bst_status status = bst_star_parse_row(ctx, line, bytes, &values);
        if (status == BST_OK) {
            bst_bright_star_correct(&values);
            status = bst_star_pack(ctx, &values, &record);
        }
        if (status == BST_OK && keeps(&options->subset, &record)) {
            status = append(ctx, list, &record, values.id >> 16);
        }
        if (status != BST_OK) {
            return bst_fail_prefix(ctx, status, "Tycho-2 row %lld", count);
        }
        if (options->progress && count % ROWS_PER_PROGRESS == 0) {
            options->progress(options->progress_user, "importing", count, options->expected_rows);
        }
    }
    if (ferror(rows)) {
        return bst_fail(ctx, BST_ERR_IO, "cannot read Tycho-2 after row %lld: %s", count,
                        strerror(errno));
    }
    if (options->expected_rows && count != options->expected_rows) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "found %lld stars where Tycho-2 has %lld: this is not the whole catalogue; "
                        "run `boresight stars fetch`",
                        count, options->expected_rows);
    }
    if (options->progress) {
        options->progress(options->progress_user, "importing", count, count);
    }
    return BST_OK;
}

static int compare_u32(uint32_t a, uint32_t b) {
    return (a > b) - (a < b);
}

/* Sorts stars by cell, brightest first, ties by identity; position last, so that the order is
 * total. */
static int compare_stars(const void *pa, const void *pb) {
    const import_star *a = pa, *b = pb;
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

/* Computes the cap around stars first to first + count - 1 of *cell. */
static void bound_cell(const import_star *stars, bst_star_cell *cell) {
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
static bst_status build_image(bst_ctx *ctx, const import_list *list, const bst_star_subset *subset,
                              unsigned char **out, size_t *out_bytes) {
    size_t patch_bytes = (size_t)subset->patch_count * sizeof(bst_star_patch);
    size_t cell_bytes = BST_STAR_CELLS * sizeof(bst_star_cell);
    size_t bytes =
        sizeof(bst_star_header) + patch_bytes + cell_bytes + list->count * sizeof(bst_star_record);
    unsigned char *image = calloc(1, bytes);
    bst_star_cell *cells = calloc(BST_STAR_CELLS, sizeof *cells);
    if (!image || !cells) {
        free(image);
        free(cells);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a catalogue of %zu bytes", bytes);
    }
    unsigned char *records = image + bytes - list->count * sizeof(bst_star_record);
    for (size_t i = 0; i < list->count; i++) {
        cells[list->stars[i].cell].count++;
        memcpy(records + i * sizeof(bst_star_record), &list->stars[i].record,
               sizeof(bst_star_record));
    }
    uint32_t next = 0;
    for (uint32_t c = 0; c < BST_STAR_CELLS; c++) {
        cells[c].first = next;
        bound_cell(list->stars + next, &cells[c]);
        next += cells[c].count;
    }
    bst_star_header header = {0};
    memcpy(header.magic, BST_STAR_MAGIC, sizeof header.magic);
    header.endian = BST_STAR_ENDIAN;
    header.version = BST_STAR_VERSION;
    header.file_bytes = bytes;
    header.star_count = list->count;
    header.cell_count = BST_STAR_CELLS;
    header.patch_count = (uint32_t)subset->patch_count;
    header.complete_to_v_mag = fmin(subset->v_limit, BST_STAR_TYCHO2_COMPLETE_V);
    snprintf(header.source, sizeof header.source, "%s", BST_STAR_TYCHO2_SOURCE);
    memcpy(image, &header, sizeof header);
    memcpy(image + sizeof header, subset->patches, patch_bytes);
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

/* Sorts, indexes and writes the imported stars. */
static bst_status write_catalogue(bst_ctx *ctx, import_list *list,
                                  const bst_star_import_options *options, const char *out_path) {
    if (list->count == 0) {
        return bst_fail(ctx, BST_ERR_FORMAT, "no stars to write to %s", out_path);
    }
    qsort(list->stars, list->count, sizeof *list->stars, compare_stars);
    unsigned char *image = NULL;
    size_t bytes = 0;
    BST_TRY(build_image(ctx, list, &options->subset, &image, &bytes));
    bst_status status = write_atomically(ctx, out_path, image, bytes);
    free(image);
    return status;
}

bst_status bst_star_write(bst_ctx *ctx, const bst_star_values *values, size_t count,
                          const bst_star_patch *complete, const char *out_path) {
    import_list list = {0};
    bst_star_import_options options = {.subset = {.v_limit = BRIGHTER_THAN_ALL, .patch_count = 1}};
    bst_status status = BST_OK;
    options.subset.patches[0] = *complete;
    for (size_t i = 0; i < count && status == BST_OK; i++) {
        bst_star_record record;
        status = bst_star_pack(ctx, &values[i], &record);
        if (status == BST_OK) {
            status = append(ctx, &list, &record, values[i].id >> 16);
        }
    }
    if (status == BST_OK) {
        status = write_catalogue(ctx, &list, &options, out_path);
    }
    free(list.stars);
    return status;
}

bst_status bst_star_import_rows(bst_ctx *ctx, FILE *rows, const bst_star_import_options *options,
                                const char *out_path, long long *stars_written) {
    import_list list = {0};
    bst_status status = read_rows(ctx, rows, options, &list);
    if (status == BST_OK) {
        status = write_catalogue(ctx, &list, options, out_path);
    }
    if (stars_written) {
        *stars_written = status == BST_OK ? (long long)list.count : 0;
    }
    free(list.stars);
    return status;
}

bst_status bst_star_import_tarball(bst_ctx *ctx, const char *tarball_path,
                                   const bst_star_import_options *options, const char *out_path,
                                   long long *stars_written) {
    if (stars_written) {
        *stars_written = 0;
    }
    int fd;
    uint64_t tarball_bytes;
    BST_TRY(bst_file_open(ctx, tarball_path, (uint64_t)1 << 30, "Debian's tycho2_2.orig.tar.xz",
                          &fd, &tarball_bytes));
    close(fd);
    const char *argv[] = {"tar",         "-xJf",         tarball_path,  "--to-stdout",
                          "--wildcards", "*suppl_1.dat", "*tyc2.dat.*", NULL};
    bst_subprocess tar;
    BST_TRY(bst_subprocess_start(ctx, argv, NULL, true, NULL, &tar));
    import_list list = {0};
    bst_status status = read_rows(ctx, tar.output, options, &list);
    int code = bst_subprocess_wait(&tar);
    /* a reader that stops early closes tar's pipe: then report the reader's error */
    if (code != 0 && (status == BST_OK || list.count == 0)) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "cannot unpack %s (tar ended with %d): it must be Debian's "
                          "tycho2_2.orig.tar.xz, and the program xz must be there (Debian package "
                          "xz-utils)",
                          tarball_path, code);
    }
    if (status == BST_OK) {
        status = write_catalogue(ctx, &list, options, out_path);
    }
    if (status == BST_OK && stars_written) {
        *stars_written = (long long)list.count;
    }
    free(list.stars);
    return status;
}
