/* Probabilities of tracks over the catalogue's objects: exact cases, and their reliability in
 * random clusters whose catalogue, brightness and tracks have the stated errors. Usage:
 * test_tracker_catalogue_identity [slow]; slow: ten times the clusters. */
#include "boresight/rng.h"
#include "tests/test_support.h"
#include "tracker/identity.h"

#define AS BST_ARCSEC_RAD
enum { BINS = 10, CLUSTERS = 20000 };

static const double FIELD_AS = 3000.0, RATE_AS = 60.0, SIGMA_AS = 36.0, RATE_SIGMA_AS = 0.3,
                    MAG_SIGMA = 0.7, TRACK_AS = 1.0, TRACK_RATE_AS = 0.1, TRACK_MAG = 0.2,
                    UNKNOWN = 0.5;

static bst_identity_params params(void) {
    return (bst_identity_params){
        .unknown_density =
            UNKNOWN / (pow(FIELD_AS * AS, 2) * BST_PI * pow(RATE_AS * AS, 2) * BST_IDENTITY_MAG),
        .detection_probability = 0.9,
        .fit = {.direction_chi2 = 30,
                .rate_chi2 = 30,
                .magnitude_chi2 = 30,
                .max_rate_sigma_radps = 0.8 * AS,
                .max_chi2 = 4}};
}

typedef struct source {
    bst_rng_key key;
    uint64_t next;
} source;

static double uniform(source *s, double low, double high) {
    return low + (high - low) * bst_rng_uniform(s->key, 1, s->next++);
}
static double normal(source *s) {
    double n[2];
    bst_rng_normal2(s->key, 2, s->next++, n);
    return n[0];
}

static const bst_vec3 centre = {0.6, 0.0, 0.8};

/* A direction and a rate by their components at the centre of the field, arcsec. */
static bst_vec3 direction_at(const double x[2]) {
    bst_tangent axes = bst_tangent_at(centre);
    return bst_tangent_exp(centre, bst_tangent_vector(&axes, x[0] * AS, x[1] * AS));
}
static bst_vec3 rate_at(bst_vec3 direction, const double r[2]) {
    bst_tangent axes = bst_tangent_at(centre);
    return bst_tangent_carry(centre, direction, bst_tangent_vector(&axes, r[0] * AS, r[1] * AS));
}

typedef struct state {
    double x[2], r[2], v_mag;
} state;

static bst_mtt_track track_of(source *s, int64_t id, const state *truth) {
    state t = *truth;
    for (int a = 0; a < 2; a++) {
        t.x[a] += TRACK_AS * normal(s);
        t.r[a] += TRACK_RATE_AS * normal(s);
    }
    t.v_mag += TRACK_MAG * normal(s);
    bst_mtt_track track = {.id = id,
                           .status = BST_TRACK_CONFIRMED,
                           .hits = 20,
                           .v_mag = t.v_mag,
                           /* bst_target_misfit adds the 0.1 mag of a photometric zero point */
                           .v_mag_variance = TRACK_MAG * TRACK_MAG - 0.01};
    track.state.direction = direction_at(t.x);
    track.state.rate_radps = rate_at(track.state.direction, t.r);
    track.state.covariance[0][0] = track.state.covariance[1][1] = pow(TRACK_AS * AS, 2);
    track.state.covariance[2][2] = track.state.covariance[3][3] = pow(TRACK_RATE_AS * AS, 2);
    return track;
}

static bst_identity_object object_of(int32_t number, const state *catalogued) {
    bst_identity_object o = {.object = number,
                             .direction = direction_at(catalogued->x),
                             .sigma_rad = SIGMA_AS * AS,
                             .rate_sigma_radps = RATE_SIGMA_AS * AS,
                             .v_mag = catalogued->v_mag,
                             .v_mag_sigma = MAG_SIGMA};
    o.rate_radps = rate_at(o.direction, catalogued->r);
    return o;
}

typedef struct reliability {
    int64_t count[BINS], right[BINS];
    double sum[BINS];
} reliability;

static void add(reliability *r, double probability, bool right) {
    int bin = (int)(probability * BINS);
    bin = bin < BINS ? bin : BINS - 1;
    r->count[bin]++;
    r->right[bin] += right;
    r->sum[bin] += probability;
}

