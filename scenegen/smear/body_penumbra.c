#include "scenegen/smear/body_penumbra.h"

#include <math.h>

enum { RINGS_MAX = 6 };

/* Points of the Sun's disc with limb darkening 1 - 0.6 (1 - mu) (Cox, Allen's Astrophysical
 * Quantities, 4th edition, section 14.7): rings of Gauss' quadrature in the square of the radius,
 * or one about the centre, each of equidistant points, an even number: their mean is the centre. */
typedef struct sun_rule {
    int rings, points, around[RINGS_MAX];
    double radius[RINGS_MAX], weight[RINGS_MAX];
    /* the error of a border is at most `error` times that power of half the width in PSF sigmas */
    double error, power;
} sun_rule;

/* tests/scenegen/test_body_penumbra.c compares moments and errors with closed forms. */
static const sun_rule rules[BST_BODY_SUN_RULES] = {
    {1, 1, {1}, {0.0}, {1.0}, 0.0275, 2.0},
    {1, 4, {4}, {0.67082039325}, {1.0}, 1.35e-3, 4.0},
    {2, 7, {1, 6}, {0.0, 0.790151013629}, {0.279237288136, 0.720762711864}, 5.0e-5, 6.0},
    {2,
     16,
     {6, 10},
     {0.441743268347, 0.870529674222},
     {0.547059231888, 0.452940768112},
     1.7e-6,
     6.0},
    {3,
     32,
     {6, 12, 14},
     {0.325720453642, 0.691264087487, 0.932913249552},
     {0.317335802482, 0.453037207525, 0.229626989993},
     2.5e-8,
     7.0},
    {4,
     58,
     {6, 14, 18, 20},
     {0.257230718963, 0.562828130813, 0.807121466112, 0.959436754058},
     {0.203357256652, 0.354116542261, 0.308409196991, 0.134117004097},
     4.5e-9,
     6.5},
    {5,
     90,
     {6, 14, 20, 24, 26},
     {0.21230990376, 0.471835359841, 0.697020299178, 0.868927408686, 0.972978487789},
     {0.14047540516, 0.269553834319, 0.291220375195, 0.212109435104, 0.0866409502213},
     8e-10,
     6.5},
    {6,
     142,
     {8, 16, 24, 28, 32, 34},
     {0.180655446518, 0.40513168005, 0.608670335276, 0.778770013664, 0.905452134947, 0.98076885781},
     {0.102535396446, 0.207894377833, 0.251492132095, 0.22655429284, 0.151401818819,
      0.0601219819665},
     1.1e-10,
     6.5}};

/* The two borders of a shadow of two PSF sigmas, with the same sign between them. */
static const double BOTH_BORDERS = 2.0;
/* Light of the pixel with the largest error, over that beside the border: body_precision.c. */
static const double BORDER_LIGHT = 0.1;

/* Error of a border that moves across itself, over the square of half the width of its penumbra and
 * the motion: half of the disc's second moment, 0.225, times the extremum 0.4 of a Gaussian. */
static const double SWEPT = 0.045;

int bst_body_sun_points(int rule) {
    return rules[rule].points;
}

double bst_body_sun_error(int rule, double half_width) {
    return fmin(rules[rule].error * pow(half_width, rules[rule].power), 0.5);
}

double bst_body_penumbra_sigma(const bst_resolved_image *m, int rule, double electrons,
                               double sigma_px, double swept, double dark_variance_e2) {
    double worst = 0.0;
    for (int i = 0; i < BST_RESOLVED_PENUMBRAE; i++) {
        const bst_resolved_penumbra *p = &m->penumbrae[i];
        /* the widest with that light has at least the error of each, which grows with the square of
         * the width or faster */
        double light_e = p->px > 0.0 ? electrons * p->light_px2 / (p->px * p->px) : 0.0;
        double width = p->px / sigma_px, error = bst_body_sun_error(rule, width);
        error = swept > 0.0 ? fmin(error, SWEPT * width * width / swept) : error;
        error *= BOTH_BORDERS;
        worst = fmax(worst, error * light_e / sqrt(BORDER_LIGHT * light_e + dark_variance_e2));
    }
    return worst;
}

int bst_body_penumbra_expand(bst_body_times *t, int rule) {
    while (rules[rule].points * t->count > BST_BODY_POSES_MAX && rule > 0) {
        rule--;
    }
    const sun_rule *r = &rules[rule];
    int to = t->count * r->points;
    for (int k = t->count - 1; k >= 0; k--) { /* from the last one: in place */
        double u = t->u[k], weight = t->weight[k];
        for (int i = r->rings - 1; i >= 0; i--) {
            for (int n = r->around[i] - 1; n >= 0; n--) {
                double angle = 2.0 * BST_PI * (n + 0.5 * (i % 2)) / r->around[i];
                to--;
                t->u[to] = u;
                t->weight[to] = weight * r->weight[i] / r->around[i];
                t->shadow_at[to][0] = r->radius[i] * cos(angle);
                t->shadow_at[to][1] = r->radius[i] * sin(angle);
            }
        }
    }
    t->count *= r->points;
    return rule;
}
