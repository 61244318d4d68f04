/* Detections of a random field of the star catalogue, for tests of identification without an
 * attitude. */
#ifndef BST_TESTS_IMGPROC_RANDOM_SKY_H
#define BST_TESTS_IMGPROC_RANDOM_SKY_H

#include "boresight/rng.h"
#include "imgproc/identify/lost_in_space.h"

typedef struct bst_random_sky_options {
    double field_deg;   /* side of a square field of 1024 px */
    double v_limit;     /* magnitude of SNR 8 */
    double streak_px;   /* length of the stars' streaks, 0: points; widens centroids along them */
    double scale_error; /* true scale over the camera's less 1 */
    double lost_share;  /* stars that are not detected */
    int false_detections;
    bool mirrored;                   /* x reversed */
    bool scrambled;                  /* places drawn anew: no star is where it should be */
    bool planted;                    /* scrambled, but for a quad of the onboard catalogue */
    bool even;                       /* all detections of one brightness */
    const bst_quat *q_cam_from_gcrf; /* NULL: random */
} bst_random_sky_options;

enum { BST_RANDOM_SKY_ROOM = 4096 };

typedef struct bst_random_sky {
    bst_camera camera;
    bst_light light;
    bst_quat q_cam_from_gcrf;
    bst_detection items[BST_RANDOM_SKY_ROOM];
    int count;
    int usable; /* stars of SNR 8 and more that the onboard catalogue has */
} bst_random_sky;

/* Draws field number `index`.
 *
 * Given:     sky      stars of the sky
 *            onboard  stars of the onboard catalogue; may be the same */
void bst_random_sky_draw(const bst_random_sky_options *options, const bst_stars *sky,
                         const bst_stars *onboard, uint64_t seed, uint64_t index,
                         bst_random_sky *out);

#endif
