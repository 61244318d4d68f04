/* Which sources get room in a truth message, and which of them saturate: limits computed here from
 * the camera's numbers, light of binned pixels by numerical integration. */
#include "sim/world/scene/truth_list.h"

#include "tests/world/world_support.h"

enum { RATE = 6000, EXPOSURE = 3000, MOST = 400 };

/* Vignetting, dark current and a sky that count; the converter is full before the well. */
#define SCENE(well, bits)                                                                         \
    "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"GX5\", " TEST_GX5  \
    "}]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT                                  \
    ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": {\"width_px\": 900, "           \
    "\"height_px\": 700, \"pixel_scale_arcsec\": 6, \"aperture_m\": 0.15, "                       \
    "\"dark_current_e_per_s\": 2000, \"background_mag_arcsec2\": 15, \"psf_fwhm_px\": 1.7, "      \
    "\"full_well_e\": " well ", \"gain_e_per_dn\": 3.5, \"offset_dn\": 700, \"bits\": " bits      \
    ", \"optics\": {\"vignetting\": {\"model\": \"polynomial\", \"coefficients\": [-0.3, 0.1, 0]" \
    "}}}}]}]}"

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_field *field;
    bst_los_history *history;
    bst_los_track track;
    const bst_scene_source *sources;
    int count;
    bst_truth *truth;
    double peak_e[MOST];
} scene;

static const bst_window whole = {0, 0, 900, 700};

/* The camera turns by so many pixels during the exposure. */
static scene make(const char *text, double dx_px, double dy_px) {
    scene s = {.world = test_world(text)};
    bst_assert_ok(&s.ctx, bst_field_create(&s.ctx, s.world, 0, 0, &s.field));
    s.history = calloc(1, sizeof *s.history + 8 * sizeof *s.history->items);
    s.truth = calloc(1, sizeof *s.truth + MOST * sizeof *s.truth->items);
    assert_true(s.history && s.truth);
    s.history->capacity = 8;
    bst_quat q = bst_world_body_attitude(s.world, 0, 0);
    for (int k = 0; k <= 4; k++) {
        double u = k / 4.0 - 0.5, scale = 6 * BST_ARCSEC_RAD;
        bst_quat turn = bst_quat_from_rotvec((bst_vec3){-dy_px * u * scale, dx_px * u * scale, 0});
        s.history->items[s.history->written++] =
            (bst_los_sample){k * EXPOSURE / 4, bst_quat_mul(turn, q)};
    }
    const bst_field_options options = {.v_limit = 12, .margin_px = 5};
    bst_assert_ok(&s.ctx, bst_field_track(&s.ctx, s.field, s.history, 0, EXPOSURE, RATE, &s.track));
    bst_assert_ok(&s.ctx, bst_field_query(&s.ctx, s.field, &s.track, 0, EXPOSURE, RATE, whole,
                                          &options, s.truth, &s.sources, &s.count));
    assert_true(s.count > 20 && s.count < MOST);
    return s;
}

static void drop(scene *s) {
    bst_field_free(s->field);
    bst_world_free(s->world);
    free(s->history);
    free(s->truth);
}

static double peak(const void *user, int index, const bst_truth_item *item) {
    const scene *s = user;
    assert_int_equal(item->id, s->sources[index].id);
    return s->peak_e[index];
}

static void fill(scene *s, bst_truth_list *list, int binning, int capacity, int *source_of) {
    const bst_truth_request q = {.field = s->field,
                                 .camera = bst_world_camera(s->world, 0, 0),
                                 .track = &s->track,
                                 .sources = s->sources,
                                 .count = s->count,
                                 .window = whole,
                                 .binning = binning,
                                 .peak_e = peak,
                                 .user = s};
    bst_assert_ok(&s->ctx, bst_truth_list_fill(&s->ctx, list, &q, s->truth, capacity, source_of));
}

