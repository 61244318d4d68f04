/* What the modules of all gimbals have in common: the channels they write, their set-up, and the
 * end of a step, in which they publish what the platform and the mount on it do. */
#ifndef BST_GIMBAL_PLATFORM_STEP_H
#define BST_GIMBAL_PLATFORM_STEP_H

#include "gimbal/platform.h"
#include "sim/world/world.h"

/* Ports that all of them begin with. */
enum {
    BST_GIMBAL_HISTORY,
    BST_GIMBAL_POINTING,
    BST_GIMBAL_NAV,
    BST_GIMBAL_MOUNT, /* not of a scripted line of sight */
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
    [BST_GIMBAL_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS, .direction = BST_PORT_OUT}
/* clang-format on */

/* The first member of a gimbal module's instance. */
typedef struct bst_gimbal_base {
    bst_world_view *view;   /* owned */
    bst_platform *platform; /* the instance's own, which bst_gimbal_destroy frees; NULL: none yet */
    int observer, sensor;
    double tick_rate_hz, dt_s; /* plant step */
    int64_t telemetry_steps, nav_steps;
} bst_gimbal_base;

/* Makes what is a module's own in an instance whose base has observer, sensor and times. */
typedef bst_status (*bst_gimbal_prepare_fn)(const bst_module_env *env, const void *config,
                                            void *self);

/* A module's `create`: `bytes` of zeros that begin with a bst_gimbal_base, prepared; what is left
 * after an error goes to `destroy` (bst_gimbal_destroy, or the module's own). BST_ERR_CONFIG
 * without a rate; passes on errors of `prepare`.
 */
bst_status bst_gimbal_create(const bst_module_env *env, size_t bytes, bst_gimbal_prepare_fn prepare,
                             void (*destroy)(void *self), const void *config,
                             void **self) BST_MUST_CHECK;

/* Nominal attitude of the body of the module's observer. */
bst_quat bst_gimbal_nominal(const bst_module_env *env);
/* Pixel scale of the module's sensor, rad. */
double bst_gimbal_pixel_rad(const bst_module_env *env);

/* bst_platform_init for the instance's platform, with its random streams; base->platform is that
 * platform then. */
bst_status bst_gimbal_platform_init(const bst_module_env *env, const bst_platform_config *config,
                                    bst_gimbal_base *base, bst_platform *platform) BST_MUST_CHECK;

/* The rest of the base: dividers, view, and the capacities of the rings. exposure_s: longest of the
 * sensor, which the history must cover; history_more: room in it besides the plant's steps. Errors
 * as bst_platform_check_history, bst_platform_divider and bst_world_view_create. */
bst_status bst_gimbal_base_init(const bst_module_env *env, const bst_platform_config *config,
                                double exposure_s, int history_more,
                                bst_gimbal_base *base) BST_MUST_CHECK;
/* A module's `destroy`: frees an instance that begins with a bst_gimbal_base, with the view and the
 * platform of that; NULL is allowed. What the instance owns besides is freed before. */
void bst_gimbal_destroy(void *self);

/* bst_platform_advance in a module's step, the body's roll as commanded (NULL: nothing), with an
 * event and a count where wheels saturate or star
 * trackers lose the stars, and an event when that is over. */
bst_status bst_platform_step(struct bst_step *step, bst_platform *platform, int64_t n,
                             bst_vec3 reaction_nm, const bst_los_command *command) BST_MUST_CHECK;

/* The newest los_command of a port (NULL: none yet), and its age. */
const bst_los_command *bst_gimbal_command(struct bst_step *step, int port,
                                          const bst_gimbal_base *base, double *age_s);

/* Publishes the true attitude of the camera at this tick. */
void bst_gimbal_publish_sight(struct bst_step *step, const bst_platform *platform,
                              bst_quat q_cam_from_gcrf);

/* What encoders and attitude sensors say at a plant step. */
typedef struct bst_gimbal_reading {
    bst_quat q_cam_from_gcrf, q_body_from_gcrf;
    double axis_rad[2];
    bool settled, limited;
} bst_gimbal_reading;

/* That of a mount without axes that follows exactly, at plant step n: the body as measured. */
bst_gimbal_reading bst_gimbal_exact(const bst_platform *platform, int64_t n,
                                    bst_quat q_cam_from_body);

/* Publishes a reading and, with the body's part added, the mount's status (NULL: not published). */
void bst_gimbal_publish_reading(struct bst_step *step, const bst_platform *platform,
                                const bst_gimbal_reading *reading, bst_mount_status *status);

/* Publishes at plant step n, where it is time, the state that the spacecraft believes itself in,
 * the errors of its orbit and clock in it. Passes on errors of the view. */
bst_status bst_gimbal_publish_nav(struct bst_step *step, const bst_gimbal_base *base,
                                  int64_t n) BST_MUST_CHECK;

/* Both, for a mount that follows exactly and has no status: its reading and the state, where it is
 * time. */
bst_status bst_gimbal_publish_exact(struct bst_step *step, const bst_platform *platform,
                                    const bst_gimbal_base *base, int64_t n,
                                    bst_quat q_cam_from_body) BST_MUST_CHECK;

#endif
