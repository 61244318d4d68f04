/* One satellite in two frames: as it is described, and carried by a joint that turns and shifts all
 * of it. Light, heat, silhouettes, forces, torques and images are turned with it and else the same.
 * An axis, a sign or a place that is treated unlike the others makes a difference. */
#include "sim/satellite/heat.h"
#include "sim/satellite/resolved_image.h"
#include "sim/satellite/shape_forces.h"
#include "tests/satellite/satellite_support.h"

#define MATERIALS                                                                                \
    "{\"materials\": ["                                                                          \
    "{\"name\": \"w\", \"diffuse\": 0.7, \"emissivity\": 0.6, \"colour\": [0.8, 1, 1.1, 1.3]}, " \
    "{\"name\": \"g\", \"model\": \"cook_torrance\", \"diffuse\": 0.2, \"specular\": 0.3, "      \
    "\"roughness\": 0.3}, "                                                                      \
    "{\"name\": \"d\", \"diffuse\": 0.15, \"emissivity\": 0.9}], \"joints\": ["                  \
    "{\"name\": \"all\""
#define WING_JOINT                                                                                 \
    "}, {\"name\": \"wing\", \"parent\": \"all\", \"follows\": \"sun\", \"axis\": [0.2, 1, 0.1], " \
    "\"normal\": [0, 0, 1], \"position_m\": [0.2, 1.1, -0.3]}, "                                   \
    "{\"name\": \"dish\", \"parent\": \"all\", \"follows\": \"target\", \"axes\": 2, \"axis\": "   \
    "[1, 0.1, 0], \"normal\": [0, 0, 1], \"position_m\": [0.9, -0.9, 1.6]}, "                      \
    "{\"name\": \"spin\", \"parent\": \"all\", \"follows\": \"spin\", \"axis\": [0, 0.3, 1], "     \
    "\"rate_deg_per_s\": 3}], \"parts\": ["
#define PARTS                                                                                    \
    "{\"name\": \"bus\", \"kind\": \"box\", \"size_m\": [1.6, 1.1, 2.3], \"joint\": \"all\", "   \
    "\"rotation_deg\": [5, -8, 20], \"material\": \"w\"}, "                                      \
    "{\"name\": \"left\", \"kind\": \"plate\", \"size_m\": [1.2, 3.1, 1], \"position_m\": "      \
    "[0.1, 2.2, 0.1], \"joint\": \"wing\", \"material\": \"g\", \"back_material\": \"d\"}, "     \
    "{\"name\": \"antenna\", \"kind\": \"dish\", \"radius_m\": 0.6, \"length_m\": 0.2, "         \
    "\"joint\": \"dish\", \"material\": \"w\", \"back_material\": \"g\"}, "                      \
    "{\"name\": \"tank\", \"kind\": \"sphere\", \"radius_m\": 0.4, \"position_m\": [-1.5, 0.3, " \
    "0.4], \"joint\": \"all\", \"material\": \"g\"}, "                                           \
    "{\"name\": \"nozzle\", \"kind\": \"cone\", \"radius_m\": 0.5, \"top_radius_m\": 0.2, "      \
    "\"length_m\": 0.7, \"position_m\": [0.2, -0.1, -1.9], \"rotation_deg\": [10, 5, 0], "       \
    "\"joint\": \"all\", \"material\": \"d\"}, "                                                 \
    "{\"name\": \"boom\", \"kind\": \"cylinder\", \"radius_m\": 0.08, \"length_m\": 2.5, "       \
    "\"position_m\": [-0.3, -1.9, 0.6], \"rotation_deg\": [80, 10, 0], \"joint\": \"spin\", "    \
    "\"material\": \"w\"}]}"

static const bst_vec3 SHIFT_M = {3.0, -2.0, 5.0}, ABOUT = {1.0, 2.0, -0.5};
static const double TURN_DEG = 77.0;

typedef struct pair {
    bst_test_model a, b;
    bst_quat turn;
    int cases;
} pair;

static pair both;

static bst_vec3 turned(bst_vec3 v) {
    return bst_quat_rotate(both.turn, v);
}

static int open_both(void **state) {
    (void)state;
    both.a = bst_test_model_open(MATERIALS WING_JOINT PARTS);
    both.b = bst_test_model_open(MATERIALS
                                 ", \"axis\": [0.5, 1, -0.25], \"offset_deg\": 77, "
                                 "\"position_m\": [3, -2, 5]" WING_JOINT PARTS);
    bst_satellite_make_surfaces(both.a.satellite);
    bst_satellite_make_surfaces(both.b.satellite);
    both.turn = bst_quat_from_rotvec(bst_vec3_scale(bst_vec3_unit(ABOUT), TURN_DEG * BST_DEG_RAD));
    return 0;
}

