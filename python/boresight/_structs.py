"""ctypes structs of the C interface (include/boresight/boresight.h, stages.h, module.h). A generated C
file asserts their layout when the library is built."""
from __future__ import annotations

import ctypes
from ctypes import (CFUNCTYPE, POINTER, c_bool, c_char, c_char_p, c_double, c_int, c_int64,
                    c_size_t, c_uint, c_uint32, c_uint64, c_void_p)
from typing import Any, List, Type

LogFunction = CFUNCTYPE(None, c_void_p, c_int, c_char_p)
MessageFunction = CFUNCTYPE(c_int, c_void_p, c_char_p, c_char_p, c_void_p, c_int64)
EventFunction = CFUNCTYPE(c_int, c_void_p, c_int64, c_char_p, c_char_p, c_char_p)
InterruptedFunction = CFUNCTYPE(c_bool, c_void_p, c_int64)


class Context(ctypes.Structure):
    """bst_ctx: message of the last error, and the log."""
    C_NAME = "bst_ctx"
    _fields_ = [("message", c_char * 1024), ("log", LogFunction), ("log_user", c_void_p),
                ("log_level", c_int), ("warnings", c_uint)]


class ModelOptions(ctypes.Structure):
    """bst_model_options."""
    C_NAME = "bst_model_options"
    _fields_ = [("assignments", POINTER(c_char_p)), ("assignment_count", c_int),
                ("text", c_char_p), ("device", c_char_p), ("threads", c_int),
                ("no_plugins", c_bool)]


class SimOptions(ctypes.Structure):
    """bst_sim_options."""
    C_NAME = "bst_sim_options"
    _fields_ = [("other_run", c_bool), ("run", c_uint64)]


class SimObserver(ctypes.Structure):
    """bst_sim_observer."""
    C_NAME = "bst_sim_observer"
    _fields_ = [("user", c_void_p), ("message", MessageFunction), ("event", EventFunction),
                ("interrupted", InterruptedFunction)]


class SimMessage(ctypes.Structure):
    """bst_sim_message."""
    C_NAME = "bst_sim_message"
    _fields_ = [("payload", c_void_p), ("written_tick", c_int64), ("sequence", c_int64),
                ("items", c_int), ("capacity", c_int)]


class SimFrame(ctypes.Structure):
    """bst_sim_frame."""
    C_NAME = "bst_sim_frame"
    _fields_ = [("message", c_void_p), ("pixels", c_void_p), ("width", c_int), ("height", c_int)]


class SimColumns(ctypes.Structure):
    """bst_sim_columns."""
    C_NAME = "bst_sim_columns"
    _fields_ = [("headers", c_void_p), ("items", c_void_p), ("item_capacity", c_int),
                ("item_counts", c_void_p), ("written_at", c_void_p)]


class Vec3(ctypes.Structure):
    """bst_vec3."""
    C_NAME = "bst_vec3"
    _fields_ = [("x", c_double), ("y", c_double), ("z", c_double)]


class Quat(ctypes.Structure):
    """bst_quat."""
    C_NAME = "bst_quat"
    _fields_ = [("x", c_double), ("y", c_double), ("z", c_double), ("w", c_double)]


class ChannelType(ctypes.Structure):
    """bst_channel_type."""
    C_NAME = "bst_channel_type"
    _fields_ = [("name", c_char_p), ("kind", c_int), ("header_bytes", c_size_t),
                ("item_bytes", c_size_t), ("in_place", c_bool), ("release", c_void_p),
                ("retain", c_void_p), ("lends", c_bool), ("count", c_void_p)]


class Window(ctypes.Structure):
    """bst_window."""
    C_NAME = "bst_window"
    _fields_ = [("x0", c_int), ("y0", c_int), ("width", c_int), ("height", c_int)]


