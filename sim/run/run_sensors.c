#include "sim/run/run_sensors.h"

#include <stdio.h>
#include <string.h>

#include "sim/core/text.h"

static bool is_sensor(const char *wanted, const bst_run_sensor *sensor) {
    size_t n = strlen(sensor->observer);
    return !wanted || strcmp(wanted, sensor->name) == 0 ||
           (strncmp(wanted, sensor->observer, n) == 0 && wanted[n] == '/' &&
            strcmp(wanted + n + 1, sensor->name) == 0);
}

bst_status bst_run_sensors(bst_ctx *ctx, const bst_run_reader *run, const char *sensor,
                           bst_run_sensor sensors[BST_EXPORT_SENSORS], int *count) {
    bst_io_rows *rows;
    bst_status status;
    bool more;
    char all[600] = "";
    *count = 0;
    if (!bst_run_reader_has_tables(run)) {
        sensors[(*count)++] = (bst_run_sensor){.index = -1, .file = "frames.fits"};
        return BST_OK;
    }
    BST_TRY(bst_io_rows_open(ctx, run,
                             "SELECT sensor, observer, name, target, file FROM sensors"
                             " ORDER BY sensor",
                             0, 0, &rows));
    while ((status = bst_io_rows_next(ctx, rows, &more)) == BST_OK && more &&
           *count < BST_EXPORT_SENSORS) {
        bst_run_sensor *s = &sensors[*count];
        s->index = bst_io_rows_int(rows, 0);
        snprintf(s->observer, sizeof s->observer, "%s", bst_io_rows_text(rows, 1));
        snprintf(s->name, sizeof s->name, "%s", bst_io_rows_text(rows, 2));
        snprintf(s->target, sizeof s->target, "%s", bst_io_rows_text(rows, 3));
        /* a file name from a damaged database must stay inside the folder */
        const char *file = bst_io_rows_text(rows, 4);
        snprintf(s->file, sizeof s->file, "%s", strchr(file, '/') ? "" : file);
        size_t n = strlen(all);
        snprintf(all + n, sizeof all - n, "%s%s/%s", n ? ", " : "", s->observer, s->name);
        *count += is_sensor(sensor, s);
    }
    bst_io_rows_close(rows);
    if (status == BST_OK && *count == 0) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: has no sensor \"%s\"; it has %s",
                        bst_run_reader_folder(run), sensor ? sensor : "", *all ? all : "none");
    }
    return status;
}
