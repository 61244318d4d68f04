/* Onboard knowledge of one sensor: its catalogue, camera model and cue. It gives no access to true
 * states. */
#ifndef BST_ONBOARD_KNOWLEDGE_H
#define BST_ONBOARD_KNOWLEDGE_H

#include "boresight/archive.h"
#include "boresight/messages.h"
#include "sim/astro/belt.h"
#include "sim/onboard/region.h"
#include "sim/world/world.h"

typedef struct bst_knowledge bst_knowledge;

/* Camera model on board, with a Gaussian PSF: for another known PSF (bst_knowledge_psf) the
 * Gaussian with the same noise-equivalent area. */
const bst_camera *bst_knowledge_camera(const bst_knowledge *knowledge);
/* Memo of parameters that onboard modules derive from their configuration; modules of several
 * simulations may share it. */
struct bst_memo *bst_knowledge_memo(const bst_knowledge *knowledge);
/* Onboard PSF, valid as long as the world; NULL: Gaussian with the camera's psf_fwhm_px, or from a
 * file (see bst_knowledge_psf_file). Without an error in knowledge.camera it is the true PSF. */
const struct bst_psf *bst_knowledge_psf(const bst_knowledge *knowledge);
/* FITS file of the onboard PSF ("": none, psf_fwhm_px holds), and its samples per pixel (0: from
 * the file). */
const char *bst_knowledge_psf_file(const bst_knowledge *knowledge, double *oversampling);
/* Star catalogue on board; it belongs to the knowledge or its world. */
const bst_stars *bst_knowledge_stars(const bst_knowledge *knowledge);
double bst_knowledge_julian_year(
    const bst_knowledge *knowledge); /* at the epoch, for proper motion */

/* The cue: estimated direction of the target. */
typedef struct bst_onboard_cue {
    bool valid;
    bst_vec3 direction_gcrf; /* unit, geometric (with light time, without aberration), including the
                                cue error */
    bst_vec3 rate_gcrf_radps;  /* d(direction)/dt */
    double sigma_rad;          /* 1 sigma per axis of the direction */
    double rate_sigma_radps;   /* 1 sigma per axis of the rate */
    double v_mag, v_mag_sigma; /* estimated brightness; sigma INFINITY: unknown */
} bst_onboard_cue;

/* A user's view of onboard knowledge, with caches, like bst_world_view. */
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

/* Corrects the view's times by an estimate of the onboard clock's offset (sigma 0: there is none,
 * and no correction), if it differs from that in use by more than a third of its sigma. True: it
 * did, and the cue has changed. */
bool bst_knowledge_view_set_clock(bst_knowledge_view *view, double offset_s, double sigma_s);
/* The clock offset in use, s; 0: none was set. */
double bst_knowledge_view_clock_s(const bst_knowledge_view *view);

/* Archives the task of a view and its directions of the cue. A task for an object that the
 * catalogue lacks is a range error of the archive. */
void bst_knowledge_view_archive(bst_knowledge_view *view, bst_archive *archive);

/* The cue at `seconds` after the epoch. */
bst_status bst_knowledge_cue_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_onboard_cue *out) BST_MUST_CHECK;
/* Direction of the cue only, at a third of the cost; *valid as in bst_onboard_cue. */
bst_status bst_knowledge_cue_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                          bool *valid, bst_vec3 *direction) BST_MUST_CHECK;

/* Sets the cue from a task: its object without cue error, or, without object, the sensor's own cue.
 * NULL: no task. True for a new task id. */
bool bst_knowledge_view_task(bst_knowledge_view *view, const bst_task *task);
/* Region of the cue, as bst_knowledge_region; none during a task with an object. */
void bst_knowledge_view_region(const bst_knowledge_view *view, bst_region *out);

/* Estimated range of the cue's object and its rate at `seconds` after the epoch; *known false: the
 * cue is a direction. */
bst_status bst_knowledge_cue_range_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                      bool *known, double *range_m,
                                      double *range_rate_mps) BST_MUST_CHECK;

/* Region that the cue gives instead of a direction; kind BST_REGION_NONE: none. The cue's direction
 * is its centre, sigma_rad its larger half extent. Each point has its own rate and range
 * (bst_knowledge_belt_eye_at). */
void bst_knowledge_region(const bst_knowledge *knowledge, bst_region *out);

/* Direction (unit, geometric) of a point of the region at `seconds` after the epoch, by angles
 * along and across from its centre: on the sky (BST_REGION_ARC), or longitude and latitude about
 * the Earth's centre (BST_REGION_GEOSTATIONARY: appears 0.85 to 1.2 times as large from low
 * orbits). */