/* One cluster: 1 to 7 objects of the catalogue within 100 arcsec, and unknown ones anywhere. */
static void cluster(uint64_t seed, reliability *out) {
    static bst_identity identity;
    source s = {bst_rng_make_key(seed, 3, "test", "identity"), 0};
    bst_identity_object objects[8];
    bst_mtt_track tracks[24];
    int truth[24], count = 0, known = 1 + (int)uniform(&s, 0.0, 7.0);
    double r[2] = {uniform(&s, -30.0, 30.0), uniform(&s, -30.0, 30.0)};
    for (int i = 0; i < known; i++) {
        state catalogued = {{uniform(&s, -100.0, 100.0), uniform(&s, -100.0, 100.0)},
                            {r[0] + 0.5 * normal(&s), r[1] + 0.5 * normal(&s)},
                            uniform(&s, 10.0, 14.0)};
        state real = catalogued;
        objects[i] = object_of(i, &catalogued);
        for (int a = 0; a < 2; a++) {
            real.x[a] += SIGMA_AS * normal(&s);
            real.r[a] += RATE_SIGMA_AS * normal(&s);
        }
        real.v_mag += MAG_SIGMA * normal(&s);
        if (uniform(&s, 0.0, 1.0) < 0.9) {
            truth[count] = i;
            tracks[count] = track_of(&s, count + 1, &real);
            count++;
        }
    }
    /* Poisson */
    for (double p = uniform(&s, 0.0, 1.0); p > exp(-UNKNOWN) && count < 24;
         p *= uniform(&s, 0.0, 1.0)) {
        double speed = RATE_AS * sqrt(uniform(&s, 0.0, 1.0)), turn = uniform(&s, 0.0, 2 * BST_PI);
        state real = {
            {uniform(&s, -FIELD_AS / 2, FIELD_AS / 2), uniform(&s, -FIELD_AS / 2, FIELD_AS / 2)},
            {speed * cos(turn), speed * sin(turn)},
            uniform(&s, 7.0, 17.0)};
        truth[count] = -1;
        tracks[count] = track_of(&s, count + 1, &real);
        count++;
    }
    const bst_identity_params p = params();
    bst_identity_match(&p, tracks, count, objects, known, &identity);
    assert_int_equal(identity.tracks, count);
    for (int t = 0; t < count; t++) {
        double sum = identity.unknown[t];
        for (int o = 0; o < known; o++) {
            sum += identity.probability[t][o];
            add(out, identity.probability[t][o], truth[t] == o);
        }
        bst_assert_close(sum, 1.0, 1e-12);
        add(out, identity.unknown[t], truth[t] < 0);
    }
}

/* Of the tracks with probability p, the share p is of that object: within 5 %. The least bin has
 * 1,392 entries, in groups of up to four that depend on each other: 1 sigma is 2.7 %. */
static void probabilities_are_reliable(void **unused) {
    (void)unused;
    reliability r = {0};
    for (int k = 0; k < CLUSTERS; k++) {
        cluster((uint64_t)k, &r);
    }
    for (int b = 0; b < BINS; b++) {
        double n = (double)r.count[b], mean = r.sum[b] / n, share = (double)r.right[b] / n;
        print_message("stated %.4f, right %.4f of %lld\n", mean, share, (long long)r.count[b]);
        assert_true(r.count[b] > 1000);
        bst_assert_close(share, mean, 0.05);
    }
}

