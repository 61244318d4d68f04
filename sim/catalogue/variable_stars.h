/* Brightness of variable stars, and parallax: what of a star changes with the observer's place and
 * time. */
#ifndef BST_CATALOGUE_VARIABLE_STARS_H
#define BST_CATALOGUE_VARIABLE_STARS_H

#include "sim/catalogue/star_index.h"
#include "sim/catalogue/stars.h"

/* Observer of a query. */
typedef struct bst_star_observer {
    double years;          /* after J2000 */
    double jd;             /* Julian date (TDB) */
    bst_vec3 barycentre_m; /* observer relative to the solar-system barycentre, ICRS axes */
    bool at_barycentre;    /* no parallax, no light time */
} bst_star_observer;

/* Observer of an epoch.
 *
 * Given:     view  a catalogue without parallaxes and variable stars needs no place: it is skipped
 * Notes:     the Sun's place relative to the barycentre is that of eraEpv00 */
void bst_star_observer_at(const bst_star_view *view, const bst_star_epoch *epoch,
                          bst_star_observer *out);

/* Direction of a record from an observer: unit (u - p b / |au|), where u is the barycentric
 * direction, p the parallax and b the observer's place, as eraPmpx.
 *
 * Reference: Urban and Seidelmann, Explanatory Supplement, 3rd ed., section 7.2.2 */
bst_vec3 bst_star_record_seen(const bst_star_record *record, const bst_star_observer *observer);

/* V of a variable star less its brightest V.
 *
 * Given:     jd  barycentric Julian date (TDB)
 * Notes:     cosine: A/2 (1 - cos(2 pi (jd - epoch) / period)); light curve: linear between points,
 *            periodic in phase, or constant beyond its ends if its times are days */
double bst_star_variable_mag(const bst_star_view *view, const bst_star_variable *variable,
                             double jd);

/* Variability of a star; NULL: it has none. */
const bst_star_variable *bst_star_variable_of(const bst_star_view *view, uint32_t star);

#endif