bst_status bst_knowledge_region_direction_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                             double along_rad, double across_rad,
                                             bst_vec3 *direction) BST_MUST_CHECK;

/* Observer state from which the motion of the geostationary belt is computed; *known false: the cue
 * has no region. */
bst_status bst_knowledge_belt_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                     bool *known, bst_belt_eye *eye) BST_MUST_CHECK;

/* Initial body attitude, which the spacecraft tries to hold (see bst_world_body_attitude). */
bst_quat bst_knowledge_body_attitude(const bst_knowledge *knowledge);

/* ---- the onboard catalogue: the scenario's objects on their orbits as catalogued ---- */

/* Onboard catalogue: number of the scenario's objects, on catalogued orbits. */
int bst_knowledge_object_count(const bst_knowledge *knowledge);

/* Description of an object of the onboard catalogue; it belongs to the world.
 *
 * Given:     object  index, 0 to one less than the number of objects */
const bst_world_object_info *bst_knowledge_object(const bst_knowledge *knowledge, int object);
/* Index of an object of the onboard catalogue by name; -1: none. */
int bst_knowledge_find_object(const bst_knowledge *knowledge, const char *name);
/* True if an object is the spacecraft itself: same catalogue number, or same place in a
 * constellation. */
bool bst_knowledge_is_itself(const bst_knowledge *knowledge, int object);
/* Geocentric distances of the apsides of an object's osculating orbit at the epoch; false: no orbit
 * at that time. */
bool bst_knowledge_apsides(bst_knowledge_view *view, int object, double *perigee_m,
                           double *apogee_m);
/* Age of an object's element set at the scenario's epoch, s; false: it has none. */
bool bst_knowledge_element_age(const bst_knowledge *knowledge, int object, double *seconds);
/* Geocentric positions (GCRF) of all objects within 4 s of `seconds`, accurate to 1 km, for a
 * preselection. Returns their time, a multiple of 8 s. NAN: compute it directly; 0, 0, 0: no
 * orbit. */
double bst_knowledge_places(const bst_knowledge *knowledge, double seconds, double *x_m,
                            double *y_m, double *z_m);
/* The time of the positions that bst_knowledge_places returns: those of one time are the same. */
double bst_knowledge_places_time(double seconds);
/* Objects that may be in a cone of apparent directions at `seconds`: all that are, and few others.
 *
 * Returned:  *count  in `indices`, ascending; room for all objects is needed */
bst_status bst_knowledge_near(bst_ctx *ctx, bst_knowledge_view *view, double seconds, bst_vec3 axis,
                              double half_angle_rad, int *indices, int *count) BST_MUST_CHECK;
/* Index of the cue's object: that of the task, or that of the sensor's own cue; -1: the cue is a
 * direction or a region. */
int bst_knowledge_cue_object(const bst_knowledge_view *view);
/* Observer state by onboard navigation, and Sun and Moon at the onboard clock's time. */
bst_status bst_knowledge_eye_at(bst_ctx *ctx, bst_knowledge_view *view, double seconds,
                                bst_world_state *eye, bst_bodies *bodies) BST_MUST_CHECK;
/* Geometric direction (GCRF, unit vector) of an object as in bst_knowledge_sight_at, without its
 * light: the same bits in a third of the time. BST_ERR_NUMERIC: an orbit has ended. */
bst_status bst_knowledge_direction_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                      double seconds, bst_vec3 *geometric) BST_MUST_CHECK;
/* An object of the onboard catalogue and the spacecraft by onboard navigation, geocentric, GCRF. */
typedef struct bst_onboard_line {
    bst_vec3 direction; /* as by bst_knowledge_direction_at */
    double range_m;
    bst_world_state eye, object; /* at reception, at emission */
} bst_onboard_line;
/* The line of sight to an object at `seconds`. BST_ERR_NUMERIC: an orbit has ended. */
bst_status bst_knowledge_line_at(bst_ctx *ctx, bst_knowledge_view *view, int object, double seconds,
                                 bst_onboard_line *out) BST_MUST_CHECK;
/* Predicted sight of an object from the estimated observer state. BST_ERR_NUMERIC: an orbit has
 * ended. */
bst_status bst_knowledge_sight_at(bst_ctx *ctx, bst_knowledge_view *view, int object,
                                  double seconds, bst_world_sight *out) BST_MUST_CHECK;

#endif
