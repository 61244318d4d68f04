#include "sim/catalogue/star_import.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/catalogue/bright_stars.h"
#include "sim/catalogue/star_list.h"
#include "sim/catalogue/stars.h"
#include "sim/core/file.h"
#include "sim/core/subprocess.h"

#define ROWS_PER_PROGRESS 20000

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

static bst_status read_rows(bst_ctx *ctx, FILE *rows, const bst_star_import_options *options,
                            bst_star_list *list) {
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
            status = bst_star_list_add(ctx, list, &record, values.id >> 16);
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

/* Adds those of the stars that are of Tycho-2, or of a table. */
static bst_status add_values(bst_ctx *ctx, const bst_star_values *values, size_t count, bool tycho2,
                             bst_star_list *list) {
    for (size_t i = 0; i < count; i++) {
        if ((values[i].id < BST_STAR_TABLE_ID) == tycho2) {
            bst_star_record record;
            BST_TRY(bst_star_pack(ctx, &values[i], &record));
            BST_TRY(bst_star_list_add(ctx, list, &record,
                                      tycho2 ? values[i].id >> 16 : BST_STAR_CELLS));
        }
    }
    return BST_OK;
}

bst_status bst_star_write(bst_ctx *ctx, const bst_star_values *values, size_t count,
                          const bst_star_patch *complete, const char *out_path) {
    bst_star_list list = {0};
    bst_star_head head = {.complete_to_v_mag = BST_STAR_BRIGHTER_THAN_ALL, .patch_count = 1};
    head.patches[0] = *complete;
    snprintf(head.source, sizeof head.source, "%s", BST_STAR_TYCHO2_SOURCE);
    bst_status status = add_values(ctx, values, count, true, &list);
    const size_t tycho2 = list.count;
    if (status == BST_OK) {
        status = add_values(ctx, values, count, false, &list);
    }
    if (status == BST_OK && list.count > tycho2) {
        status = bst_star_list_divide(ctx, &list, tycho2);
    }
    if (status == BST_OK) {
        status = bst_star_list_write(ctx, &list, &head, out_path);
    }
    bst_star_list_free(&list);
    return status;
}

/* Writes the stars that were read. */
static bst_status write_rows(bst_ctx *ctx, bst_star_list *list,
                             const bst_star_import_options *options, const char *out_path) {
    bst_star_head head = {
        .complete_to_v_mag = fmin(options->subset.v_limit, BST_STAR_TYCHO2_COMPLETE_V),
        .patch_count = options->subset.patch_count};
    memcpy(head.patches, options->subset.patches, sizeof head.patches);
    snprintf(head.source, sizeof head.source, "%s", BST_STAR_TYCHO2_SOURCE);
    return bst_star_list_write(ctx, list, &head, out_path);
}

bst_status bst_star_import_rows(bst_ctx *ctx, FILE *rows, const bst_star_import_options *options,
                                const char *out_path, long long *stars_written) {
    bst_star_list list = {0};
    bst_status status = read_rows(ctx, rows, options, &list);
    if (status == BST_OK) {
        status = write_rows(ctx, &list, options, out_path);
    }
    if (stars_written) {
        *stars_written = status == BST_OK ? (long long)list.count : 0;
    }
    bst_star_list_free(&list);
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
    bst_star_list list = {0};
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
        status = write_rows(ctx, &list, options, out_path);
    }
    if (status == BST_OK && stars_written) {
        *stars_written = (long long)list.count;
    }
    bst_star_list_free(&list);
    return status;
}
