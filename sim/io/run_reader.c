#include "sim/io/run_reader.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/config.h"
#include "sim/io/run_files.h"
#include "sim/io/run_internal.h"

enum { MAX_PROBLEMS = 16 };

struct bst_run_reader {
    char folder[BST_RUN_PATH_BYTES];
    bst_run_state state;
    bst_json *manifest, *scenario;
    int64_t steps_left;   /* of bst_run_reader_allow */
    const char *database; /* file name in the folder; a literal */
    sqlite3 *db;
    bool has_epoch;
    bst_time epoch;
    char problems[MAX_PROBLEMS][BST_MESSAGE_BYTES];
    int problem_count;
};

struct bst_io_rows {
    const bst_run_reader *reader;
    sqlite3_stmt *statement;
};

bst_status bst_run_reader_file(bst_ctx *ctx, const bst_run_reader *reader, const char *name,
                               char *buffer, size_t bytes) {
    int n = snprintf(buffer, bytes, "%s/%s", reader->folder, name);
    if (n < 0 || (size_t)n >= bytes) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s/%s: the path is too long", reader->folder, name);
    }
    return BST_OK;
}

void bst_run_reader_note_problem(bst_run_reader *reader, const char *format, ...) {
    if (reader->problem_count < MAX_PROBLEMS) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(reader->problems[reader->problem_count++], BST_MESSAGE_BYTES, format, arguments);
        va_end(arguments);
    }
}

static bool has_file(const bst_run_reader *reader, const char *name) {
    char path[BST_RUN_PATH_BYTES];
    struct stat info;
    return bst_run_reader_file(NULL, reader, name, path, sizeof path) == BST_OK &&
           stat(path, &info) == 0 && S_ISREG(info.st_mode);
}

/* Checks whether a running process holds the lock of the folder. */
static bool is_locked(const bst_run_reader *reader) {
    char path[BST_RUN_PATH_BYTES];
    if (bst_run_reader_file(NULL, reader, "lock", path, sizeof path) != BST_OK) {
        return false;
    }
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return false;
    }
    bool held = flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    close(fd);
    return held;
}

static bst_json *load_json(bst_run_reader *reader, const char *name, const char *when_missing) {
    char path[BST_RUN_PATH_BYTES];
    bst_json *json = NULL;
    bst_ctx ctx = {0};
    if (!has_file(reader, name)) {
        if (when_missing) {
            bst_run_reader_note_problem(reader, "%s", when_missing);
        }
    } else if (bst_run_reader_file(&ctx, reader, name, path, sizeof path) != BST_OK ||
               bst_json_load(&ctx, path, &json) != BST_OK) {
        bst_run_reader_note_problem(reader, "%s", ctx.message);
    } else if (!cJSON_IsObject(bst_json_root(json))) {
        bst_run_reader_note_problem(reader, "%s: is not a JSON object", path);
        bst_json_free(json);
        json = NULL;
    }
    return json;
}

/* SQL function utc(seconds): time after the run's epoch as ISO 8601, to 1e-6 s. */
static void sql_utc(sqlite3_context *context, int count, sqlite3_value **values) {
    const bst_run_reader *reader = sqlite3_user_data(context);
    char text[40];
    if (count == 1 && reader->has_epoch && sqlite3_value_type(values[0]) != SQLITE_NULL) {
        bst_time_to_utc(bst_time_add(reader->epoch, sqlite3_value_double(values[0])), 6, text,
                        sizeof text);
        sqlite3_result_text(context, text, -1, SQLITE_TRANSIENT);
    }
}