class CameraHead(ctypes.Structure):
    """The first members of bst_camera."""
    C_NAME, C_PREFIX = "bst_camera", True
    _fields_ = [("width_px", c_int64), ("height_px", c_int64), ("pixel_scale_arcsec", c_double),
                ("focal_length_m", c_double), ("f_number", c_double),
                ("pixel_pitch_um", c_double), ("aperture_m", c_double), ("obscuration", c_double),
                ("throughput", c_double), ("quantum_efficiency", c_double),
                ("photon_flux_v0_per_s_m2", c_double), ("psf_fwhm_px", c_double),
                ("zero_point_mag", c_double), ("ensquared_energy", c_double),
                ("background_mag_arcsec2", c_double), ("dark_current_e_per_s", c_double),
                ("read_noise_e", c_double), ("full_well_e", c_double), ("gain_e_per_dn", c_double),
                ("offset_dn", c_double), ("bits", c_int64), ("rotation_deg", c_double)]


class StageDesc(ctypes.Structure):
    """bst_stage_desc."""
    C_NAME = "bst_stage_desc"
    _fields_ = [("abi", c_uint32), ("kind", c_char_p), ("type", c_char_p), ("doc", c_char_p),
                ("config", c_void_p), ("config_bytes", c_size_t), ("functions", c_void_p)]


class DetectorEnv(ctypes.Structure):
    """bst_detector_env."""
    C_NAME = "bst_detector_env"
    _fields_ = [("camera", POINTER(CameraHead)), ("electrons_per_s_v0", c_double),
                ("capacity", c_int), ("dark_e_per_s", c_void_p), ("flat", c_void_p),
                ("bad", c_void_p)]


class DetectorFrame(ctypes.Structure):
    """bst_detector_frame."""
    C_NAME = "bst_detector_frame"
    _fields_ = [("exposure_id", c_int64), ("pixels", c_void_p), ("window", Window),
                ("binning", c_int), ("bits", c_int), ("exposure_s", c_double),
                ("motion", c_void_p)]


class FrameStageEnv(ctypes.Structure):
    """bst_frame_stage_env."""
    C_NAME = "bst_frame_stage_env"
    _fields_ = [("camera", POINTER(CameraHead)), ("instance", c_char_p), ("seed", c_uint64),
                ("run", c_uint64)]


class FrameStageFrame(ctypes.Structure):
    """bst_frame_stage_frame."""
    C_NAME = "bst_frame_stage_frame"
    _fields_ = [("exposure_id", c_int64), ("start_s", c_double), ("end_s", c_double),
                ("window", Window), ("width", c_int), ("height", c_int), ("binning", c_int),
                ("bits", c_int)]


class ConfigDesc(ctypes.Structure):
    """bst_config_desc."""
    C_NAME = "bst_config_desc"
    _fields_ = [("key", c_char_p), ("type", c_int), ("unit", c_char_p), ("minimum", c_double),
                ("maximum", c_double), ("fallback", c_char_p), ("doc", c_char_p),
                ("offset", c_size_t), ("size", c_size_t), ("choices", c_void_p),
                ("children", c_void_p), ("item_bytes", c_size_t)]


class Port(ctypes.Structure):
    """bst_port."""
    C_NAME = "bst_port"
    _fields_ = [("channel", c_char_p), ("direction", c_int), ("flags", c_uint),
                ("max_age_s", c_double), ("capacity", c_int)]


class FleetMember(ctypes.Structure):
    """bst_fleet_member."""
    C_NAME = "bst_fleet_member"
    _fields_ = [("scope", c_char_p), ("observer", c_int), ("sensor", c_int),
                ("knowledge", c_void_p), ("frame_exposure_s", c_double),
                ("frame_period_s", c_double), ("frame_latency_s", c_double)]


class ModuleEnv(ctypes.Structure):
    """bst_module_env."""
    C_NAME = "bst_module_env"
    _fields_ = [("ctx", c_void_p), ("instance", c_char_p), ("tick_rate_hz", c_int64),
                ("period_ticks", c_int64), ("seed", c_uint64), ("run", c_uint64),
                ("world", c_void_p), ("knowledge", c_void_p), ("device", c_void_p),
                ("observer", c_int), ("sensor", c_int), ("exposure_s", c_double),
                ("los_period_ticks", c_int64), ("los_offset_ticks", c_int64),
                ("planes", c_uint32), ("mask_threshold_sigma", c_double),
                ("engine_private", c_void_p), ("frame_exposure_s", c_double),
                ("frame_period_s", c_double), ("frame_latency_s", c_double), ("link", c_void_p),
                ("members", POINTER(FleetMember)), ("member_count", c_int)]


