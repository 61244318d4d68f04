/* The heat of an object with a shape in its orbit: a box of unequal sides whose faces each balance
 * sunlight at the Sun's distance, its visible part and the Earth's infrared; directions in GCRF,
 * the attitude in its own words: z to the Earth, y against the orbit's normal. */
#include "sim/world/scene/object_heat.h"
#include "tests/world/world_support.h"

static const double ABSORPTANCE = 0.3, EMISSIVITY = 0.7, SIGMA = 5.670374419e-8, S = 1361.0;
static const double SIDES[3] = {1.2, 0.8, 2.0};

static const char box[] =
    "{\"name\": \"box\", \"brightness\": {\"model\": \"shape\"}, \"shape\": {\"materials\": "
    "[{\"name\": \"w\", \"diffuse\": 0.25, \"emissivity\": 0.7, \"absorptance\": 0.3}], "
    "\"parts\": [{\"name\": \"b\", \"kind\": \"box\", \"size_m\": [1.2, 0.8, 2], \"material\": "
    "\"w\"}]}, " TEST_GX5 "}";

typedef struct fixture {
    bst_world *world;
    const bst_object_shape *shape;
    bst_brightness_config config;
    bst_satellite_pose *pose;
    bst_object_heat *heat;
} fixture;

static fixture set_up(void) {
    bst_ctx ctx = {0};
    fixture f = {.world = test_world_with(box, "")};
    const bst_world_object_info *info = bst_world_object(f.world, 0);
    f.shape = info->shape;
    f.config = *bst_brightness_config_of(info->brightness);
    bst_satellite_make_surfaces((bst_satellite *)(uintptr_t)f.shape->satellite);
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, f.shape->satellite, &f.pose));
    bst_assert_ok(&ctx, bst_object_heat_create(&ctx, f.shape, false, &f.heat));
    return f;
}

static void tear_down(fixture *f) {
    bst_object_heat_free(f->heat);
    bst_satellite_pose_free(f->pose);
    bst_world_free(f->world);
}

static void faces_of_a_box(void **state) {
    (void)state;
    fixture f = set_up();
    const bst_vec3 place = {2.1e7, -1.7e7, 1.1e7}, velocity = {1500, 2500, -700};
    static const bst_vec3 eyes[] = {{3e7, -1e7, 4e7}, {-1e7, 2e7, 1e7}, {5e7, -2e7, -3e7}};
    for (int k = 0; k < 3; k++) {
        f.config.earth_albedo = 0.0;
        f.config.earth_infrared_w_per_m2 = k == 2 ? 237.0 : 0.0;
        const bst_scene_lighting l = {.object_m = place,
                                      .eye_m = eyes[k],
                                      .sun_m = {0.6 * 1.496e11, 0.7 * 1.496e11, -0.5 * 1.496e11},
                                      .sunlit_fraction = k == 1 ? 0.35 : 1.0};
        bst_scene_glow glow = {.v_mag = 0};
        bst_object_heat_glow(f.heat, f.shape, f.pose, &f.config, &l, velocity, &glow);
        /* body axes in GCRF */
        bst_vec3 axes[3];
        axes[2] = bst_vec3_unit(bst_vec3_scale(place, -1.0));
        axes[1] = bst_vec3_scale(bst_vec3_unit(bst_vec3_cross(place, velocity)), -1.0);
        axes[0] = bst_vec3_cross(axes[1], axes[2]);
        bst_vec3 sun = bst_vec3_sub(l.sun_m, place), eye = bst_vec3_sub(l.eye_m, place);
        double au = bst_vec3_norm(sun) / 149597870700.0, range2 = bst_vec3_dot(eye, eye);
        double sine = 6378137.0 / bst_vec3_norm(place), total = 0.0, fourth = 0.0;
        int faces = 0;
        for (int i = 0; i < 6; i++) {
            bst_vec3 n = bst_vec3_scale(axes[i / 2], i % 2 ? -1.0 : 1.0);
            double area = SIDES[(i / 2 + 1) % 3] * SIDES[(i / 2 + 2) % 3];
            double seen = area * EMISSIVITY * bst_vec3_dot(n, bst_vec3_unit(eye)) / range2;
            double cosine = fmax(bst_vec3_dot(n, bst_vec3_unit(sun)), 0.0);
            double load = ABSORPTANCE * S * l.sunlit_fraction * cosine / (au * au);
            /* a sphere that emits evenly: sin^2 of it on the face that looks at it, and on one at
             * a right angle (asin s - s sqrt(1 - s^2)) / pi (Howell B-43) */
            double factor = i == 4   ? sine * sine
                            : i == 5 ? 0.0
                                     : (asin(sine) - sine * sqrt(1.0 - sine * sine)) / BST_PI;
            load += EMISSIVITY * f.config.earth_infrared_w_per_m2 * factor;
            if (seen > 0.0) {
                faces++;
                total += seen;
                fourth += seen * load / (EMISSIVITY * SIGMA);
            }
        }
        assert_int_equal(faces, 3);
        assert_true(fourth > 0.0);
        /* the solar constant is known to the watt */
        bst_assert_close(glow.emission_sr / total, 1.0, 1e-6);
        bst_assert_close(glow.temperature_k / sqrt(sqrt(fourth / total)), 1.0, 3e-4);
        double parts = 0.0;
        for (int i = 0; i < glow.emission_count; i++) {
            parts += glow.emissions[i].sr;
        }
        bst_assert_close(parts / total, 1.0, 1e-9);
    }
    tear_down(&f);
}

