/* The star catalogue's file. An input of odd length is the file itself. Another input builds one
 * that is whole but for the numbers in it: 8 bytes for the limit of completeness, one for the
 * number of patches, then the patches, then cells (2 bytes for which, 20 for its cap, 1 for its
 * stars) up to one without stars, then the records. One whose length is a multiple of 4 has
 * variable stars too: a byte for their number, one for that of points, then these, behind the
 * patches. What is accepted must give finite directions and magnitudes. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/catalogue/variable_stars.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

typedef struct source {
    const uint8_t *at;
    size_t left;
} source;

/* The next bytes of the input; zeros when there are no more. */
static void take(source *s, void *out, size_t bytes) {
    size_t n = bytes < s->left ? bytes : s->left;
    memset(out, 0, bytes);
    memcpy(out, s->at, n);
    s->at += n;
    s->left -= n;
}

static unsigned char *build(source *s, bool in_time, size_t *bytes) {
    static bst_star_variable variables[256];
    static bst_star_point points[256];
    bst_star_extension more = {0, 0};
    bst_star_header h = {.magic = {'B', 'S', 'T', 'S', 'T', 'A', 'R', 'S'},
                         .endian = BST_STAR_ENDIAN,
                         .version = in_time ? BST_STAR_TIME_VERSION : BST_STAR_VERSION,
                         .cell_count = BST_STAR_CELLS};
    bst_star_patch patches[BST_STAR_PATCHES_MAX];
    bst_star_cell *cells = calloc(BST_STAR_CELLS, sizeof *cells);
    uint8_t count;
    take(s, &h.complete_to_v_mag, sizeof h.complete_to_v_mag);
    take(s, &count, 1);
    h.patch_count = count % (BST_STAR_PATCHES_MAX + 1);
    take(s, patches, h.patch_count * sizeof *patches);
    if (in_time) {
        uint8_t counts[2];
        take(s, counts, sizeof counts);
        more = (bst_star_extension){counts[0], counts[1]};
        take(s, variables, more.variable_count * sizeof *variables);
        take(s, points, more.point_count * sizeof *points);
    }
    do {
        uint16_t which;
        take(s, &which, sizeof which);
        bst_star_cell *cell = &cells[which % BST_STAR_CELLS];
        take(s, cell, offsetof(bst_star_cell, first));
        take(s, &count, 1);
        cell->count = count;
    } while (count);
    for (uint32_t i = 0; i < BST_STAR_CELLS; i++) {
        cells[i].first = (uint32_t)h.star_count;
        h.star_count += cells[i].count;
    }
    size_t patch_bytes = h.patch_count * sizeof *patches;
    size_t extension = in_time ? sizeof more : 0;
    size_t variable_bytes = more.variable_count * sizeof *variables;
    size_t point_bytes = more.point_count * sizeof *points;
    size_t cell_bytes = BST_STAR_CELLS * sizeof *cells;
    size_t record_bytes = h.star_count * sizeof(bst_star_record);
    *bytes = sizeof h + extension + patch_bytes + variable_bytes + point_bytes + cell_bytes +
             record_bytes;
    unsigned char *image = malloc(*bytes), *at = image + sizeof h;
    memcpy(at, &more, extension);
    memcpy(at += extension, patches, patch_bytes);
    memcpy(at += patch_bytes, variables, variable_bytes);
    memcpy(at += variable_bytes, points, point_bytes);
    memcpy(at += point_bytes, cells, cell_bytes);
    take(s, at + cell_bytes, record_bytes);
    free(cells);
    h.file_bytes = *bytes;
    memcpy(image, &h, sizeof h);
    const size_t skip = offsetof(bst_star_header, checksum) + sizeof h.checksum;
    h.checksum = bst_star_checksum(image + skip, *bytes - skip);
    memcpy(image, &h, sizeof h);
    return image;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    source s = {data, bytes};
    size_t image_bytes = bytes;
    unsigned char *image = NULL;
    if (bytes % 2) {
        image = malloc(bytes);
        memcpy(image, data, bytes);
    } else {
        image = build(&s, bytes % 4 == 0, &image_bytes);
    }
    bst_ctx ctx;
    bst_star_view view;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_star_view_init(&ctx, "input", image, image_bytes, true, &view);
    if ((status == BST_OK) != (ctx.message[0] == '\0')) {
        abort(); /* a failure without its reason, or a reason without a failure */
    }
    for (uint64_t i = 0; status == BST_OK && i < view.header->star_count; i++) {
        bst_vec3 u = bst_star_record_direction(&view.records[i], 22.5);
        if (!(fabs(bst_vec3_norm(u) - 1.0) < 1e-9)) {
            abort();
        }
    }
    for (uint32_t i = 0; status == BST_OK && i < view.variable_count; i++) {
        for (int k = -2; k <= 2; k++) {
            const bst_star_variable *v = &view.variables[i];
            double mag = bst_star_variable_mag(&view, v, 2459000.0 + 1e3 * k);
            if (!(mag >= -1e-6 && mag <= 40.0 + 1e-6) ||
                bst_star_variable_of(&view, v->star) != v) {
                abort();
            }
        }
    }
    free(image);
    return 0;
}
