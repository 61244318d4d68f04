/* The reason for which a target was detected in a frame, or not. */
#include <math.h>
#include <stdio.h>

#include "view/why.h"

/* Distance up to which two sources can be one detection, or one hides the other, px. */
static const double MERGED_PX = 6.0;

static const char *say_detected(const bst_view_why_facts *f, char *text, size_t bytes) {
    char found[160];
    snprintf(found, sizeof found,
             "detected %.1f px from its true place with SNR %.1f (true %.1f)%s", f->detection_px,
             f->detection_snr, f->snr, f->is_blend ? ", blended with another source" : "");
    if (f->is_star) {
        snprintf(text, bytes, "%s, but identified as a star", found);
        return "star";
    }
    if (f->track > 0) {
        snprintf(text, bytes, "%s; it updated track %lld (%s)", found, f->track, f->track_status);
        return "tracked";
    }
    if (f->no_attitude) {
        snprintf(text, bytes,
                 "%s, but the tracker found no attitude from stars that is good enough to measure "
                 "its direction",
                 found);
        return "no_attitude";
    }
    if (f->near_track > 0 && f->near_coasts && isfinite(f->near_sigma)) {
        snprintf(text, bytes, "%s, but %.1f px from where track %lld expected it: about %.1f sigma",
                 found, f->near_px, f->near_track, f->near_sigma);
        return "gated";
    }
    snprintf(text, bytes, "%s; no track has it yet", found);
    return "detected";
}

/* Reasons that lie outside the frame. NULL: none of them. */
static const char *say_unseen(const bst_view_why_facts *f, char *text, size_t bytes) {
    if (f->dropped) {
        snprintf(text, bytes, "the frame was dropped");
        return "dropped";
    }
    if (!f->recorded) {
        snprintf(text, bytes, "the run did not record the truth");
        return "unlisted";
    }
    if (!f->listed) {
        snprintf(text, bytes, "far outside the field of view: the truth does not list it");
        return "outside";
    }
    if (f->occulted) {
        snprintf(text, bytes, "behind the Earth");
        return "occulted";
    }
    if (!f->in_field) {
        snprintf(text, bytes, "outside the field of view");
        return "outside";
    }
    if (f->sunlit_fraction <= 0.0) {
        snprintf(text, bytes, "in the Earth's shadow");
        return "dark";
    }
    if (!f->processed) {
        snprintf(text, bytes, "image processing reported nothing of this frame");
        return "unprocessed";
    }
    return NULL;
}

const char *bst_view_why_reason(const bst_view_why_facts *f, char *text, size_t bytes) {
    const char *unseen = say_unseen(f, text, bytes);
    if (unseen) {
        return unseen;
    }
    if (f->detection_px <= BST_VIEW_WHY_REACH_PX) {
        return say_detected(f, text, bytes);
    }
    if (f->snr < f->threshold_snr) {
        snprintf(text, bytes, "SNR %.1f is below the threshold of %.1f", f->snr, f->threshold_snr);
        return "faint";
    }
    if (f->saturated) {
        snprintf(text, bytes, "saturated");
        return "saturated";
    }
    if (f->object_px <= MERGED_PX) {
        snprintf(text, bytes, "merged with %.60s, %.1f px away", f->object, f->object_px);
        return "merged";
    }
    if (f->star_px <= MERGED_PX) {
        snprintf(text, bytes, "next to a star of V %.1f, %.1f px away", f->star_v_mag, f->star_px);
        return "near_star";
    }
    snprintf(text, bytes, "not detected, though SNR %.1f is above the threshold of %.1f%s", f->snr,
             f->threshold_snr,
             f->lost > 0 ? "; there were more detections than image processing has room for"
                         : ": noise, or motion during the exposure");
    return "chance";
}
