/* Places and tables of ghosts. */
#include "sim/optics/ghost_map.h"
#include "tests/test_support.h"

static bst_status read(bst_ctx *ctx, const char *text, bst_ghost_map *map) {
    return bst_ghost_map_read(ctx, "ghosts.csv", text, strlen(text), map);
}

/* A table of the reflection about (50, 40) with intensity 0.5 at the left and 1 at the right. */
static const char reflected[] =
    "# comment\n"
    "source_x_px,source_y_px,x_px,y_px,intensity\n"
    "0,0,100,80,0.5\n100,0,0,80,1\n100,80,0,0,1\n0,80,100,0,0.5\n";

static void tables_are_bilinear(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_ghost_map map;
    bst_assert_ok(&ctx, read(&ctx, reflected, &map));
    assert_int_equal(map.columns * 10 + map.rows, 22);
    const double places[][2] = {{0, 0}, {30, 10}, {50, 40}, {100, 80}, {-20, 95}};
    for (int i = 0; i < 5; i++) { /* a linear table: exact, beyond its ends too; rounding */
        double to[2];
        bst_ghost_map_place(&map, places[i][0], places[i][1], to);
        bst_assert_close(to[0], 100.0 - places[i][0], 1e-12);
        bst_assert_close(to[1], 80.0 - places[i][1], 1e-12);
    }
    bst_assert_close(bst_ghost_map_intensity(&map, 25, 33), 0.625, 1e-15);
    bst_assert_close(bst_ghost_map_intensity(&map, -99, 33), 0.5, 1e-15);
    bst_assert_close(map.magnification, sqrt(2.0), 1e-12); /* bound of cells: 1 along the edges */
    bst_ghost_map_free(&map);
}

