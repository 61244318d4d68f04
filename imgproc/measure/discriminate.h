/* Says what each detection is, with a probability: from its shape, from the catalogue, and from
 * what earlier frames showed at the same place of the sky and of the sensor. */
#ifndef BST_IMGPROC_MEASURE_DISCRIMINATE_H
#define BST_IMGPROC_MEASURE_DISCRIMINATE_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* One frame, as far as it is known. */
typedef struct bst_imgproc_frame_knowledge {
    bool oriented;            /* stars are identified: attitude is theirs */
    bst_quat q_cam_from_gcrf; /* mid-exposure */
    bst_light light;
    bst_window window;
    double streak_px;                        /* of the stars; below streak_min_px: 0 */
    const bst_predictions *predictions;      /* moving tracks; NULL: none */
    double predictions_age_s;                /* from their tick to mid-exposure */
    const struct bst_pixel_learner *learned; /* bad pixels; NULL: none */
    const struct bst_pixel_map *left_out;    /* with `learned`: of this frame */
} bst_imgproc_frame_knowledge;

/* Memory of earlier frames. */
typedef struct bst_imgproc_discriminator bst_imgproc_discriminator;

/* For frames of up to `capacity` detections; `camera` is copied. BST_ERR_MEMORY. */
bst_status bst_imgproc_discriminator_create(bst_ctx *ctx, const bst_camera *camera, int capacity,
                                            bst_imgproc_discriminator **out) BST_MUST_CHECK;
/* Frees a discriminator; NULL is allowed. */
void bst_imgproc_discriminator_free(bst_imgproc_discriminator *discriminator);

/* Sets label and label_probability of a frame's detections; frames come in order of time.
 *
 * Given: label STAR with star_id (identified), HOT_PIXEL or HIT (charge, by shape), ARTEFACT,
 * UNKNOWN. Charge is a HOT_PIXEL where the same sensor pixel held charge in an earlier frame, a HIT
 * where it did not although an earlier frame covered it; a source below SNR 8 on a pixel that held
 * charge in two frames is a HOT_PIXEL too, and so is a source on a pixel that learning suspects
 * with odds of 200 (pixel_learner.h). Of the rest, in this order: cut by the edge, an ARTEFACT; at
 * a moving track's predicted place, an OBJECT; drawn as the stars are in a frame that follows
 * something else, a STAR, and a point there an OBJECT; three times as long as wide where stars are
 * points, and not at rest there before, an OBJECT; where earlier frames had a source of its
 * brightness at the same place of the sky, a STAR without star_id, or an OBJECT once it has left
 * the place where it was seen first; else new: of the new sources of like brightness in earlier
 * frames some stayed where they were (stars near the limit of detection that show in some frames
 * only) and some did not, and their share is the probability. Without earlier frames ten objects
 * are expected in a frame and the others are stars. Nothing is said without orientation, except of
 * charge. */
void bst_imgproc_discriminator_label(bst_imgproc_discriminator *discriminator,
                                     const bst_imgproc_frame_knowledge *frame,
                                     bst_detections *detections);

#endif