/* Reads the epoch from the table run, else from scenario.json. */
static void find_epoch(bst_run_reader *reader) {
    bst_ctx unheard = {0};
    bst_io_rows *rows = NULL;
    bool more = false;
    if (bst_io_rows_open(&unheard, reader, "SELECT epoch_utc FROM run", 0, 0, &rows) == BST_OK &&
        bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
        reader->has_epoch =
            bst_time_from_utc(&unheard, bst_io_rows_text(rows, 0), &reader->epoch) == BST_OK;
    }
    bst_io_rows_close(rows);
    const cJSON *text =
        cJSON_GetObjectItemCaseSensitive(bst_run_reader_scenario(reader), "epoch_utc");
    if (!reader->has_epoch && cJSON_IsString(text)) {
        reader->has_epoch =
            bst_time_from_utc(&unheard, text->valuestring, &reader->epoch) == BST_OK;
    }
}

bool bst_run_reader_epoch(const bst_run_reader *reader, bst_time *epoch) {
    *epoch = reader->epoch;
    return reader->has_epoch;
}

/* Checks whether the database header declares a WAL journal. */
static bool has_wal_header(const char *path) {
    unsigned char head[20] = {0};
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t n = fd >= 0 ? read(fd, head, sizeof head) : -1;
    if (fd >= 0) {
        close(fd);
    }
    return n == (ssize_t)sizeof head && head[18] == 2;
}

/* Makes a "file:" URI of a path with all special bytes escaped. */
static void make_uri(char *uri, size_t bytes, const char *path, const char *parameters) {
    size_t n = (size_t)snprintf(uri, bytes, "file:");
    for (const unsigned char *c = (const unsigned char *)path; *c && n + 64 < bytes; c++) {
        bool plain = (*c >= '0' && *c <= '9') || (*c >= 'A' && *c <= 'Z') ||
                     (*c >= 'a' && *c <= 'z') || strchr("/._-", *c);
        n += (size_t)snprintf(uri + n, bytes - n, plain ? "%c" : "%%%02X", *c);
    }
    snprintf(uri + n, bytes - n, "?%s", parameters);
}

static void open_database(bst_run_reader *reader, const char *name) {
    char path[BST_RUN_PATH_BYTES], uri[3 * BST_RUN_PATH_BYTES + 128];
    reader->database = name;
    if (!has_file(reader, name)) {
        bst_run_reader_note_problem(reader, "%s is missing", name);
        return;
    }
    if (bst_run_reader_file(NULL, reader, name, path, sizeof path) != BST_OK) {
        return;
    }
    /* The database of a running process is read with SQLite's locks and shared index. Other
     * databases have no writer: they are read without locks and with the journal's index in memory,
     * so that SQLite writes nothing. "immutable" is for a database without its journal. */
    bool journal = has_file(reader, BST_RUN_DATABASE "-wal");
    bool living = reader->state == BST_RUN_RUNNING;
    make_uri(uri, sizeof uri, path,
             living                             ? "mode=ro"
             : journal || !has_wal_header(path) ? "mode=ro&vfs=unix-none"
                                                : "mode=ro&immutable=1");
    int flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
    int code = sqlite3_open_v2(uri, &reader->db, flags, NULL);
    if (code == SQLITE_OK) {
        sqlite3_db_config(reader->db, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, (int *)NULL);
        /* a run has only tables; a view could be a query that does not end */
        sqlite3_db_config(reader->db, SQLITE_DBCONFIG_ENABLE_VIEW, 0, (int *)NULL);
        sqlite3_db_config(reader->db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, (int *)NULL);
        sqlite3_busy_timeout(reader->db, 2000);
        code = sqlite3_exec(reader->db,
                            living ? "PRAGMA query_only=1; SELECT count(*) FROM sqlite_master;"
                                   : "PRAGMA locking_mode=EXCLUSIVE; PRAGMA query_only=1;"
                                     "SELECT count(*) FROM sqlite_master;",
                            NULL, NULL, NULL);
    }
    if (code != SQLITE_OK) {
        bst_run_reader_note_problem(reader, "%s: cannot be read: %s", path,
                                    reader->db ? sqlite3_errmsg(reader->db) : "out of memory");
        sqlite3_close(reader->db);
        reader->db = NULL;
    }
}

