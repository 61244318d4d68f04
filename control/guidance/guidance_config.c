#include "control/guidance/guidance.h"

static const char *const slews[] = {"mount", "planned", NULL};

#define G bst_guidance_config
const bst_config_desc bst_guidance_config_table[] = {
    BST_REAL(G, sun_keep_out_deg, "deg", 0, 179, "0",
             "The boresight keeps this far from the Sun; 0: no matter."),
    BST_REAL(G, moon_keep_out_deg, "deg", 0, 179, "0",
             "The boresight keeps this far from the Moon; 0: no matter."),
    BST_BOOL(G, earth_keep_out, "false", "The boresight keeps away from the Earth's limb."),
    BST_REAL(G, earth_limb_keep_out_deg, "deg", -90, 90, "0",
             "With earth_keep_out: how far beyond the limb; negative: so far inside."),
    BST_REAL(G, earth_limb_altitude_km, "km", 0, 10000, "100",
             "With earth_keep_out: altitude of the limb that counts, the air's."),
    BST_ENUM(
        G, slews, slews, "\"mount\"",
        "mount: a command jumps to the new aim and the mount gets there by itself. planned: by "
        "the fastest motion of the axes. Keep-out zones plan slews in any case."),
    BST_REAL(G, min_planned_slew_deg, "deg", 0.001, 180, "1",
             "Slews are planned above this distance."),
    BST_FORMER("slew_above_deg", "min_planned_slew_deg"),
    BST_REAL(G, limit_fraction, "", 0.1, 1, "0.95",
             "Share of the mount's rate and acceleration limits that plans and predictions use."),
    BST_FORMER("limits_share", "limit_fraction"),
    BST_REAL(G, prediction_horizon_s, "s", 0, 86400, "0",
             "How far ahead of the aim limits, keep-out zones, the Earth and the mount's pole are "
             "looked for, and turns of the cable chosen; 0: not at all."),
    BST_FORMER("look_ahead_s", "prediction_horizon_s"),
    BST_REAL(G, prediction_interval_s, "s", 0.1, 86400, "10", "Time between two looks ahead."),
    BST_FORMER("look_ahead_every_s", "prediction_interval_s"),
    BST_REAL(G, loss_tolerance_px, "px", 0.01, 1e5, "2",
             "A target that passes the pole counts as lost beyond this distance."),
    BST_BOOL(G, acceleration_feed_forward, "false",
             "Commands carry the aim's acceleration: for lines of sight whose rate changes within "
             "a control period."),
    BST_FORMER("acceleration", "acceleration_feed_forward"),
    BST_BOOL(G, body_roll, "false",
             "A rigid_body spacecraft rolls about the axis of its pointing law where that keeps a "
             "target out of the mount's keyhole that prediction_horizon_s sees coming."),
    BST_CONFIG_END};
#undef G
