/* Field query: which sources the swept field holds during one exposure, where they are and how
 * bright. For rendering and for the observation generator. */
#ifndef BST_WORLD_FIELD_H
#define BST_WORLD_FIELD_H

#include "sim/core/messages.h"
#include "sim/world/world.h"

/* A source that may put light on the window. Its apparent direction at time s in [0, 1] of the
 * exposure is the quadratic through three points. */
typedef struct bst_source {
    int32_t kind; /* bst_source_kind */
    uint32_t id;  /* star: Tycho-2 identity, or statistical (bit 31); object: index in the world */
    bst_vec3 apparent_start, apparent_mid, apparent_end; /* GCRF axes, unit; equal for stars */
    double electrons_per_s;                              /* detected, at mid exposure */
    double v_mag;
    double ra_rad, dec_rad; /* as in bst_truth_item */
    double sunlit_fraction, phase_rad, range_m;
    bool occulted; /* objects: no light */
} bst_source;

/* The true attitude during an exposure, cut out of a los_history. */
typedef struct bst_los_track {
    int count; /* samples, >= 2; the first and last are at the exposure's very ends (interpolated)
                */
    const double *time_s;            /* [count] since exposure start, ascending, time_s[0] = 0 */
    const bst_quat *q_cam_from_gcrf; /* [count], neighbouring signs agree */
} bst_los_track;

typedef struct bst_field_options {
    double v_limit;   /* stars fainter than this are left out */
    double margin_px; /* sources this far outside the window still count (PSF wings) */
} bst_field_options;

typedef struct bst_field
    bst_field; /* work space and result of one query, reused from frame to frame */

bst_status bst_field_create(bst_ctx *ctx, const bst_world *world, int observer, int sensor,
                            bst_field **out) BST_MUST_CHECK;
void bst_field_free(bst_field *field);

/* Cuts the samples from start_tick to end_tick out of the ring, interpolating at the ends; held in
 * `field` until the next call. BST_ERR_STATE when the ring no longer (or not yet) covers the
 * exposure. A zero-length exposure gives two equal samples. */
bst_status bst_field_track(bst_ctx *ctx, bst_field *field, const bst_los_history *history,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_los_track *out) BST_MUST_CHECK;

/* Fills the header of `truth` (attitudes, observer, light, background) and returns the sources that
 * touch `window`: stars by cell then brightness, then objects by index. *sources is held in `field`
 * until the next query. */
bst_status bst_field_query(bst_ctx *ctx, bst_field *field, const bst_los_track *track,
                           int64_t start_tick, int64_t end_tick, int64_t tick_rate_hz,
                           bst_window window, const bst_field_options *options, bst_truth *truth,
                           const bst_source **sources, int *count) BST_MUST_CHECK;

/* Pixel position of a source at sample k of the track. false when behind the camera. */
bool bst_field_project(const bst_camera *camera, const bst_los_track *track, int k,
                       const bst_source *source, double *x_px, double *y_px);

/* Makes the truth item of a source (positions, magnitude, electrons; SNR for a Gaussian PSF that is
 * smeared along the source's own track, sigma from background, dark and read noise). */
void bst_field_truth_item(const bst_field *field, const bst_los_track *track,
                          const bst_source *source, bst_window window, const bst_truth *header,
                          bst_truth_item *out);

#endif
