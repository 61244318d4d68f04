/* Who may use a folder for the results of a study. */
#include "sim/studies/study_folder.h"
#include "tests/studies/study_fixture.h"

enum { ALONE, SHARED, RESUMED };

typedef struct place {
    char folder[BST_TEST_PATH], out[BST_TEST_PATH + 16];
    bst_ctx ctx;
    bst_study study, other;
} place;

static int set_up(void **state) {
    place *p = calloc(1, sizeof *p);
    fixture_folder(p->folder);
    bst_assert_ok(&p->ctx, fixture_open(&p->ctx, p->folder, "\"replicates\": 3", &p->other));
    bst_assert_ok(&p->ctx, fixture_open(&p->ctx, p->folder, "\"replicates\": 2", &p->study));
    snprintf(p->out, sizeof p->out, "%s/out", p->folder);
    *state = p;
    return 0;
}

static int tear_down(void **state) {
    place *p = *state;
    bst_study_close(&p->study);
    bst_study_close(&p->other);
    fixture_remove(p->folder);
    free(p);
    return 0;
}

/* Opens the folder, expects a status, and returns the lock. */
static int lock_of(place *p, const bst_study *study, int how, bst_status wanted,
                   const char *message) {
    int lock = 7;
    bst_status status =
        bst_study_folder_open(&p->ctx, study, p->out, how == RESUMED, how == SHARED, &lock);
    assert_int_equal(status, wanted);
    assert_int_equal(lock >= 0, wanted == BST_OK);
    if (message) {
        assert_non_null(strstr(p->ctx.message, message));
    }
    return lock;
}

static void once(place *p, const bst_study *study, int how, bst_status wanted,
                 const char *message) {
    int lock = lock_of(p, study, how, wanted, message);
    if (lock >= 0) {
        close(lock);
    }
}

static bool has(const place *p, const char *name) {
    char path[BST_TEST_PATH + 64];
    snprintf(path, sizeof path, "%s/%s", p->out, name);
    return access(path, F_OK) == 0;
}

static void one_study(void **state) {
    place *p = *state;
    once(p, &p->study, ALONE, BST_OK, NULL);
    assert_true(has(p, "study.json") && has(p, "shards") && has(p, "lock"));
    once(p, &p->study, ALONE, BST_ERR_STATE, "holds this study already");
    once(p, &p->study, RESUMED, BST_OK, NULL);
    once(p, &p->study, SHARED, BST_OK, NULL);
    once(p, &p->other, ALONE, BST_ERR_STATE, "holds another study");
    once(p, &p->other, RESUMED, BST_ERR_STATE, "holds another study");
}

static void what_is_there(void **state) {
    place *p = *state;
    assert_int_equal(mkdir(p->out, 0777), 0); /* an empty folder is none */
    once(p, &p->study, ALONE, BST_OK, NULL);
    fixture_remove(p->out);
    assert_int_equal(mkdir(p->out, 0777), 0);
    fixture_write(p->out, "letter", "");
    once(p, &p->study, ALONE, BST_ERR_IO, "is in the way and holds no study");
    assert_true(has(p, "letter") && !has(p, "shards") && !has(p, "lock"));
    once(p, &p->study, RESUMED, BST_OK, NULL); /* results without their study */
    assert_true(has(p, "letter") && has(p, "study.json"));
}

static void locks(void **state) {
    place *p = *state;
    int first = lock_of(p, &p->study, ALONE, BST_OK, NULL);
    once(p, &p->study, RESUMED, BST_ERR_IO, "is at work there");
    once(p, &p->study, SHARED, BST_ERR_IO, "is at work there");
    close(first);
    first = lock_of(p, &p->study, SHARED, BST_OK, NULL);
    once(p, &p->study, SHARED, BST_OK, NULL);
    once(p, &p->study, RESUMED, BST_ERR_IO, "is at work there");
    close(first);
    once(p, &p->study, RESUMED, BST_OK, NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(one_study, set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_is_there, set_up, tear_down),
        cmocka_unit_test_setup_teardown(locks, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
