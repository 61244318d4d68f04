/* Gravity fields in the ICGEM format that are wrong as files. */
#include "sim/astro/gravity.h"
#include "tests/bad_input/faults.h"

static bst_status read_gravity(bst_ctx *ctx, const char *path) {
    bst_gravity *field = NULL;
    bst_status status = bst_gravity_load(ctx, path, 2, 1, &field);
    assert_true((status == BST_OK) == (field != NULL));
    bst_gravity_free(field);
    return status;
}

static const bad_reader reader = {read_gravity, "a gravity field in the ICGEM format", "",
                                  256 << 20};

static void paths(void **state) {
    (void)state;
    bad_paths(&reader);
}

#define HEAD "earth_gravity_constant 3.986004415e14\nradius 6378136.3\nmax_degree 2\nend_of_head\n"
#define C20 "gfc 2 0 -4.84e-4 0\n"
#define C21 "gfc 2 1 -2e-10 1.4e-9\n"

static void exact_messages(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } cases[] = {
        {"", ":0: the file ends before the line \"end_of_head\""},
        {"radius 6378136.3\n", ":1: the file ends before the line \"end_of_head\""},
        {"radius nan\n", ":1: radius (found \"nan\"; expected a finite number)"},
        {"radius 1e400\n", ":1: radius (found \"1e400\"; expected a finite number)"},
        {"max_degree 2.5\n", ":1: max_degree (found \"2.5\"; expected a whole number 0 to 100000)"},
        {"norm none\n", ":1: norm (found \"none\"; expected fully_normalized or unnormalized)"},
        {"end_of_head\n",
         ":1: the header must give earth_gravity_constant, about 3.986e14 m^3/s^2 (found 0)"},
        {HEAD, ":4: the file ends without degree 2, order 0"},
        {HEAD C20, ":5: the file ends without degree 2, order 1"},
        {HEAD C20 C20, ":6: a degree and order that came before (found \"0\"; expected each once)"},
        {HEAD C20 "gfc 2 1 x 0\n", ":6: C (found \"x\"; expected a finite number)"},
        {HEAD C20 "gfc 2 3 0 0\n", ":6: order (found \"3\"; expected at most the degree)"},
        {HEAD C20 "gfc 3 0 0 0\n",
         ":6: degree (found \"3\"; expected at most the header's max_degree)"},
        {HEAD C20 "gfc 2 1 0\n",
         ":6: a coefficient is cut short (found \"0\"; expected \"gfc\", degree, order, C, S)"},
        {HEAD C20 C21 "garbage\n",
         ":7: not a static coefficient (found \"garbage\"; expected \"gfc\": time-variable terms "
         "are not read)"},
        {"\xFF\xFEr", ":1: the file is UTF-16 text (allowed: ASCII or UTF-8)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bad_text(&reader, cases[i].text, BST_ERR_FORMAT, cases[i].message);
    }
    bst_ctx ctx = {0};
    bst_gravity *field = NULL;
    static const char good[] = HEAD C20 C21;
    bst_assert_ok(&ctx, bst_gravity_read_buffer(&ctx, "x", good, sizeof good - 1, 2, 1, &field));
    bst_gravity_free(field);
    const size_t last_number = sizeof good - 1 - strlen("1.4e-9\n");
    for (size_t n = 0; n <= last_number; n++) {
        assert_int_equal(bst_gravity_read_buffer(&ctx, "x", good, n, 2, 1, &field), BST_ERR_FORMAT);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(paths), cmocka_unit_test(exact_messages)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