static int close_both(void **state) {
    (void)state;
    bst_test_model_close(&both.a);
    bst_test_model_close(&both.b);
    return 0;
}

/* Directions of a case, in the first frame. */
typedef struct sight {
    bst_vec3 sun, earth, eye;
} sight;

static sight set_pose(int k) {
    uint64_t random = 100 + (uint64_t)k;
    sight s = {bst_test_direction(&random), bst_test_direction(&random),
               bst_test_direction(&random)};
    bst_satellite_aim a = {s.sun, s.earth, s.eye, 7.0 * k};
    bst_satellite_aim b = {turned(s.sun), turned(s.earth), turned(s.eye), 7.0 * k};
    bst_satellite_pose_set(both.a.pose, &a);
    bst_satellite_pose_set(both.b.pose, &b);
    return s;
}

/* Earthlight of a satellite at 7000 km, seen from which the Earth is towards `earth`. */
static void earthlight(const sight *s, bst_earthlight *of_a, bst_earthlight *of_b) {
    const bst_earth_surface surface = {.diffuse = 0.3, .fineness = 1};
    bst_earthlight_at(&surface, bst_vec3_scale(s->earth, -7e6), s->sun, of_a);
    *of_b = *of_a;
    bst_earthlight_turn(both.turn, of_b);
}

static void expect_vec(bst_vec3 found, bst_vec3 expected, double tolerance) {
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(found, expected)), 0.0, tolerance);
}

static void light(void **state) {
    (void)state;
    static bst_earthlight e[2];
    for (int k = 0; k < 6; k++) {
        sight s = set_pose(k);
        earthlight(&s, &e[0], &e[1]);
        bst_satellite_light in = {.sun = s.sun,
                                  .observer = s.eye,
                                  .sun_radius_rad = k % 2 ? 0.00465 : 0.0,
                                  .sunlit = 1.0,
                                  .earthlight = &e[0],
                                  .emission = true};
        bst_satellite_light also = in;
        also.sun = turned(s.sun);
        also.observer = turned(s.eye);
        also.earthlight = &e[1];
        bst_satellite_flux x, y;
        bst_satellite_flux_at(both.a.pose, &in, &x);
        bst_satellite_flux_at(both.b.pose, &also, &y);
        assert_true(x.visible_m2 > 1.0);
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            /* panels of a shadow's integral have other borders about a round hider: 9.1e-4 found */
            bst_assert_close(y.sun[c], x.sun[c], 1e-9 + 1e-3 * x.sun[c]);
            bst_assert_close(y.earth[c], x.earth[c], 1e-9);
        }
        bst_assert_close(y.emission_m2, x.emission_m2, 1e-9);
        bst_assert_close(y.visible_m2, x.visible_m2, 1e-9);
    }
}

static void heat(void **state) {
    (void)state;
    static bst_earthlight e[2];
    static double x[20000], y[20000];
    for (int k = 0; k < 2; k++) {
        sight s = set_pose(k);
        earthlight(&s, &e[0], &e[1]);
        bst_heat_environment in = {s.sun, s.earth, 1361.0, &e[0], 1361.0, 0.91, 237.0};
        bst_heat_environment also = in;
        also.sun = turned(s.sun);
        also.earth = turned(s.earth);
        also.earthlight = &e[1];
        int count = both.a.satellite->facet_count;
        assert_int_equal(both.b.satellite->facet_count, count);
        assert_true(count < 20000);
        bst_heat_loads(both.a.pose, &in, x);
        bst_heat_loads(both.b.pose, &also, y);
        for (int i = 0; i < count; i++) {
            bst_assert_close(y[i], x[i], 1e-6);
        }
    }
}

/* The load of a shape about a point, in either frame. */
typedef bst_shape_load load_fn(bst_satellite_pose *, bst_vec3, bst_vec3);

static void forces(void **state) {
    (void)state;
    load_fn *const loads[2] = {bst_shape_light_load, bst_shape_drag_load};
    for (int k = 0; k < 5; k++) {
        sight s = set_pose(k);
        bst_assert_close(bst_shape_silhouette_m2(both.b.pose, turned(s.eye)),
                         bst_shape_silhouette_m2(both.a.pose, s.eye), 1e-9);
        expect_vec(bst_shape_light_area_m2(both.b.pose, turned(s.sun)),
                   turned(bst_shape_light_area_m2(both.a.pose, s.sun)), 1e-9);
        bst_vec3 centre = {0.3, -0.2, 0.7};
        for (int of = 0; of < 2; of++) {
            bst_shape_load x = loads[of](both.a.pose, s.sun, centre);
            bst_shape_load y =
                loads[of](both.b.pose, turned(s.sun), bst_vec3_add(SHIFT_M, turned(centre)));
            expect_vec(y.force, turned(x.force), 1e-9);
            expect_vec(y.torque, turned(x.torque), 1e-9);
            /* about another point: less the arm times the force */
            bst_vec3 arm = {1.0, -2.0, 0.5};
            bst_shape_load z = loads[of](both.a.pose, s.sun, bst_vec3_add(centre, arm));
            expect_vec(z.force, x.force, 1e-12);
            expect_vec(z.torque, bst_vec3_sub(x.torque, bst_vec3_cross(arm, x.force)), 1e-9);
        }
    }
}

