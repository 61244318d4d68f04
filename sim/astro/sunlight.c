#include "sim/astro/earth_limb.h"
#include "sim/astro/limb_table.inc"

const double bst_sunlight_wavelength_m[BST_SUNLIGHT_COLOURS] = {0.40e-6, 0.55e-6, 0.70e-6, 1.00e-6};

/* Optical properties of the atmosphere and limb darkening at one wavelength. */
typedef struct colour {
    double u, v;            /* limb darkening: I = 1 - u - v + u mu + v mu^2, the middle 1 (Cox,
                               table 14.17) */
    double rayleigh_per_km; /* optical depth at sea-level density: Hansen and Travis (Space Science
                               Reviews 16, 527, 1974, equation 2.30) over 8.434 km */
    double ozone_per_du;    /* optical depth: cross sections of Serdyuchenko et al. (Atmospheric
                               Measurement Techniques 7, 625, 2014) times 2.687e16 /cm2 */
} colour;

static const colour colours[BST_SUNLIGHT_COLOURS] = {
    {0.91, -0.05, 4.269e-2, 3.0e-7},
    {0.93, -0.23, 1.153e-2, 8.9e-5},
    {0.80, -0.22, 4.331e-3, 2.3e-5},
    {0.64, -0.20, 1.028e-3, 1.0e-7},
};

/* A disc whose brightness falls with the radius is a sum of even discs, of radii sin t: the edge of
 * the Sun, and four-point Gauss-Legendre in t over 0 to pi / 2 (Abramowitz and Stegun, table
 * 25.4). */
enum { RINGS = 4 };
static const double ring_place[RINGS] = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281,
                                         0.9305681557970263};
static const double ring_weight[RINGS] = {0.1739274225687269, 0.3260725774312731,
                                          0.3260725774312731, 0.1739274225687269};

/* Fraction of the Sun's light from outside a limb, by wavelength. */
static void share_outside(const bst_earth_limb *limb, double disc,
                          double out[BST_SUNLIGHT_COLOURS]) {
    if (limb->beyond >= disc) {
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            out[c] = 1.0;
        }
        return;
    }
    double edge = bst_earth_limb_share(limb, disc), ring[RINGS], weight[RINGS], mu[RINGS];
    for (int k = 0; k < RINGS; k++) {
        double t = 0.5 * BST_PI * ring_place[k], r = sin(t);
        mu[k] = cos(t);
        weight[k] = 0.5 * BST_PI * ring_weight[k] * r * r * r;
        ring[k] = bst_earth_limb_share(limb, disc * r);
    }
    for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
        const colour *l = &colours[c];
        double all = 1.0 - l->u - l->v, sum = all * edge;
        for (int k = 0; k < RINGS; k++) {
            double fall = weight[k] * (l->u + 2.0 * l->v * mu[k]);
            all += fall;
            sum += fall * ring[k];
        }
        out[c] = sum / all;
    }
}

/* Transmission of the atmosphere for rays with minimum height of at least height_km (row k). */
static double transmission(const colour *c, int k) {
    return exp(-c->rayleigh_per_km * limb_rows[k].air_km - c->ozone_per_du * limb_rows[k].ozone_du);
}

/* The rays of one row: they appear at the limb of an Earth that is higher by g. */
typedef struct ray_row {
    double impact_m, g_m;
    bst_earth_limb limb;
} ray_row;

/* Geometry of the rays of row k; false: they cross the shadow axis before the satellite, beyond the
 * Moon's distance. */
static bool see_row(bst_vec3 position_m, bst_vec3 pole, bst_vec3 towards, double way_m, int k,
                    ray_row *out) {
    out->impact_m = 1e3 * limb_rows[k].height_km + 1e3 * limb_rows[k].impact_km;
    out->g_m = out->impact_m - way_m * tan(limb_rows[k].bending_rad);
    if (BST_EARTH_RADIUS_M + out->g_m < 0.1 * BST_EARTH_RADIUS_M) {
        return false;
    }
    if (!bst_earth_limb_at(position_m, pole, out->g_m, towards, &out->limb)) {
        out->limb =
            (bst_earth_limb){.beyond = bst_vec3_dot(position_m, towards) > 0.0 ? 1.0 : -1.0};
    }
    return true;
}

/* Lowest row through whose limb, and those of all rows above, no light comes: deep in the shadow
 * row 0. LIMB_ROWS: light comes through the highest row. g falls with the height of the rays, and
 * the Sun's distance from the limb with it. */
