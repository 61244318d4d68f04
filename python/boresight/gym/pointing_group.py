"""PointingGroup: n environments of pointing as arrays, stepped in a pool of threads."""
from __future__ import annotations

from typing import Any, List, NamedTuple, Optional, Sequence

import numpy as np
import numpy.typing as npt

from ..messages import Label, LosCommand, SourceKind, TruthFlag
from ..model import Model
from ..pool import Columns, Held, Pool
from ..simulation import Simulation
from .geometry import gcrf_of_cam, tilted

REWARD_PX = 5.0
"""Error of pointing at which the reward is 1/2."""
SETTLING_FRAMES = 4
"""Frames from the start of a run until the mount has settled."""
LOW, HIGH = np.array([-2, -2, -2, 0, 0], np.float32), np.array([2, 2, 8, 1, 1], np.float32)
"""Limits of the members of an observed detection."""

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class PointingSettings(NamedTuple):
    """What the environments of a group have in common; see PointingEnv."""

    detections: int
    rate_step_px: float
    offset_px: float
    patience: int


class Outcome(NamedTuple):
    """What a step gives for each environment."""

    reward: Floats
    terminated: Flags
    truncated: Flags


class PointingGroup:
    """The state of n environments: their simulations, commanded rates, and newest observations.

    Given:     model     of one sensor, whose control is external
               count     n
               pool      of threads that step them
    """

    def __init__(self, model: Model, count: int, pool: Pool, settings: PointingSettings):
        self.model, self.count, self.settings = model, count, settings
        self.camera = model.camera()
        self.sims: List[Optional[Simulation]] = [None] * count
        self.detections = np.zeros((count, settings.detections, 5), np.float32)
        self.rate = np.zeros((count, 2))
        self.error_px, self.in_field = np.full(count, np.inf), np.zeros(count, bool)
        self._missed, self._pool = np.zeros(count, int), pool
        self._found: Optional[Columns] = None
        self._truth: Optional[Columns] = None

    def close(self) -> None:
        """Ends the simulations."""
        for sim in self.sims:
            if sim is not None:
                sim.close()
        self.sims = [None] * self.count

    def items(self, number: int) -> npt.NDArray[np.void]:
        """The newest detections of an environment."""
        if self._found is None:
            return np.zeros(0, np.dtype([]))
        return self._found.items[number, :self._found.counts[number]].copy()

    def begin(self, numbers: Sequence[int], runs: Sequence[int],
              generators: Sequence[np.random.Generator]) -> None:
        """Starts environments anew, with the boresight beside the satellite. They settle in the
        next `advance`."""
        new = np.zeros(self.count, bool)
        for number, run in zip(numbers, runs):
            sim = self.sims[number]
            if sim is not None:
                sim.close()
            self.sims[number] = Simulation(self.model, run=run)
            new[number] = True
        self.rate[new], self._missed[new] = 0.0, 0
        shift = np.zeros((self.count, 2))
        for number, generator in zip(numbers, generators):
            angle = generator.uniform(0, 2 * np.pi)
            radius = self.settings.offset_px * np.sqrt(generator.uniform())
            shift[number] = radius * self.camera.pixel_scale_rad * np.array([np.cos(angle),
                                                                            np.sin(angle)])
        with self._pool.hold(self.sims) as held:
            held.step("exposure", where=new)
            newest = held.view("pointing_telemetry", items=1, where=new).items[:, 0]
            command = np.zeros(self.count, LosCommand.dtype)
            for number in numbers:
                command["direction_gcrf"][number] = tilted(newest["q_cam_from_gcrf"][number],
                                                           *shift[number])
            command["tick"] = held.ticks()
            held.command("los_command", command, where=new)

    def settle(self) -> None:
        """Lets all environments settle after `begin`."""
        with self._pool.hold(self.sims) as held:
            self._advance(held, np.full(self.count, SETTLING_FRAMES, np.int32))

    def _advance(self, held: Held, messages: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """Goes on by numbers [n] of frames, and observes.

        Returned:  [n] frames that came before the run's end
        """
        came = held.step("detections", messages, self.model.duration_s)
        self._found = _view(held, "detections", self._found)
        self._truth = _view(held, "truth", self._truth)
        self.detections[came > 0] = self._observed(self._found)[came > 0]
        self._score(self._truth)
        return came

    def step(self, actions: Floats, fresh: Flags) -> Outcome:
        """Commands the lines of sight and goes on to the next detections. Those that `begin` has
        started (`fresh`) settle instead; their rewards are 0.

        Given:     actions  [n, 2]
        """
        self.rate[~fresh] = np.clip(self.rate[~fresh] + np.clip(actions[~fresh], -1, 1), -100, 100)
        with self._pool.hold(self.sims) as held:
            period_s = self._command(held, ~fresh)
            came = self._advance(held, np.where(fresh, SETTLING_FRAMES, 1).astype(np.int32))
        assert self._found is not None
        there = came > 0
        self._missed = np.where(fresh | self.in_field, 0, self._missed + there)
        reward = np.where(self.in_field & there & ~fresh,
                          1.0 / (1.0 + (self.error_px / REWARD_PX) ** 2), 0.0)
        time_s = self._found.ticks / self.model.tick_rate_hz
        truncated = ~fresh & (~there | (time_s + period_s > self.model.duration_s))
        terminated = ~fresh & there & (self._missed >= self.settings.patience)
        return Outcome(reward, terminated, truncated)

    def _command(self, held: Held, where: Flags) -> Floats:
        """Turns boresights on, from where they are by the telemetry, at the commanded rates.

        Returned:  [n] time between frames, s
        """
        newest = held.view("pointing_telemetry", items=1, where=where).items[:, 0]
        exposure = held.view("exposure", where=where).headers
        length = (exposure["end_tick"] - exposure["start_tick"]) / self.model.tick_rate_hz
        period_s: Floats = np.maximum(length, 1.0)
        q = newest["q_cam_from_gcrf"]
        turn = np.zeros((self.count, 3))
        turn[:, :2] = (self.rate * self.settings.rate_step_px * self.camera.pixel_scale_rad
                       / period_s[:, None])
        direction, rate = gcrf_of_cam(q, [0.0, 0.0, 1.0]), gcrf_of_cam(q, turn)
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        rate -= direction * np.sum(direction * rate, axis=1)[:, None]
        command = np.zeros(self.count, LosCommand.dtype)
        command["tick"], command["direction_gcrf"] = newest["tick"], direction
        command["rate_gcrf_radps"] = rate
        held.command("los_command", command, where=where)
        return period_s

    def _observed(self, found: Columns) -> npt.NDArray[np.float32]:
        """Rows of the newest detections: objects first, brightest first."""
        most = max(int(found.counts.max()), 1)
        used = np.arange(most) < found.counts[:, None]
        items = found.items[:, :most]
        snr, label = items["snr"], items["label"]
        order = np.lexsort((-snr, label == Label.STAR, ~used), axis=-1)
        order = order[:, :self.settings.detections]
        out = np.zeros((self.count, self.settings.detections, 5), np.float32)
        rows = out[:, :order.shape[1]]

        def of(values: Any) -> Any:
            return np.take_along_axis(values, order, 1)
        there = of(used)
        half = np.array([self.camera.width_px, self.camera.height_px]) / 2.0
        rows[..., 0] = (of(items["x_px"]) + 0.5 - half[0]) / half[0]
        rows[..., 1] = (of(items["y_px"]) + 0.5 - half[1]) / half[1]
        rows[..., 2] = np.log10(np.maximum(np.where(there, of(snr), 1.0), 0.01))
        kind = of(label)
        rows[..., 3] = np.where(kind == Label.STAR, 1.0, np.where(kind == Label.OBJECT, 0.0, 0.5))
        rows[..., 4] = 1.0
        rows[~there] = 0.0
        return np.clip(out, LOW, HIGH)

    def _score(self, truth: Columns) -> None:
        """Distance of the satellite from the boresight in the newest frames."""
        most = max(int(truth.counts.max()), 1)
        items = truth.items[:, :most]
        objects = (items["kind"] == SourceKind.OBJECT) & (np.arange(most) < truth.counts[:, None])
        first = objects.argmax(axis=1)
        item = items[np.arange(self.count), first]
        there = objects[np.arange(self.count), first]
        error = np.hypot(item["x_mid_px"] - truth.headers["boresight_x_px"],
                         item["y_mid_px"] - truth.headers["boresight_y_px"])
        error = np.where(there & np.isfinite(error), error, np.inf)
        self.error_px = error
        self.in_field = there & (item["flags"] & TruthFlag.IN_FIELD > 0)


def _view(held: Held, channel: str, before: Optional[Columns]) -> Columns:
    """All items of the newest messages; the arrays of the view before are filled again."""
    found = held.view(channel, items=64, into=before)
    most = int(found.counts.max())
    if most > found.items.shape[1]:
        grown = np.zeros((len(found.counts), 2 * most), found.items.dtype)
        grown[:, :found.items.shape[1]] = found.items
        found = held.view(channel, into=found._replace(items=grown))
    return found