class Sample(ctypes.Structure):
    """bst_sample."""
    C_NAME = "bst_sample"
    _fields_ = [("payload", c_void_p), ("written_tick", c_int64), ("sequence", c_int64),
                ("stale", c_bool)]


MapFunction = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(c_void_p))
OwnerFunction = CFUNCTYPE(None, c_void_p)


class FrameOps(ctypes.Structure):
    """bst_frame_ops."""
    C_NAME = "bst_frame_ops"
    _fields_ = [("map", MapFunction), ("unmap", OwnerFunction), ("device_buffer", c_void_p),
                ("recycle", c_void_p), ("share", c_void_p)]


class FrameHandle(ctypes.Structure):
    """bst_frame."""
    C_NAME = "bst_frame"
    _fields_ = [("ops", POINTER(FrameOps)), ("owner", c_void_p), ("width", c_int),
                ("height", c_int), ("references", c_int), ("maps", c_int)]


ArchiveFunction = CFUNCTYPE(c_int, c_void_p, c_void_p)
DestroyFunction = CFUNCTYPE(None, c_void_p)
DetectorCreate = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(DetectorEnv), POINTER(c_void_p))
DetectFunction = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(DetectorFrame), c_void_p)
FrameStageCreate = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(FrameStageEnv), POINTER(c_void_p))
ApplyFunction = CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(FrameStageFrame), c_void_p)


class DetectorStage(ctypes.Structure):
    """bst_detector_stage."""
    C_NAME = "bst_detector_stage"
    _fields_ = [("create", DetectorCreate), ("detect", DetectFunction),
                ("destroy", DestroyFunction), ("archive", ArchiveFunction)]


class FrameStage(ctypes.Structure):
    """bst_frame_stage."""
    C_NAME = "bst_frame_stage"
    _fields_ = [("create", FrameStageCreate), ("apply", ApplyFunction),
                ("destroy", DestroyFunction), ("archive", ArchiveFunction)]


ModuleCreate = CFUNCTYPE(c_int, POINTER(ModuleEnv), c_void_p, POINTER(c_void_p))
StepFunction = CFUNCTYPE(c_int, c_void_p, c_void_p)


class ModuleDesc(ctypes.Structure):
    """bst_module_desc."""
    C_NAME = "bst_module_desc"
    _fields_ = [("abi", c_uint32), ("role", c_char_p), ("type", c_char_p), ("doc", c_char_p),
                ("flags", c_uint), ("config", c_void_p), ("config_bytes", c_size_t),
                ("default_rate_hz", c_double), ("ports", c_void_p), ("port_count", c_int),
                ("create", ModuleCreate), ("step", StepFunction), ("destroy", DestroyFunction),
                ("finish", c_void_p), ("ahead", c_void_p), ("substitutes_for", c_void_p),
                ("also", c_char_p), ("archive", ArchiveFunction)]


CompensatorInit = CFUNCTYPE(c_int, c_void_p, c_void_p, c_double, c_void_p)
CompensatorStep = CFUNCTYPE(c_double, c_void_p, c_double)
CompensatorSet = CFUNCTYPE(None, c_void_p, c_double, c_double)


class CompensatorStage(ctypes.Structure):
    """bst_compensator_stage."""
    C_NAME = "bst_compensator_stage"
    _fields_ = [("state_bytes", c_size_t), ("init", CompensatorInit), ("step", CompensatorStep),
                ("set", CompensatorSet), ("response", c_void_p), ("archive", ArchiveFunction)]


STAGE_ABI = 2
"""BST_STAGE_ABI."""
MODULE_ABI = 7
"""BST_MODULE_ABI."""

ALL: List[Type[Any]] = [Context, ModelOptions, SimOptions, SimObserver, SimMessage, SimFrame, SimColumns, Vec3,
                        Quat, ChannelType, Window, CameraHead, StageDesc, DetectorEnv, DetectorFrame,
                        FrameStageEnv, FrameStageFrame, DetectorStage, FrameStage, ConfigDesc,
                        Port, FleetMember, ModuleEnv, Sample, FrameOps, FrameHandle, ModuleDesc,
                        CompensatorStage]


def size_of(struct: Type[Any]) -> int:
    """Bytes of a struct."""
    return ctypes.sizeof(struct)
