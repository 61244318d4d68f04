/* The reader of a run's folder on any bytes: a database where they begin as one of SQLite does,
 * otherwise the manifest and the scenario. Whatever is in a folder, reading its tables ends, in
 * rows or with a reason. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/io/run_reader.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

enum { MOST_ROWS = 200 };

static const char manifest[] = "{\"program\": \"boresight\", \"complete\": true}";
static const char scenario[] = "{\"epoch_utc\": \"2022-06-16T22:10:00Z\"}";

static void read_rows(const bst_run_reader *reader, const char *sql) {
    bst_ctx ctx;
    bst_io_rows *rows = NULL;
    bool more = true;
    size_t letters = 0;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_io_rows_open(&ctx, reader, sql, 0, 1, &rows);
    for (int i = 0; status == BST_OK && more && i < MOST_ROWS; i++) {
        status = bst_io_rows_next(&ctx, rows, &more);
        for (int c = 0; status == BST_OK && more && c < bst_io_rows_columns(rows); c++) {
            letters += strlen(bst_io_rows_column_name(rows, c)) + strlen(bst_io_rows_text(rows, c));
            if (bst_io_rows_is_null(rows, c) && bst_io_rows_int(rows, c) != 0) {
                abort();
            }
        }
    }
    FUZZ_CHECK_REASON(ctx, status);
    bst_io_rows_close(rows);
    if (letters > SIZE_MAX / 2) {
        abort();
    }
}

static void read_folder(const bst_run_reader *reader) {
    static const char *const queries[] = {
        "SELECT * FROM run",
        "SELECT * FROM tables",
        "SELECT * FROM columns WHERE position >= ?1",
        "SELECT *, utc(time_s) FROM exposures WHERE tick >= ?1 ORDER BY tick",
        "SELECT count(*) FROM exposures",
    };
    for (int i = 0; i < 16 && bst_run_reader_problem(reader, i); i++) {
        if (!*bst_run_reader_problem(reader, i)) {
            abort();
        }
    }
    for (size_t i = 0; i < sizeof queries / sizeof *queries; i++) {
        read_rows(reader, queries[i]);
    }
    (void)bst_run_reader_int(reader, "SELECT max(tick) FROM exposures", 0, -1);
    bst_time epoch;
    char text[40];
    if (bst_run_reader_epoch(reader, &epoch)) {
        bst_time_to_utc(epoch, 6, text, sizeof text);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    static const char magic[] = "SQLite format 3";
    bool tables = bytes > sizeof magic && memcmp(data, magic, sizeof magic) == 0;
    if (tables) {
        fuzz_write_file("run.sqlite", data, bytes);
        fuzz_write_file("study.sqlite", data, bytes);
        fuzz_write_file("manifest.json", manifest, sizeof manifest - 1);
        fuzz_write_file("scenario.json", scenario, sizeof scenario - 1);
    } else {
        unlink(fuzz_write_file("run.sqlite", "", 0));
        unlink(fuzz_write_file("study.sqlite", "", 0));
        fuzz_write_file("manifest.json", data, bytes);
        fuzz_write_file("scenario.json", data, bytes);
    }
    bst_status (*const opens[])(bst_ctx *, const char *, bst_run_reader **) = {
        bst_run_reader_open, bst_run_reader_open_study};
    for (int i = 0; i < 2; i++) {
        bst_ctx ctx;
        bst_run_reader *reader = NULL;
        bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
        bst_status status = opens[i](&ctx, fuzz_folder(), &reader);
        FUZZ_CHECK_REASON(ctx, status);
        if ((status == BST_OK) != (reader != NULL)) {
            abort();
        }
        if (reader) {
            read_folder(reader);
        }
        bst_run_reader_close(reader);
    }
    return 0;
}
