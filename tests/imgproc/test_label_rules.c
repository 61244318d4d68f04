/* Probabilities of labels, worked out by hand from the rules in discriminate.h. */
#include "sim/onboard/discriminate.h"
#include "sim/optics/photometry.h"
#include "tests/imgproc/synthetic.h"
#include "tests/test_support.h"

enum { SIDE = 512, ROOM = 256 };

typedef struct scene {
    bst_ctx ctx;
    synthetic s;
    bst_discriminator *d;
    bst_detections *out;
    bst_frame_knowledge frame;
} scene;

static scene make(void) {
    scene s = {.out = synthetic_detections(ROOM)};
    synthetic_init(&s.s, SIDE, SIDE);
    bst_assert_ok(&s.ctx, bst_discriminator_create(&s.ctx, &s.s.camera, ROOM, &s.d));
    s.frame = (bst_frame_knowledge){.oriented = true,
                                    .light = {.sun_m = {1.5e11, 0, 0}},
                                    .q_cam_from_gcrf = BST_QUAT_IDENTITY,
                                    .window = {100, 50, 300, 200}};
    return s;
}

static void end(scene *s) {
    bst_discriminator_free(s->d);
    synthetic_free(&s->s);
    free(s->out);
}

static bst_detection *add(scene *s, double x, double y, int label, double probability) {
    bst_detection *d = &s->out->items[s->out->count++];
    *d = (bst_detection){.x_px = x,
                         .y_px = y,
                         .cov_xx = 0.01,
                         .cov_yy = 0.01,
                         .flux_e = 1000,
                         .flux_sigma_e = 50,
                         .snr = 20,
                         .v_mag = 12,
                         .label = label,
                         .label_probability = probability};
    return d;
}

static void label(scene *s) {
    bst_discriminator_label(s->d, &s->frame, s->out);
}

static void expect(const scene *s, int i, int label_of, double probability) {
    const bst_detection *d = &s->out->items[i];
    if ((int)d->label != label_of || !(fabs(d->label_probability - probability) < 1e-12)) {
        fail_msg("detection %d: label %d with %.6g, expected %d with %.6g", i, (int)d->label,
                 d->label_probability, label_of, probability);
    }
}

/* Charge of a frame without earlier ones; again on its pixel or, for several pixels, beside it; and
 * elsewhere where an earlier frame looked, or did not. */
static void charge(void **state) {
    (void)state;
    scene s = make();
    add(&s, 150, 100, BST_LABEL_HIT, 0.9);
    add(&s, 200.3, 120.4, BST_LABEL_HOT_PIXEL, 0.9);
    label(&s);
    expect(&s, 0, BST_LABEL_HIT, 0.8 * 0.9);
    expect(&s, 1, BST_LABEL_HOT_PIXEL, 0.5 * 0.9);
    s.out->count = 0;
    add(&s, 150.4, 99.6, BST_LABEL_HIT, 0.9);        /* the same pixel */
    add(&s, 199.6, 119.7, BST_LABEL_HOT_PIXEL, 0.8); /* the same */
    add(&s, 201, 120, BST_LABEL_HIT, 0.7);           /* beside it, in x */
    add(&s, 200, 121, BST_LABEL_HIT, 0.7);           /* in y */
    add(&s, 199, 120, BST_LABEL_HIT, 0.7);
    add(&s, 200, 119, BST_LABEL_HIT, 0.7);
    add(&s, 201, 121, BST_LABEL_HIT, 0.6);       /* across: not again */
    add(&s, 201, 119, BST_LABEL_HOT_PIXEL, 0.6); /* one pixel does not round */
    add(&s, 149, 100, BST_LABEL_HOT_PIXEL, 0.6); /* nor beside its own */
    add(&s, 100, 50, BST_LABEL_HOT_PIXEL, 0.5);  /* the corners of the window */
    add(&s, 399, 249, BST_LABEL_HOT_PIXEL, 0.5);
    add(&s, 399.6, 249, BST_LABEL_HOT_PIXEL, 0.5); /* outside */
    add(&s, 99, 60, BST_LABEL_HIT, 0.5);
    label(&s);
    expect(&s, 0, BST_LABEL_HOT_PIXEL, 0.99 * 0.9);
    expect(&s, 1, BST_LABEL_HOT_PIXEL, 0.99 * 0.8);
    for (int i = 2; i < 6; i++) {
        expect(&s, i, BST_LABEL_HOT_PIXEL, 0.99 * 0.7);
    }
    for (int i = 6; i < 9; i++) {
        expect(&s, i, BST_LABEL_HIT, 0.95 * 0.6);
    }
    expect(&s, 9, BST_LABEL_HIT, 0.95 * 0.5);
    expect(&s, 10, BST_LABEL_HIT, 0.95 * 0.5);
    expect(&s, 11, BST_LABEL_HOT_PIXEL, 0.5 * 0.5);
    expect(&s, 12, BST_LABEL_HIT, 0.8 * 0.5);
    end(&s);
}

