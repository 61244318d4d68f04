/* How bright an object is: sunlight and Earthlight that it reflects, and its own emission. */
#ifndef BST_WORLD_SCENE_BRIGHTNESS_H
#define BST_WORLD_SCENE_BRIGHTNESS_H

#include "boresight/camera.h"
#include "boresight/vec.h"
#include "sim/astro/bodies.h"
#include "sim/world/scene/brightness_config.h"

/* A brightness ready to be evaluated; immutable, may serve many objects. */
typedef struct bst_brightness bst_brightness;

/* Reads what files it needs; relative paths start from base_dir. BST_ERR_CONFIG with the key below
 * `brightness`. */
bst_status bst_brightness_create(bst_ctx *ctx, const bst_brightness_config *config,
                                 const char *base_dir, bst_brightness **out) BST_MUST_CHECK;
/* Frees a brightness model; NULL is allowed. */
void bst_brightness_free(bst_brightness *brightness);

/* Where the light comes from and goes to. Positions are geocentric, GCRF. */
typedef struct bst_scene_lighting {
    double area_m2, albedo;             /* of the sphere; cross-section */
    bst_vec3 object_m;                  /* when the light leaves */
    bst_vec3 eye_m, sun_m;              /* when it arrives */
    double seconds;                     /* when it leaves, after the epoch */
    double sunlit_fraction;             /* of the Sun's disc that the object sees */
    const bst_astro_sunlight *sunlight; /* with limb darkening and air; NULL: sunlit_fraction of the
                                     whole Sun's light at all wavelengths */
} bst_scene_lighting;

/* Light of an object. Reflected light has the Sun's spectrum, reddened by the air at the edge of
 * the Earth's shadow. */
typedef struct bst_scene_glow {
    double v_mag;                         /* all reflected light; +INFINITY: none */
    double redness[BST_SUNLIGHT_COLOURS]; /* reflected sunlight by wavelength, over that in V */
    double specular_share; /* of the reflected light: the Sun's image in the mirror ball */
    double earth_share;    /* of the reflected light: from the Earth */
    bst_vec3 earth;        /* unit, from the object to the middle of the Earth's light, GCRF */
    double emission_sr;    /* emissivity times solid angle: what a black body would have to fill */
    double temperature_k;
    double thermal_reflection; /* factor on reflected light where reflectance is 1 - emissivity */
    bool resolved;             /* may be drawn as a disc */
} bst_scene_glow;

/* `brightness` may be NULL: a diffuse sphere that does not glow and is never drawn as a disc. */
void bst_brightness_at(const bst_brightness *brightness, const bst_scene_lighting *lighting,
                       bst_scene_glow *out);

/* Detected electrons per second; *reflected (may be NULL) of it from reflected light. */
double bst_scene_glow_electrons_per_s(const bst_camera *camera, const bst_scene_glow *glow,
                                      double *reflected);

/* Earthlight: as above, for all the light that a diffuse Earth of this albedo (a sphere of the
 * equatorial radius) sends to the object, over sunlight at 1 au: irradiance at the eye = sunlight
 * at 1 au * result * albedo * area / range^2. *middle: unit vector to the light's middle, as
 * weighted by what reaches the eye. */
double bst_scene_earthshine(double specular_fraction, double earth_albedo, bst_vec3 object_m,
                            bst_vec3 eye_m, bst_vec3 sun_m, bst_vec3 *middle);

/* Light of a diffuse sphere of radius `ratio` times the range, over what bst_astro_sphere_phase
 * gives for a far one: near by, less of the sphere is seen, and the part below the eye is nearer. 1
 * for ratio 0; ratio below 1. */
double bst_scene_sphere_nearness(double ratio, double phase_rad);

#endif
