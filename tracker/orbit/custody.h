/* Custody of a catalogue: a Kalman filter of the SGP4 mean elements of each object, fed with
 * directions and rates of tracks. */
#ifndef BST_TRACKER_ORBIT_CUSTODY_H
#define BST_TRACKER_ORBIT_CUSTODY_H

#include "sim/astro/elements.h"
#include "tracker/orbit/orbit_fit.h"

/* Components of a filter's state: differences from the catalogued elements, times what makes them
 * distances, m. With a the semi-major axis:
 *   DRIFT   a dn per day, n the mean motion: distance gained along the orbit in a day
 *   ECC_X   2 a d(e cos(omega + Omega)),  ECC_Y  2 a d(e sin(omega + Omega))
 *   PLANE_X 2 a cos^2(i/2) d(tan(i/2) cos Omega),  PLANE_Y the same with sin Omega
 *   ALONG   a d(lambda), lambda the mean longitude at time 0
 * Regular for circular and equatorial orbits, not at 180 degrees of inclination. */
enum {
    BST_CUSTODY_DRIFT,
    BST_CUSTODY_ECC_X,
    BST_CUSTODY_ECC_Y,
    BST_CUSTODY_PLANE_X,
    BST_CUSTODY_PLANE_Y,
    BST_CUSTODY_ALONG,
    BST_CUSTODY_STATE
};

enum { BST_CUSTODY_DIRECTIONS = 16 }; /* most of an update */

/* Whether SGP4's periodics are not smooth in its elements, and differences are those of osculating
 * elements: at inclinations below 0.2 degrees (Lyddane's, by Sun and Moon: 0.02 degrees), and at
 * eccentricities below 1e-3 in orbits of 225 minutes or longer, whose eccentricity Sun and Moon
 * change along the line of apsides, which a circular orbit lacks (up to 90 m at 26,560 km). */
static inline bool bst_custody_osculates(const bst_elements *e) {
    return e->inclination_rad < 0.2 * BST_DEG_RAD ||
           (e->eccentricity < 1e-3 && e->mean_motion_radpmin < 2.0 * BST_PI / 225.0);
}

typedef struct bst_custody_config {
    double sigma_m;         /* of each component except DRIFT, at the epoch of the elements */
    double drift_m_per_day; /* standard deviation of DRIFT */
    /* process noise: standard deviation of DRIFT gained in a day, as a random walk */
    double noise_m_per_day;
} bst_custody_config;

/* An object as catalogued; time 0 is the epoch of the run. */
typedef struct bst_custody_orbit {
    bst_elements elements;
    double epoch_offset_s; /* time 0 minus the epoch of the elements */
    double a_m;            /* semi-major axis */
    /* standard deviation of the photocentre from the centre of mass along each axis, m, where
     * bst_od_photocentre_factor is 1 */
    double photocentre_m;
} bst_custody_orbit;

/* Filter of an object. */
typedef struct bst_custody_filter {
    double x[BST_CUSTODY_STATE];                    /* m */
    double p[BST_CUSTODY_STATE][BST_CUSTODY_STATE]; /* m^2 */
    double noise_until_s;                           /* process noise is in `p` until this time */
} bst_custody_filter;

/* Direction and rate of a track: one observation, with errors of its own. */
typedef struct bst_custody_observation {
    bst_od_observer observer;
    bst_mat3 gcrf_from_teme; /* at the time of the observer */
    bst_vec3 direction;      /* unit, geometric, GCRF */
    bst_vec3 rate_radps;     /* perpendicular to it */
    double covariance[4][4]; /* d1, d2, r1, r2 in the tangent axes at the direction, as in bst_track
                              */
    /* factor on the standard deviation of the photocentre; 0: not known, it is taken for 1 */
    double photocentre_factor;
} bst_custody_observation;

/* An observation as a filter predicts it. */
typedef struct bst_custody_prediction {
    double innovation[4];    /* observed minus predicted, in the tangent axes at the observation */
    double covariance[4][4]; /* of the innovation */
    double chi2;             /* innovation' covariance^-1 innovation; 4 degrees of freedom */
    double log_determinant;  /* of the covariance */
} bst_custody_prediction;

/* Sets the orbit of a catalogued object.
 *
 * Errors:    BST_ERR_NUMERIC for elements that are no ellipse: message with name, number and range
 */
bst_status bst_custody_orbit_init(bst_ctx *ctx, const bst_elements *elements, double epoch_offset_s,
                                  double photocentre_m, bst_custody_orbit *out) BST_MUST_CHECK;

/* Starts a filter with the covariance of the catalogue. Its error is drawn from that covariance:
 * `normals` are standard normal deviates; NULL: none. */
void bst_custody_filter_init(const bst_custody_config *config, const bst_custody_orbit *orbit,
                             const double normals[BST_CUSTODY_STATE], bst_custody_filter *out);

/* Adds the process noise until `time_s`: a random walk of the mean motion, which spreads places
 * along the orbit. The sum does not depend on the number of steps. Earlier times change nothing.
 * Reference: Bar-Shalom, Li and Kirubarajan (2001), ch. 6.2.2: white noise acceleration; here with
 * the place at time 0 as state. */