static bst_run_state find_state(const bst_run_reader *reader) {
    if (is_locked(reader)) {
        return BST_RUN_RUNNING;
    }
    if (!reader->manifest) {
        return BST_RUN_KILLED;
    }
    const cJSON *complete =
        cJSON_GetObjectItemCaseSensitive(bst_json_root(reader->manifest), "complete");
    if (!cJSON_IsTrue(complete)) {
        return BST_RUN_INTERRUPTED;
    }
    /* a complete run has no lock and its final name; a run killed while closing does not */
    const char *tail = ".partial";
    size_t length = strlen(reader->folder), n = strlen(tail);
    bool unnamed = length > n && strcmp(reader->folder + length - n, tail) == 0;
    return unnamed || has_file(reader, "lock") ? BST_RUN_KILLED : BST_RUN_COMPLETE;
}

static bst_status check_folder(bst_ctx *ctx, const char *path) {
    struct stat info;
    if (stat(path, &info) != 0) {
        int error = errno;
        char partial[BST_RUN_PATH_BYTES];
        int n = snprintf(partial, sizeof partial, "%s.partial", path);
        bool beside = n > 0 && (size_t)n < sizeof partial && stat(partial, &info) == 0;
        return bst_fail(ctx, error == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO, "%s: %s%s%s", path,
                        strerror(error), beside ? "; there is an unfinished run, " : "",
                        beside ? partial : "");
    }
    if (!S_ISDIR(info.st_mode)) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: is not a folder; give the folder of a run", path);
    }
    if (access(path, R_OK | X_OK) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", path, strerror(errno));
    }
    return BST_OK;
}

/* Checks that manifest.json was written by boresight: other programs use the same file name. */
static bool is_ours(const bst_json *manifest) {
    const cJSON *program = cJSON_GetObjectItemCaseSensitive(bst_json_root(manifest), "program");
    return cJSON_IsString(program) && strcmp(program->valuestring, "boresight") == 0;
}

bst_status bst_run_reader_open(bst_ctx *ctx, const char *path, bst_run_reader **out) {
    *out = NULL;
    size_t length = bst_run_folder_length(path);
    if (length == 0 || length > BST_RUN_PATH_BYTES - 256) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "'%.80s' is not a path of a folder", path);
    }
    bst_run_reader *reader = calloc(1, sizeof *reader);
    if (!reader) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    memcpy(reader->folder, path, length);
    bst_status status = check_folder(ctx, reader->folder);
    bool has_lock = has_file(reader, "lock"), has_db = has_file(reader, BST_RUN_DATABASE);
    if (status == BST_OK && !has_lock && !has_db && !has_file(reader, "manifest.json")) {
        status = bst_fail(ctx, BST_ERR_FORMAT,
                          "%s: is not the folder of a run: it holds neither manifest.json nor "
                          "run.sqlite",
                          reader->folder);
    }
    if (status == BST_OK) {
        reader->manifest =
            load_json(reader, "manifest.json", has_lock ? NULL : "manifest.json is missing");
        if (reader->manifest && !is_ours(reader->manifest)) {
            bst_run_reader_note_problem(reader, "manifest.json is not one of boresight");
            bst_json_free(reader->manifest);
            reader->manifest = NULL;
        }
        if (!reader->manifest && !has_lock && !has_db) {
            status = bst_fail(ctx, BST_ERR_FORMAT, "%s: is not the folder of a run: %s",
                              reader->folder, reader->problems[0]);
        }
    }
    if (status != BST_OK) {
        bst_run_reader_close(reader);
        return status;
    }
    reader->state = find_state(reader);
    bool begun = has_db || reader->state == BST_RUN_COMPLETE;
    reader->scenario =
        load_json(reader, "scenario.json", begun ? "scenario.json is missing" : NULL);
    open_database(reader, BST_RUN_DATABASE);
    find_epoch(reader);
    if (reader->db) {
        sqlite3_create_function(reader->db, "utc", 1, SQLITE_UTF8 | SQLITE_DETERMINISTIC, reader,
                                sql_utc, NULL, NULL);
    }
    *out = reader;
    return BST_OK;
}

