/* Offset of a lit outline's centre from the centre of mass, of shipped satellites in random
 * attitudes: the factor that image processing applies to that of a sphere (phase_offset_factor),
 * and the scatter about it (centre_sigma). With the argument "print" as a table. */
#include <stdio.h>
#include <stdlib.h>

#include "boresight/rng.h"
#include "imgproc/extended/centre_of_mass.h"
#include "sim/satellite/pose.h"
#include "tests/test_support.h"

enum { ATTITUDES = 150, POINTS = 40000 };

/* Corners of what is lit and visible, in the image: x towards the Sun. */
typedef struct points {
    bst_outline_point at[POINTS], hull[2 * POINTS];
    int count;
} points;

static void add(points *p, bst_vec3 v, bst_vec3 x, bst_vec3 y) {
    assert_true(p->count < POINTS);
    p->at[p->count++] = (bst_outline_point){bst_vec3_dot(v, x), bst_vec3_dot(v, y)};
}

/* Adds the corners of a facet's lit and visible part. */
static void add_facet(bst_satellite_pose *pose, int k, bst_vec3 x, bst_vec3 y, points *out) {
    const bst_facet *f = &pose->satellite->facets[k];
    bool whole;
    if (!(bst_pose_unshadowed(pose, k, 2, &whole) > 0.0)) {
        return;
    }
    for (int i = 0; whole && i < f->count; i++) {
        add(out, pose->vertices[pose->satellite->corner[f->first + i]], x, y);
    }
    bst_vec3 origin, e1, e2;
    bst_pose_facet_axes(pose, k, &origin, &e1, &e2);
    for (int j = 0; !whole && j < pose->clip.piece_count; j++) {
        bst_polygon_piece piece = pose->clip.pieces[j];
        for (int i = 0; i < piece.count; i++) {
            bst_point2 c = pose->clip.points[piece.first + i];
            add(out, bst_vec3_axpy(bst_vec3_axpy(origin, c.x, e1), c.y, e2), x, y);
        }
    }
}

/* Outline of a model at a phase angle in a random attitude; false: nothing is lit. */
static bool outline_of(bst_satellite_pose *pose, double phase, bst_rng_key key, uint64_t attitude,
                       points *work, bst_outline *out) {
    double z[4];
    bst_rng_normal2(key, attitude, 0, z);
    bst_rng_normal2(key, attitude, 1, z + 2);
    bst_quat q = bst_quat_unit((bst_quat){z[0], z[1], z[2], z[3]});
    bst_vec3 sun = bst_quat_rotate(q, (bst_vec3){sin(phase), 0, cos(phase)});
    bst_vec3 eye = bst_quat_rotate(q, (bst_vec3){0, 0, 1});
    bst_vec3 x = bst_quat_rotate(q, (bst_vec3){1, 0, 0}),
             y = bst_quat_rotate(q, (bst_vec3){0, 1, 0});
    bst_satellite_pose_set(pose, &(bst_satellite_aim){.sun = sun, .earth = y, .target = eye});
    bst_pose_look(pose, 0, eye);
    bst_pose_look(pose, 1, sun);
    work->count = 0;
    for (int k = 0; k < pose->satellite->facet_count; k++) {
        bst_vec3 n = pose->normals[k];
        if (bst_vec3_dot(n, eye) > 1e-6 && bst_vec3_dot(n, sun) > 0.01) {
            add_facet(pose, k, x, y, work);
        }
    }
    bst_outline_make(work->at, work->count, work->hull, out);
    return out->count > 2;
}

/* Factor of the offset, and scatter of the corrected centre towards the Sun and across, share of
 * the largest extent. */
typedef struct offsets {
    double factor, along, across;
} offsets;

static offsets measure(const char *file, double phase) {
    static points work;
    bst_ctx ctx = {0};
    char path[256];
    bst_satellite *satellite;
    bst_satellite_pose *pose;
    snprintf(path, sizeof path, "scenarios/satellites/%s.json", file);
    bst_assert_ok(&ctx, bst_satellite_load(&ctx, path, &satellite));
    bst_assert_ok(&ctx, bst_satellite_pose_create(&ctx, satellite, &pose));
    bst_rng_key key = bst_rng_make_key(3, 0, "test", "outline");
    double model[ATTITUDES], found[ATTITUDES], mm = 0.0, mf = 0.0, yy = 0.0, xx = 0.0;
    int n = 0;
    for (uint64_t a = 0; a < ATTITUDES; a++) {
        bst_outline o;
        double cx, cy, length, angle, width;
        if (!outline_of(pose, phase, key, a, &work, &o)) {
            continue;
        }
        (void)bst_outline_centroid(&o, &cx, &cy);
        bst_outline_extent(&o, &length, &angle, &width);
        model[n] = bst_outline_phase_offset(phase) * bst_outline_extent_along(&o, 0, 1) / length;
        found[n] = cx / length;
        mm += model[n] * model[n];
        mf += model[n] * found[n];
        yy += cy * cy / (length * length);
        n++;
    }
    offsets out = {.factor = mm > 0.0 ? mf / mm : 0.0, .across = sqrt(yy / n)};
    for (int i = 0; i < n; i++) {
        xx += pow(found[i] - out.factor * model[i], 2.0) / n;
    }
    out.along = sqrt(xx);
    bst_satellite_pose_free(pose);
    bst_satellite_free(satellite);
    return out;
}

/* Factors of compact bodies and of bodies with long arrays at 60 deg, and their scatter. */
static void factors(void **state) {
    (void)state;
    static const struct {
        const char *file;
        double low, high, along, across;
    } cases[] = {{"neossat", 0.5, 0.8, 0.12, 0.06},
                 {"cubesat_3u", 0.55, 0.9, 0.18, 0.08},
                 {"centaur_like", 0.25, 0.55, 0.08, 0.06},
                 {"oneweb_like", 0.2, 0.4, 0.06, 0.04},
                 {"gps_iif", 0.12, 0.35, 0.06, 0.04}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        offsets o = measure(cases[i].file, 60.0 * BST_DEG_RAD);
        assert_true(o.factor > cases[i].low && o.factor < cases[i].high);
        assert_true(o.along < cases[i].along);
        assert_true(o.across < cases[i].across);
    }
}

static void print(void) {
    static const char *const files[] = {"neossat",     "cubesat_3u",  "cubesat_12u", "centaur_like",
                                        "hubble_like", "oneweb_like", "gps_iif"};
    printf("model phase_deg factor along_%% across_%%\n");
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        for (int k = 1; k <= 4; k++) {
            offsets o = measure(files[i], 30.0 * k * BST_DEG_RAD);
            printf("%s %d %.2f %.1f %.1f\n", files[i], 30 * k, o.factor, 100.0 * o.along,
                   100.0 * o.across);
        }
    }
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "print") == 0) {
        print();
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(factors)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
