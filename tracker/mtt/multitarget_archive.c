/* Saving and restoring of the multi-target tracker. */
#include "tracker/mtt/multitarget_internal.h"

/* True if the numbers of a track by which arrays are accessed are in range. */
static bool is_intact(const bst_mtt_track *track) {
    const bst_filter_models *models = &track->models;
    if ((models->levels != 0 && models->levels != BST_FILTER_LEVELS) || models->count < 0 ||
        models->count > BST_FILTER_COMPONENTS) {
        return false;
    }
    int of_level[BST_FILTER_LEVELS] = {0};
    for (int i = 0; models->levels > 0 && i < models->count; i++) {
        if ((unsigned)models->level[i] >= BST_FILTER_LEVELS ||
            ++of_level[models->level[i]] > BST_FILTER_COMPONENTS / BST_FILTER_LEVELS) {
            return false;
        }
    }
    return isfinite(models->unswitched_s) && models->unswitched_s >= 0.0 &&
           (unsigned)track->status <= BST_TRACK_COASTING &&
           (unsigned)track->sight <= BST_MTT_EARTH && track->innovation_count >= 0 &&
           track->brightness_count >= 0;
}

/* Saves or restores tracks. */
static bst_status archive_tracks(bst_mtt_track *tracks, int *count, int capacity,
                                 bst_archive *archive) {
    *count = bst_archive_count(archive, *count, capacity);
    bst_archive_bytes(archive, tracks, (size_t)*count * sizeof *tracks);
    for (int t = 0; t < *count; t++) {
        if (!is_intact(&tracks[t])) {
            return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                            "the saved state of the tracker is damaged at track %d", t);
        }
    }
    return BST_OK;
}

/* The arrays per track and detection that are not named here are the work space of one frame. */
bst_status bst_mtt_archive(bst_mtt *m, bst_archive *archive) {
    int most = m->params.max_tracks + m->params.max_stationary_tracks;
    BST_TRY(archive_tracks(m->tracks, &m->track_count, most, archive));
    BST_TRY(archive_tracks(m->memory, &m->memory_count, m->params.max_dormant_tracks, archive));
    m->rest_count = bst_archive_count(archive, m->rest_count, m->params.max_stationary_tracks);
    m->sleepers = bst_archive_count(archive, m->sleepers, most);
    BST_ARCHIVE(archive, m->next_id);
    BST_ARCHIVE(archive, m->seconds);
    bst_archive_bool(archive, &m->started);
    bst_archive_bool(archive, &m->cue_lag_valid);
    BST_ARCHIVE(archive, m->cue_lag_radps2);
    BST_ARCHIVE(archive, m->undetected);
    BST_ARCHIVE(archive, m->boresight);
    BST_ARCHIVE(archive, m->bad_pixels);
    BST_ARCHIVE(archive, m->charged);
    BST_ARCHIVE(archive, m->clutter);
    BST_ARCHIVE(archive, m->clutter_density);
    BST_ARCHIVE(archive, m->alarms);
    BST_ARCHIVE(archive, m->alarm_frames);
    BST_ARCHIVE(archive, m->alarm_density);
    BST_ARCHIVE(archive, m->alarm_snr);
    BST_ARCHIVE(archive, m->lost);
    bst_mtt_pool_archive(&m->now, m->params.max_detections, archive);
    m->history_count = bst_archive_count(archive, m->history_count, BST_MTT_HISTORY);
    for (int h = 0; h < BST_MTT_HISTORY; h++) {
        bst_mtt_pool_archive(&m->history[h], m->params.max_detections, archive);
    }
    if (bst_archive_is_restoring(archive)) {
        m->event_count = 0;
    }
    return BST_OK;
}
