"""Scenario: the text of a scenario with changes, before it is read."""
from __future__ import annotations

import json
import os
import pathlib
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from .block import Block, plain
from .errors import ArgumentError, FileError, NotFoundError

Path = Union[str, "os.PathLike[str]"]
_KEPT = ("rate_hz", "offset_s", "delay_s", "description")
_KEPT_BY = {"control": ("exposure_s", "period_s"), "gimbal": ("platform",)}
EXTERNAL_ROLES = ("imgproc", "tracker", "control", "gimbal")


class Scenario:
    """A scenario: a file or a dictionary, and values that replace some of its values. Immutable.

    >>> scn = Scenario.load("neossat_geo_track.json").with_(duration_s=60)
    """

    __slots__ = ("path", "text", "assignments")
    path: str
    text: Optional[str]
    assignments: Tuple[str, ...]

    def __init__(self, path: str, text: Optional[str] = None,
                 assignments: Sequence[str] = ()) -> None:
        for name, value in (("path", path), ("text", text), ("assignments", tuple(assignments))):
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise ArgumentError(f"a scenario is immutable: use with_({name}=...)")

    @classmethod
    def load(cls, path: Path) -> "Scenario":
        """A scenario file; also the name of one that comes with Boresight.

        Errors:    NotFoundError: no such file; FileError. The content is checked by `validate` and
                   when a model is made of it
        """
        from . import _native
        try:
            given = pathlib.Path(path)
        except TypeError:
            raise ArgumentError(f"load takes a path, not {type(path).__name__}") from None
        if "\0" in str(given):
            raise ArgumentError("load: a path with a zero in it")
        shipped = _native.scenarios_path()
        for place in (given, shipped / given, shipped / f"{given}.json", shipped.parent / given):
            if place.is_file():
                return cls(str(place.resolve()))
        if given.exists():
            raise FileError(f"{given} is no file")
        raise NotFoundError(f"{given}: there is no such file, nor one of that name among the "
                            f"scenarios that come with Boresight ({shipped})")

    @classmethod
    def from_dict(cls, document: Dict[str, Any], folder: Path = ".") -> "Scenario":
        """A scenario of a dictionary; relative paths in it start in `folder`."""
        try:
            text = json.dumps(plain(document))
        except (TypeError, ValueError, RecursionError) as error:
            raise ArgumentError(f"this is no JSON document: {error}") from None
        return cls(str(pathlib.Path(folder).resolve() / "scenario"), text)

    @classmethod
    def of(cls, source: Any) -> "Scenario":
        """A scenario of a Scenario, a path or a dictionary."""
        if isinstance(source, Scenario):
            return source
        if isinstance(source, dict):
            return cls.from_dict(source)
        if isinstance(source, (str, os.PathLike)):
            return cls.load(source)
        if isinstance(source, Block):
            return cls.from_dict(source.to_dict())
        raise ArgumentError("a scenario is a Scenario, a path, a dictionary or a config.Scenario, "
                            f"not {type(source).__name__}")

    @classmethod
    def new(cls, observer: Any = None, target: Any = None, telescope: Any = None, *, aperture_m: Optional[float] = None,
            pixel_scale_arcsec: Optional[float] = None, focal_length_m: Optional[float] = None,
            period_s: Optional[float] = None, duration_s: Optional[float] = None,
            start_utc: Optional[str] = None) -> "Scenario":
        """A small scenario in which one satellite finds and follows another (`boresight new`).

        Given:     observer, target  catalogue number or name of the element sets that come with
                                     Boresight, or FILE:NUMBER; None: NEOSSat and INMARSAT GX5
                   telescope         values of its camera: a config.Camera or a dictionary
                   aperture_m, ...   as the options of `boresight new`
        """
        from .program import options_of, work_folder, execute
        options = options_of(observer_tle=observer, target_tle=target, aperture=aperture_m,
                             pixel_scale=pixel_scale_arcsec, focal_length=focal_length_m,
                             period=period_s, duration=duration_s, start=start_utc)
        with work_folder() as folder:
            file = folder / "scenario.json"
            execute(["new", str(file), *options])
            document = json.loads(file.read_text(encoding="utf-8"))
        camera = {} if telescope is None else plain(telescope)
        if not isinstance(camera, dict):
            raise ArgumentError(f"telescope takes a config.Camera or a dictionary, not "
                                f"{type(telescope).__name__}")
        return cls.from_dict(document).with_(
            {f"/observers/0/sensors/0/camera/{key}": value for key, value in camera.items()})

    def with_(self, _values: Optional[Dict[str, Any]] = None, **values: Any) -> "Scenario":
        """A scenario in which some values are replaced.

        Given:     values   by the names of keys and list positions with "__" between them:
                            observers__0__sensors__0__exposure__exposure_s=0.2. Keys that scenarios
                            hold in `world` may omit it: objects__0__area_m2=1
                   _values  by JSON pointers: {"/world/objects/0/area_m2": 1}
        """
        added = []
        for pointer, value in (_values or {}).items():
            if not isinstance(pointer, str) or not pointer.startswith("/"):
                raise ArgumentError(f"with_: {pointer!r} is no JSON pointer, as \"/duration_s\"")
            added.append(_assignment(pointer, value))
        for name, value in values.items():
            steps = name.split("__")
            if steps[0] in _WORLD:
                steps.insert(0, "world")
            added.append(_assignment("/" + "/".join(steps), value))
        return Scenario(self.path, self.text, self.assignments + tuple(added))

    def with_external(self, names: Sequence[str]) -> "Scenario":
        """A scenario whose named modules are played from outside, as by `run --external`."""
        document = self.to_dict()
        changes: Dict[str, Any] = {}
        for name in names:
            found = 0
            for where, role, module in _modules(document):
                pointer, full = where
                if role in EXTERNAL_ROLES and name in (role, full):
                    kept = _KEPT + _KEPT_BY.get(role, ())
                    changes[pointer] = {"type": "external",
                                        **{k: v for k, v in module.items() if k in kept}}
                    found += 1
            if not found:
                raise ArgumentError(f"external: the scenario has no module {name!r} that can be "
                                    "outside (allowed: imgproc, tracker, control, gimbal, or "
                                    "OBSERVER/SENSOR/MODULE)")
        return self.with_(changes)

    def with_plugin(self, *, detector: Optional[str] = None, frame_stage: Optional[str] = None,
                    compensator: Optional[str] = None, imgproc: Optional[str] = None,
                    tracker: Optional[str] = None, control: Optional[str] = None,
                    tasking: Optional[str] = None, **keys: Any) -> "Scenario":
        """A scenario in which a plug-in replaces modules or parts of them, of all sensors: the path
        of a library, or a name that `register` gave.

        Given:     detector     of imgproc
                   frame_stage  of scenegen
                   compensator  of control
                   imgproc, tracker, control, tasking
                                the whole module; it keeps the delays of its inputs
                   keys         the plug-in's own keys, and rate_hz, offset_s and delay_s
        """
        stages = {"detector": ("imgproc", detector), "frame_stage": ("scenegen", frame_stage),
                  "compensator": ("control", compensator)}
        modules = {"imgproc": imgproc, "tracker": tracker, "control": control}
        changes: Dict[str, Any] = {}
        document = self.to_dict()
        for (pointer, _), role, module in _modules(document):
            for stage, (owner, plugin) in stages.items():
                if plugin is not None and owner == role:
                    changes[f"{pointer}/{stage}"] = {"plugin": plugin, **keys}
            whole = modules.get(role)
            if whole is not None:
                changes[pointer] = {**_in_place(role, whole, module), **keys}
        if tasking is not None:
            changes["/tasking"] = {**_in_place("tasking", tasking, document.get("tasking") or {}),
                                   **keys}
        if not changes:
            raise ArgumentError("with_plugin: give a detector, frame_stage, compensator, imgproc, "
                                "tracker, control or tasking, of a scenario with that module")
        return self.with_(changes)

    def validate(self) -> "Scenario":
        """Reads and checks the scenario.

        Errors:    ScenarioError, FormatError, ...: the text names file, key and allowed values
        """
        from .model import load_model
        load_model(self)
        return self

    def to_dict(self) -> Dict[str, Any]:
        """The complete scenario, with every default written out."""
        from .model import Model
        return Model(self).to_dict()

    def to_json(self, indent: Optional[int] = 4) -> str:
        """The complete scenario as JSON, with every default written out."""
        return json.dumps(self.to_dict(), indent=indent)

    def arguments(self) -> List[str]:
        """Arguments of the program for the changes: --set POINTER=VALUE ..."""
        return [part for a in self.assignments for part in ("--set", a)]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> Tuple[Any, ...]:
        return self.path, self.text, self.assignments

    def __reduce__(self) -> Any:
        return Scenario, self._key()

    def __repr__(self) -> str:
        changes = "".join(f", {a}" for a in self.assignments)
        return f"<Scenario {self.path}{changes}>"


