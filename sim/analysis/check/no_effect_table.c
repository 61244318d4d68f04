/* The keys that depend on another key: one entry for each group with the same conditions. */
#include "sim/analysis/check/no_effect.h"

#define ORBITS "/observers/*/orbit /world/objects/*/orbit"
#define BRIGHTNESS                                                \
    "/world/objects/*/brightness /world/catalogues/*/brightness " \
    "/world/constellations/*/brightness"
#define OBJECT "/world/objects/*"
#define SENSOR "/observers/*/sensors/*"
#define CAMERA SENSOR "/camera"
#define DETECTOR CAMERA "/detector"
#define GIMBAL SENSOR "/modules/gimbal"
#define PLATFORM GIMBAL "/platform"
#define CRAFT PLATFORM "/spacecraft"
#define CONTROL SENSOR "/modules/control"
#define COMPENSATORS GIMBAL "/servo/compensator " CONTROL "/compensator"
#define TRACKER SENSOR "/modules/tracker"
#define IMGPROC SENSOR "/modules/imgproc"

#define OFF(key_) \
    { .key = key_, .test = BST_WHEN_OFF }
#define ON(key_) \
    { .key = key_, .test = BST_WHEN_ON }
#define IS(key_, words_) \
    { .key = key_, .test = BST_WHEN_IS, .words = words_ }
#define IS_NOT(key_, words_) \
    { .key = key_, .test = BST_WHEN_IS_NOT, .words = words_ }
#define LACKS(key_, word_) \
    { .key = key_, .test = BST_WHEN_LACKS, .words = word_ }