/* A faint source on a pixel that held charge twice; a brighter one, or after once, is light. */
static void faint_light_on_charge(void **state) {
    (void)state;
    static const struct {
        int frames;
        double snr;
        bool hot;
    } cases[] = {{2, 7.9, true}, {2, 8.0, false}, {1, 7.9, false}, {3, 4.0, true}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        scene s = make();
        for (int f = 0; f < cases[k].frames; f++) {
            s.out->count = 0;
            add(&s, 150, 100, BST_LABEL_HOT_PIXEL, 1.0);
            label(&s);
        }
        s.out->count = 0;
        add(&s, 150.2, 100.3, BST_LABEL_UNKNOWN, 0.0)->snr = cases[k].snr;
        label(&s);
        assert_int_equal(s.out->items[0].label == BST_LABEL_HOT_PIXEL, cases[k].hot);
        if (cases[k].hot) {
            expect(&s, 0, BST_LABEL_HOT_PIXEL, 0.8);
        }
        end(&s);
    }
}

/* Charge that stays away: once seen it is forgotten after 8 frames that looked at its pixel, twice
 * seen after 50; frames that do not look do not count. */
static void charge_is_forgotten(void **state) {
    (void)state;
    static const struct {
        int seen, away;
        bool looking, again;
    } cases[] = {{1, 7, true, true},
                 {1, 8, true, false},
                 {1, 30, false, true},
                 {2, 49, true, true},
                 {2, 50, true, false}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        scene s = make();
        for (int f = 0; f < cases[k].seen + cases[k].away; f++) {
            s.out->count = 0;
            if (f < cases[k].seen) {
                add(&s, 150, 100, BST_LABEL_HOT_PIXEL, 1.0);
            }
            s.frame.window.x0 = f < cases[k].seen || cases[k].looking ? 100 : 151;
            label(&s);
        }
        s.out->count = 0;
        add(&s, 150, 100, BST_LABEL_HOT_PIXEL, 1.0);
        label(&s);
        expect(&s, 0,
               cases[k].again     ? BST_LABEL_HOT_PIXEL
               : cases[k].looking ? BST_LABEL_HIT
                                  : BST_LABEL_HOT_PIXEL,
               cases[k].again     ? 0.99
               : cases[k].looking ? 0.95
                                  : 0.5);
        end(&s);
    }
}

/* Without earlier frames ten objects are expected among the sources that no catalogue has. */
static void stars_of_a_first_frame(void **state) {
    (void)state;
    for (int n = 1; n <= 40; n += 13) {
        scene s = make();
        for (int i = 0; i < n; i++) {
            add(&s, 120 + 6 * (i % 30), 60 + 20 * (i / 30), BST_LABEL_UNKNOWN, 0);
        }
        add(&s, 300, 200, BST_LABEL_STAR, 0.99)->star_id = 7; /* identified: not among them */
        label(&s);
        double star = 1 - fmin(10.0 / (10 + n), 0.9);
        for (int i = 0; i < n; i++) {
            expect(&s, i, star > 0.5 ? BST_LABEL_STAR : BST_LABEL_OBJECT,
                   star > 0.5 ? star : 1 - star);
        }
        expect(&s, n, BST_LABEL_STAR, 0.99);
        end(&s);
    }
}

