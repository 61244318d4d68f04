/* Ghosts among the sources of a field query, and their truth. */
#include "sim/optics/ghosts.h"
#include "tests/world/field_scene.h"

static const bst_window full = {0, 0, 1024, 1024}, wide = {0, 0, 800, 400}, high = {0, 0, 400, 800};
enum { OUTSIDE_PX = 300 }; /* from which the second ghost of the scene takes light */

static void query(scene *s, double sigma, bst_window window) {
    bst_field_options options = {.v_limit = 13, .margin_px = 5, .ghost_sigma = sigma};
    bst_assert_ok(&s->ctx,
                  bst_field_track(&s->ctx, s->field, s->history, 0, 3000, RATE, &s->track));
    bst_assert_ok(&s->ctx, bst_field_query(&s->ctx, s->field, &s->track, 0, 3000, RATE, window,
                                           &options, &s->truth, &s->sources, &s->count));
}

static bst_truth_item item_of(const scene *s, int i) {
    bst_truth_item item;
    bst_field_truth_item(s->field, &s->track, &s->sources[i], full, 1, &s->truth, &item);
    return item;
}

/* The scene of GX5 with an opposite ghost of 5 % and a bright one of half the distance. */
static scene ghost_scene_on(bst_window sensor) {
    char text[2000];
    snprintf(text, sizeof text,
             "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [" GX5
             "]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
             ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": "
             "{\"pixel_scale_arcsec\": 3, \"width_px\": %d, \"height_px\": %d, \"aperture_m\": "
             "0.15, \"ghosts\": [{\"intensity\": 0.05, \"radius_px\": 3}, {\"intensity\": 0.5, "
             "\"factor\": 0.5, \"outside_px\": %d}]}}]}]}",
             sensor.width, sensor.height, OUTSIDE_PX);
    scene s = make_scene_in(test_world(text));
    for (int64_t tick = 0; tick <= 3000; tick += 100) {
        double u = (double)tick / 3000.0 - 0.5;
        push(s.history, tick, turned(s.target, 12.0 * u, -4.0 * u, 0.0));
    }
    return s;
}

static scene ghost_scene(void) {
    return ghost_scene_on(full);
}

static void sources_have_ghosts_where_they_are_mapped(void **state) {
    (void)state;
    scene s = ghost_scene();
    query(&s, 0.0, full);
    int plain = s.count;
    query(&s, 0.05, full);
    int stars = 0, ghosts = 0, objects = 0, last = BST_SOURCE_STAR;
    double c = 511.5, least = INFINITY;
    for (int i = 0; i < s.count; i++) {
        const bst_scene_source *g = &s.sources[i];
        stars += g->kind == BST_SOURCE_STAR;
        objects += g->kind == BST_SOURCE_OBJECT;
        if (!bst_source_is_ghost(g->kind)) {
            assert_true(last == BST_SOURCE_STAR || g->kind == BST_SOURCE_OBJECT); /* the order */
            last = g->kind;
            continue;
        }
        last = g->kind;
        ghosts++;
        assert_non_null(g->ghost);
        bst_truth_item item = item_of(&s, i);
        least = fmin(least, item.electrons);
        for (int k = 0; k < s.count; k++) {
            const bst_scene_source *source = &s.sources[k];
            if (source->id != g->id || source->ghost ||
                bst_source_is_object(source->kind) != bst_source_is_object(g->kind)) {
                continue;
            }
            bst_truth_item own = item_of(&s, k);
            double m = g->ghost->factor;
            /* affine: positions at the ends, in the middle and the mean; rounding of tangents */
            bst_assert_close(item.x_start_px - c, m * (own.x_start_px - c), 1e-7);
            bst_assert_close(item.y_end_px - c, m * (own.y_end_px - c), 1e-7);
            bst_assert_close(item.x_mid_px - c, m * (own.x_mid_px - c), 1e-7);
            bst_assert_close(item.x_chief_px - c, m * (own.x_chief_px - c), 1e-7);
            bst_assert_close(item.electrons, g->ghost->intensity * own.electrons,
                             1e-12 * own.electrons);
            bst_assert_close(item.v_mag, own.v_mag - 2.5 * log10(g->ghost->intensity), 1e-12);
        }
    }
    assert_true(ghosts >= 4 && objects == 1 && stars + objects == plain);
    assert_true(s.sources[s.count - 1].kind == BST_SOURCE_OBJECT);
    /* none is fainter than 0.05 sigma of a dark pixel in its brightest one, which has at most the
     * share of the PSF's middle */
    double sigma = sqrt(s.truth.background_e + s.truth.dark_e + 64.0);
    assert_true(least > 0.05 * sigma);
    int before = s.count; /* a coarser tolerance: fewer */
    query(&s, 1.0, full);
    assert_true(s.count < before && s.count > plain - 1);
    free_scene(&s);
}

