/* Brightness of space objects: reflected sunlight, reflected earthlight and thermal emission. */
#ifndef BST_WORLD_SCENE_BRIGHTNESS_H
#define BST_WORLD_SCENE_BRIGHTNESS_H

#include "boresight/camera.h"
#include "boresight/vec.h"
#include "sim/astro/bodies.h"
#include "sim/world/scene/brightness_config.h"

/* A brightness model; immutable; several objects may share it. */
typedef struct bst_brightness bst_brightness;

/* Creates a brightness model and reads its files; relative paths start at base_dir. BST_ERR_CONFIG
 * names the key below `brightness`. */
bst_status bst_brightness_create(bst_ctx *ctx, const bst_brightness_config *config,
                                 const char *base_dir, bst_brightness **out) BST_MUST_CHECK;
/* Configuration of a brightness model; it belongs to the model. */
const bst_brightness_config *bst_brightness_config_of(const bst_brightness *brightness);
/* Frees a brightness model; NULL is allowed. */
void bst_brightness_free(bst_brightness *brightness);

/* Geometry of the illumination of an object. Positions are geocentric, GCRF. */
typedef struct bst_scene_lighting {
    double area_m2, albedo;             /* cross-section and albedo of the sphere */
    bst_vec3 object_m;                  /* position of the object at emission */
    bst_vec3 eye_m, sun_m;              /* observer and Sun at reception */
    double seconds;                     /* time of emission, after the epoch */
    double sunlit_fraction;             /* visible fraction of the Sun's disc at the object */
    const bst_astro_sunlight *sunlight; /* with limb darkening and atmosphere; NULL: sunlit_fraction
                                           of the whole Sun at all wavelengths */
    bool reflected_only;                /* shapes: without thermal emission */
} bst_scene_lighting;

enum { BST_SCENE_EMISSIONS = 8 };

/* Thermal emission at two temperatures, temperature_k +- deviation_k, half of it at each. */
typedef struct bst_scene_emission {
    double sr; /* emissivity times solid angle */
    double temperature_k, deviation_k;
} bst_scene_emission;

/* Light of an object. Reflected light has the solar spectrum, reddened by the atmosphere at the
 * edge of the Earth's shadow. */
typedef struct bst_scene_glow {
    double v_mag;                         /* of all reflected light; +INFINITY: none */
    double redness[BST_SUNLIGHT_COLOURS]; /* reflected sunlight by wavelength, relative to V */
    double specular_share; /* fraction of reflected light: the Sun's specular image */
    double earth_share;    /* fraction of reflected light: earthlight */
    bst_vec3 earth;        /* unit, GCRF: from the object to the centroid of the earthlight */
    double emission_sr;    /* emissivity times solid angle: of an equivalent black body */
    double temperature_k;
    /* Parts of the emission, whose sum is emission_sr and whose mean is temperature_k; none: all at
     * temperature_k. */
    bst_scene_emission emissions[BST_SCENE_EMISSIONS];
    int emission_count;
    double thermal_reflection; /* factor on reflected light at thermal wavelengths: reflectance = 1
                                  - emissivity */
    bool resolved;             /* may be rendered as a disc */
} bst_scene_glow;

/* Computes the light of an object without a shape (see object_shape.h). `brightness` NULL: a
 * diffuse sphere without emission, rendered as a point. */
void bst_brightness_at(const bst_brightness *brightness, const bst_scene_lighting *lighting,
                       bst_scene_glow *out);

/* Leaves a part of all light of an object, 0 to 1. */
void bst_scene_glow_dim(bst_scene_glow *glow, double part);

/* Detected electrons per second from an object's light. *reflected (may be NULL): the part from
 * reflected light. */
double bst_scene_glow_electrons_per_s(const bst_camera *camera, const bst_scene_glow *glow,
                                      double *reflected);

/* Earthlight on an object over sunlight at 1 au: irradiance at the observer = sunlight at 1 au *
 * result * albedo * area / range^2. The Earth is a diffuse sphere of this albedo and the equatorial
 * radius. *middle: unit vector to the centroid of the light, weighted by what the observer
 * receives. */
double bst_scene_earthshine(double specular_fraction, double earth_albedo, bst_vec3 object_m,
                            bst_vec3 eye_m, bst_vec3 sun_m, bst_vec3 *middle);

/* Brightness of a diffuse sphere at a finite distance over that at infinity
 * (bst_astro_sphere_phase). ratio: radius over range, below 1; 1 for ratio 0. Nearby, less of the
 * sphere is visible, and the sub-observer part is nearer. */
double bst_scene_sphere_nearness(double ratio, double phase_rad);

#endif