static void bad_tables_are_named(void **state) {
    (void)state;
    static const struct {
        const char *text, *message;
    } bad[] = {
        {"", "ghosts.csv: has no rows"},
        {"source_x_px,source_y_px,x_px\n", "ghosts.csv:1: a column is missing"},
        {"source_x_px,source_y_px,x_px,flux\n", "ghosts.csv:1: the column is not known (found"},
        {"source_x_px,source_y_px,x_px,x_px\n", "ghosts.csv:1: a column is there twice"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,1\n", "ghosts.csv:2: the row does not have"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,1,nan\n", "ghosts.csv:2: y_px is not a number"},
        {"source_x_px,source_y_px,x_px,y_px,intensity\n0,0,1,1,-1\n",
         "ghosts.csv:2: intensity is not a number"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,1,1\n", "the places of the source are no rectang"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,1,1\n1,0,1,1\n0,1,1,1\n2,1,1,1\n",
         "no rectangular grid (at source_x_px 2, source_y_px 1)"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,1,1\n0,0,1,1\n0,1,1,1\n0,1,1,1\n",
         "no rectangular grid"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,0,0\n1,0,100,0\n0,1,0,0\n1,1,0,101\n",
         "ghosts.csv: the ghost moves 142.1 px for each px of its source (at source_x_px 1, "
         "source_y_px 1); allowed are up to 100"},
        {"source_x_px,source_y_px,x_px,y_px\n0,0,0,0\n1e-300,0,1,0\n0,1,0,0\n1e-300,1,1,0\n",
         "the ghost moves 1e+300 px for each px"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bst_ctx ctx = {0};
        bst_ghost_map map;
        assert_int_equal(read(&ctx, bad[i].text, &map), BST_ERR_FORMAT);
        if (!strstr(ctx.message, bad[i].message)) {
            fail_msg("%s: wanted %s", ctx.message, bad[i].message);
        }
    }
}

static bst_camera camera_with(bst_ghost_config *list, int count) {
    return (bst_camera){.width_px = 101,
                        .height_px = 81,
                        .pixel_scale_arcsec = 3.0,
                        .boresight_offset_px = {4.0, -3.0},
                        .ghosts = {list, count}};
}

static void factors_reflect_about_the_boresight(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_ghost_config list[] = {{.intensity = 0.1, .factor = -1.0},
                               {.intensity = 0.2,
                                .factor = 0.5,
                                .centre_px = {2.0, 1.0},
                                .radius_px = 6.0,
                                .inner_radius_px = 2.0,
                                .outside_px = 10.0}};
    bst_camera camera = camera_with(list, 2);
    bst_ghosts *g;
    bst_assert_ok(&ctx, bst_ghosts_create(&ctx, &camera, "", &g));
    double to[2]; /* boresight at (54, 37) */
    bst_ghost_place(&g->items[0], 50.0, 40.0, to);
    bst_assert_close(to[0], 58.0, 1e-12);
    bst_assert_close(to[1], 34.0, 1e-12);
    bst_ghost_place(&g->items[1], 50.0, 40.0, to);
    bst_assert_close(to[0], 53.0, 1e-12);
    bst_assert_close(to[1], 39.0, 1e-12);
    bst_assert_close(bst_ghost_intensity(&g->items[0], &camera, 100.6, 3.0), 0.0, 0.0);
    bst_assert_close(bst_ghost_intensity(&g->items[1], &camera, 100.6, 3.0), 0.2, 0.0);
    /* mean of x^2 over a ring: (r^2 + hole^2) / 4 */
    bst_assert_close(bst_ghost_variance_px2(&g->items[1]), 10.0, 1e-12);
    bst_assert_close(bst_ghost_peak_share(&g->items[1]), 1.0 / (BST_PI * 32.0), 1e-15);
    /* the direction of a ghost is that of its place */
    bst_vec3 v = bst_ghost_direction(&g->items[0], &camera, bst_camera_unproject(&camera, 50, 40));
    double x, y;
    assert_true(bst_camera_project(&camera, v, &x, &y));
    bst_assert_close(x, 58.0, 1e-9);
    bst_assert_close(y, 34.0, 1e-9);
    assert_true(bst_ghost_direction(&g->items[0], &camera, (bst_vec3){0, 0, -1}).z < 0.0);
    bst_ghosts_free(g);
}

/* A table of 2 columns and 3 rows: a ghost within its bounds and outside_px, by a tenth of a pixel
 * on each side; and one without a table within the sensor's. */
static void ghosts_end_outside_their_bounds(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_ghost_config list[] = {{.intensity = 0.1, .factor = -1.0, .outside_px = 2.0}};
    bst_camera camera = camera_with(list, 1);
    bst_ghosts *made;
    bst_assert_ok(&ctx, bst_ghosts_create(&ctx, &camera, "", &made));
    bst_ghost table = {.intensity = 0.1, .outside_px = 2.0};
    bst_assert_ok(&ctx, read(&ctx,
                             "source_x_px,source_y_px,x_px,y_px,intensity\n10,5,1,1,1\n60,5,2,1,1\n"
                             "10,20,1,2,1\n60,20,2,2,1\n10,75,1,3,1\n60,75,2,3,1\n",
                             &table.map));
    const bst_ghost *const ghosts[2] = {&made->items[0], &table};
    const double bounds[2][4] = {{-0.5, 100.5, -0.5, 80.5}, {10.0, 60.0, 5.0, 75.0}};
    for (int n = 0; n < 2; n++) {
        const double *b = bounds[n];
        for (int side = 0; side < 4; side++) {
            for (int out = 0; out < 2; out++) {
                double place[2] = {0.5 * (b[0] + b[1]), 0.5 * (b[2] + b[3])};
                place[side / 2] = b[side] + (side % 2 ? 1.0 : -1.0) * (out ? 2.1 : 1.9);
                double light = bst_ghost_intensity(ghosts[n], &camera, place[0], place[1]);
                bst_assert_close(light, out ? 0.0 : 0.1, 1e-15);
            }
        }
    }
    bst_ghost_map_free(&table.map);
    bst_ghosts_free(made);
}

static void bad_ghosts_are_named(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_ghost_config two = {.intensity = 0.1, .fwhm_px = 2.0, .radius_px = 3.0};
    bst_ghost_config hole = {.intensity = 0.1, .radius_px = 3.0, .inner_radius_px = 3.0};
    bst_ghost_config file = {.intensity = 0.1, .map_file = "nowhere.csv"};
    bst_ghost_config *const bad[] = {&two, &hole, &file};
    const char *const key[] = {"ghosts/0/fwhm_px: is 2, and radius_px is 3",
                               "inner_radius_px: is 3", "ghosts/0/map_file: "};
    for (int i = 0; i < 3; i++) {
        bst_camera camera = camera_with(bad[i], 1);
        bst_ghosts *g;
        assert_int_equal(bst_ghosts_create(&ctx, &camera, "", &g), BST_ERR_CONFIG);
        assert_non_null(strstr(ctx.message, key[i]));
        assert_null(g);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tables_are_bilinear),
        cmocka_unit_test(bad_tables_are_named),
        cmocka_unit_test(factors_reflect_about_the_boresight),
        cmocka_unit_test(bad_ghosts_are_named),
        cmocka_unit_test(ghosts_end_outside_their_bounds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
