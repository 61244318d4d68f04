/* Classification of detections with a probability: by shape, catalogue, and earlier frames at the
 * same position of the sky and of the sensor. Image processing and the observation generator label
 * their detections with it. */
#ifndef BST_ONBOARD_DISCRIMINATE_H
#define BST_ONBOARD_DISCRIMINATE_H

#include "boresight/archive.h"
#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* What is known of a frame before its detections are labelled. */
typedef struct bst_frame_knowledge {
    bool oriented;            /* stars are identified and set the attitude */
    bst_quat q_cam_from_gcrf; /* mid-exposure */
    bst_light light;
    bst_window window;
    double streak_px;                   /* of the stars; 0 if below streak_min_px */
    const bst_predictions *predictions; /* moving tracks; NULL: none */
    double predictions_age_s;           /* from their epoch to mid-exposure */
    /* log odds that a sensor pixel, y * width + x, is a defect that causes a maximum; NULL: no
     * pixel is suspected */
    double (*suspicion)(const void *user, int32_t pixel);
    const void *suspicion_user;
} bst_frame_knowledge;

/* Classifier of detections with its sources and charge of earlier frames. */
typedef struct bst_discriminator bst_discriminator;

/* True if a label stands for charge (hot pixel or radiation hit) instead of light. */
static inline bool bst_label_is_charge(int32_t label) {
    return label == BST_LABEL_HOT_PIXEL || label == BST_LABEL_HIT;
}

/* Creates a discriminator for frames of up to `capacity` detections; `camera` is copied. Errors:
 * BST_ERR_MEMORY. */
bst_status bst_discriminator_create(bst_ctx *ctx, const bst_camera *camera, int capacity,
                                    bst_discriminator **out) BST_MUST_CHECK;
/* Frees a discriminator; NULL is allowed. */
void bst_discriminator_free(bst_discriminator *discriminator);

/* Replaces the camera by one of the same sensor whose geometry is known better. */
void bst_discriminator_use_camera(bst_discriminator *discriminator, const bst_camera *camera);

/* Saves or restores what is remembered of earlier frames. */
void bst_discriminator_archive(bst_discriminator *discriminator, bst_archive *archive);

/* Sets label and label_probability of a frame's detections. Frames come in order of time.
 *
 * Given:     frame       orientation, predictions and motion of the frame
 *            detections  with a label: STAR with star_id (identified), HOT_PIXEL or HIT (charge, by
 *                        shape), ARTEFACT, UNKNOWN
 * Notes:     charge is a HOT_PIXEL if the same sensor pixel held charge in an earlier frame. It is
 *            a HIT if an earlier frame covered the pixel and found no charge. A source is a
 *            HOT_PIXEL if its pixel held charge in two frames and its SNR is below 8. So is a
 *            source on a pixel that learning suspects with odds of 200 (pixel_learner.h).
 *            For the others the first rule that applies counts:
 *            1. cut by the edge: ARTEFACT;
 *            2. at the predicted position of a moving track: OBJECT;
 *            3. in a frame that does not follow the stars: a streak is a STAR unless its path
 *            is another one than the stars', and a point is an OBJECT;
 *            4. stars are points, and the source is three times as long as wide and was not at rest
 *            there before: OBJECT;
 *            5. earlier frames had a source of its brightness at the same position of the sky: STAR
 *            without star_id, or OBJECT once it has left its first position;
 *            6. new. The probability of a star is the share of new sources of like brightness in
 *            earlier frames that stayed at rest. Without earlier frames ten objects are expected in
 *            a frame, and the others are stars.
 *            Without orientation only charge is labelled. */
void bst_discriminator_label(bst_discriminator *discriminator, const bst_frame_knowledge *frame,
                             bst_detections *detections);

#endif
