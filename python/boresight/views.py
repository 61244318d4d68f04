"""The channels of a sensor as attributes."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, cast

from . import messages as m
from .record import Message

if TYPE_CHECKING:
    from .frame import Frame


class ChannelViews:
    """Newest message of each channel of a sensor: None before the first one.

    A message is a copy, which stays valid; the pixels of `frame` are not copied. Assigning gives
    an external module its next output, with the checks of the packet link.

    Errors:    NotFoundError: no module writes the channel; assigning: ArgumentError, NotFoundError:
               no external module
    """

    __slots__ = ()

    def view(self, channel: str) -> Optional[Message]:
        """Newest message of a channel by its name."""
        raise NotImplementedError

    def view_frame(self) -> "Optional[Frame]":
        """Newest frame with its pixels."""
        raise NotImplementedError

    def command(self, channel: str, value: Any) -> None:
        """Gives the external module of a channel its next output."""
        raise NotImplementedError

    @property
    def frame(self) -> "Optional[Frame]":
        """Newest frame; its pixels are not copied."""
        return self.view_frame()

    @property
    def exposure(self) -> Optional[m.Exposure]:
        """Times and sensor settings of the newest exposure."""
        return cast("Optional[m.Exposure]", self.view("exposure"))

    @property
    def truth(self) -> Optional[m.Truth]:
        """The true scene of the newest exposure."""
        return cast("Optional[m.Truth]", self.view("truth"))

    @property
    def los_history(self) -> Optional[m.LosHistory]:
        """True attitudes of the camera, oldest first."""
        return cast("Optional[m.LosHistory]", self.view("los_history"))

    @property
    def pointing_telemetry(self) -> Optional[m.PointingTelemetry]:
        """Measured attitudes of the camera, oldest first."""
        return cast("Optional[m.PointingTelemetry]", self.view("pointing_telemetry"))

    @property
    def nav_telemetry(self) -> Optional[m.NavTelemetry]:
        """Orbit of the spacecraft by onboard navigation."""
        return cast("Optional[m.NavTelemetry]", self.view("nav_telemetry"))

    @property
    def mount_status(self) -> Optional[m.MountStatus]:
        """Geometry, limits and state of the mount, as known on board."""
        return cast("Optional[m.MountStatus]", self.view("mount_status"))

    @property
    def task(self) -> Optional[m.Task]:
        """Object that the sensor shall search for."""
        return cast("Optional[m.Task]", self.view("task"))

    @task.setter
    def task(self, value: Any) -> None:
        self.command("task", value)

    @property
    def detections(self) -> Optional[m.Detections]:
        """What image processing, or the observation generator, found in the newest frame."""
        return cast("Optional[m.Detections]", self.view("detections"))

    @detections.setter
    def detections(self, value: Any) -> None:
        self.command("detections", value)

    @property
    def tracks(self) -> Optional[m.Tracks]:
        """The tracker's state after the newest frame."""
        return cast("Optional[m.Tracks]", self.view("tracks"))

    @tracks.setter
    def tracks(self, value: Any) -> None:
        self.command("tracks", value)

    @property
    def predictions(self) -> Optional[m.Predictions]:
        """Predicted positions of tracks."""
        return cast("Optional[m.Predictions]", self.view("predictions"))

    @predictions.setter
    def predictions(self, value: Any) -> None:
        self.command("predictions", value)

    @property
    def los_command(self) -> Optional[m.LosCommand]:
        """Where the boresight is commanded to point."""
        return cast("Optional[m.LosCommand]", self.view("los_command"))

    @los_command.setter
    def los_command(self, value: Any) -> None:
        self.command("los_command", value)

    @property
    def sensor_command(self) -> Optional[m.SensorCommand]:
        """Exposure, period, window and binning that control requests."""
        return cast("Optional[m.SensorCommand]", self.view("sensor_command"))

    @sensor_command.setter
    def sensor_command(self, value: Any) -> None:
        self.command("sensor_command", value)

    @property
    def control_status(self) -> Optional[m.ControlStatus]:
        """Mode and target of control."""
        return cast("Optional[m.ControlStatus]", self.view("control_status"))

    @control_status.setter
    def control_status(self, value: Any) -> None:
        self.command("control_status", value)
