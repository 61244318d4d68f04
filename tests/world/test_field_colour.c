/* What the field query says of the colour of each source's light. */
#include <stdlib.h>

#include "sim/optics/band.h"
#include "sim/optics/psf.h"
#include "sim/world/scene/field.h"
#include "tests/world/world_support.h"

enum { RATE = 6000, END = 600, MOST = 4096 };

typedef struct scene {
    bst_ctx ctx;
    bst_world *world;
    bst_field *field;
    const bst_camera *camera;
    bst_quat q;
    const bst_scene_source *sources;
    int count;
} scene;

/* A tenth of a second of staring at GX5 through these optics. */
static scene stare(const char *object, const char *camera) {
    char text[4000];
    scene s = {.world = NULL};
    snprintf(
        text, sizeof text,
        "{\"world\": {\"star_catalogue\": \"embedded\", \"objects\": [{\"name\": \"GX5\", " TEST_GX5
        "%s}]}, \"observers\": [{\"name\": \"neossat\", " TEST_NEOSSAT
        ", \"sensors\": [{\"cue\": {\"object\": \"GX5\"}, \"camera\": "
        "{\"pixel_scale_arcsec\": 3, \"aperture_m\": 0.15, \"optics\": {\"psf\": "
        "\"diffraction\", \"spectrum\": \"sources\"}%s}}]}]}",
        object, camera);
    s.world = test_world(text);
    s.camera = bst_world_camera(s.world, 0, 0);
    bst_assert_ok(&s.ctx, bst_field_create(&s.ctx, s.world, 0, 0, &s.field));
    bst_los_history *history = calloc(1, sizeof *history + 2 * sizeof *history->items);
    assert_non_null(history);
    s.q = bst_world_body_attitude(s.world, 0, 0);
    history->capacity = 2;
    history->written = 2;
    history->items[0] = (bst_los_sample){0, s.q};
    history->items[1] = (bst_los_sample){END, s.q};
    bst_los_track track;
    bst_truth truth = {.count = 0};
    const bst_field_options options = {.v_limit = 12, .margin_px = 5};
    bst_assert_ok(&s.ctx, bst_field_track(&s.ctx, s.field, history, 0, END, RATE, &track));
    bst_assert_ok(&s.ctx, bst_field_query(&s.ctx, s.field, &track, 0, END, RATE,
                                          (bst_window){0, 0, 1024, 1024}, &options, &truth,
                                          &s.sources, &s.count));
    free(history);
    return s;
}

static void end(scene *s) {
    bst_field_free(s->field);
    bst_world_free(s->world);
}

static bool is_colour(const float *colour, const float *want, double share) {
    bool is = true;
    for (int k = 0; k < BST_PSF_COLOURS; k++) {
        /* floats of numbers up to 2 */
        is = is && fabs((double)colour[k] - share * (double)want[k]) < 1e-6;
    }
    return is;
}

static const float none[BST_PSF_COLOURS] = {0.0F};

static void stars_by_their_colour_and_objects_by_the_sun_s(void **state) {
    (void)state;
    scene s = stare("", "");
    static bst_star stars[MOST];
    int known, found = 0, without = 0, objects = 0;
    bst_vec3 axis = bst_quat_rotate(bst_quat_conj(s.q), (bst_vec3){0, 0, 1});
    bst_assert_ok(&s.ctx, bst_stars_query(&s.ctx, bst_world_stars(s.world), axis, 0.02, 12.0,
                                          2022.4, stars, MOST, &known));
    assert_true(known <= MOST);
    for (int i = 0; i < s.count; i++) {
        const bst_scene_source *source = &s.sources[i];
        if (source->kind == BST_SOURCE_OBJECT) {
            assert_true(is_colour(source->colour, none, 1.0));
            objects++;
            continue;
        }
        for (int k = 0; k < known; k++) {
            float want[BST_PSF_COLOURS] = {0.0F};
            double colour = (double)stars[k].b_minus_v;
            if (stars[k].id != source->id) {
                continue;
            }
            if (!isnan(colour)) { /* held where the law of stellar colour is */
                colour = fmin(fmax(colour, -0.4), 2.5);
                bst_psf_colour(s.camera->psf, bst_optics_star_temperature_k(colour), want);
            }
            assert_true(is_colour(source->colour, want, 1.0));
            found++;
            without += isnan(colour);
        }
    }
    assert_int_equal(objects, 1);
    assert_int_equal(found, s.count - 1);
    assert_true(found > 20 && without < found / 2);
    end(&s);
}

/* In the infrared a satellite shines by itself: sunlight and emission by their electrons. */
static void warm_objects_by_their_own_light(void **state) {
    (void)state;
    static const char *const preset[2] = {"mwir", "lwir"};
    for (int b = 0; b < 2; b++) {
        char band[100];
        snprintf(band, sizeof band, ", \"band\": {\"preset\": \"%s\"}", preset[b]);
        scene s = stare(
            ", \"area_m2\": 10, \"albedo\": 0.4, \"brightness\": {\"emissivity\": 0.6, "
            "\"temperature_k\": 320}",
            band);
        bst_world_view *view;
        bst_world_sight sight;
        bst_assert_ok(&s.ctx, bst_world_view_create(&s.ctx, s.world, &view));
        bst_assert_ok(&s.ctx, bst_world_view_sight(&s.ctx, view, 0, 0, 0.5 * END / RATE, &sight));
        double reflected, all = bst_scene_glow_electrons_per_s(s.camera, &sight.glow, &reflected);
        float warm[BST_PSF_COLOURS];
        bst_psf_colour(s.camera->psf, 320.0, warm);
        assert_true(reflected > 1e-4 * all && all - reflected > 0.1 * all);
        int objects = 0;
        for (int i = 0; i < s.count; i++) {
            if (s.sources[i].kind == BST_SOURCE_OBJECT) {
                assert_true(is_colour(s.sources[i].colour, warm, 1.0 - reflected / all));
                objects++;
            }
        }
        assert_int_equal(objects, 1);
        bst_world_view_free(view);
        end(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_by_their_colour_and_objects_by_the_sun_s),
        cmocka_unit_test(warm_objects_by_their_own_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