static int lowest_dark_row(bst_vec3 position_m, bst_vec3 pole, bst_vec3 towards, double way_m,
                           double disc) {
    int bright = -1, dark = LIMB_ROWS; /* rows that are known to be so */
    while (dark - bright > 1) {
        int k = dark == LIMB_ROWS ? LIMB_ROWS - 1 : (bright + dark) / 2;
        ray_row row;
        if (see_row(position_m, pole, towards, way_m, k, &row) &&
            bst_earth_limb_share(&row.limb, disc) <= 0.0) {
            dark = k;
        } else {
            bright = k;
        }
    }
    return dark;
}

/* Light through the atmosphere. Rays at height h with impact parameter b appear at g = b - way *
 * bending. Between two rows all the light between their g is counted, times the divergence of the
 * bundle along and across the limb. */
static void through_air(bst_vec3 position_m, bst_vec3 pole, bst_vec3 towards, double disc,
                        bst_astro_sunlight *out) {
    double distance = bst_vec3_norm(position_m);
    double way = sqrt(fmax(distance * distance - BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M, 0.0));
    double above[BST_SUNLIGHT_COLOURS] = {0.0}, here[BST_SUNLIGHT_COLOURS];
    int dark = lowest_dark_row(position_m, pole, towards, way, disc);
    ray_row upper = {.g_m = 0.0}, row;
    for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
        out->light[c] = 0.0;
    }
    for (int k = dark < LIMB_ROWS ? dark : LIMB_ROWS - 1;
         k >= 0 && see_row(position_m, pole, towards, way, k, &row); k--) {
        share_outside(&row.limb, disc, here);
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            if (k == LIMB_ROWS - 1) {
                out->light[c] = here[c];
            } else if (k < dark) {
                double top = 1e3 * limb_rows[k + 1].height_km, h = 1e3 * limb_rows[k].height_km;
                double thinned = (upper.impact_m - row.impact_m) / (upper.g_m - row.g_m) *
                                 (BST_EARTH_RADIUS_M + 0.5 * (top + h)) /
                                 (BST_EARTH_RADIUS_M + 0.5 * (upper.g_m + row.g_m));
                double low = transmission(&colours[c], k), high = transmission(&colours[c], k + 1);
                double clear = (low + 4.0 * sqrt(low * high) + high) / 6.0; /* Simpson */
                out->light[c] += fmax(here[c] - above[c], 0.0) * thinned * clear;
            }
            above[c] = here[c];
        }
        upper = row;
        if (above[BST_SUNLIGHT_V] >= 1.0) {
            break; /* no light from below */
        }
    }
}

void bst_astro_sunlight_at(bst_vec3 position_m, bst_vec3 sun_m, bst_vec3 pole, bool atmosphere,
                           bst_astro_sunlight *out) {
    const double top_m = 1e3 * limb_rows[LIMB_ROWS - 1].height_km;
    bst_vec3 to_sun = bst_vec3_sub(sun_m, position_m);
    double distance = bst_vec3_norm(position_m), sun_distance = bst_vec3_norm(to_sun), sunlit;
    if (bst_earth_far_from_shadow(position_m, to_sun, sun_distance, top_m, &sunlit) &&
        sunlit == 1.0) {
        *out = (bst_astro_sunlight){.disc = 1.0};
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            out->light[c] = 1.0;
        }
        return;
    }
    *out = (bst_astro_sunlight){.disc = bst_astro_sun_fraction(position_m, sun_m, pole)};
    double sine = fmin(BST_SUN_RADIUS_M / sun_distance, 0.5);
    bool aired = atmosphere && distance > BST_EARTH_RADIUS_M + 1.001 * top_m;
    bst_vec3 down = bst_vec3_scale(position_m, -1.0);
    double grown = fmin((BST_EARTH_RADIUS_M + (aired ? top_m : 0.0)) / distance, 1.0);
    bool clear = bst_vec3_angle(down, to_sun) > asin(grown) + asin(sine) || sun_distance < distance;
    bst_earth_limb limb;
    if ((out->disc >= 1.0 && (clear || !aired)) || (out->disc <= 0.0 && !aired) ||
        bst_earth_depth(position_m, pole) < 0.0) {
        for (int c = 0; c < BST_SUNLIGHT_COLOURS; c++) {
            out->light[c] = out->disc;
        }
        return;
    }
    bst_vec3 towards = bst_vec3_scale(to_sun, 1.0 / sun_distance);
    double disc = sine / sqrt(1.0 - sine * sine);
    if (aired) {
        through_air(position_m, pole, towards, disc, out);
    } else if (bst_earth_limb_at(position_m, pole, 0.0, towards, &limb)) {
        share_outside(&limb, disc, out->light);
    }
}
