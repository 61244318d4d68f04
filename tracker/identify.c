/* When tracks are compared with the catalogue, and with which objects. */
#include <stdlib.h>

#include "tracker/tracker_internal.h"

/* Objects so far outside the field may be of tracks in it. */
static const double MOST_MARGIN_RAD = BST_DEG_RAD;

bst_status bst_tracker_identity_create(bst_ctx *ctx, const bst_tracker_config *config,
                                       bst_tracker *t) {
    t->identity_period_s = config->identity_period_s;
    if (!(config->identity_period_s > 0.0)) {
        return BST_OK;
    }
    double scale = bst_camera_scale_rad(&t->camera);
    double field_sr = (double)t->camera.width_px * (double)t->camera.height_px * scale * scale;
    double rate = config->max_rate_arcsec_per_s * BST_ARCSEC_RAD;
    t->identity_params = (bst_identity_params){
        .unknown_density = config->uncatalogued_per_field /
                           (field_sr * BST_PI * fmax(rate * rate, 1e-20) * BST_IDENTITY_MAG),
        .detection_probability = config->detection_probability,
        .fit = t->target_params};
    t->identity = calloc(1, sizeof *t->identity);
    t->identified_s = -INFINITY;
    return t->identity ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "tracker: out of memory");
}

bst_status bst_tracker_identity_archive(bst_tracker *t, bst_archive *archive) {
    bool saved = t->identity != NULL;
    bst_identity unused = {.tracks = 0};
    double unused_s = 0.0;
    bst_archive_bool(archive, &saved);
    if (!saved) {
        t->identified_s = -INFINITY;
        return BST_OK;
    }
    bst_identity *identity = t->identity ? t->identity : &unused;
    BST_ARCHIVE(archive, *identity);
    if (t->identity) {
        BST_ARCHIVE(archive, t->identified_s);
    } else {
        BST_ARCHIVE(archive, unused_s);
    }
    if (identity->tracks < 0 || identity->tracks > BST_IDENTITY_TRACKS || identity->objects < 0 ||
        identity->objects > BST_IDENTITY_OBJECTS) {
        identity->tracks = 0;
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved state of the tracker's identities is damaged");
    }
    return BST_OK;
}

/* True if there is a confirmed track that moves. */
static bool any_track(const bst_mtt_track *tracks, int count) {
    bool any = false;
    for (int i = 0; i < count && !any; i++) {
        any = tracks[i].status != BST_TRACK_TENTATIVE && !tracks[i].at_rest && !tracks[i].star;
    }
    return any;
}

/* True if the cue names an object of the catalogue, whose rivals the other objects are. What a cue
 * without an object means may be any of them: then none is a rival. */
static bool is_named(const bst_tracker_input *input, const bst_target_cue *cue) {
    return cue->valid && !cue->in_region && input->cue_object >= 0;
}

/* Compares all tracks with the catalogue; the cue stands for the object that it names. Returns
 * false if the catalogue does not answer. */
static bool compare(bst_tracker *t, const bst_tracker_input *input, bst_vec3 boresight,
                    const bst_target_cue *cue) {
    bst_identity_object objects[BST_IDENTITY_OBJECTS];
    bst_vec3 directions[BST_IDENTITY_TRACKS];
    int count = 0, tracks, left_out = 0;
    if (is_named(input, cue)) {
        objects[count++] = (bst_identity_object){.object = input->cue_object,
                                                 .direction = cue->direction,
                                                 .rate_radps = cue->rate_radps,
                                                 .sigma_rad = cue->sigma_rad,
                                                 .rate_sigma_radps = cue->rate_sigma_radps,
                                                 .v_mag = cue->v_mag,
                                                 .v_mag_sigma = cue->v_mag_sigma};
    }
    double half = 0.5 * bst_camera_scale_rad(&t->camera) *
                  hypot((double)t->camera.width_px, (double)t->camera.height_px);
    const bst_mtt_track *all = bst_mtt_tracks(t->mtt, &tracks);
    bst_tracker_search search = {.axis = boresight,
                                 .half_angle_rad = fmin(half + MOST_MARGIN_RAD, 0.5 * BST_PI),
                                 .tracks = directions};
    for (int i = 0; i < tracks && search.track_count < BST_IDENTITY_TRACKS; i++) {
        if (bst_identity_compares(&t->identity_params, &all[i])) {
            directions[search.track_count++] = all[i].state.direction;
        }
    }
    int found = input->near(input->near_user, &search, objects + count,
                            BST_IDENTITY_OBJECTS - count, &left_out);
    if (found < 0) {
        return false;
    }
    bst_identity_match(&t->identity_params, all, tracks, objects, count + found, t->identity);
    t->identity->left_out += left_out;
    return true;
}

void bst_tracker_identify(bst_tracker *t, const bst_tracker_input *input, bool usable,
                          const bst_mtt_frame *frame, bst_target_cue *cue) {
    int count;
    double seconds = frame->seconds;
    const bst_mtt_track *tracks = bst_mtt_tracks(t->mtt, &count);
    bool undecided = t->target.id == 0 || t->target.ambiguous;
    bool due = undecided || seconds - t->identified_s >= t->identity_period_s;
    t->identified =
        usable && due && any_track(tracks, count) && compare(t, input, frame->boresight, cue);
    if (t->identified) {
        t->identified_s = seconds;
    }
    if (is_named(input, cue) && seconds - t->identified_s < t->identity_period_s) {
        const bst_identity_params *p = &t->identity_params;
        cue->object = input->cue_object;
        cue->identity = t->identity;
        cue->unseen_density =
            (1.0 - p->detection_probability) / p->detection_probability * p->unknown_density;
    }
    if (usable) {
        bst_tracker_learn_clock(t, input, frame);
    }
}
