/* Why the target of a sensor was detected in a frame, or not, as the recorded tables tell. */
#ifndef BST_VIEW_WHY_H
#define BST_VIEW_WHY_H

#include <stdbool.h>

#include "view/routes.h"

/* Exposures before and after the frame that are looked at. */
enum { BST_VIEW_WHY_AROUND = 200 };
/* Distance up to which a detection can be the target, px. */
#define BST_VIEW_WHY_REACH_PX 3.0

/* What is known of a frame and the target in it. Distances in px; NAN: there is none. */
typedef struct bst_view_why_facts {
    bool dropped, processed;                    /* processed: image processing reported the frame */
    double threshold_snr;                       /* of points */
    long long lost;                             /* detections beyond the capacity */
    bool recorded;                              /* the run has its truth */
    bool listed, in_field, occulted, saturated; /* of the truth */
    double snr, sunlit_fraction;
    double star_px, star_v_mag;         /* nearest true star */
    double object_px;                   /* nearest other object */
    const char *object;                 /* its name */
    double detection_px, detection_snr; /* nearest detection */
    bool is_star, is_blend;             /* its label and flag */
    bool no_attitude;                   /* the tracker found none from the stars of the frame */
    long long track;                    /* that the detection updated; 0: none */
    const char *track_status;
    long long near_track;       /* nearest other one; 0: none */
    double near_px, near_sigma; /* from the detection, or without one from the truth */
    bool near_coasts;           /* it was not updated in this frame */
} bst_view_why_facts;

/* Finds the reason.
 *
 * Returned:  text    [bytes] a sentence
 *            the reason's word: "tracked", "detected", "gated", "no_attitude", "star", "dropped",
 * "unlisted", "outside", "occulted", "dark", "unprocessed", "saturated", "merged", "near_star",
 * "faint" or "chance" */
const char *bst_view_why_reason(const bst_view_why_facts *facts, char *text, size_t bytes);

/* Reasons for exposures first to last of the list, as far as there are any: {target, frame: {kind,
 * text}, spans: [{first, last, kind, text}]}. first, last: frames of the list; text: of the first
 * one. frame: the reason of x->frame, if it is among them. target: null without one.
 *
 * Returned:  x->json
 * Errors:    BST_ERR_NOT_FOUND: no such sensor or frame; BST_ERR_FORMAT: damaged tables */
bst_status bst_view_why(bst_ctx *ctx, bst_view_exchange *x, int64_t first,
                        int64_t last) BST_MUST_CHECK;

/* The route of one frame: bst_view_why for x->frame alone. */
bst_status bst_view_route_reason(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

/* The route: bst_view_why for BST_VIEW_WHY_AROUND exposures before and after x->frame. */
bst_status bst_view_route_why(bst_ctx *ctx, bst_view_exchange *x) BST_MUST_CHECK;

#endif
