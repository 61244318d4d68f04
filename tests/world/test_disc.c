/* A lit sphere as a disc against sums over its surface. */
#include "sim/world/scene/disc.h"

#include "tests/world/lit_sphere.h"

static moments of_points(const bst_scene_source *source, int lights) {
    bst_ctx ctx = {0};
    bst_disc_points list = {0};
    moments m = {.total = 0};
    bst_assert_ok(
        &ctx, bst_disc_make_points(&ctx, source, lights, asin(source->shape->radius) / 20, &list));
    for (int i = 0; i < list.count; i++) {
        moments_add(&m, list.items[i].offset, list.items[i].share);
    }
    free(list.items);
    moments_close(&m);
    return m;
}

static void compare(moments a, moments b, double radius, double share) {
    bst_assert_close(a.total, share, 1e-12);
    /* half a million visible elements of the surface; an edge of them is a thousandth of a radius
     */
    bst_assert_close(bst_vec3_norm(bst_vec3_sub(a.mean, b.mean)), 0, 5e-4 * radius);
    double square = radius * radius;
    bst_assert_close(a.along_xx, b.along_xx, 5e-4 * square);
    bst_assert_close(a.along_yy, b.along_yy, 5e-4 * square);
    bst_assert_close(a.along_xy, b.along_xy, 5e-4 * square);
}

static const bst_vec3 lights[] = {
    {0.36, 0.48, -0.8}, /* from the side and behind the eye */
    {-0.96, 0.0, 0.28}, /* a crescent's share of the back */
    {0.6, 0.0, 0.8},    /* from behind the sphere */
    {-0.48, 0.64, -0.6} /* straight from the eye: full phase */
};

static void points_have_the_light_of_the_surface(void **state) {
    (void)state;
    static const double radii[] = {0.01, 0.35};
    for (int r = 0; r < 2; r++) {
        for (int l = 0; l < 4; l++) {
            bst_scene_source_shape shape = {.radius = radii[r],
                                            .sun = lights[l],
                                            .earth = lights[(l + 1) % 4],
                                            .diffuse = 0.4,
                                            .earthshine = 0.25,
                                            .specular = 0.2,
                                            .thermal = 0.15};
            /* any length will do for the direction */
            bst_scene_source s = {.apparent_mid = bst_vec3_scale(ahead, 3), .shape = &shape};
            compare(of_points(&s, BST_DISC_SUN), lit_surface(radii[r], &shape.sun), radii[r], 0.4);
            compare(of_points(&s, BST_DISC_EARTH), lit_surface(radii[r], &shape.earth), radii[r],
                    0.25);
            compare(of_points(&s, BST_DISC_THERMAL), lit_surface(radii[r], NULL), radii[r], 0.15);
            bst_assert_close(of_points(&s, BST_DISC_ALL).total, 1, 1e-12);
        }
    }
}

/* Where the mirror has the Sun: the normal halves the angle between the light and the eye, far
 * away. */
static void the_mirror_shows_the_sun(void **state) {
    (void)state;
    for (int l = 0; l < 4; l++) {
        bst_scene_source_shape shape = {.radius = 1e-3, .sun = lights[l], .specular = 1};
        bst_scene_source s = {.apparent_mid = ahead, .shape = &shape};
        bst_vec3 to_eye = bst_vec3_scale(ahead, -1), sum = bst_vec3_add(to_eye, lights[l]);
        bst_vec3 normal = bst_vec3_norm(sum) > 1e-9 ? bst_vec3_unit(sum) : to_eye;
        bst_vec3 place = bst_vec3_axpy(ahead, 1e-3, normal);
        bst_vec3 offset =
            bst_vec3_sub(bst_vec3_scale(place, 1 / bst_vec3_dot(place, ahead)), ahead);
        /* the eye at a thousand radii instead of far away: 1e-3 of a radius */
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(bst_disc_specular(&s), offset)), 0, 2e-6);
        moments m = of_points(&s, BST_DISC_SPECULAR);
        bst_assert_close(m.total, 1, 0);
        bst_assert_close(bst_vec3_norm(bst_vec3_sub(m.mean, bst_disc_specular(&s))), 0, 0);
    }
}

/* Radiance by place: where a ray meets the sphere, against the light of the whole surface. */
static void radiance_is_that_of_the_place(void **state) {
    (void)state;
    static const double radii[] = {0.01, 0.35};
    for (int r = 0; r < 2; r++) {
        double k = radii[r];
        for (int l = 0; l < 3; l++) {
            bst_scene_source_shape shape = {.radius = k,
                                            .sun = lights[l],
                                            .earth = lights[l + 1],
                                            .diffuse = 0.5,
                                            .earthshine = 0.3,
                                            .thermal = 0.2};
            bst_scene_source s = {.apparent_mid = ahead, .shape = &shape};
            double sun = lit_surface(k, &shape.sun).total,
                   earth = lit_surface(k, &shape.earth).total;
            double element = 4 * BST_PI * k * k / (LIT_RINGS * LIT_SPOKES);
            /* solid angle of the disc */
            double solid = 2 * BST_PI * (1 - sqrt(1 - k * k));
            bst_disc disc;
            bst_disc_begin(&s, &disc);
            int seen = 0;
            for (int i = -6; i <= 6; i++) {
                for (int j = -6; j <= 6; j++) {
                    bst_vec3 d = bst_vec3_unit(bst_vec3_axpy(
                        bst_vec3_axpy(ahead, 0.19 * k * i, cross_x), 0.19 * k * j, cross_y));
                    double along = bst_vec3_dot(d, ahead), beside2 = 1 - along * along;
                    double found = bst_disc_radiance(&disc, d);
                    if (beside2 > k * k) {
                        assert_true(found == 0.0);
                        continue;
                    }
                    double range = along - sqrt(k * k - beside2);
                    bst_vec3 n =
                        bst_vec3_scale(bst_vec3_axpy(bst_vec3_scale(d, range), -1, ahead), 1 / k);
                    double expected =
                        0.2 / solid + 0.5 * fmax(bst_vec3_dot(n, shape.sun), 0) / (sun * element) +
                        0.3 * fmax(bst_vec3_dot(n, shape.earth), 0) / (earth * element);
                    /* sums over the surface; radii of 0.01 round to 1e-16 / 1e-4 */
                    bst_assert_close(found, expected, 2e-3 * expected);
                    seen++;
                }
            }
            assert_true(seen > 60);
            assert_true(bst_disc_radiance(&disc, bst_vec3_scale(ahead, -1)) == 0.0);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_have_the_light_of_the_surface),
        cmocka_unit_test(the_mirror_shows_the_sun),
        cmocka_unit_test(radiance_is_that_of_the_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