/* A window on the ghost alone shows it, too, though its star lies far outside the window. */
static void windows_see_ghosts_of_stars_elsewhere(void **state) {
    (void)state;
    scene s = ghost_scene();
    query(&s, 0.05, full);
    bool found = false;
    for (int i = 0; i < s.count && !found; i++) {
        const bst_scene_source *g = &s.sources[i];
        bst_truth_item item = item_of(&s, i);
        if (g->kind != BST_SOURCE_STAR_GHOST || g->ghost->factor > 0.0 ||
            fabs(item.x_mid_px - 511.5) < 120.0 || item.x_mid_px < 60.0 || item.x_mid_px > 960.0 ||
            item.y_mid_px < 60.0 || item.y_mid_px > 960.0) {
            continue;
        }
        uint32_t id = g->id;
        bst_window w = {(int)item.x_mid_px - 20, (int)item.y_mid_px - 20, 41, 41};
        query(&s, 0.05, w);
        for (int k = 0; k < s.count; k++) {
            found = found || (s.sources[k].kind == BST_SOURCE_STAR_GHOST && s.sources[k].id == id);
        }
        assert_true(found);
    }
    assert_true(found);
    free_scene(&s);
}

/* On sensors of unequal sides: each star that is bright enough has a ghost by the second one where
 * that lies on the sensor, also from so far outside as it takes light from. */
static void stars_about_the_sensor_have_ghosts(void **state) {
    (void)state;
    const bst_window around = {0, 0, 2048, 2048};
    scene all = ghost_scene_on(around);
    query(&all, 0.05, around);
    for (int tall = 0; tall < 2; tall++) {
        const bst_window sensor = tall ? high : wide;
        scene s = ghost_scene_on(sensor);
        query(&s, 0.05, sensor);
        const double sigma = sqrt(s.truth.background_e + s.truth.dark_e + 64.0);
        int outside[4] = {0}; /* left, right, above, below */
        for (int i = 0; i < all.count; i++) {
            const bst_scene_source *source = &all.sources[i];
            bst_truth_item item;
            bst_field_truth_item(all.field, &all.track, source, around, 1, &all.truth, &item);
            /* from the middle of both sensors */
            double x = item.x_mid_px - 1023.5, y = item.y_mid_px - 1023.5;
            bool near = fabs(x) < 0.5 * sensor.width + OUTSIDE_PX - 1.0 &&
                        fabs(y) < 0.5 * sensor.height + OUTSIDE_PX - 1.0 &&
                        fabs(x) < sensor.width - 1.0 && fabs(y) < sensor.height - 1.0;
            /* half of its light, of which the brightest pixel of 12 px of motion has 1 % or more */
            if (source->kind != BST_SOURCE_STAR || !near ||
                0.5 * 0.01 * item.electrons < 0.05 * sigma) {
                continue;
            }
            int ghosts = 0;
            for (int k = 0; k < s.count; k++) {
                const bst_scene_source *g = &s.sources[k];
                ghosts += g->kind == BST_SOURCE_STAR_GHOST && g->id == source->id &&
                          g->ghost->factor == 0.5;
            }
            assert_int_equal(ghosts, 1);
            outside[0] += x < -0.5 * sensor.width;
            outside[1] += x > 0.5 * sensor.width;
            outside[2] += y < -0.5 * sensor.height;
            outside[3] += y > 0.5 * sensor.height;
        }
        assert_true(outside[tall ? 2 : 0] >= 1 && outside[tall ? 3 : 1] >= 1);
        free_scene(&s);
    }
    free_scene(&all);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sources_have_ghosts_where_they_are_mapped),
        cmocka_unit_test(windows_see_ghosts_of_stars_elsewhere),
        cmocka_unit_test(stars_about_the_sensor_have_ghosts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
