"""Members of each message of the link, as NumPy types."""
from __future__ import annotations

from typing import Any, Dict, List

import numpy as np

VERSION = 9

# Members of each message's record, then of its items: name:type, x for an array. A test compares
# them with docs/reference/icd.md.
_TABLES = {
    "hello": (
        "name:S64 serves:S256 shared_memory:i4",
    ),
    "welcome": (
        "scenario:S64 epoch_utc:S40 tick_rate_hz:i8 duration_ticks:i8 timeout_s:f8 "
        "shared_memory:S64 slot_bytes:i8 slots:i4 count:i4",
        "instance:S160 role:S32 width_px:i4 height_px:i4 bits:i4 pixel_scale_rad:f8 "
        "boresight_px:f8x2 psf_fwhm_px:f8 gain_e_per_dn:f8 offset_dn:f8 read_noise_e:f8 "
        "dark_e_per_s:f8 full_well_e:f8 flux_v0_e_per_s:f8 exposure_s:f8 period_s:f8 "
        "period_ticks:i8",
    ),
    "step": (
        "inputs:i4 attempt:i4",
    ),
    "done": (
        "outputs:i4 busy_s:f8",
    ),
    "error": (
        "sequence:i8 fault:S32 text:S256",
    ),
    "health": (
        "state:i4 text:S256",
    ),
    "end": (
        "reason:i4 text:S256",
    ),
    "frame": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 window.x0:i4 window.y0:i4 "
        "window.width:i4 window.height:i4 binning:i4 bits:i4 width:i4 height:i4",
    ),
    "truth": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 dropped:i4 count:i4 lost:i4 hits:i4 "
        "q_cam_from_gcrf_mid:f8x4 q_cam_from_gcrf_mean:f8x4 observer_gcrf_m:f8x3 "
        "observer_gcrf_mps:f8x3 boresight_x_px:f8 boresight_y_px:f8 background_e:f8 "
        "dark_e:f8",
        "kind:i4 id:u4 norad:i4 flags:u4 x_start_px:f8 y_start_px:f8 x_mid_px:f8 "
        "y_mid_px:f8 x_end_px:f8 y_end_px:f8 x_chief_px:f8 y_chief_px:f8 "
        "x_centroid_px:f8 y_centroid_px:f8 ra_rad:f8 dec_rad:f8 v_mag:f8 electrons:f8 snr:f8 range_m:f8",
    ),
    "pointing_telemetry": (
        "first:i8 capacity:i4 count:i4 q_body_from_gcrf:f8x4 settled:i4 limited:i4",
        "tick:i8 q_cam_from_gcrf:f8x4 axis_rad:f8x2",
    ),
    "nav_telemetry": (
        "tick:i8 position_gcrf_m:f8x3 velocity_gcrf_mps:f8x3 velocity_bary_mps:f8x3 "
        "sun_m:f8x3 moon_m:f8x3",
    ),
    "mount_status": (
        "tick:i8 axes:i4 wheels_saturated:i4 q_body_from_cam_at_zero:f8x4 "
        "q_body_from_gcrf:f8x4 rate_body_radps:f8x3 axis[0].axis_body:f8x3 "
        "axis[0].angle_rad:f8 axis[0].rate_radps:f8 axis[0].rate_limit_radps:f8 "
        "axis[0].accel_limit_radps2:f8 axis[0].min_rad:f8 axis[0].max_rad:f8 "
        "axis[0].redundant:i4 axis[0].flags:u4 axis[1].axis_body:f8x3 "
        "axis[1].angle_rad:f8 axis[1].rate_radps:f8 axis[1].rate_limit_radps:f8 "
        "axis[1].accel_limit_radps2:f8 axis[1].min_rad:f8 axis[1].max_rad:f8 "
        "axis[1].redundant:i4 axis[1].flags:u4 axis[2].axis_body:f8x3 "
        "axis[2].angle_rad:f8 axis[2].rate_radps:f8 axis[2].rate_limit_radps:f8 "
        "axis[2].accel_limit_radps2:f8 axis[2].min_rad:f8 axis[2].max_rad:f8 "
        "axis[2].redundant:i4 axis[2].flags:u4 roll.axis_body:f8x3 roll.angle_rad:f8 "
        "roll.rate_radps:f8 roll.rate_limit_radps:f8 roll.accel_limit_radps2:f8",
    ),
    "detections": (
        "exposure_id:i8 start_tick:i8 end_tick:i8 q_cam_from_gcrf:f8x4 "
        "q_telemetry_from_gcrf:f8x4 background_e:f8 noise_e:f8 threshold_snr:f8 "
        "shared_xx:f8 shared_xy:f8 shared_yy:f8 "
        "zero_point_mag:f8 zero_point_sigma_mag:f8 zero_point_stars:i4 "
        "stars_identified:i4 windows:i4 count:i4 lost:i4 bad_pixels:i4 "
        "calibration.frames:i4 calibration.scale:f8 calibration.rotation_rad:f8 "
        "calibration.k1:f8 calibration.p1:f8 calibration.p2:f8 calibration.covariance:f8x25",
        "x_px:f8 y_px:f8 cov_xx:f8 cov_xy:f8 cov_yy:f8 flux_e:f8 flux_sigma_e:f8 snr:f8 "
        "length_px:f8 width_px:f8 angle_rad:f8 v_mag:f8 v_mag_sigma:f8 flags:u4 "
        "star_id:u4 label:i4 label_probability:f8 rate_x_pxps:f8 rate_y_pxps:f8 "
        "rate_sigma_pxps:f8 extent.light_x_px:f8 extent.light_y_px:f8 extent.x0_px:f8 "
        "extent.y0_px:f8 extent.x1_px:f8 extent.y1_px:f8 extent.size_px:f8 "
        "extent.size_sigma_px:f8 extent.area_px2:f8 extent.phase_rad:f8 "
        "extent.saturated_share:f8 extent.range_m:f8 extent.range_sigma_m:f8",
    ),
    "predictions": (
        "tick:i8 attitude_valid:i4 count:i4 lost:i4 attitude_error_cam_rad:f8x3 "
        "attitude_error_rate_cam_radps:f8x3",
        "track_id:i8 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 sigma_rad:f8 "
        "target_of_interest:i4",
    ),
    "tracks": (
        "exposure_id:i8 tick:i8 attitude.valid:i4 attitude.stars:i4 attitude.tick:i8 "
        "attitude.q_cam_from_gcrf:f8x4 attitude.error_cam_rad:f8x3 "
        "attitude.sigma_rad:f8x3 attitude.correlation:f8x3 attitude.rms_px:f8 attitude.shared:f8 "
        "target_id:i8 clock_offset_s:f8 clock_sigma_s:f8 at_rest:i4 count:i4 "
        "lost:i4",
        "id:i8 status:i4 target_of_interest:i4 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 "
        "covariance:f8x16 v_mag:f8 snr:f8 score:f8 hits:i4 misses_in_row:i4 first_tick:i8 "
        "last_update_tick:i8 x_px:f8 y_px:f8 uncorrelated:i4 hidden:i4",
    ),
    "track_identities": (
        "exposure_id:i8 tick:i8 count:i4 lost:i4",
        "track_id:i8 object:i4 probability:f8",
    ),
    "tracks_smoothed": (
        "exposure_id:i8 tick:i8 count:i4 lost:i4",
        "id:i8 status:i4 target_of_interest:i4 later_frames:i4 direction_gcrf:f8x3 "
        "rate_gcrf_radps:f8x3 covariance:f8x16",
    ),
    "los_command": (
        "tick:i8 direction_gcrf:f8x3 rate_gcrf_radps:f8x3 accel_gcrf_radps2:f8x3 "
        "near_given:i4 near_rad:f8x3 near_radps:f8x3 roll_given:i4 roll_rad:f8",
    ),
    "sensor_command": (
        "exposure_s:f8 period_s:f8 window.x0:i4 window.y0:i4 window.width:i4 "
        "window.height:i4 binning:i4 pixel_scale_arcsec:f8",
    ),
    "control_status": (
        "tick:i8 mode:i4 target_id:i8 search_step:i4 aim_error_px:f8x2",
    ),
    "pointing": (
        "count:i4",
        "tick:i8 q_cam_from_gcrf:f8x4",
    ),
    "target_states": (
        "count:i4",
        "object:S64 tick:i8 position_gcrf_m:f8x3 velocity_gcrf_mps:f8x3",
    ),
    "target_attitudes": (
        "count:i4",
        "object:S64 tick:i8 q_body_from_gcrf:f8x4 rate_body_radps:f8x3",
    ),
}