/* Seen n times at one place: 1 - 0.1 / n. Away from its first place by more than 4 sigma: 0.05. */
static void at_rest_and_moved(void **state) {
    (void)state;
    scene s = make();
    /* sigma of a place: 0.1 and 0.15 px, of two frames */
    double limit = 4 * sqrt(2 * (0.01 + 0.0225));
    for (int f = 1; f <= 5; f++) {
        s.out->count = 0;
        add(&s, 150, 100, BST_LABEL_UNKNOWN, 0);
        add(&s, 200, 100 + 0.2 * (f - 1), BST_LABEL_UNKNOWN, 0);
        add(&s, 250 - 0.26 * (f - 1), 100, BST_LABEL_UNKNOWN, 0);
        label(&s);
        if (f > 1) {
            expect(&s, 0, BST_LABEL_STAR, 1 - 0.1 / f);
            expect(&s, 1, BST_LABEL_STAR, 1 - 0.1 / f); /* 0.8 px at the end */
            bool moved = 0.26 * (f - 1) > limit;
            expect(&s, 2, moved ? BST_LABEL_OBJECT : BST_LABEL_STAR, moved ? 0.95 : 1 - 0.1 / f);
        }
    }
    assert_true(limit > 0.8 && limit < 1.04);
    end(&s);
}

/* Another brightness is another source: within 0.75 mag and three times its error. */
static void brightness(void **state) {
    (void)state;
    scene s = make();
    add(&s, 150, 100, BST_LABEL_UNKNOWN, 0);
    add(&s, 200, 100, BST_LABEL_UNKNOWN, 0);
    label(&s);
    s.out->count = 0;
    double allowed = 0.75 + 3 * bst_photometry_noise_mag(&s.out->items[0]);
    add(&s, 150, 100, BST_LABEL_UNKNOWN, 0)->v_mag = 12 + 0.99 * allowed;
    add(&s, 200, 100, BST_LABEL_UNKNOWN, 0)->v_mag = 12 - 1.01 * allowed;
    label(&s);
    expect(&s, 0, BST_LABEL_STAR, 0.95);
    assert_int_equal(s.out->items[1].label,
                     BST_LABEL_OBJECT); /* new in a region that was looked at */
    expect(&s, 1, BST_LABEL_OBJECT, 1.0);
    end(&s);
}

/* New where an earlier frame looked: the share of new ones that stayed, with two that moved before,
 * over the share that is found again. */
static void shares_of_new_sources(void **state) {
    (void)state;
    scene s = make();
    label(&s); /* an empty frame that looks */
    enum { NEW = 6 };
    for (int i = 0; i < NEW; i++) {
        add(&s, 150 + 20 * i, 100, BST_LABEL_UNKNOWN, 0);
    }
    label(&s);
    for (int i = 0; i < NEW; i++) {
        expect(&s, i, BST_LABEL_OBJECT, 1.0); /* none has been tested yet */
    }
    s.out->count = 0;
    for (int i = 0; i < NEW; i++) { /* four stay, one has gone, one leaves its place */
        if (i != 1) {
            add(&s, 150 + 20 * i + (i == 2 ? 1.1 : 0), 100, BST_LABEL_UNKNOWN, 0);
        }
    }
    bst_detection *next = add(&s, 300, 150, BST_LABEL_UNKNOWN, 0);
    bst_detection *other = add(&s, 320, 150, BST_LABEL_UNKNOWN, 0);
    other->flags = BST_DETECTION_BLEND; /* blends have their own statistics */
    bst_detection *fainter = add(&s, 340, 150, BST_LABEL_UNKNOWN, 0);
    fainter->v_mag = 12.6;
    label(&s);
    double star = fmin(4.0 / (6 + 2) / 0.6, 0.98);
    expect(&s, (int)(next - s.out->items), BST_LABEL_STAR, star);
    expect(&s, (int)(other - s.out->items), BST_LABEL_OBJECT, 1.0);
    expect(&s, (int)(fainter - s.out->items), BST_LABEL_OBJECT, 1.0); /* half a magnitude a bin */
    end(&s);
}