def _in_place(role: str, plugin: str, module: Dict[str, Any]) -> Dict[str, Any]:
    """Block of a plug-in in place of a module: it keeps the delays of the channels that it reads."""
    from .registration import registered
    delays = module.get("delay_s")
    reads = registered.get(plugin, {}).get(role)
    if isinstance(delays, dict) and reads is not None:
        delays = {channel: delay for channel, delay in delays.items() if channel in reads}
    return {"plugin": plugin, **({"delay_s": delays} if delays else {})}


_WORLD = ("objects", "star_catalogue", "earth_orientation")


def _assignment(pointer: str, value: Any) -> str:
    try:
        return f"{pointer}={json.dumps(plain(value))}"
    except (TypeError, ValueError, RecursionError) as error:
        raise ArgumentError(f"{pointer}: {error}") from None


def _modules(document: Dict[str, Any]) -> Iterator[Tuple[Tuple[str, str], str, Dict[str, Any]]]:
    """JSON pointer and name of each module of each sensor, its role, and its keys."""
    for i, observer in enumerate(document.get("observers", [])):
        for j, sensor in enumerate(observer.get("sensors", [])):
            for role, module in sensor.get("modules", {}).items():
                pointer = f"/observers/{i}/sensors/{j}/modules/{role}"
                name = f"{observer.get('name')}/{sensor.get('name')}/{role}"
                yield (pointer, name), role, module