/* A grey surface has the Sun's colours, whatever the band; half of the Sun is half of the light. */
static void colours_of_a_grey_box(void **state) {
    (void)state;
    fixture f = set_up();
    bst_scene_glow glow[2];
    f.config.earthshine = false;
    for (int k = 0; k < 2; k++) {
        const bst_scene_lighting l = {.object_m = {2.1e7, -1.7e7, 1.1e7},
                                      .eye_m = {3e7, -1e7, 4e7},
                                      .sun_m = {0.6 * BST_AU_M, 0.7 * BST_AU_M, -0.5 * BST_AU_M},
                                      .sunlit_fraction = k ? 0.5 : 1.0};
        bst_object_shape_glow(f.shape, f.pose, &f.config, &l, (bst_vec3){1500, 2500, -700},
                              &glow[k]);
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            bst_assert_close(glow[k].redness[c], 1.0, 1e-9);
        }
    }
    bst_assert_close(glow[1].v_mag - glow[0].v_mag, 2.5 * log10(2.0), 1e-9);
    /* of all its sides: what is not emitted is reflected */
    bst_assert_close(glow[0].thermal_reflection, 1.0 - EMISSIVITY, 1e-9);
    /* a convex body's faces that are seen: emissivity times their projected area */
    const bst_vec3 eye = {9e6, 7e6, 2.9e7};
    bst_object_aspect aspect;
    const bst_scene_lighting l = {.object_m = {2.1e7, -1.7e7, 1.1e7},
                                  .eye_m = {3e7, -1e7, 4e7},
                                  .sun_m = {0.6 * BST_AU_M, 0.7 * BST_AU_M, -0.5 * BST_AU_M}};
    bst_object_shape_aspect(f.shape, &l, (bst_vec3){1500, 2500, -700}, &aspect);
    bst_vec3 to = bst_quat_rotate(aspect.q_body_from_gcrf, bst_vec3_unit(eye));
    double area = fabs(to.x) * SIDES[1] * SIDES[2] + fabs(to.y) * SIDES[0] * SIDES[2] +
                  fabs(to.z) * SIDES[0] * SIDES[1];
    bst_assert_close(glow[0].emission_sr, EMISSIVITY * area / bst_vec3_dot(eye, eye),
                     1e-9 * glow[0].emission_sr);
    tear_down(&f);
}

/* The Earth's light goes with its albedo and the Sun's distance from the Earth, not from the body;
 * it warms the side that looks at the lit half. */
static void light_of_the_earth(void **state) {
    (void)state;
    fixture f = set_up();
    const bst_vec3 velocity = {0, 3000, 500};
    double fourth[4];
    for (int k = 0; k < 4; k++) {
        f.config.earth_albedo = k == 1 ? 0.6 : 0.3;
        f.config.earth_infrared_w_per_m2 = 0.0;
        double far = k == 2 ? 2.0 : 1.0;
        bst_scene_lighting l = {.object_m = {8e6, 0, 0},
                                .eye_m = {6.6e6, 0, 0},
                                .sun_m = {far * 1.1e11, far * 0.9e11, far * 0.2e11},
                                .sunlit_fraction = 0.0};
        if (k == 3) { /* over the night */
            l.sun_m = bst_vec3_scale(l.sun_m, -1.0);
        }
        bst_scene_glow glow = {.v_mag = 0};
        bst_object_heat_glow(f.heat, f.shape, f.pose, &f.config, &l, velocity, &glow);
        fourth[k] = pow(glow.temperature_k, 4);
    }
    bst_assert_close(fourth[1] / fourth[0], 2.0, 1e-9);
    bst_assert_close(fourth[2] / fourth[0], 0.25, 1e-9);
    assert_true(fourth[3] < 0.2 * fourth[0]);
    /* a diffuse Earth, whose every place is lit as its normal is to the Sun: summed over what the
     * face sees of it */
    enum { RINGS = 200, AROUND = 400 };
    const double r = 6378137.0, d = 8e6;
    bst_vec3 sun = bst_vec3_unit((bst_vec3){1.1e11, 0.9e11, 0.2e11});
    double sum = 0.0;
    for (int i = 0; i < RINGS; i++) {
        for (int j = 0; j < AROUND; j++) {
            double c = r / d + (1.0 - r / d) * (i + 0.5) / RINGS, s = sqrt(1.0 - c * c);
            double a = 2.0 * BST_PI * (j + 0.5) / AROUND;
            bst_vec3 n = {c, s * cos(a), s * sin(a)}; /* of the ground */
            bst_vec3 to = bst_vec3_sub((bst_vec3){d, 0, 0}, bst_vec3_scale(n, r));
            double far = bst_vec3_norm(to);
            double out = bst_vec3_dot(n, to) / far, in = to.x / far;
            double cell = r * r * 2.0 * BST_PI * (1.0 - r / d) / (RINGS * AROUND);
            sum += 0.3 / BST_PI * fmax(bst_vec3_dot(n, sun), 0.0) * out * in * cell / (far * far);
        }
    }
    double au2 = (1.21 + 0.81 + 0.04) * 1e22 / (149597870700.0 * 149597870700.0);
    double want = ABSORPTANCE * S / au2 * sum / (EMISSIVITY * SIGMA);
    /* the Earth's light comes in few patches */
    bst_assert_close(fourth[0] / want, 1.0, 0.03);
    tear_down(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faces_of_a_box),
        cmocka_unit_test(colours_of_a_grey_box),
        cmocka_unit_test(light_of_the_earth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
