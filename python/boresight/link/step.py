"""A step of a part: its inputs, and the answer to it."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .errors import LinkError
from .packet import Message, new_items, new_record
from .tables import MODES

if TYPE_CHECKING:
    from .connection import Link


@dataclass
class Part:
    """A part that this peer plays, with the onboard knowledge of its sensor."""
    instance: str
    role: str
    record: np.void

    def __getitem__(self, name: str) -> Any:
        """A member of `welcome`: width_px, pixel_scale_rad, gain_e_per_dn, ..."""
        return self.record[name]


@dataclass
class Step:
    """A step of a part: its inputs, and the answer to it."""
    link: "Link"
    part: Part
    header: Dict[str, Any]
    inputs: List[Message] = field(default_factory=list)
    sent: Dict[str, Tuple[npt.NDArray[np.void], Optional[npt.NDArray[np.void]]]] = field(
        default_factory=dict)
    _done: bool = False

    @property
    def tick(self) -> int:
        """Tick of the step."""
        return int(self.header["tick"])

    @property
    def seconds(self) -> float:
        """Time since the start of the run, s."""
        return self.tick / self.link.tick_rate_hz

    def get(self, kind: str) -> Optional[Message]:
        """The newest input of a type in this step, or None."""
        return next((m for m in reversed(self.inputs) if m.type == kind), None)

    @property
    def frame(self) -> Optional[Message]:
        """The newest frame of this step, or None."""
        return self.get("frame")

    def send(self, kind: str, record: npt.NDArray[np.void],
             items: Optional[npt.NDArray[np.void]] = None) -> None:
        """Answers with a message, at most one of each type (see new_record and new_items)."""
        if self._done or kind in self.sent:
            raise LinkError(f"a step takes one {kind}, before it is done")
        self.sent[kind] = (record, items)

    def send_detections(self, x_px: Any, y_px: Any, **columns: Any) -> None:
        """Detections in the frame of this step: full-sensor pixels, and any other member of an item
        by name (flux_e, snr, cov_xx, label, ...), each a number or an array. cov_xx and cov_yy are
        0.01 px^2 by default."""
        frame = self.frame
        if frame is None:
            raise LinkError("there is no frame in this step")
        x_px = np.atleast_1d(np.asarray(x_px, float))
        items, record = new_items("detections", len(x_px)), new_record("detections")
        items["cov_xx"] = items["cov_yy"] = 0.01
        for name, values in {"x_px": x_px, "y_px": y_px, **columns}.items():
            items[name] = values
        for name in ("exposure_id", "start_tick", "end_tick"):
            record[name] = frame[name]
        q = self.link.attitude_at(self.part, (frame["start_tick"] + frame["end_tick"]) / 2)
        record["q_cam_from_gcrf"] = record["q_telemetry_from_gcrf"] = q
        self.send("detections", record, items)

    def send_command(self, direction_gcrf: Any, rate_gcrf_radps: Any = (0.0, 0.0, 0.0),
                     tick: Optional[int] = None) -> None:
        """Commands the boresight: apparent direction (normalised) at a tick, by default this step's,
        with rate and acceleration."""
        direction = np.asarray(direction_gcrf, float)
        record = new_record("los_command")
        record["tick"] = self.tick if tick is None else tick
        record["direction_gcrf"] = direction / np.linalg.norm(direction)
        record["rate_gcrf_radps"] = rate_gcrf_radps
        self.send("los_command", record)

    def send_status(self, mode: str, target_id: int = 0) -> None:
        """Sends the mode of control, for recording and summary: one of MODES."""
        record = new_record("control_status")
        record["tick"], record["mode"], record["target_id"] = self.tick, MODES[mode], target_id
        self.send("control_status", record)

    def send_sensor(self, exposure_s: float = 0.0, period_s: float = 0.0,
                    window: Tuple[int, int, int, int] = (0, 0, 0, 0), binning: int = 0,
                    pixel_scale_arcsec: float = 0.0) -> None:
        """Commands exposure settings from the next exposure on; 0: unchanged. `window`: x0, y0, width,
        height in full-sensor pixels; zeros: full sensor."""
        record = new_record("sensor_command")
        record["exposure_s"], record["period_s"], record["binning"] = exposure_s, period_s, binning
        record["pixel_scale_arcsec"] = pixel_scale_arcsec
        for name, value in zip(("x0", "y0", "width", "height"), window):
            record["window." + name] = value
        self.send("sensor_command", record)

    def send_pointing(self, ticks: Any, q_cam_from_gcrf: Any) -> None:
        """Answer of a gimbal: true attitudes (x, y, z, w), from GCRF to camera axes, at ascending ticks up to
        the next step, `period_ticks` from now; start and end, or a history."""
        ticks = np.atleast_1d(np.asarray(ticks))
        items = new_items("pointing", len(ticks))
        items["tick"], items["q_cam_from_gcrf"] = ticks, q_cam_from_gcrf
        self.send("pointing", new_record("pointing"), items)

    def send_states(self, states: Any) -> None:
        """Answer of a gimbal: states of commanded objects: (name, tick, position m, velocity m/s), GCRF.
        Two-body motion continues each state until the next one."""
        states = list(states)
        items = new_items("target_states", len(states))
        for item, (name, tick, position, velocity) in zip(items, states):
            item["object"], item["tick"] = name, tick
            item["position_gcrf_m"], item["velocity_gcrf_mps"] = position, velocity
        self.send("target_states", new_record("target_states"), items)

    def send_attitudes(self, attitudes: Any) -> None:
        """Answer of a gimbal: attitudes of commanded objects with a shape: (name, tick, quaternion x, y, z, w
        from GCRF to the body, angular velocity rad/s in the body frame)."""
        attitudes = list(attitudes)
        items = new_items("target_attitudes", len(attitudes))
        for item, (name, tick, q_body_from_gcrf, rate) in zip(items, attitudes):
            item["object"], item["tick"] = name, tick
            item["q_body_from_gcrf"], item["rate_body_radps"] = q_body_from_gcrf, rate
        self.send("target_attitudes", new_record("target_attitudes"), items)

    def done(self) -> None:
        """Ends the step. `Link.steps` does this when the next step is requested."""
        if not self._done:
            self._done = True
            self.link.answer(self)