/* The objects and the brightest stars, in the order of the sources. */
static void the_brightest_stay(void **state) {
    (void)state;
    scene s = make(SCENE("1e8", "16"), 0, 0);
    bst_truth_list list = {0};
    int source_of[MOST];
    fill(&s, &list, 1, MOST, source_of);
    assert_int_equal(s.truth->count, s.count);
    assert_int_equal(s.truth->lost, 0);
    for (int i = 0; i < s.count; i++) {
        assert_int_equal(source_of[i], i);
        assert_int_equal(s.truth->items[i].id, s.sources[i].id);
    }
    int objects = 0;
    for (int i = 0; i < s.count; i++) {
        objects += s.sources[i].kind == BST_SOURCE_OBJECT;
    }
    assert_int_equal(objects, 1);
    static const int rooms[] = {1, 2, 7, 12};
    for (int r = 0; r < 4; r++) {
        int room = rooms[r], found = 0;
        fill(&s, &list, 1, room, source_of);
        assert_int_equal(s.truth->count, room);
        assert_int_equal(s.truth->lost, s.count - room);
        for (int i = 0; i < s.count; i++) {
            /* how many stars go before it; embedded stars differ in rate, or the first does */
            int before = 0;
            for (int k = 0; k < s.count; k++) {
                double a = s.sources[k].electrons_per_s, b = s.sources[i].electrons_per_s;
                before += s.sources[k].kind == BST_SOURCE_OBJECT || a > b || (a == b && k < i);
            }
            bool stays = s.sources[i].kind == BST_SOURCE_OBJECT || before < room;
            if (stays) {
                assert_int_equal(source_of[found], i);
                assert_int_equal(s.truth->items[found++].id, s.sources[i].id);
            }
        }
        assert_int_equal(found, room);
    }
    bst_truth_list_free(&list);
    assert_null(list.picks);
    drop(&s);
}

/* Share of a Gaussian of this variance in |x| < half, by Simpson's rule. */
static double within(double variance, double half) {
    enum { N = 2000 };
    double sum = 0;
    for (int i = 0; i <= N; i++) {
        double x = half * (2.0 * i / N - 1);
        sum += (i == 0 || i == N ? 1 : i % 2 ? 4 : 2) * exp(-0.5 * x * x / variance);
    }
    return sum * 2 * half / N / 3 / sqrt(2 * BST_PI * variance);
}

/* Each source a little below its limit, and then a little above. */
static void saturation(void **state) {
    (void)state;
    static const struct {
        const char *text;
        double dx, dy, well, top;
        int binning;
    } cases[] = {
        {SCENE("60000", "16"), 3, -5, 60000, 3.5 * (65535 - 700), 1}, /* the well */
        {SCENE("1e8", "12"), 3, -5, 1e8, 3.5 * (4095 - 700), 1},      /* the converter */
        {SCENE("1e8", "16"), 3, -5, 1e8, 3.5 * (65535 - 700), 2},     /* with added pixels */
        {SCENE("1e8", "16"), 0.5, 4, 1e8, 3.5 * (65535 - 700), 3},
        {SCENE("60000", "16"), 0, 0, 60000, 3.5 * (65535 - 700), 2}, /* the wells before them */
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        scene s = make(cases[c].text, cases[c].dx, cases[c].dy);
        bst_truth_list list = {0};
        int n = cases[c].binning, judged = 0;
        fill(&s, &list, n, MOST, NULL);
        /* pixel of 6 arcsec, 0.5 s */
        const bst_camera *camera = bst_world_camera(s.world, 0, 0);
        double sky = 0.5 * bst_camera_electrons_per_s(camera, 15) * 36;
        double limits[MOST];
        for (int i = 0; i < s.count; i++) {
            const bst_truth_item *item = &s.truth->items[i];
            double rx = item->x_chief_px - 449.5, ry = item->y_chief_px - 349.5;
            double r2 = (rx * rx + ry * ry) / (0.25 * (900.0 * 900 + 700.0 * 700));
            double light = 1 - 0.3 * r2 + 0.1 * r2 * r2, dark = 1000 + sky * light;
            double wx = item->x_end_px - item->x_start_px, wy = item->y_end_px - item->y_start_px;
            double psf = 1.7 / (2 * sqrt(2 * log(2))), share = 1;
            double spread[2] = {psf * psf + wx * wx / 12, psf * psf + wy * wy / 12};
            for (int k = 0; k < 2 && n > 1; k++) {
                share *= within(spread[k], 0.5 * n) / within(spread[k], 0.5);
            }
            /* n times n pixels of dark current and sky are converted with it */
            double well = (cases[c].well - dark) / light;
            double top = (cases[c].top - n * n * dark) / share / light;
            limits[i] = fmin(well, top);
            assert_true(limits[i] > 0);
        }
        for (int above = 0; above < 2; above++) {
            for (int i = 0; i < s.count; i++) {
                /* the sky between the nodes of its map: 5e-4 of 1800 e-, nine times */
                s.peak_e[i] = limits[i] * (above ? 1 + 5e-4 : 1 - 5e-4);
            }
            fill(&s, &list, n, MOST, NULL);
            for (int i = 0; i < s.count; i++) {
                const bst_truth_item *item = &s.truth->items[i];
                /* bst_field_truth_item's own estimate flags bright stars anyway */
                if (item->electrons < 3000) {
                    assert_true(!(item->flags & BST_TRUTH_SATURATED) == !above);
                    judged++;
                }
            }
        }
        assert_true(judged > 20);
        bst_truth_list_free(&list);
        drop(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_brightest_stay),
        cmocka_unit_test(saturation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
