/* Nodes of smeared sources by their moments: light, mean place and spread along and across, against
 * the path in many small steps; the camera is turned in its focal plane and rolls, a star follows
 * the track, another source its own curved path. */
#include "scenegen/smear/smear.h"
#include "sim/world/scene/los_track.h"
#include "tests/test_support.h"

enum { SAMPLES = 6, STEPS = 6000 };

typedef struct moments {
    double light, x, y, xx, xy, yy;
} moments;

static void add(moments *m, double light, double x, double y) {
    m->light += light;
    m->x += light * x;
    m->y += light * y;
    m->xx += light * x * x;
    m->xy += light * x * y;
    m->yy += light * y * y;
}

static void finish(moments *m) {
    m->x /= m->light;
    m->y /= m->light;
    m->xx = m->xx / m->light - m->x * m->x;
    m->xy = m->xy / m->light - m->x * m->y;
    m->yy = m->yy / m->light - m->y * m->y;
}

/* Of the nodes of a source, by the record and the table as the kernels read them. */
static moments of_nodes(const bst_smear *s, const bst_kernel_source_record *r) {
    int blocks;
    const float *table = bst_smear_table(s, &blocks);
    assert_true(r->first_table >= 0 && r->first_table + r->blocks <= blocks);
    moments m = {0};
    for (int i = 0; i < r->blocks * BST_BLOCK; i++) {
        const float *block =
            table + (size_t)(r->first_table + i / BST_BLOCK) * BST_TABLE_ROWS * BST_BLOCK;
        double t[BST_TABLE_ROWS], x = (double)r->x_px, y = (double)r->y_px;
        for (int k = 0; k < BST_TABLE_ROWS; k++) {
            t[k] = (double)block[k * BST_BLOCK + i % BST_BLOCK];
        }
        double depth = t[6] * x + t[7] * y, scale = 1.0 / (depth + t[8]);
        add(&m, t[9], x + (t[0] * x + t[1] * y + t[2] - depth * x) * scale,
            y + (t[3] * x + t[4] * y + t[5] - depth * y) * scale);
        bst_assert_close(t[10], 0.0, 1e-8); /* no node is widened here */
    }
    finish(&m);
    return m;
}

static moments of_steps(const bst_camera *camera, const bst_los_track *track,
                        const bst_scene_source *source) {
    moments m = {0};
    double duration = track->time_s[track->count - 1];
    for (int i = 0; i < STEPS; i++) {
        double u = (i + 0.5) / STEPS, x, y;
        bst_quat q = bst_los_track_attitude(track, u * duration);
        bst_vec3 v = bst_scene_source_direction(source, u);
        assert_true(bst_camera_project(camera, bst_quat_rotate(q, v), &x, &y));
        add(&m, 1.0 / STEPS, x - bst_camera_centre_x(camera), y - bst_camera_centre_y(camera));
    }
    finish(&m);
    return m;
}

static void nodes_have_the_moments_of_the_path(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_camera camera = {.width_px = 320,
                         .height_px = 200,
                         .pixel_scale_arcsec = 60.0,
                         .psf_fwhm_px = 2.5,
                         .rotation_deg = 25.0,
                         .boresight_offset_px = {6.0, -4.0},
                         .full_well_e = 1e5};
    bst_assert_ok(&ctx, bst_camera_prepare(&ctx, &camera));
    /* uneven times, an attitude that turns about all three axes and changes its rate */
    const double time_s[SAMPLES] = {0.0, 0.15, 0.3, 0.55, 0.8, 1.0};
    bst_quat q[SAMPLES], q0 = bst_quat_unit((bst_quat){0.3, -0.5, 0.2, 0.7});
    for (int i = 0; i < SAMPLES; i++) {
        double t = time_s[i], px = bst_camera_scale_rad(&camera);
        bst_vec3 turn = {px * (9.0 * t + 5.0 * t * t), px * (-14.0 * t + 4.0 * t * t * t),
                         0.05 * t * t};
        q[i] = bst_quat_mul(bst_quat_from_rotvec(turn), q0);
    }
    const bst_los_track track = {SAMPLES, time_s, q};
    bst_smear *s;
    const bst_smear_options options = {
        .tolerance_sigma = 0.01, .taps = 24, .motion = BST_STAR_MOTION_MULTI, .widest = 1e-9};
    bst_assert_ok(&ctx, bst_smear_create(&ctx, &camera, &options, &s));
    const bst_smear_frame frame = {.track = &track,
                                   .window = {40, 30, 240, 130},
                                   .margin_px = 20.0,
                                   .sources = 4,
                                   .binning = 1,
                                   .dark_variance_e2 = 60.0,
                                   .brightest_e_per_s = 2e5};
    bst_assert_ok(&ctx, bst_smear_begin(&ctx, s, &frame));
    static const double places[4][2] = {
        {100.0, 60.0}, {230.0, 130.0}, {160.0, 90.0}, {90.0, 140.0}};
    for (int n = 0; n < 4; n++) {
        bool moves = n >= 2;
        bst_quat back = bst_quat_conj(bst_los_track_attitude(&track, 0.5));
        bst_vec3 d[3];
        for (int k = 0; k < 3; k++) { /* 12 px along a bent path of its own, to either side */
            double x = places[n][0] + (moves ? (k - 1) * (n == 2 ? 7.0 : -5.0) : 0.0),
                   y = places[n][1] + (moves ? (k - 1) * 4.0 + (k == 1 ? 1.5 : 0.0) : 0.0);
            d[k] = bst_quat_rotate(back, bst_camera_unproject(&camera, x, y));
        }
        bst_scene_source_path path = bst_scene_source_path_through(d[0], d[1], d[2]);
        const bst_scene_source source = {.kind = moves ? BST_SOURCE_OBJECT : BST_SOURCE_STAR,
                                         .id = (uint32_t)n + 1,
                                         .apparent_mid = d[1],
                                         .electrons_per_s = 1e5,
                                         .path = moves ? &path : NULL};
        bst_kernel_source_record record;
        bool visible;
        bst_assert_ok(&ctx, bst_smear_source(&ctx, s, &source, &record, &visible));
        assert_true(visible);
        moments a = of_nodes(s, &record), b = of_steps(&camera, &track, &source);
        bst_assert_close(a.light, 1.0, 1e-5);
        /* single precision; steps of the path and quadrature */
        bst_assert_close(a.x, b.x, 2e-3);
        bst_assert_close(a.y, b.y, 2e-3);
        double spread = b.xx + b.yy;
        assert_true(spread > 0.5);
        bst_assert_close(a.xx, b.xx, 2e-3 * spread);
        bst_assert_close(a.xy, b.xy, 2e-3 * spread);
        bst_assert_close(a.yy, b.yy, 2e-3 * spread);
        /* where the source is at the reference attitude */
        double parts =
            (double)record.place_x / ((double)record.x_px + bst_camera_centre_x(&camera));
        bst_assert_close((double)record.place_y / parts,
                         (double)record.y_px + bst_camera_centre_y(&camera), 1e-3);
        assert_true(parts > 100.0 && fabs(log2(parts) - round(log2(parts))) < 1e-4);
        /* all of the light, and little more for what is beyond the stamp */
        assert_true(record.electrons >= 1e5F && record.electrons < 1.01e5F);
    }
    bst_smear_free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(nodes_have_the_moments_of_the_path)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
