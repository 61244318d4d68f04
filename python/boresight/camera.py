"""Camera: size, optics and radiometry of a sensor."""
from __future__ import annotations

import math
from typing import Any, NamedTuple


class Camera(NamedTuple):
    """A camera as the simulator describes it (bst_camera). NaN: unknown."""
    width_px: int
    height_px: int
    pixel_scale_arcsec: float
    focal_length_m: float
    f_number: float
    pixel_pitch_um: float
    aperture_m: float
    obscuration: float
    throughput: float
    quantum_efficiency: float
    photon_flux_v0_per_s_m2: float
    psf_fwhm_px: float
    background_mag_arcsec2: float
    dark_current_e_per_s: float
    read_noise_e: float
    full_well_e: float
    gain_e_per_dn: float
    offset_dn: float
    bits: int
    rotation_deg: float

    @property
    def pixel_scale_rad(self) -> float:
        """Angle of a pixel at the boresight, rad."""
        return math.radians(self.pixel_scale_arcsec / 3600.0)


def camera_of(struct: Any) -> Camera:
    """A copy of the first members of a bst_camera."""
    return Camera(*(getattr(struct, name) for name in Camera._fields))
