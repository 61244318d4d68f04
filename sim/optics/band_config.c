#include "boresight/band_config.h"
#include "sim/optics/band.h"

static const char *const presets[] = {"v", "silicon", "swir", "mwir", "lwir", NULL};

static const bst_config_desc point_table[] = {
    BST_REAL(bst_optics_response_point, wavelength_um, "um", 0.2, 30, NULL, "Wavelength."),
    BST_REAL(bst_optics_response_point, value, "", 0, 1, NULL,
             "Electrons per photon, or transmission."),
    BST_CONFIG_END,
};

const bst_config_desc bst_band_config_table[] = {
    BST_ENUM(bst_band_config, preset, presets, "\"v\"",
             "\"v\": photon_flux_v0_per_s_m2, the same for all colours. The others have a spectral "
             "response with a peak of 1: silicon 0.3 to 1.1 um, swir 0.9 to 1.7 um, mwir 3.4 to 5 "
             "um, lwir 8 to 12 um; sources have spectra in them, and throughput and "
             "quantum_efficiency are factors."),
    BST_LIST(bst_band_config, response, bst_optics_response_point, point_table, 0, 1000, "[]",
             "Spectral response of the detector, electrons per photon, instead of the preset's; "
             "linear between points, 0 beyond."),
    BST_PATH(bst_band_config, response_file, "\"\"",
             "The same from a CSV file with the columns wavelength_um,response."),
    BST_LIST(bst_band_config, transmission, bst_optics_response_point, point_table, 0, 1000, "[]",
             "Transmission of the optics by wavelength; empty: 1."),
    BST_PATH(bst_band_config, transmission_file, "\"\"",
             "The same from a CSV file with the columns wavelength_um,transmission."),
    BST_REAL(bst_band_config, optics_temperature_k, "K", 0, 1000, "250",
             "Temperature of the optics, whose emission is part of the background in all presets "
             "but v."),
    BST_REAL(bst_band_config, optics_emissivity, "", 0, 1, "0.05", "Emissivity of the optics."),
    BST_REAL(bst_band_config, optics_beam_factor, "", 0, 1e4, "1",
             "Solid angle from which a pixel receives that emission, over that of the beam that "
             "makes the image: 1 behind a cold stop that fits."),
    BST_CONFIG_END,
};
