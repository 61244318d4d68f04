#include "gimbal/spacecraft/spacecraft_config.h"

static const char *const type_names[] = {"inertial", "rigid_body", NULL};

#define C bst_spacecraft_mode_config
static const bst_config_desc mode_table[] = {
    BST_REAL(C, frequency_hz, "Hz", 1e-4, 10000, NULL,
             "Of the appendage on a fixed hub; on the free craft it is higher."),
    BST_REAL(C, damping, "", 0, 0.99, "0.005", "Damping ratio."),
    BST_REALS(C, coupling, "sqrt(kg) m", -1e3, 1e3, NULL,
              "Angular momentum about the body axes per unit speed of the mode."),
    BST_CONFIG_END};
#undef C

#define C bst_spacecraft_attitude_config
static const bst_config_desc attitude_table[] = {
    BST_ENUM(C, law, bst_law_names, "\"inertial\"",
             "What the body is kept on: `inertial`, the attitude of the epoch; `nadir`, axis to "
             "the Earth's centre and second axis along the velocity; `sun`, axis to the Sun; "
             "`target`, axis to the cue; `free`, nothing."),
    BST_REALS(C, axis, "", -1e6, 1e6, "[0, 0, 1]", "Body axis that points, any length."),
    BST_REALS(C, second_axis, "", -1e6, 1e6, "[1, 0, 0]",
              "Body axis that fixes the turn about the first."),
    BST_REAL(C, roll_deg, "deg", -360, 360, "0",
             "Turn of the body about `axis` on top of the law."),
    BST_REAL(C, rate_hz, "Hz", 0.01, 10000, "50",
             "Rate of the attitude controller; divides the plant's rate."),
    BST_REAL(C, bandwidth_hz, "Hz", 1e-5, 100, "0.05", "Natural frequency of the attitude loop."),
    BST_REAL(C, damping, "", 0.1, 10, "0.9", "Its damping ratio."),
    BST_REAL(C, integral_hz, "Hz", 0, 100, "0.002",
             "Below this frequency the integral part is the larger; 0: none."),
    BST_REAL(C, rate_limit_degps, "deg/s", 1e-6, 100, "0.5", "Greatest rate of a slew."),
    BST_REAL(C, accel_limit_degps2, "deg/s^2", 1e-6, 100, "0.1",
             "Greatest acceleration of a slew."),
    BST_CONFIG_END};
#undef C

#define C bst_spacecraft_config
const bst_config_desc bst_spacecraft_config_table[] = {
    BST_ENUM(C, type, type_names, "\"inertial\"",
             "`inertial`: held but for drift_arcsec_per_s, known but for attitude_bias_arcsec and "
             "attitude_noise_arcsec. `rigid_body`: dynamics, wheels, sensors and controller of the "
             "keys below, and none of those three."),
    BST_ENUM(C, integrator, bst_integrator_names, "\"symplectic\"",
             "How the attitude is stepped; errors are in docs/how-to/spacecraft.md."),
    BST_REALS(C, inertia_kgm2, "kg m^2", -1e9, 1e9, "[12, 14, 10, 0, 0, 0]",
              "Inertia tensor of all but a full mount, whose reaction has its share, wheels and "
              "appendages with it, about the centre of mass: xx, "
              "yy, zz, xy, xz, yz."),
    BST_REALS(C, initial_attitude_error_deg, "deg", -180, 180, "[0, 0, 0]",
              "Turn of the body, about its axes, from the attitude that the law wants at the "
              "epoch."),
    BST_FORMER("initial_turn_deg", "initial_attitude_error_deg"),
    BST_REALS(C, initial_rate_degps, "deg/s", -1000, 1000, "[0, 0, 0]",
              "Rate of the body at the epoch on top of the law's, body axes."),
    BST_REAL(C, initial_knowledge_arcsec, "arcsec", 1e-6, 648000, "3",
             "Standard deviation of the believed attitude's error about each axis when its filter "
             "begins."),
    BST_REAL(
        C, filter_warm_up_s, "s", 0, 86400, "600",
        "How long the filter has been running at the epoch, on a body that turned evenly, with "
        "the star trackers that see stars then (with all, where none does); 0: it begins."),
    BST_FORMER("running_s", "filter_warm_up_s"),
    BST_LIST(C, wheels, bst_wheel_config, bst_wheel_config_table, 0, BST_WHEELS_MOST, "[]",
             "Reaction wheels. None given: four like the default one on the edges of a pyramid "
             "about z, at [1, 1, 1] and so on; with the law `free` none."),
    BST_LIST(C, modes, bst_spacecraft_mode_config, mode_table, 0, BST_MODES_MOST, "[]",
             "Flexible modes of appendages."),
    BST_LIST(C, star_trackers, bst_spacecraft_star_tracker_config, bst_star_tracker_config_table, 0,
             BST_TRACKERS_MOST, "[]",
             "Star trackers. None given: two like the default one, along +y and -y, of which one "
             "always looks away from the Earth."),
    BST_OBJECT(C, gyro, bst_gyro_config_table, "{}", "The gyro."),
    BST_OBJECT(C, disturbances, bst_disturbance_config_table, "{}", "Torques of the surroundings."),
    BST_OBJECT(C, attitude, attitude_table, "{}", "Pointing law and attitude controller."),
    BST_CONFIG_END};
#undef C

bst_spacecraft_attitude_control_spec bst_spacecraft_attitude_control_of(
    const bst_spacecraft_config *config) {
    const bst_spacecraft_attitude_config *a = &config->attitude;
    return (bst_spacecraft_attitude_control_spec){
        .natural_radps = 2.0 * BST_PI * a->bandwidth_hz,
        .damping = a->damping,
        .integral_radps = 2.0 * BST_PI * a->integral_hz,
        .rate_limit_radps = a->rate_limit_degps * BST_DEG_RAD,
        .accel_limit_radps2 = a->accel_limit_degps2 * BST_DEG_RAD,
        .dt_s = 1.0 / a->rate_hz,
        .inertia_kgm2 = bst_spacecraft_inertia_matrix(config->inertia_kgm2)};
}

#define WHEEL(x, y) \
    { .axis = {x, y, 1}, .inertia_kgm2 = 0.001, .torque_limit_nm = 0.05, .speed_limit_rpm = 6000 }
#define TRACKER(y)                                                                         \
    {                                                                                      \
        .axis = {0, y, 0}, .noise_arcsec = 3, .noise_about_axis_arcsec = 20, .rate_hz = 4, \
        .latency_s = 0.1, .sun_exclusion_deg = 30, .earth_exclusion_deg = 20,              \
        .rate_limit_degps = 2                                                              \
    }

const bst_wheel_config *bst_spacecraft_wheels(const bst_spacecraft_config *config, int *count) {
    static const bst_wheel_config pyramid[4] = {WHEEL(1, 1), WHEEL(-1, 1), WHEEL(-1, -1),
                                                WHEEL(1, -1)};
    bool given = config->wheels.count > 0 || config->attitude.law == BST_LAW_FREE;
    *count = given ? config->wheels.count : 4;
    return given ? config->wheels.items : pyramid;
}

const bst_spacecraft_star_tracker_config *bst_spacecraft_trackers(
    const bst_spacecraft_config *config, int *count) {
    static const bst_spacecraft_star_tracker_config pair[2] = {TRACKER(1), TRACKER(-1)};
    bool given = config->star_trackers.count > 0;
    *count = given ? config->star_trackers.count : 2;
    return given ? config->star_trackers.items : pair;
}
