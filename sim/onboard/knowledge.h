/* What the onboard side of one sensor knows: its own catalogue, camera, and the cue it was given.
 * No true state of anything can be reached from here. */
#ifndef BST_ONBOARD_KNOWLEDGE_H
#define BST_ONBOARD_KNOWLEDGE_H

#include "boresight/messages.h"
#include "sim/astro/belt.h"
#include "sim/onboard/region.h"
#include "sim/world/world.h"

typedef struct bst_knowledge bst_knowledge;

/* With a plain Gaussian for its PSF: where the known one is another (bst_knowledge_psf), that with
 * the same noise-equivalent area. */
const bst_camera *bst_knowledge_camera(const bst_knowledge *knowledge);
/* The PSF that is known on board, lent as long as the world lives; NULL where it is the Gaussian of
 * the camera's psf_fwhm_px, or that of a file (see below). Without an error in
 * knowledge.camera it is the true one. */
const struct bst_psf *bst_knowledge_psf(const bst_knowledge *knowledge);
/* The FITS image of the PSF that is known on board ("": none, the camera's psf_fwhm_px holds), and
 * its samples per pixel (0: the file says). */
const char *bst_knowledge_psf_file(const bst_knowledge *knowledge, double *oversampling);
/* Star catalogue on board; it belongs to the knowledge or its world. */
const bst_stars *bst_knowledge_stars(const bst_knowledge *knowledge);
double bst_knowledge_julian_year(
    const bst_knowledge *knowledge); /* at the epoch, for proper motion */

/* The cue: where the target is believed to be. */
typedef struct bst_onboard_cue {
    bool valid;
    bst_vec3
        direction_gcrf; /* unit, geometric (light time in, aberration out), cue error included */
    bst_vec3 rate_gcrf_radps;  /* d(direction)/dt */
    double sigma_rad;          /* 1 sigma per axis of the direction's error */
    double rate_sigma_radps;   /* 1 sigma per axis of the rate's error */
    double v_mag, v_mag_sigma; /* believed brightness; sigma INFINITY: unknown */
} bst_onboard_cue;

/* A cheap per-user window, as bst_world_view is for the world. */
typedef struct bst_knowledge_view bst_knowledge_view;

/* Creates a view of onboard knowledge, with a sky clock of its own; one thread may use it at a
 * time.
 *
 * Given:     knowledge  must outlive the view
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_knowledge_view_free */
bst_status bst_knowledge_view_create(bst_ctx *ctx, const bst_knowledge *knowledge,
                                     bst_knowledge_view **out) BST_MUST_CHECK;
/* Frees a view; the knowledge itself stays; NULL is allowed. */
void bst_knowledge_view_free(bst_knowledge_view *view);

/* The cue at `seconds` after the epoch. */
bst_status bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_onboard_cue *out) BST_MUST_CHECK;
/* Its direction alone, at a third of the cost; *valid as bst_onboard_cue has it. */
bst_status bst_knowledge_cue_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                          bool *valid, bst_vec3 *direction) BST_MUST_CHECK;

/* Has the cue be what a task says, from now on: its object, without an error, or with none the
 * sensor's own. True when the task is a new one, by its id; NULL is none. */
bool bst_knowledge_view_task(bst_knowledge_view *view, const bst_task *task);
/* The cue's region, as bst_knowledge_region; none while the view has a task with an object. */
void bst_knowledge_view_region(const bst_knowledge_view *view, bst_region *out);

/* Range of the cue's object as it is believed, and its rate, at `seconds` after the epoch; *known
 * false: the cue is a direction. */
bst_status bst_knowledge_cue_range_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                      bool *known, double *range_m,
                                      double *range_rate_mps) BST_MUST_CHECK;

/* The region that the cue gives in place of a place; kind BST_REGION_NONE: none. The cue's
 * direction is its middle, then, sigma_rad its greater half extent, and each of its places has a
 * rate and a range of its own (bst_knowledge_belt_eye_at). */
void bst_knowledge_region(const bst_knowledge *knowledge, bst_region *out);

/* The direction (unit, geometric) of a place in the region at `seconds` after the epoch, by angles
 * along and across it from its middle: on the sky (BST_REGION_ARC), or longitude and latitude about
 * the Earth's centre (BST_REGION_GEOSTATIONARY: seen 0.85 to 1.2 times as large from low orbits).
 */
bst_status bst_knowledge_region_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                             double along_rad, double across_rad,
                                             bst_vec3 *direction) BST_MUST_CHECK;

/* From where the belt's motion is seen, as it is believed; *known false: the cue has no region. */
bst_status bst_knowledge_belt_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                     bool *known, bst_belt_eye *eye) BST_MUST_CHECK;

/* The body attitude in which the spacecraft starts and that it tries to hold (see
 * bst_world_body_attitude). */
bst_quat bst_knowledge_body_attitude(const bst_knowledge *knowledge);

/* ---- the onboard catalogue: the scenario's objects on their orbits as catalogued ---- */

/* Onboard catalogue: number of the scenario's objects, on their catalogued orbits. */
int bst_knowledge_object_count(const bst_knowledge *knowledge);

/* Description of an object of the onboard catalogue; it belongs to the world.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const bst_world_object_info *bst_knowledge_object(const bst_knowledge *knowledge, int object);
/* -1: there is no object of this name. */
int bst_knowledge_find_object(const bst_knowledge *knowledge, const char *name);
/* Whether an object is the spacecraft itself: by catalogue number, or its place in a constellation.
 */
bool bst_knowledge_is_itself(const bst_knowledge *knowledge, int object);
/* Distances from the Earth's centre of the osculating orbit's apsides at the epoch; false: the
 * object has no orbit then. */
bool bst_knowledge_apsides(bst_knowledge_view *view, int object, double *perigee_m,
                           double *apogee_m);
/* Geocentric places (GCRF) of all objects within 4 s of `seconds`, to 1 km: for a first choice.
 * Returns the time that they are for, a whole multiple of 8 s. NAN: not known so quickly; 0, 0, 0:
 * it has no orbit. */
double bst_knowledge_places(const bst_knowledge *knowledge, double seconds, double *x_m,
                            double *y_m, double *z_m);
/* Where the spacecraft believes to be, and the bodies by its clock. */
bst_status bst_knowledge_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_world_state *eye, bst_bodies *bodies) BST_MUST_CHECK;
/* How an object should be seen from there. BST_ERR_NUMERIC when either has no orbit then. */
bst_status bst_knowledge_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                  double seconds, bst_world_sight *out) BST_MUST_CHECK;

#endif
