#include "control/tasking/tasking.h"

#define L bst_tasking_line
static const bst_config_desc line_table[] = {
    BST_STRING(L, object, "\"\"",
               "Name of the object; empty: all whose apsides lie within the bounds."),
    BST_REALS(L, perigee_km, "km", -7000, 1e9, "[-7000, 1e9]",
              "Altitude of the osculating perigee at the epoch over 6378 km, from and to."),
    BST_REALS(L, apogee_km, "km", -7000, 1e9, "[-7000, 1e9]", "The same of the apogee."),
    BST_REAL(L, priority, "", 0, 1e6, "1", "What a target counts against others; 0: leave it out."),
    BST_REAL(L, revisit_s, "s", 1, 1e9, "3600",
             "It is to be seen again after this time: it is due then."),
    BST_REAL(L, sigma_m, "m", 0, 1e9, "0",
             "Above 0: it is due when the standard deviation of its place along the orbit exceeds "
             "this too; the more, the more urgent."),
    BST_INT(L, frames, "frames", 1, 1000000, "15", "Frames in which it is to be seen each time."),
    BST_CONFIG_END};
#undef L

#define T bst_tasking_config
const bst_config_desc bst_tasking_config_table[] = {
    BST_LIST(T, targets, bst_tasking_line, line_table, 1, 30000, "[{}]",
             "The targets: the first line that fits an object counts; what fits none is none."),
    BST_REAL(T, sun_keep_out_deg, "deg", 0, 179, "30", "Least angle to the Sun; 0: any."),
    BST_REAL(T, moon_keep_out_deg, "deg", 0, 179, "5", "Least angle to the Moon; 0: any."),
    BST_REAL(T, earth_limb_keep_out_deg, "deg", -60, 90, "5",
             "Least angle to the Earth's limb; negative: so far inside."),
    BST_REAL(T, earth_limb_altitude_km, "km", 0, 10000, "100",
             "Altitude of the limb that counts, the air's."),
    BST_REAL(T, min_snr, "", 0, 1e6, "8",
             "Least signal to noise that is expected of a frame, by the catalogue's brightness."),
    BST_REAL(T, max_rate_arcsec_per_s, "arcsec/s", 0, 1e6, "300",
             "Greatest rate of a target among the stars."),
    BST_REAL(T, slew_rate_deg_per_s, "deg/s", 1e-3, 1000, "2", "Mean rate of slews, for plans."),
    BST_REAL(T, settle_s, "s", 0, 3600, "10", "Time to settle and to confirm, for plans."),
    BST_REAL(T, find_timeout_s, "s", 1, 1e6, "60",
             "A target that has not been seen for this time, from the planned arrival or the last "
             "frame with it, is given up."),
    BST_REAL(T, retry_s, "s", 1, 1e6, "1800",
             "A sensor tries one that it has given up, or found too faint, no sooner than this."),
    BST_REAL(T, replan_interval_s, "s", 1, 1e6, "10",
             "A sensor for which there is nothing is planned for again after this time."),
    BST_FORMER("idle_s", "replan_interval_s"),
    BST_REAL(T, sigma_deg, "deg", 1e-6, 90, "0.05", "Error of the cues, 1 sigma per axis."),
    BST_REAL(T, rate_sigma_arcsec_per_s, "arcsec/s", 1e-6, 1e5, "0.5", "The same of their rates."),
    BST_REAL(T, v_mag_sigma, "mag", 0.01, 100, "1", "The same of their brightness."),
    BST_REAL(T, catalogue_sigma_m, "m", 1e-3, 1e9, "500",
             "For targets with sigma_m: standard deviation of the catalogue's places at the epoch "
             "of the elements."),
    BST_REAL(T, catalogue_drift_m_per_day, "m/day", 1e-3, 1e9, "1500",
             "Growth of this along the orbit in a day, 1 sigma."),
    BST_REAL(T, catalogue_noise_m_per_day, "m/day", 0, 1e9, "0",
             "Standard deviation of the drift gained in a day, as a random walk."),
    BST_REAL(T, report_every_s, "s", 0, 1e9, "3600",
             "An event says this often what no sensor can see, and why; 0: never."),
    BST_CONFIG_END};
#undef T