void bst_custody_add_process_noise(const bst_custody_config *config, double time_s,
                                   bst_custody_filter *filter);

/* Predicts an observation, with the mean and the covariance of second order. False: SGP4 has no
 * state there, or the covariance is singular. */
bool bst_custody_predict(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                         const bst_custody_observation *observation, bst_custody_prediction *out);

/* Updates a filter with an observation of its object. The observation is made linear over the
 * states that are left after the update, again and again until these settle, and what a line leaves
 * of its curvature counts as noise: iterated posterior linearisation (Garcia-Fernandez, Svensson,
 * Morelande and Sarkka, "Posterior linearization filter: principles and implementation using sigma
 * points", IEEE Transactions on Signal Processing 63, 2015), with second-order differences along
 * the columns of the covariance's root (Norgaard, Poulsen and Ravn, Automatica 36, 2000); Joseph's
 * form. Without the curvature, covariances of orbits with strong drag are too small. False: as
 * bst_custody_predict; the filter is as before. */
bool bst_custody_update(const bst_custody_orbit *orbit, const bst_custody_observation *observation,
                        bst_custody_filter *filter);

/* The same with directions as they were measured, without rates: errors that they share count
 * (bst_od_observation). Single directions far off the others are left out, and the covariances are
 * scaled by the variance of unit weight of the arc (Koch, Parameter Estimation and Hypothesis
 * Testing in Linear Models, 1999, 4.3). False also for directions that are of another object or of
 * several ones: a chi-square of the innovations that is exceeded with probability 2e-5 by errors
 * twice as large as stated.
 *
 * Given:     count           1 to BST_CUSTODY_DIRECTIONS, in order of time
 *            gcrf_from_teme  at the first and at the last of them: of a near object a direction of
 *                            two milliarcseconds shows the precession of half a minute */
bool bst_custody_update_directions(const bst_custody_orbit *orbit, const bst_mat3 gcrf_from_teme[2],
                                   const bst_od_observation *directions, int count,
                                   bst_custody_filter *filter);

/* State (TEME, m and m/s) at `time_s` on the elements that differ from the orbit's by x. False:
 * none.
 */
bool bst_custody_state(const bst_custody_orbit *orbit, const double x[BST_CUSTODY_STATE],
                       double time_s, bst_vec3 *position_teme_m, bst_vec3 *velocity_teme_mps);

/* Position (TEME, m) on the catalogued elements at `time_s`. False: no state. */
bool bst_custody_catalogued_position(const bst_custody_orbit *orbit, double time_s,
                                     bst_vec3 *position_teme_m);

/* Position (TEME, m) at `time_s`, and its standard deviation, the root of the sum over three axes.
 * False: no state, or the covariance is singular. */
bool bst_custody_predict_position(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                                  double time_s, bst_vec3 *position_teme_m, double *sigma_m);

/* Lower triangular root of a covariance; the rest of `root` is 0. False: it is singular. */
bool bst_custody_root(const double p[BST_CUSTODY_STATE][BST_CUSTODY_STATE],
                      double root[BST_CUSTODY_STATE][BST_CUSTODY_STATE]) BST_MUST_CHECK;

/* Normalised estimation error squared against an object that moves on its catalogued elements; 6
 * degrees of freedom. NAN: the covariance is singular. */
double bst_custody_nees(const bst_custody_filter *filter);

/* A state with its covariance: TEME, m and m/s, order r, v. */
typedef struct bst_custody_fix {
    double time_s;          /* since the epoch of the run */
    double epoch_utc_jd[2]; /* the same as a Julian date in two parts */
    bst_vec3 position_m, velocity_mps;
    double covariance[6][6];
} bst_custody_fix;

/* Orbit and filter of a new object.
 *
 * Given:     fix            at what becomes the epoch of the elements; its velocity is the
 *                           derivative of positions
 *            photocentre_m  as in bst_custody_orbit
 * Returned:  elements without drag (B* 0), and a filter about them; false: no SGP4 orbit there, or
 *            the covariance is singular
 * Notes:     the covariance is carried to the elements by central differences of one standard
 *            deviation along the columns of its root, with the curvature along them; near the
 * equator to osculating ones. The fit takes directions as those of the centre of mass, so that the
 * photocentre's distance is added to the position, and times v / r to the velocity.
 */
bool bst_custody_start(const bst_custody_fix *fix, double photocentre_m, bst_custody_orbit *orbit,
                       bst_custody_filter *filter);

/* Standard deviation of the drift that an object gains in a day as a random walk, so that its place
 * a day after the epoch of its elements is as uncertain as by an unknown B* of 3e-4 per Earth
 * radius, m. 0: no drag there. */
double bst_custody_drag_noise_m_per_day(const bst_custody_orbit *orbit);

/* Differences of the osculating elements of a filter's orbit from those of a state at `time_s`, in
 * components as those of a filter but with ALONG at that time, and their covariance, to first
 * order. bst_custody_nees(out) is the squared error of an orbit whose true state that is, and the
 * sum of two such covariances belongs to the difference of two orbits. False: no state, or the
 * covariance is singular. */
bool bst_custody_difference(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                            double time_s, bst_vec3 position_teme_m, bst_vec3 velocity_teme_mps,
                            bst_custody_filter *out);

#endif