def _dtype(members: str) -> "np.dtype[np.void]":
    """Packed, little-endian, padded to a multiple of 8 bytes."""
    names: List[str] = []
    formats: "List[np.dtype[Any]]" = []
    offsets: List[int] = []
    end = 0
    for member in members.split():
        name, kind = member.split(":")
        kind, _, count = kind.partition("x")
        one: "np.dtype[Any]" = np.dtype((kind if kind[0] == "S" else "<" + kind, (int(count),) if count else ()))
        names.append(name)
        formats.append(one)
        offsets.append(end)
        end += one.itemsize
    return np.dtype({"names": names, "formats": formats, "offsets": offsets,
                     "itemsize": (end + 7) // 8 * 8})


RECORDS: "Dict[str, np.dtype[np.void]]" = {name: _dtype(tables[0]) for name, tables in _TABLES.items()}
ITEMS: "Dict[str, np.dtype[np.void]]" = {name: _dtype(tables[1]) for name, tables in _TABLES.items() if len(tables) > 1}

LABELS = {"unknown": 0, "star": 1, "object": 2, "artefact": 3, "hot_pixel": 4, "hit": 5}
MODES = {name: number for number, name in enumerate(
    ("idle", "slew", "search", "acquire", "track", "reacquire", "stare", "rate", "coast", "fixed",
     "scan", "lost"))}
