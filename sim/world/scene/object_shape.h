/* Space objects with a shape: a satellite's model and its attitude, and the light that follows. */
#ifndef BST_WORLD_SCENE_OBJECT_SHAPE_H
#define BST_WORLD_SCENE_OBJECT_SHAPE_H

#include "sim/satellite/body_attitude.h"
#include "sim/satellite/flux.h"
#include "sim/satellite/glint.h"
#include "sim/satellite/shape_forces.h"
#include "sim/world/scene/brightness.h"

/* An object's model and attitude; immutable once the world is built. */
typedef struct bst_object_shape {
    bst_satellite *satellite;
    bst_body_attitude *attitude;
    int index;                                    /* in the world's list of shapes */
    bst_glint_surface glints[BST_GLINT_SURFACES]; /* surfaces that may glint */
    int glint_count;
    double *burn_s; /* [burn_count] starts of the object's burns */
    int burn_count;
    bool interreflection;             /* light is reflected twice */
    bst_shape_forces *forces;         /* NULL: the orbit does not follow from the shape */
    struct bst_object_torque *torque; /* NULL: none; the world's, which frees it */
} bst_object_shape;

/* Where a body stands to its light at one time. */
typedef struct bst_object_aspect {
    bst_quat q_body_from_gcrf;
    bst_satellite_aim aim; /* its `target` is the observer's direction */
    double sun_radius_rad; /* angular radius of the Sun's disc */
} bst_object_aspect;

/* True if the configuration of an object gives a shape. */
bool bst_object_shape_is_given(const bst_satellite_config *config);

/* Builds the shape of an object.
 *
 * Given:     config    its shape
 *            attitude  bst_attitude_config; empty: nadir
 *            source    base of relative paths, and of attitudes from files
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_CONFIG with the path below the object ("shape/parts/0/..."), BST_ERR_MEMORY
 * Ownership: free *out with bst_object_shape_free */
bst_status bst_object_shape_create(bst_ctx *ctx, const bst_satellite_config *config,
                                   const bst_config_list *attitude,
                                   const bst_attitude_source *source,
                                   bst_object_shape **out) BST_MUST_CHECK;
/* Frees a shape; NULL is allowed. */
void bst_object_shape_free(bst_object_shape *shape);

/* Computes the light of an object with a shape, as bst_brightness_at does for a sphere.
 *
 * Given:     pose          work memory of the calling thread, of this shape's model
 *            brightness    gives earthshine, its albedo, and the temperatures
 *            lighting      area and albedo are not used
 *            velocity_mps  of the object, GCRF
 * Returned:  *out  light of a point source */
void bst_object_shape_glow(const bst_object_shape *shape, bst_satellite_pose *pose,
                           const bst_brightness_config *brightness,
                           const bst_scene_lighting *lighting, bst_vec3 velocity_mps,
                           bst_scene_glow *out);

/* Temperature of a body that the Sun lights in part: mean of the fourth powers, K. */
double bst_object_shape_temperature_k(const bst_brightness_config *brightness,
                                      double sunlit_fraction);

/* Where a body stands to its light.
 *
 * Given:     lighting      places of body, observer and Sun; time
 *            velocity_mps  of the body, GCRF */
void bst_object_shape_aspect(const bst_object_shape *shape, const bst_scene_lighting *lighting,
                             bst_vec3 velocity_mps, bst_object_aspect *out);

/* Number of equal intervals with which the sampling of an exposure begins: two in the time that the
 * widest lobe needs to pass, for rotation rates as they are at that time.
 *
 * Given:     seconds     middle of the exposure, after the epoch
 *            exposure_s  its length
 * Value:     16 to 64, even */
int bst_object_shape_samples(const bst_object_shape *shape, double seconds, double exposure_s);

/* Finds the times of an exposure around which a surface glints (bst_glint_times).
 *
 * Given:     pose        work memory of the calling thread, of this shape's model
 *            seconds, exposure_s  as for bst_object_shape_samples
 *            aspect      where the body stands at a time in [0, 1]
 *            most        room in `times`
 * Returned:  times       within (0, 1), unordered
 * Value:     their number */
int bst_object_shape_glints(const bst_object_shape *shape, bst_satellite_pose *pose, double seconds,
                            double exposure_s,
                            void (*aspect)(void *user, double u, bst_object_aspect *out),
                            void *user, double *times, int most);

#endif
