/* Stray light: brightness of Sun, Moon and Earth outside the field, and the part that reaches the
 * detector through the baffle and optics (PST). Internal to sim/world. */
#ifndef BST_WORLD_SCENE_STRAY_H
#define BST_WORLD_SCENE_STRAY_H

#include "boresight/background_config.h"
#include "boresight/status.h"
#include "sim/astro/bodies.h"

#define BST_MOON_RADIUS_M 1737400.0 /* IAU mean radius */

/* Point source transmittance (PST) by angle; immutable. */
typedef struct bst_scene_pst bst_scene_pst;

/* Reads the table of point source transmittance of a camera; *out NULL if there is none.
 * `base_dir`: base of relative paths. BST_ERR_CONFIG with the key below `background`, when the
 * angles do not ascend, both tables are given, or there is no pixel pitch (pixel_pitch_um, the
 * optics' one). */
bst_status bst_scene_pst_create(bst_ctx *ctx, const bst_background_config *config,
                                double optics_pixel_um, const char *base_dir,
                                bst_scene_pst **out) BST_MUST_CHECK;
/* Frees a table of point source transmittance; NULL is allowed. */
void bst_scene_pst_free(bst_scene_pst *pst);

/* Irradiance on the detector over that at the entrance (normal to the light), for a source
 * angle_rad from the boresight. Interpolation is log-linear (linear next to a zero); the first and
 * last values hold beyond the table. */
double bst_scene_pst_at(const bst_scene_pst *pst, double angle_rad);
/* Pixel pitch for stray light, m. */
double bst_scene_pst_pixel_m(const bst_scene_pst *pst);

/* V magnitude of the Moon: -12.73 + 0.026 |a| + 4e-9 a^4, a the phase angle (Sun - Moon - observer)
 * in degrees, at its mean distance of 384400 km and 1 au from the Sun (Krisciunas and Schaefer,
 * PASP 103, 1033 (1991), after Allen), times the inverse squares of both distances. */
double bst_scene_moon_v_mag(bst_vec3 moon_from_eye_m, bst_vec3 sun_from_moon_m);

/* Fraction of a body's disc (radius_m, at body_m from the Earth's centre) that the Earth does not
 * occult at eye_m; as bst_astro_sun_fraction. */
double bst_scene_disc_fraction(bst_vec3 eye_m, bst_vec3 body_m, double radius_m, bst_vec3 pole);

/* PST-weighted irradiance of Sun, Moon and Earth at a camera's entrance, in units of one star of V
 * = 0, uniform over the detector. The Earth is a Lambertian sphere of `albedo`. boresight: unit,
 * GCRF. */
double bst_stray_irradiance(const bst_scene_pst *pst, const bst_background_config *config,
                            bst_vec3 eye_m, const bst_bodies *bodies, bst_vec3 boresight);

#endif
