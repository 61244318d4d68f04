/* Common parts of all gimbal modules: output channels, set-up, and publication of platform and
 * mount state at the end of a step. */
#ifndef BST_GIMBAL_PLATFORM_STEP_H
#define BST_GIMBAL_PLATFORM_STEP_H

#include "gimbal/platform.h"
#include "sim/world/world.h"

/* Ports common to all gimbal modules. */
enum {
    BST_GIMBAL_HISTORY,
    BST_GIMBAL_POINTING,
    BST_GIMBAL_NAV,
    BST_GIMBAL_MOUNT, /* not for a scripted line of sight, as what follows */
    BST_GIMBAL_WHEELS,
    BST_GIMBAL_PORTS
};
/* clang-format off */
#define BST_GIMBAL_PORTS_SEEN                                            \
    [BST_GIMBAL_HISTORY] = {.channel = BST_CHANNEL_LOS_HISTORY,          \
                            .direction = BST_PORT_OUT,                   \
                            .capacity = 4000},                           \
    [BST_GIMBAL_POINTING] = {.channel = BST_CHANNEL_POINTING_TELEMETRY,  \
                             .direction = BST_PORT_OUT,                  \
                             .capacity = 800},                           \
    [BST_GIMBAL_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY, .direction = BST_PORT_OUT}
#define BST_GIMBAL_PORTS_ALL                                             \
    BST_GIMBAL_PORTS_SEEN,                                               \
    [BST_GIMBAL_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS,           \
                          .direction = BST_PORT_OUT},                    \
    [BST_GIMBAL_WHEELS] = {.channel = BST_CHANNEL_WHEEL_STATUS, .direction = BST_PORT_OUT}
/* clang-format on */

/* Base of a gimbal module's instance; its first member. */
typedef struct bst_gimbal_base {
    bst_world_view *view;   /* owned */
    bst_platform *platform; /* owned by the instance, freed by bst_gimbal_destroy; NULL: none yet */
    int observer, sensor;
    double tick_rate_hz, dt_s; /* plant step */
    int64_t telemetry_steps, nav_steps;
} bst_gimbal_base;

/* Creates a module's own parts in an instance whose base has observer, sensor and times. */
typedef bst_status (*bst_gimbal_prepare_fn)(const bst_module_env *env, const void *config,
                                            void *self);

/* Common `create` of the gimbal modules: allocates `bytes` of zeros that start with a
 * bst_gimbal_base, and prepares them. After an error `destroy` (bst_gimbal_destroy, or the module's
 * own) frees the instance.
 *
 * Errors:    BST_ERR_CONFIG without a rate; those of `prepare` */
bst_status bst_gimbal_create(const bst_module_env *env, size_t bytes, bst_gimbal_prepare_fn prepare,
                             void (*destroy)(void *self), const void *config,
                             void **self) BST_MUST_CHECK;

/* Nominal attitude of the body of the module's observer. */
bst_quat bst_gimbal_nominal(const bst_module_env *env);
/* Pixel scale of the module's sensor, rad. */
double bst_gimbal_pixel_rad(const bst_module_env *env);

/* Initialises the instance's platform (bst_platform_init) with its random streams and sets
 * base->platform. */
bst_status bst_gimbal_platform_init(const bst_module_env *env, const bst_platform_config *config,
                                    bst_gimbal_base *base, bst_platform *platform) BST_MUST_CHECK;

/* Completes the base: rate dividers, view, and capacities of the rings and of the wheels. Call it
 * after bst_platform_equip.
 *
 * Given:     exposure_s    longest exposure of the sensor, which the history must cover
 *            history_more  additional samples besides the plant steps
 * Errors:    those of bst_platform_check_history, bst_platform_divider and bst_world_view_create */
bst_status bst_gimbal_base_init(const bst_module_env *env, const bst_platform_config *config,
                                double exposure_s, int history_more,
                                bst_gimbal_base *base) BST_MUST_CHECK;
/* Common `destroy` of the gimbal modules: frees an instance that starts with a bst_gimbal_base,
 * with its view and platform; NULL is allowed. The module frees its own members first. */
void bst_gimbal_destroy(void *self);

/* Advances the platform in a module's step (bst_platform_advance), with the commanded roll of the
 * body (NULL: none). Publishes events and counts for wheel saturation and loss of star tracking,
 * and an event when they end. */
bst_status bst_platform_step(struct bst_step *step, bst_platform *platform, int64_t n,
                             bst_vec3 reaction_nm, const bst_los_command *command) BST_MUST_CHECK;

/* Newest los_command of a port (NULL: none yet), and its age. */
const bst_los_command *bst_gimbal_command(struct bst_step *step, int port,
                                          const bst_gimbal_base *base, double *age_s);

/* Publishes the true camera attitude of this tick. */
void bst_gimbal_publish_sight(struct bst_step *step, const bst_platform *platform,
                              bst_quat q_cam_from_gcrf);

/* Encoder and attitude-sensor readings at a plant step. */
typedef struct bst_gimbal_reading {
    bst_quat q_cam_from_gcrf, q_body_from_gcrf;
    double axis_rad[2];
    bool settled, limited;
} bst_gimbal_reading;

/* Reading of an ideal mount without axes at plant step n; the body as measured. */
bst_gimbal_reading bst_gimbal_exact(const bst_platform *platform, int64_t n,
                                    bst_quat q_cam_from_body);

/* Publishes a reading and, with the body's part added, the mount status (NULL: not published); with
 * it the status of the spacecraft's wheels, if it has any. */
void bst_gimbal_publish_reading(struct bst_step *step, const bst_platform *platform,
                                const bst_gimbal_reading *reading, bst_mount_status *status);

/* Publishes the spacecraft's estimated state at plant step n, if due, including orbit and clock
 * errors. Errors: those of the view. */
bst_status bst_gimbal_publish_nav(struct bst_step *step, const bst_gimbal_base *base,
                                  int64_t n) BST_MUST_CHECK;

/* Publishes reading and estimated state, if due, of an ideal mount without status. */
bst_status bst_gimbal_publish_exact(struct bst_step *step, const bst_platform *platform,
                                    const bst_gimbal_base *base, int64_t n,
                                    bst_quat q_cam_from_body) BST_MUST_CHECK;

#endif
