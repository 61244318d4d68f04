"""ctypes structs of the C interface (include/boresight/boresight.h, stages.h). A generated C file
asserts their layout when the library is built."""
from __future__ import annotations

import ctypes
from ctypes import (CFUNCTYPE, POINTER, c_bool, c_char, c_char_p, c_double, c_int, c_int64,
                    c_size_t, c_uint, c_uint64, c_void_p)
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


class Vec3(ctypes.Structure):
    """bst_vec3."""
    C_NAME = "bst_vec3"
    _fields_ = [("x", c_double), ("y", c_double), ("z", c_double)]


class ChannelType(ctypes.Structure):
    """bst_channel_type."""
    C_NAME = "bst_channel_type"
    _fields_ = [("name", c_char_p), ("kind", c_int), ("header_bytes", c_size_t),
                ("item_bytes", c_size_t), ("in_place", c_bool), ("release", c_void_p),
                ("retain", c_void_p), ("lends", c_bool), ("count", c_void_p)]


ALL: List[Type[Any]] = [Context, ModelOptions, SimOptions, SimObserver, SimMessage, SimFrame, Vec3,
                        ChannelType]


def size_of(struct: Type[Any]) -> int:
    """Bytes of a struct."""
    return ctypes.sizeof(struct)
