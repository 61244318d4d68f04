/* Photometry in a spectral band: detected photons from stars, sunlight and thermal surfaces.
 *
 * All rates are photons weighted with the band's response (detector times transmission, by
 * wavelength), so that electrons = rate * area * throughput * quantum efficiency. */
#ifndef BST_OPTICS_BAND_H
#define BST_OPTICS_BAND_H

#include "boresight/band_config.h"
#include "boresight/status.h"
#include "sim/astro/bodies.h"

/* Immutable once made; shareable between threads. */
typedef struct bst_band bst_band;

/* colour of stars without one: the Sun's (Willmer 2018: 0.653) */
#define BST_SUN_B_MINUS_V 0.65
/* Apparent V magnitude of the Sun at 1 au (Willmer 2018 gives -26.76 in Vega V; -26.74 is the value
 * in common use). */
#define BST_SUN_V_MAG (-26.74)

/* Creates a band; `base_dir`: base of relative paths ("": current folder). *out is NULL for the
 * preset "v" without tables: that has no spectrum. BST_ERR_CONFIG with the key below `band` when
 * the tables do not ascend, are given twice or leave no response; errors of the files as of
 * bst_file_read and BST_ERR_FORMAT with the line. */
bst_status bst_band_create(bst_ctx *ctx, const bst_band_config *config, const char *base_dir,
                           bst_band **out) BST_MUST_CHECK;
/* Frees a band; NULL is allowed. */
void bst_band_free(bst_band *band);

/* Photon rate of a star of V = 0 and colour B-V (NAN: solar), 1/s/m2. Its spectrum is a black body
 * at the temperature of Ballesteros (EPL 97, 34008, 2012), with the flux of V = 0 through Bessell's
 * V (PASP 102, 1181, 1990): 3.631e-9 erg/s/cm2/A (Bessell, Castelli and Plez 1998). B-V is limited
 * to -0.4 .. 2.5. */
double bst_band_star(const bst_band *band, double b_minus_v);

/* Photon rate of sunlight at 1 au, 1/s/m2, from bst_optics_sun_irradiance. */
double bst_band_sun(const bst_band *band);

/* Ratio of sunlight after passing the Earth's atmosphere to direct sunlight in the band. `light`:
 * that ratio at bst_sunlight_wavelength_m, interpolated linearly, constant beyond. */
double bst_band_reddened_sun(const bst_band *band, const double light[BST_SUNLIGHT_COLOURS]);

/* Photon radiance of a black body in the band, 1/s/m2/sr; 0 for a temperature that is not
 * positive. */
double bst_band_radiance(const bst_band *band, double temperature_k);

/* Response of the band at a wavelength. */
double bst_band_response(const bst_band *band, double wavelength_m);

/* True for a thermal band: mean wavelength above 3 um. Emission of bodies at 300 K matters, and
 * reflectance follows from emissivity (Kirchhoff). */
bool bst_band_is_thermal(const bst_band *band);

/* Planck's law in photons: spectral radiance of a black body, 1/s/m2/sr per m of wavelength:
 * 2 c / lambda^4 / (exp(h c / (lambda k T)) - 1). */
double bst_optics_planck_photons(double wavelength_m, double temperature_k);

/* Spectral irradiance of the Sun at 1 au, W/m2 per m of wavelength: ASTM G173-03 extraterrestrial
 * from 0.28 to 4 um, beyond a black body with the table's brightness temperature at 4 um (5558 K)
 * and the Sun's solid angle; 0 below. */
double bst_optics_sun_irradiance(double wavelength_m);

/* Temperature of a star of colour B-V, K: Ballesteros 2012, equation 14. */
double bst_optics_star_temperature_k(double b_minus_v);
/* Black-body temperature that bst_band_star uses for a star of colour B-V (NAN: solar), K: 2725 to
 * 21707. */
double bst_optics_star_spectrum_k(double b_minus_v);

#endif