/* One object, one track at its place: the odds by hand. */
static void closed_form(void **unused) {
    (void)unused;
    static bst_identity identity;
    source s = {bst_rng_make_key(1, 3, "test", "closed form"), 0};
    const state at = {{10.0, -20.0}, {5.0, 3.0}, 12.0};
    bst_mtt_track track = track_of(&s, 7, &at);
    bst_identity_object object = object_of(3, &at);
    object.direction = track.state.direction;
    object.rate_radps = track.state.rate_radps;
    object.v_mag = track.v_mag;
    const bst_identity_params p = params();
    bst_identity_match(&p, &track, 1, &object, 1, &identity);
    double variance = pow(AS, 2) * (pow(SIGMA_AS, 2) + pow(TRACK_AS, 2)),
           rate = pow(AS, 2) * (pow(RATE_SIGMA_AS, 2) + pow(TRACK_RATE_AS, 2)),
           mag = pow(MAG_SIGMA, 2) + pow(TRACK_MAG, 2);
    double density = 1.0 / (2 * BST_PI * variance) / (2 * BST_PI * rate) / sqrt(2 * BST_PI * mag);
    double odds = 9.0 * density / p.unknown_density;
    bst_assert_close(identity.unknown[0] * (1.0 + odds), 1.0, 1e-9);
    bst_assert_close(bst_identity_log_unexplained(&identity, 7, 4), -log1p(odds), 1e-9);
    bst_assert_close(bst_identity_log_unexplained(&identity, 7, 3), 0.0, 0.0);
    bst_assert_close(bst_identity_log_unexplained(&identity, 8, 4), 0.0, 0.0);
    /* far away, at rest, or not confirmed: of no object */
    object.direction = (bst_vec3){1.0, 0.0, 0.0};
    bst_identity_match(&p, &track, 1, &object, 1, &identity);
    bst_assert_close(identity.unknown[0], 1.0, 0.0);
    track.at_rest = true;
    bst_identity_match(&p, &track, 1, &object, 1, &identity);
    assert_int_equal(identity.tracks, 0);
}

/* Two tracks at the place of one object: it has one of them, and the other one is unknown. */
static void an_object_has_one_track(void **unused) {
    (void)unused;
    static bst_identity identity;
    source s = {bst_rng_make_key(1, 3, "test", "one track"), 0};
    const state at = {{0.0, 0.0}, {5.0, 3.0}, 12.0};
    const bst_mtt_track one = track_of(&s, 1, &at);
    bst_mtt_track both[2] = {one, one};
    both[1].id = 2;
    const bst_identity_object object = object_of(0, &at);
    const bst_identity_params p = params();
    bst_identity_match(&p, both, 2, &object, 1, &identity);
    bst_assert_close(identity.probability[0][0], identity.probability[1][0], 1e-9);
    /* it is missed with odds of 1e-5 or less */
    bst_assert_close(identity.probability[0][0] + identity.probability[1][0], 1.0, 1e-3);
}

/* The cue is between two tracks, nearer to the wrong one, which another object explains. */
static void the_target_is_what_nothing_else_explains(void **unused) {
    (void)unused;
    static bst_identity identity;
    source s = {bst_rng_make_key(1, 3, "test", "target"), 0};
    const state wanted = {{300.0, 0.0}, {5.0, 3.0}, 12.0}, other = {{-100.0, 0.0}, {5, 3}, 12.0};
    const bst_mtt_track tracks[2] = {track_of(&s, 1, &wanted), track_of(&s, 2, &other)};
    const state cued = {{0.0, 0.0}, {5.0, 3.0}, 12.0};
    bst_identity_object objects[2] = {object_of(5, &cued), object_of(6, &other)};
    objects[0].sigma_rad = 300.0 * AS;
    bst_target_cue cue = {.valid = true,
                          .direction = objects[0].direction,
                          .rate_radps = objects[0].rate_radps,
                          .sigma_rad = objects[0].sigma_rad,
                          .rate_sigma_radps = objects[0].rate_sigma_radps,
                          .v_mag = 12.0,
                          .v_mag_sigma = 1.0};
    bst_identity_params p = params();
    bst_target_params choice = p.fit;
    choice.min_hits = 4;
    choice.margin = 2.0;
    choice.margin_hits = 8;
    bst_target target = {.id = 0};
    bst_target_step(&target, &choice, &cue, 1.0, tracks, 2);
    assert_int_equal(target.id, 2); /* by the cue alone, and it is ambiguous */
    assert_true(target.ambiguous);
    bst_identity_match(&p, tracks, 2, objects, 2, &identity);
    cue.identity = &identity;
    cue.object = 5;
    cue.unseen_density = p.unknown_density / 9.0;
    bst_target by_catalogue = {.id = 0};
    bst_target_step(&by_catalogue, &choice, &cue, 1.0, tracks, 2);
    assert_int_equal(by_catalogue.id, 1);
    assert_false(by_catalogue.ambiguous);
    assert_true(by_catalogue.probability > 0.99);
    /* the ambiguous one is replaced */
    bst_target_step(&target, &choice, &cue, 2.0, tracks, 2);
    assert_int_equal(target.id, 1);
    /* if the wanted one has no track yet, the other one is not taken for it */
    bst_identity_match(&p, tracks + 1, 1, objects, 2, &identity);
    bst_target none = {.id = 0};
    bst_target_step(&none, &choice, &cue, 1.0, tracks + 1, 1);
    assert_int_equal(none.id, 0);
}