bst_status bst_run_reader_open_study(bst_ctx *ctx, const char *path, bst_run_reader **out) {
    *out = NULL;
    size_t length = bst_run_folder_length(path);
    if (length == 0 || length > BST_RUN_PATH_BYTES - 256) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "'%.80s' is not a path of a folder", path);
    }
    bst_run_reader *reader = calloc(1, sizeof *reader);
    if (!reader) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    memcpy(reader->folder, path, length);
    reader->state = BST_RUN_COMPLETE; /* its tables appear at completion */
    open_database(reader, BST_STUDY_DATABASE);
    if (!reader->db) {
        bst_status status = has_file(reader, BST_STUDY_DATABASE)
                                ? bst_fail(ctx, BST_ERR_FORMAT, "%s", reader->problems[0])
                                : bst_fail(ctx, BST_ERR_NOT_FOUND,
                                           "%s: has no " BST_STUDY_DATABASE
                                           " yet, which a study gets when all its runs are done",
                                           reader->folder);
        bst_run_reader_close(reader);
        return status;
    }
    *out = reader;
    return BST_OK;
}

void bst_run_reader_close(bst_run_reader *reader) {
    if (reader) {
        sqlite3_close(reader->db);
        bst_json_free(reader->manifest);
        bst_json_free(reader->scenario);
        free(reader);
    }
}

const char *bst_run_reader_folder(const bst_run_reader *reader) {
    return reader->folder;
}

bst_run_state bst_run_reader_state(const bst_run_reader *reader) {
    return reader->state;
}

const char *bst_run_state_name(bst_run_state state) {
    switch (state) {
        case BST_RUN_COMPLETE:
            return "complete";
        case BST_RUN_INTERRUPTED:
            return "interrupted";
        case BST_RUN_RUNNING:
            return "still running";
        case BST_RUN_KILLED:
            return "left over from a killed run";
    }
    return "unknown";
}

const char *bst_run_reader_problem(const bst_run_reader *reader, int index) {
    return index >= 0 && index < reader->problem_count ? reader->problems[index] : NULL;
}

const cJSON *bst_run_reader_manifest(const bst_run_reader *reader) {
    return reader->manifest ? bst_json_root(reader->manifest) : NULL;
}

const cJSON *bst_run_reader_scenario(const bst_run_reader *reader) {
    return reader->scenario ? bst_json_root(reader->scenario) : NULL;
}

bool bst_run_reader_has_tables(const bst_run_reader *reader) {
    return reader->db != NULL;
}

/* Steps of SQLite between two looks at the limit. */
enum { STEPS_AT_A_TIME = 10000 };

/* Counts the work of queries; 1 ends the one in progress. */
static int count_steps(void *user) {
    bst_run_reader *reader = user;
    reader->steps_left -= STEPS_AT_A_TIME;
    return reader->steps_left < 0;
}

void bst_run_reader_allow(bst_run_reader *reader, int64_t steps) {
    reader->steps_left = steps;
    if (reader->db) {
        sqlite3_progress_handler(reader->db, steps > 0 ? STEPS_AT_A_TIME : 0,
                                 steps > 0 ? count_steps : NULL, reader);
    }
}

void bst_run_reader_interrupt(bst_run_reader *reader) {
    if (reader->db) {
        sqlite3_interrupt(reader->db);
    }
}

static bst_status fail_sql(bst_ctx *ctx, const bst_run_reader *reader) {
    if (sqlite3_errcode(reader->db) == SQLITE_INTERRUPT) {
        return bst_fail(ctx, BST_ERR_FORMAT,
                        "%s/%s: a query takes too long: the tables are not as a run writes them",
                        reader->folder, reader->database);
    }
    return bst_fail(ctx, BST_ERR_FORMAT, "%s/%s: %s", reader->folder, reader->database,
                    sqlite3_errmsg(reader->db));
}