/* Cells of an image that is `quarters` right angles from the first one. */
static const bst_resolved_image *draw(bst_resolved *r, const bst_test_model *m,
                                      const bst_resolved_view *view,
                                      const bst_resolved_light *light, double reach) {
    bst_ctx ctx = {0};
    double low[2] = {-reach, -reach}, high[2] = {reach, reach};
    bst_assert_ok(&ctx, bst_resolved_begin(&ctx, r, low, high, 1.0));
    bst_assert_ok(&ctx, bst_resolved_add(&ctx, r, m->pose, view, light, 1.0, NULL));
    return bst_resolved_image_of(r);
}

static void images(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    static bst_earthlight e[2];
    bst_resolved *ra, *rb;
    bst_resolved_gain gain[BST_SATELLITE_MATERIALS_MAX];
    for (int i = 0; i < both.a.satellite->material_count; i++) {
        gain[i] = (bst_resolved_gain){.sun = 1.0 + i, .earth = 0.4, .emission = 0.02 * i};
    }
    bst_assert_ok(&ctx, bst_resolved_create(&ctx, both.a.satellite, &ra));
    bst_assert_ok(&ctx, bst_resolved_create(&ctx, both.b.satellite, &rb));
    for (int k = 1; k < 4; k++) {
        sight s = set_pose(k);
        earthlight(&s, &e[0], &e[1]);
        e[0].count = e[1].count = 3; /* each is a light with shadows */
        bst_quat q = bst_quat_look(bst_vec3_scale(s.eye, -1.0), (bst_vec3){0.3, 1.0, 0.2});
        /* the second camera is rolled by right angles about its boresight, not about the body */
        bst_quat roll = bst_quat_from_rotvec((bst_vec3){0, 0, 0.5 * BST_PI * k});
        bst_resolved_view v = {q, {1.1, -0.7, 60.0}, 0.002, 0.0, 0.0, NULL}, w = v;
        w.q_image_from_body = bst_quat_mul(roll, bst_quat_mul(q, bst_quat_conj(both.turn)));
        w.origin_m = bst_vec3_sub(bst_quat_rotate(roll, v.origin_m),
                                  bst_quat_rotate(w.q_image_from_body, SHIFT_M));
        bst_resolved_light in = {.sun = s.sun,
                                 .sun_radius_rad = k % 2 ? 0.00465 : 0.0,
                                 .earthlight = &e[0],
                                 .gain = gain};
        bst_resolved_light also = {.sun = turned(s.sun),
                                   .sun_radius_rad = in.sun_radius_rad,
                                   .earthlight = &e[1],
                                   .gain = gain};
        const bst_resolved_image *x = draw(ra, &both.a, &v, &in, 40.0);
        const bst_resolved_image *y = draw(rb, &both.b, &w, &also, 40.0);
        assert_int_equal(y->width, x->width);
        assert_int_equal(y->height, x->height);
        assert_int_equal(x->width, x->height);
        assert_int_equal(x->x0, -x->width / 2);
        assert_int_equal(x->y0, -x->height / 2);
        int n = x->width, covered = 0;
        double brightest = 0.0;
        for (int i = 0; i < n * n; i++) {
            brightest = fmax(brightest, (double)x->cells[i].light);
        }
        for (int i = 0; i < n * n; i++) {
            int column = i % n, row = i / n, c = column, t = row;
            double mx = (double)x->cells[i].moment_x, my = (double)x->cells[i].moment_y;
            for (int turn = 0; turn < k; turn++) { /* x goes to y, y to -x */
                int old = c;
                double m = mx;
                c = n - 1 - t;
                t = old;
                mx = -my;
                my = m;
            }
            const bst_resolved_cell *p = &x->cells[i], *o = &y->cells[t * n + c];
            bst_assert_close((double)o->light, (double)p->light, 1e-3 * brightest);
            bst_assert_close((double)o->moment_x, mx, 1e-3 * brightest);
            bst_assert_close((double)o->moment_y, my, 1e-3 * brightest);
            bst_assert_close((double)o->cover, (double)p->cover, 2e-3);
            covered += (double)p->cover > 0.5;
        }
        assert_true(covered > 60);
    }
    bst_resolved_free(ra);
    bst_resolved_free(rb);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(light), cmocka_unit_test(heat),
                                       cmocka_unit_test(forces), cmocka_unit_test(images)};
    return cmocka_run_group_tests(tests, open_both, close_both);
}
