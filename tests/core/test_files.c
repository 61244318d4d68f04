/* Files of others, drafts of our own, what channels are called, and messages of failures. */
#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "boresight/messages.h"
#include "sim/core/draft.h"
#include "sim/core/file.h"
#include "tests/test_support.h"

static char folder[BST_TEST_PATH];

static int set_up(void **state) {
    (void)state;
    bst_test_template(folder, "boresight_files");
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state) {
    (void)state;
    char command[BST_TEST_PATH + 16];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static const char *in_folder(const char *name) {
    static char path[BST_TEST_PATH + 100];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_bytes(const char *path, const char *bytes, size_t n) {
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

static void expect_words(const bst_ctx *ctx, const char *words) {
    if (!strstr(ctx->message, words)) {
        fail_msg("\"%s\" does not say \"%s\"", ctx->message, words);
    }
}

static void files_are_read_whole(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char *text = NULL;
    size_t bytes = 0;
    const char *path = in_folder("whole");
    write_bytes(path, "ab\0cd", 5);
    bst_assert_ok(&ctx, bst_file_read(&ctx, path, 5, "a thing", &text, &bytes));
    assert_int_equal(bytes, 5);
    assert_memory_equal(text, "ab\0cd\0", 6); /* and a zero behind */
    free(text);
    assert_int_equal(bst_file_read(&ctx, path, 4, "a thing", &text, &bytes), BST_ERR_FORMAT);
    int fd = -1;
    uint64_t size = 0;
    bst_assert_ok(&ctx, bst_file_open(&ctx, path, 5, "a thing", &fd, &size));
    assert_int_equal(size, 5);
    close(fd);
    write_bytes(path, "", 0);
    bst_assert_ok(&ctx, bst_file_read(&ctx, path, 0, "a thing", &text, &bytes));
    assert_int_equal(bytes, 0);
    assert_true(*text == '\0');
    free(text);
    assert_int_equal(bst_file_read(&ctx, in_folder("none"), 5, "a thing", &text, &bytes),
                     BST_ERR_NOT_FOUND);
    expect_words(&ctx, "; give a thing");
    assert_int_equal(bst_file_read(&ctx, folder, 5, "a thing", &text, &bytes), BST_ERR_IO);
    expect_words(&ctx, "; give a thing");
    /* a pipe without a writer is not waited for */
    assert_int_equal(mkfifo(in_folder("pipe"), 0600), 0);
    assert_int_equal(bst_file_read(&ctx, in_folder("pipe"), 5, "a thing", &text, &bytes),
                     BST_ERR_IO);
}

static void text_is_text(void **state) {
    (void)state;
    static const struct {
        const char *text;
        size_t bytes;
        const char *words; /* NULL: it is */
    } cases[] = {
        {"", 0, NULL},
        {"plain\n", 6, NULL},
        {"\xFF\xFE", 2, "x:1: the file is UTF-16 text"},
        {"\xFE\xFFz", 3, "x:1: the file is UTF-16 text"},
        {"\xFF", 1, NULL},
        {"\xFE\xFE", 2, NULL},
        {"\xEF\xBB\xBF{}", 5, NULL},
        {"ab\ncd\0e\n", 8, "x:2:"},
        {"ab\ncd\n", 7, "x:3:"}, /* the zero behind the text counts as in it */
        {"\0", 1, "x:1:"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bst_ctx ctx = {0};
        bst_status status = bst_file_check_text(&ctx, "x", cases[i].text, cases[i].bytes);
        assert_int_equal(status, cases[i].words ? BST_ERR_FORMAT : BST_OK);
        if (cases[i].words) {
            expect_words(&ctx, cases[i].words);
        }
    }
}

static void drafts_are_files_of_their_own(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    char path[BST_TEST_PATH + 100], first[600], second[600];
    int a = -1, b = -1;
    snprintf(path, sizeof path, "%s", in_folder("out.fits"));
    bst_assert_ok(&ctx, bst_draft_make(&ctx, path, first, sizeof first, &a));
    bst_assert_ok(&ctx, bst_draft_make(&ctx, path, second, sizeof second, &b));
    assert_true(strcmp(first, second) != 0);
    assert_memory_equal(first, path, strlen(path));
    assert_memory_equal(first + strlen(path), ".tmp.", 5);
    assert_int_equal(strspn(first + strlen(path) + 5, "0123456789"), 18);
    assert_int_equal(strlen(first), strlen(path) + 5 + 18);
    assert_true(bst_draft_is_name(first));
    char back[4] = "";
    assert_int_equal(write(a, "abc", 3), 3);
    assert_int_equal(pread(a, back, 3, 0), 3); /* read and written */
    assert_string_equal(back, "abc");
    close(a);
    close(b);
    assert_int_equal(access(path, F_OK), -1); /* nothing is at the path itself */
    char tight[20];
    assert_int_equal(bst_draft_make(&ctx, path, tight, sizeof tight, &a), BST_ERR_ARGUMENT);
    assert_int_equal(a, -1);
    assert_int_equal(bst_draft_make(&ctx, folder, first, sizeof first, &a), BST_ERR_ARGUMENT);
    expect_words(&ctx, "is not a regular file");
    assert_int_equal(bst_draft_make(&ctx, "/nowhere/at/all", first, sizeof first, &a), BST_ERR_IO);
    expect_words(&ctx, strerror(ENOENT));
    /* a link in the place of a file is not written through */
    const char *victim = in_folder("victim");
    write_bytes(victim, "mine", 4);
    assert_int_equal(symlink("victim", path), 0);
    bst_assert_ok(&ctx, bst_draft_make_at(&ctx, path, &a));
    assert_int_equal(write(a, "new", 3), 3);
    close(a);
    struct stat info;
    assert_int_equal(lstat(path, &info), 0);
    assert_true(S_ISREG(info.st_mode) && info.st_size == 3);
    assert_int_equal(stat(in_folder("victim"), &info), 0);
    assert_int_equal(info.st_size, 4);
    assert_int_equal(bst_draft_make_at(&ctx, "/nowhere/at/all", &a), BST_ERR_IO);
}

static void names_of_drafts(void **state) {
    (void)state;
    static const char *const good[] = {"x.tmp.1", "a.b.tmp.000000000000000012"},
                             *const bad[] = {"x.tmp.", "x.tmp.1a", "x.tmp1",   ".tmp.1",
                                             "x",      "x.tpm.1",  "x.tmp.-1", "x.tmp.1."};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        assert_true(bst_draft_is_name(good[i]));
    }
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_false(bst_draft_is_name(bad[i]));
    }
}

static int recycled;
static void recycle(void *owner) {
    (void)owner;
    recycled++;
}

/* What the engine has to know of each message. */
static void channels_by_name(void **state) {
    (void)state;
    static const struct {
        const char *name;
        size_t header, item;
        int kind;
        bool extended; /* in place */
    } cases[] = {
        {"sensor_command", sizeof(bst_sensor_command), 0, BST_CHANNEL_LATEST, false},
        {"exposure", sizeof(bst_exposure), 0, BST_CHANNEL_QUEUE, false},
        {"los_history", sizeof(bst_los_history), sizeof(bst_los_sample), BST_CHANNEL_LATEST, true},
        {"truth", sizeof(bst_truth), sizeof(bst_truth_item), BST_CHANNEL_QUEUE, false},
        {"detections", sizeof(bst_detections), sizeof(bst_detection), BST_CHANNEL_QUEUE, false},
        {"predictions", sizeof(bst_predictions), sizeof(bst_prediction), BST_CHANNEL_LATEST, false},
        {"tracks", sizeof(bst_tracks), sizeof(bst_track), BST_CHANNEL_QUEUE, false},
        {"tracks_smoothed", sizeof(bst_tracks_smoothed), sizeof(bst_track_smoothed),
         BST_CHANNEL_QUEUE, false},
        {"track_identities", sizeof(bst_track_identities), sizeof(bst_track_identity),
         BST_CHANNEL_QUEUE, false},
        {"regions_of_interest", sizeof(bst_regions_of_interest), sizeof(bst_searched_window),
         BST_CHANNEL_QUEUE, false},
        {"wheel_status", sizeof(bst_wheel_status), sizeof(bst_wheel_state), BST_CHANNEL_LATEST,
         false},
        {"control_status", sizeof(bst_control_status), 0, BST_CHANNEL_LATEST, false},
        {"frame", sizeof(bst_frame_message), 0, BST_CHANNEL_QUEUE, false},
        {"task", sizeof(bst_task), 0, BST_CHANNEL_LATEST, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const bst_channel_type *t = bst_channel_type_find(cases[i].name);
        assert_non_null(t);
        assert_string_equal(t->name, cases[i].name);
        assert_int_equal(t->header_bytes, cases[i].header);
        assert_int_equal(t->item_bytes, cases[i].item);
        assert_int_equal(t->kind, cases[i].kind);
        assert_true((t->release != NULL) == (strcmp(t->name, "frame") == 0));
        if (t->count) {
            union {
                bst_truth truth;
                bst_detections detections;
                bst_predictions predictions;
                bst_tracks tracks;
                bst_tracks_smoothed smoothed;
                bst_track_identities identities;
                bst_regions_of_interest regions;
                bst_wheel_status wheels;
            } m;
            memset(&m, 0, sizeof m);
            *(i == 3   ? &m.truth.count
              : i == 4 ? &m.detections.count
              : i == 5 ? &m.predictions.count
              : i == 6 ? &m.tracks.count
              : i == 7 ? &m.smoothed.count
              : i == 8 ? &m.identities.count
              : i == 9 ? &m.regions.count
                       : &m.wheels.count) = 17;
            assert_int_equal(t->count(&m), 17);
        }
        assert_true((t->count != NULL) == (cases[i].item > 0 && !cases[i].extended));
    }
    assert_null(bst_channel_type_find("nothing"));
    /* a frame's message owns a reference */
    const bst_channel_type *t = bst_channel_type_find("frame");
    const bst_frame_ops ops = {.recycle = recycle};
    bst_frame frame = {.ops = &ops, .references = 1};
    bst_frame_message message = {.frame = &frame}, none = {.frame = NULL};
    t->retain(&none);
    t->release(&none);
    t->retain(&message);
    assert_int_equal(frame.references, 2);
    bst_frame_message copy = message;
    t->release(&copy);
    assert_null(copy.frame);
    assert_int_equal(recycled, 0);
    t->release(&message);
    assert_int_equal(recycled, 1);
}

static void names_of_modes(void **state) {
    (void)state;
    assert_string_equal(bst_mode_name(BST_MODE_TRACK), "track");
    assert_string_equal(bst_mode_name(0), "idle");
    assert_string_equal(bst_mode_name(BST_MODE_COUNT - 1), "lost");
    assert_string_equal(bst_mode_name(BST_MODE_COUNT), "unknown");
    assert_string_equal(bst_mode_name(-1), "unknown");
    assert_string_equal(bst_task_end_name(BST_TASK_LOST), "lost");
    assert_string_equal(bst_task_end_name(BST_TASK_NONE), "none");
    assert_string_equal(bst_task_end_name(BST_TASK_END_COUNT), "unknown");
    assert_string_equal(bst_task_end_name(-1), "unknown");
}

static int logged;
static void count_log(void *user, bst_log_level level, const char *text) {
    (void)user;
    assert_string_equal(text, level == BST_LOG_WARNING ? "take care 3" : "by the way");
    logged++;
}

static void failures_have_messages(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, count_log, NULL, BST_LOG_WARNING);
    assert_int_equal(bst_fail(&ctx, BST_ERR_IO, "disk %d\x1b[31m\x7f\nfull", 5), BST_ERR_IO);
    /* what would drive a terminal is not passed on; a new line is */
    assert_null(strchr(ctx.message, '\x1b'));
    assert_null(strchr(ctx.message, '\x7f'));
    assert_non_null(strstr(ctx.message, "disk 5"));
    assert_non_null(strstr(ctx.message, "\nfull"));
    assert_int_equal(bst_fail(&ctx, BST_ERR_FORMAT, "odd"), BST_ERR_FORMAT);
    assert_int_equal(bst_fail_prefix(&ctx, BST_ERR_IO, "file %s", "x"), BST_ERR_IO);
    assert_string_equal(ctx.message, "file x: odd");
    assert_int_equal(bst_fail(NULL, BST_ERR_IO, "nobody hears"), BST_ERR_IO);
    assert_int_equal(bst_fail_prefix(NULL, BST_ERR_IO, "nobody hears"), BST_ERR_IO);
    bst_log(&ctx, BST_LOG_WARNING, "take care %d", 3);
    bst_log(&ctx, BST_LOG_INFO, "by the way");
    bst_log(NULL, BST_LOG_WARNING, "nobody hears");
    assert_int_equal(logged, 1);
    assert_int_equal(ctx.warnings, 1);
    ctx.log_level = BST_LOG_INFO;
    bst_log(&ctx, BST_LOG_INFO, "by the way");
    assert_int_equal(logged, 2);
    assert_int_equal(ctx.warnings, 1);
    assert_string_equal(bst_status_name(BST_OK), "ok");
    assert_string_equal(bst_status_name(BST_ERR_INTERRUPTED), "interrupted");
    assert_string_equal(bst_status_name(BST_STATUS_COUNT), "unknown status");
}

/* Absolute and empty names, and a document in the working directory, leave a name as it is. */
static void names_are_resolved(void **state) {
    (void)state;
    const struct {
        const char *base_dir, *file, *path;
    } cases[] = {{"a/b", "c.csv", "a/b/c.csv"},
                 {"a/b", "/c.csv", "/c.csv"},
                 {"", "c.csv", "c.csv"},
                 {"a/b", "", ""},
                 {"/", "c.csv", "//c.csv"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char path[32];
        bst_file_resolve(cases[k].base_dir, cases[k].file, path, sizeof path);
        assert_string_equal(path, cases[k].path);
    }
    char small[6];
    bst_file_resolve("a/b", "c.csv", small, sizeof small);
    assert_string_equal(small, "a/b/c");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_resolved), cmocka_unit_test(files_are_read_whole),
        cmocka_unit_test(text_is_text),       cmocka_unit_test(drafts_are_files_of_their_own),
        cmocka_unit_test(names_of_drafts),    cmocka_unit_test(channels_by_name),
        cmocka_unit_test(names_of_modes),     cmocka_unit_test(failures_have_messages),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