static void shapes(void **state) {
    (void)state;
    static const struct {
        unsigned flags;
        double length, width, streak_px;
        int label;
        double probability;
    } cases[] = {
        {BST_DETECTION_EDGE, 2, 2, 0, BST_LABEL_ARTEFACT, 0.9},
        {BST_DETECTION_STREAK, 6.1, 2, 0, BST_LABEL_OBJECT, 0.95},
        {BST_DETECTION_STREAK, 5.9, 2, 0, BST_LABEL_OBJECT, 1 - (1 - 0.9)}, /* one of ten: 0.909 */
        {BST_DETECTION_STREAK, 9, 2, 3.0, BST_LABEL_STAR, 0.9},
        {0, 2, 2, 3.0, BST_LABEL_OBJECT, 0.95},
        {BST_DETECTION_STREAK | BST_DETECTION_OTHER_PATH, 9, 2, 3.0, BST_LABEL_OBJECT, 0.95},
        {BST_DETECTION_STREAK | BST_DETECTION_EDGE | BST_DETECTION_OTHER_PATH, 9, 2, 3.0,
         BST_LABEL_ARTEFACT, 0.9},
        {BST_DETECTION_STREAK | BST_DETECTION_EDGE, 9, 2, 3.0, BST_LABEL_ARTEFACT, 0.9},
    };
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        scene s = make();
        s.frame.streak_px = cases[k].streak_px;
        bst_detection *d = add(&s, 200, 120, BST_LABEL_UNKNOWN, 0);
        d->flags = cases[k].flags;
        d->length_px = cases[k].length;
        d->width_px = cases[k].width;
        label(&s);
        expect(&s, 0, cases[k].label, cases[k].probability);
        /* without an attitude only what is cut is labelled */
        scene blind = make();
        blind.frame.oriented = false;
        *add(&blind, 200, 120, BST_LABEL_UNKNOWN, 0) =
            (bst_detection){.x_px = 200, .y_px = 120, .snr = 20, .flags = cases[k].flags};
        label(&blind);
        bool cut = (cases[k].flags & BST_DETECTION_EDGE) != 0;
        expect(&blind, 0, cut ? BST_LABEL_ARTEFACT : BST_LABEL_UNKNOWN, cut ? 0.9 : 0.0);
        end(&blind);
        end(&s);
    }
}

/* The detection nearest to a prediction within 1 px and three of its sigmas. */
static void predictions(void **state) {
    (void)state;
    scene s = make();
    double scale = bst_camera_scale_rad(&s.s.camera);
    bst_predictions *p = calloc(1, sizeof *p + 2 * sizeof p->items[0]);
    assert_non_null(p);
    p->count = 2;
    for (int i = 0; i < 2; i++) {
        double x = i ? 300 : 200, y = i ? 90 : 150;
        /* it moves by 4 px to the right and 2 down in 2 s */
        bst_vec3 from = bst_camera_unproject(&s.s.camera, x - 4, y - 2),
                 to = bst_camera_unproject(&s.s.camera, x, y);
        p->items[i].direction_gcrf = from;
        p->items[i].rate_gcrf_radps = bst_vec3_scale(bst_vec3_sub(to, from), 0.5);
        p->items[i].sigma_rad = (i ? 5.0 : 0.4) * scale; /* 16 px: at most 6; and 2.2 px */
    }
    s.frame.predictions = p;
    s.frame.predictions_age_s = 2.0;
    add(&s, 200 + 2.1, 150, BST_LABEL_UNKNOWN, 0);
    add(&s, 200, 150 + 2.0, BST_LABEL_UNKNOWN, 0);
    add(&s, 196, 148, BST_LABEL_UNKNOWN, 0);
    add(&s, 200.1, 150, BST_LABEL_STAR, 0.9)->star_id = 5;
    add(&s, 300 - 6.2, 90, BST_LABEL_UNKNOWN, 0);
    label(&s);
    expect(&s, 1, BST_LABEL_OBJECT, 0.98);
    expect(&s, 3, BST_LABEL_STAR, 0.9);
    /* the others by the expectation of ten objects among four */
    for (int i = 0; i < 5; i += 2) {
        expect(&s, i, BST_LABEL_OBJECT, 10.0 / 14);
    }
    s.out->count = 0;
    add(&s, 300 - 5.8, 90, BST_LABEL_UNKNOWN, 0);
    label(&s);
    expect(&s, 0, BST_LABEL_OBJECT, 0.98);
    free(p);
    end(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(charge),
        cmocka_unit_test(faint_light_on_charge),
        cmocka_unit_test(charge_is_forgotten),
        cmocka_unit_test(stars_of_a_first_frame),
        cmocka_unit_test(at_rest_and_moved),
        cmocka_unit_test(brightness),
        cmocka_unit_test(shares_of_new_sources),
        cmocka_unit_test(shapes),
        cmocka_unit_test(predictions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