bst_status bst_io_rows_open(bst_ctx *ctx, const bst_run_reader *reader, const char *sql,
                            int64_t parameter1, int64_t parameter2, bst_io_rows **out) {
    *out = NULL;
    if (!reader->db) {
        return bst_fail(ctx, BST_ERR_NOT_FOUND, "%s: has no tables that could be read",
                        reader->folder);
    }
    bst_io_rows *rows = calloc(1, sizeof *rows);
    if (!rows) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    rows->reader = reader;
    if (sqlite3_prepare_v2(reader->db, sql, -1, &rows->statement, NULL) != SQLITE_OK) {
        free(rows);
        return fail_sql(ctx, reader);
    }
    bst_io_rows_restart(rows, parameter1, parameter2);
    *out = rows;
    return BST_OK;
}

void bst_io_rows_restart(bst_io_rows *rows, int64_t parameter1, int64_t parameter2) {
    const int64_t values[2] = {parameter1, parameter2};
    sqlite3_reset(rows->statement);
    for (int i = 0; i < 2 && i < sqlite3_bind_parameter_count(rows->statement); i++) {
        sqlite3_bind_int64(rows->statement, i + 1, values[i]);
    }
}

bst_status bst_io_rows_next(bst_ctx *ctx, bst_io_rows *rows, bool *more) {
    int code = sqlite3_step(rows->statement);
    *more = code == SQLITE_ROW;
    return code == SQLITE_ROW || code == SQLITE_DONE ? BST_OK : fail_sql(ctx, rows->reader);
}

int bst_io_rows_columns(const bst_io_rows *rows) {
    return sqlite3_column_count(rows->statement);
}

const char *bst_io_rows_column_name(const bst_io_rows *rows, int column) {
    const char *name = sqlite3_column_name(rows->statement, column);
    return name ? name : "";
}

bst_io_cell_kind bst_io_rows_kind(const bst_io_rows *rows, int column) {
    switch (sqlite3_column_type(rows->statement, column)) {
        case SQLITE_NULL:
            return BST_CELL_NULL;
        case SQLITE_INTEGER:
            return BST_CELL_INT;
        case SQLITE_FLOAT:
            return BST_CELL_REAL;
        default:
            return BST_CELL_TEXT;
    }
}

bool bst_io_rows_is_null(const bst_io_rows *rows, int column) {
    return bst_io_rows_kind(rows, column) == BST_CELL_NULL;
}

int64_t bst_io_rows_int(const bst_io_rows *rows, int column) {
    return sqlite3_column_int64(rows->statement, column);
}

double bst_io_rows_real(const bst_io_rows *rows, int column) {
    return bst_io_rows_is_null(rows, column) ? NAN : sqlite3_column_double(rows->statement, column);
}

const char *bst_io_rows_text(const bst_io_rows *rows, int column) {
    const char *text = (const char *)sqlite3_column_text(rows->statement, column);
    return text ? text : "";
}

void bst_io_rows_close(bst_io_rows *rows) {
    if (rows) {
        sqlite3_finalize(rows->statement);
        free(rows);
    }
}

int64_t bst_run_reader_int(const bst_run_reader *reader, const char *sql, int64_t parameter,
                           int64_t fallback) {
    bst_io_rows *rows;
    bst_ctx unheard = {0};
    bool more = false;
    if (bst_io_rows_open(&unheard, reader, sql, parameter, 0, &rows) != BST_OK) {
        return fallback;
    }
    int64_t value = fallback;
    if (bst_io_rows_next(&unheard, rows, &more) == BST_OK && more &&
        !bst_io_rows_is_null(rows, 0)) {
        value = bst_io_rows_int(rows, 0);
    }
    bst_io_rows_close(rows);
    return value;
}