/* Tracks of one place, and objects there of which each is very much likelier than an unknown one:
 * the sums of products stay in range, and each track is as likely of each of the objects. */
static void extreme_weights(void **unused) {
    (void)unused;
    static bst_identity identity;
    enum { EQUAL = 9, ALIKE = 12 };
    source s = {bst_rng_make_key(1, 3, "test", "extreme"), 0};
    const state at = {{0.0, 0.0}, {5.0, 3.0}, 12.0};
    bst_mtt_track tracks[ALIKE];
    bst_identity_object objects[EQUAL];
    for (int t = 0; t < ALIKE; t++) {
        tracks[t] = t > 0 ? tracks[0] : track_of(&s, 1, &at);
        tracks[t].id = t + 1;
    }
    for (int o = 0; o < EQUAL; o++) {
        objects[o] = object_of(o, &at);
    }
    bst_identity_params p = params();
    for (double density = 1.0; density >= 1e-290; density *= 1e-29) {
        p.unknown_density = density;
        bst_identity_match(&p, tracks, ALIKE, objects, EQUAL, &identity);
        for (int t = 0; t < ALIKE; t++) {
            /* all objects have tracks: nine of twelve */
            bst_assert_close(identity.unknown[t], 0.25, 1e-6);
            for (int o = 0; o < EQUAL; o++) {
                bst_assert_close(identity.probability[t][o], 1.0 / ALIKE, 1e-6);
            }
        }
    }
}

/* What has no room is counted. */
static void tracks_without_room(void **unused) {
    (void)unused;
    static bst_identity identity;
    static bst_mtt_track tracks[BST_IDENTITY_TRACKS + 3];
    source s = {bst_rng_make_key(1, 3, "test", "room"), 0};
    const state at = {{0.0, 0.0}, {5.0, 3.0}, 12.0};
    for (int t = 0; t < BST_IDENTITY_TRACKS + 3; t++) {
        tracks[t] = track_of(&s, t + 1, &at);
    }
    tracks[0].at_rest = true;
    const bst_identity_object object = object_of(0, &at);
    const bst_identity_params p = params();
    bst_identity_match(&p, tracks, BST_IDENTITY_TRACKS + 3, &object, 1, &identity);
    assert_int_equal(identity.tracks, BST_IDENTITY_TRACKS);
    assert_int_equal(identity.left_out, 2);
    bst_identity_match(&p, tracks, 3, &object, 1, &identity);
    assert_int_equal(identity.left_out, 0);
}

/* Tracks are compared once their rates are known along both axes, and only those of objects. */
static void which_tracks_are_compared(void **unused) {
    (void)unused;
    const bst_identity_params p = params();
    const double limit = pow(p.fit.max_rate_sigma_radps, 2);
    for (int k = 0; k < 16; k++) {
        bst_mtt_track track = {.status = BST_TRACK_CONFIRMED};
        track.state.covariance[2][2] = limit * (k & 1 ? 1.01 : 0.99);
        track.state.covariance[3][3] = limit * (k & 2 ? 1.01 : 0.99);
        track.state.covariance[2][3] = track.state.covariance[3][2] = k & 4 ? 2.0 * limit : 0.0;
        track.state.covariance[0][0] = track.state.covariance[1][1] = k & 8 ? 2.0 * limit : 0.0;
        assert_int_equal(bst_identity_compares(&p, &track), (k & 3) == 0);
        track.star = k & 4;
        track.at_rest = !(k & 4);
        assert_false(bst_identity_compares(&p, &track));
    }
    assert_false(bst_identity_compares(&p, &(bst_mtt_track){.status = BST_TRACK_TENTATIVE}));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(probabilities_are_reliable),
                                       cmocka_unit_test(closed_form),
                                       cmocka_unit_test(an_object_has_one_track),
                                       cmocka_unit_test(extreme_weights),
                                       cmocka_unit_test(which_tracks_are_compared),
                                       cmocka_unit_test(tracks_without_room),
                                       cmocka_unit_test(the_target_is_what_nothing_else_explains)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