const bst_no_effect bst_no_effect_table[] = {
    /* what is written, the clock, the link */
    {"/record", "detections_of", {OFF("detections")}},
    {"/record", "truth_stars", {OFF("truth")}},
    {"/record", "custody_timeout_s", {OFF("sightings")}},
    {"/record",
     "custody_sigma_m custody_drift_m_per_day custody_noise_m_per_day custody_within_m "
     "custody_unknown_share",
     {OFF("custody")}},
    {"/record", "mask_threshold_sigma", {LACKS("planes", "segmentation")}},
    {"/pacing", "overrun speed deadline_s priority cpu", {IS("mode", "lockstep")}},
    {"/link", "keys_file shared_memory", {OFF("address")}},

    /* orbits */
    {ORBITS,
     "elements_file norad tle_line1 tle_line2",
     {IS("source", "relative oem injected constellation")}},
    {ORBITS,
     "elements_file norad tle_line1 tle_line2",
     {IS("source", "numerical"), IS_NOT("state/source", "element_set")}},
    {ORBITS,
     "reference offset_rtn_m rate_rtn_mps",
     {IS("source", "sgp4 oem injected constellation")}},
    {ORBITS,
     "reference offset_rtn_m rate_rtn_mps",
     {IS("source", "numerical"), IS_NOT("state/source", "relative")}},
    {ORBITS, "at_s", {IS_NOT("source", "relative")}},
    {ORBITS, "oem_file oem_object", {IS_NOT("source", "oem")}},
    {ORBITS, "states_file states_object states_frame", {IS_NOT("source", "injected")}},
    {ORBITS, "constellation member", {IS_NOT("source", "constellation")}},
    {ORBITS,
     "state forces/gravity forces/degree forces/order forces/sun forces/moon "
     "forces/solar_pressure forces/drag forces/tolerance spacecraft/mass_kg "
     "spacecraft/drag_area_m2 spacecraft/srp_area_m2 spacecraft/cr",
     {IS_NOT("source", "numerical")}},
    {"/observers/*/orbit", "forces/density_scale spacecraft/cd", {IS_NOT("source", "numerical")}},
    /* they also count for the torques of air on the object's shape */
    {OBJECT,
     "orbit/forces/density_scale orbit/spacecraft/cd",
     {IS_NOT("orbit/source", "numerical"), OFF("attitude")}},
    {ORBITS,
     "state/position_gcrf_m state/velocity_gcrf_mps",
     {IS("source", "numerical"), IS_NOT("state/source", "cartesian")}},
    {ORBITS,
     "state/semi_major_axis_m state/perigee_radius_m state/eccentricity state/inclination_deg "
     "state/raan_deg state/arg_perigee_deg state/true_anomaly_deg state/mean_anomaly_deg",
     {IS("source", "numerical"), IS_NOT("state/source", "keplerian")}},
    {ORBITS,
     "forces/degree forces/order",
     {IS("source", "numerical"), IS("forces/gravity", "two_body j6")}},
    {ORBITS, "spacecraft/drag_area_m2", {IS("source", "numerical"), OFF("forces/drag")}},
    {ORBITS,
     "spacecraft/srp_area_m2 spacecraft/cr",
     {IS("source", "numerical"), OFF("forces/solar_pressure")}},

    /* objects: brightness, attitude, shape */
    {BRIGHTNESS, "standard_v_mag", {IS_NOT("model", "standard_magnitude")}},
    {BRIGHTNESS, "light_curve_file light_curve_period_s", {IS_NOT("model", "light_curve")}},
    {BRIGHTNESS, "earth_albedo", {OFF("earthshine"), IS("heat_balance", "none")}},
    {BRIGHTNESS, "earth_infrared_w_per_m2", {IS("heat_balance", "none")}},
    {OBJECT, "attitude", {IS_NOT("brightness/model", "shape")}},
    {OBJECT "/attitude/*", "rotation_deg", {IS("law", "inertial spin tumble table")}},
    {OBJECT "/attitude/*", "quaternion", {IS_NOT("law", "inertial spin tumble")}},
    {OBJECT "/attitude/*", "rate_body_deg_per_s", {IS_NOT("law", "spin tumble")}},
    {OBJECT "/attitude/*", "inertia_kg_m2 torques", {IS_NOT("law", "tumble")}},
    {OBJECT "/attitude/*", "file object", {IS_NOT("law", "table")}},
    {OBJECT "/shape/materials/*",
     "model diffuse volume specular exponent roughness tau_deg omega_deg binomial_b binomial_c "
     "binomial_base binomial_first_power table_file",
     {IS_NOT("library", "none")}},
    {OBJECT "/shape/materials/*", "volume tau_deg omega_deg", {IS_NOT("model", "maxwell_beard")}},
    {OBJECT "/shape/materials/*", "exponent", {IS_NOT("model", "phong ashikhmin_shirley")}},
    {OBJECT "/shape/materials/*", "roughness", {IS_NOT("model", "cook_torrance maxwell_beard")}},
    {OBJECT "/shape/materials/*",
     "binomial_b binomial_c binomial_base binomial_first_power",
     {IS_NOT("model", "binomial")}},
    {OBJECT "/shape/materials/*", "table_file", {IS_NOT("model", "table")}},
    {OBJECT "/shape/joints/*", "file", {IS_NOT("follows", "table")}},
    {OBJECT "/shape/joints/*", "burn turn_deg", {IS_NOT("follows", "burn")}},
    {OBJECT "/shape/joints/*", "rate_deg_per_s", {IS_NOT("follows", "spin burn")}},
    {OBJECT "/shape/parts/*", "size_m", {IS_NOT("kind", "box plate")}},
    {OBJECT "/shape/parts/*", "radius_m", {IS_NOT("kind", "cylinder cone sphere dish")}},
    {OBJECT "/shape/parts/*", "top_radius_m", {IS_NOT("kind", "cone")}},
    {OBJECT "/shape/parts/*", "length_m", {IS_NOT("kind", "cylinder cone dish")}},
    {OBJECT "/shape/parts/*", "open", {IS_NOT("kind", "cylinder cone")}},
    {OBJECT "/shape/parts/*", "file scale", {IS_NOT("kind", "mesh")}},
    {OBJECT "/shape/parts/*", "back_material", {IS_NOT("kind", "plate dish")}},
    {OBJECT "/shape/parts/*", "segments", {IS("kind", "box plate mesh")}},
    {"/world", "faint_limit_v_mag faint_seed", {IS("faint_stars", "none")}},

    /* exposures, the cue, what is known on board */
    {SENSOR "/exposure", "dropped_burst_frames", {OFF("dropped_fraction")}},
    {SENSOR "/cue", "direction_radec_deg", {ON("object")}},
    {SENSOR "/cue", "direction_radec_deg", {OFF("object"), IS_NOT("region/kind", "none")}},
    {SENSOR "/cue", "offset_axis offset_angle_deg", {OFF("offset_deg")}},
    {SENSOR "/cue/region", "arc_radec_deg", {IS_NOT("kind", "arc")}},
    {SENSOR "/cue/region", "longitude_deg", {IS_NOT("kind", "geostationary")}},
    {SENSOR "/cue/region", "half_width_deg", {IS("kind", "none")}},
    {SENSOR "/knowledge/stars", "position_error_sigma_arcsec", {OFF("position_error_fraction")}},
    {SENSOR "/knowledge/stars", "position_error_fraction", {OFF("position_error_sigma_arcsec")}},
    {SENSOR "/knowledge/stars", "seed", {OFF("missing_fraction"), OFF("position_error_fraction")}},
    {SENSOR "/knowledge/camera", "distortion", {OFF("override_distortion")}},
    {SENSOR "/knowledge/camera", "psf_oversampling", {OFF("psf_file")}},

    /* optics and sky */
    {CAMERA, "optics/moffat_beta", {IS_NOT("optics/psf", "moffat")}},
    {CAMERA "/optics",
     "q band_nm spectrum wavelengths central_obstruction spiders zernike_nm zernike_waves "
     "defocus_um",
     {IS_NOT("psf", "diffraction")}},
    {CAMERA "/optics", "psf_file psf_oversampling file_centre", {IS_NOT("psf", "file")}},
    {CAMERA "/optics",
     "spiders/width_m spiders/angle_deg",
     {IS("psf", "diffraction"), OFF("spiders/count")}},
    {CAMERA "/optics/vignetting", "coefficients", {IS_NOT("model", "polynomial")}},
    {CAMERA "/band",
     "optics_temperature_k optics_emissivity optics_beam_factor",
     {IS("preset", "v"), OFF("response"), OFF("response_file")}},
    {CAMERA, "background_mag_arcsec2", {IS("background/model", "sky")}},
    {CAMERA "/background",
     "zodiacal starlight diffuse_galactic_fraction pst pst_file",
     {IS("model", "uniform")}},
    {CAMERA "/background",
     "earth_albedo earth_night_mag_arcsec2 earth_temperature_k limb_scale_height_m",
     {OFF("earth")}},
    {CAMERA "/background", "stray_map stray_map_scale", {OFF("stray_map_file")}},
    {CAMERA "/ghosts/*", "factor centre_px", {ON("map_file")}},

    /* the detector */
    {CAMERA, "detector/dsnu_rms", {OFF("dark_current_e_per_s")}},
    {DETECTOR, "hot_median_e_per_s hot_spread_dex", {OFF("hot_fraction")}},
    {DETECTOR, "telegraph_noise_rms_e", {OFF("telegraph_noise_fraction")}},
    {DETECTOR, "telegraph_noise_fraction", {OFF("telegraph_noise_rms_e"), OFF("ramp/reads")}},
    {DETECTOR "/cosmic_rays",
     "pixel_pitch_um depth_um e_per_um straggling readout_s",
     {OFF("rate_per_cm2_s")}},
    {DETECTOR "/quantisation", "bits", {IS_NOT("model", "square_root")}},
    {DETECTOR "/quantisation", "table", {IS_NOT("model", "table")}},
    {DETECTOR "/quantisation", "expand", {IS("model", "uniform")}},
    {DETECTOR "/pick_up", "cycles_per_px cycles_per_row phase_deg", {OFF("amplitude_e")}},
    {DETECTOR "/glow", "scale_px x_px y_px", {OFF("peak_e")}},
    {DETECTOR "/parallel_traps", "release_px fill_exponent reference_e", {OFF("traps_per_px")}},
    {DETECTOR "/serial_traps", "release_px fill_exponent reference_e", {OFF("traps_per_px")}},
    {DETECTOR "/persistence", "time_constant_s", {OFF("trapped_share")}},
    {DETECTOR "/ramp", "fit flicker_noise_e", {OFF("reads")}},
    {DETECTOR "/pixel_flicker_noise", "lowest_hz highest_hz", {OFF("rms_e")}},
    {DETECTOR "/crosstalk", "coupling mirrored", {IS("outputs", "1")}},

    /* mounts and spacecraft */
    {GIMBAL, "object", {IS("type", "ideal"), IS_NOT("target", "object")}},
    {GIMBAL, "ra_deg dec_deg", {IS("type", "ideal"), IS_NOT("target", "direction")}},
    {GIMBAL, "star_tyc", {IS("type", "ideal"), IS_NOT("target", "star")}},
    {GIMBAL, "inertia_third_kgm2", {OFF("third_axis")}},
    {GIMBAL "/fault", "stuck_from_s", {IS("stuck_axis", "none")}},
    {GIMBAL "/flexible", "damping inertia_fraction line_of_sight_fraction", {OFF("frequency_hz")}},
    {PLATFORM, "jitter_low_cutoff_hz", {OFF("jitter_low_px_rms")}},
    {PLATFORM, "jitter_high_band_hz", {OFF("jitter_high_px_rms")}},
    {PLATFORM "/jitter_psd/lines/*", "phase_deg", {ON("random_phase")}},
    {PLATFORM,
     "drift_arcsec_per_s attitude_bias_arcsec attitude_noise_arcsec",
     {IS("spacecraft/type", "rigid_body")}},
    {CRAFT,
     "integrator inertia_kgm2 initial_attitude_error_deg initial_rate_degps "
     "initial_knowledge_arcsec filter_warm_up_s wheels modes star_trackers gyro disturbances "
     "attitude",
     {IS("type", "inertial")}},
    {CRAFT "/wheels/*", "position_m", {OFF("static_imbalance_kgm")}},
    {CRAFT "/disturbances", "cr centre_of_pressure_m", {OFF("srp_area_m2"), OFF("shape_file")}},
    {CRAFT "/disturbances", "srp_area_m2 cr centre_of_pressure_m", {ON("shape_file")}},
    {CRAFT "/disturbances", "centre_of_mass_m drag cd", {OFF("shape_file")}},
    {CRAFT "/disturbances", "cd", {ON("shape_file"), OFF("drag")}},

    /* control */
    {COMPENSATORS, "derivative_filter_hz integral_ratio", {IS("type", "pi")}},
    {COMPENSATORS,
     "lead_zero_hz lead_pole_hz lag_zero_hz lag_pole_hz",
     {IS("type", "pi pid observer")}},
    {CONTROL "/compensator",
     "bandwidth_hz crossover_hz phase_margin_deg integral_ratio proportional integral_per_s "
     "derivative_s derivative_filter_hz gain notches low_pass_hz prewarp_hz feed_forward "
     "output_limit output_rate_limit_per_s anti_windup_s",
     {IS("type", "observer")}},
    {CONTROL, "compensator robust_observer servo_lag_s", {OFF("compensate_attitude")}},
    {CONTROL, "stare_time_s", {IS_NOT("strategy", "stare")}},
    {CONTROL, "fixed_frame fixed_direction", {IS_NOT("strategy", "fixed")}},
    {CONTROL, "scan_rate_arcsec_per_s", {IS_NOT("strategy", "scan")}},
    {SENSOR,
     "modules/control/search_rate",
     {IS("modules/control/strategy", "track"), IS("cue/region/kind", "none")}},
    {CONTROL,
     "search_pattern search_rate search_timeout_s search_sigmas search_max_deg search_step "
     "dwell_frames dwell_timeout_s candidate_hits candidate_rate_sigmas candidate_score "
     "acquire_timeout_s track_handover_px reacquire_coast_s reacquire_extent_deg",
     {IS_NOT("strategy", "track")}},
    {CONTROL "/guidance",
     "earth_limb_keep_out_deg earth_limb_altitude_km",
     {OFF("earth_keep_out")}},
    {CONTROL "/guidance",
     "prediction_interval_s loss_tolerance_px body_roll",
     {OFF("prediction_horizon_s")}},
    {"/tasking/targets/*", "perigee_km apogee_km", {ON("object")}},

    /* tracker */
    {TRACKER,
     "assumed_range_km range_sigma range_rate_sigma_mps size_range_correlation_s "
     "orbit_noise_mps15",
     {IS("motion", "constant_rate")}},
    {TRACKER, "steady_noise_share", {IS("type", "imm")}},
    {TRACKER, "false_events_per_hour", {OFF("event_window")}},
    {TRACKER, "event_window", {OFF("false_events_per_hour")}},
    {TRACKER, "max_dormant_s max_dormant_sigma_deg dormant_gate_chi2", {OFF("max_dormant_tracks")}},
    {TRACKER, "navigation_sigma_m", {OFF("clock_sigma_s")}},

    /* image processing */
    {IMGPROC, "window_px window_stars full_frame_period full_frame_count", {OFF("track_windows")}},
    {IMGPROC, "lost_scale_tolerance", {IS("attitude", "telemetry"), OFF("lost_after_frames")}},
    {IMGPROC "/camera_calibration",
     "scale_sigma rotation_sigma_deg distortion_sigma_px telemetry_roll_sigma_arcsec "
     "drift_px_per_sqrt_h star_sigma_px",
     {OFF("enabled")}},
    {IMGPROC "/stack", "rate_px_per_frame false_alarms_per_frame", {OFF("frames")}},
    {IMGPROC "/extended",
     "handover_fwhm return_share join_share phase_offset_factor centre_sigma target_size_m "
     "target_size_sigma_m",
     {OFF("enabled")}},
    {IMGPROC "/extended", "target_size_sigma_m", {ON("enabled"), OFF("target_size_m")}},
    {IMGPROC "/reference_pixels", "smooth_rows alternating_columns", {OFF("enabled")}},
    {IMGPROC "/bad_pixel_learning", "capacity false_alarm_probability", {OFF("enabled")}},

    {.where = NULL},
};
