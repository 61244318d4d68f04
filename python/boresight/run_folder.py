"""Run: the folder of a run, with summary, tables and frames."""
from __future__ import annotations

import json
import os
import pathlib
import shutil
import weakref
from typing import Any, Dict, Iterator, List, Optional, Sequence, Union, overload

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError, FileError, FormatError, NotFoundError
from .fits import Place, images, read_image, wcs_of
from .scenario import Scenario
from .tables import HasTables, Store, Table

Path = Union[str, "os.PathLike[str]"]


class RecordedFrame:
    """A frame of a run: `data`, `header` and `wcs`, read when they are asked for."""

    def __init__(self, path: pathlib.Path, place: Place, number: int):
        self._path, self._place, self._number = path, place, number

    @property
    def data(self) -> npt.NDArray[np.uint16]:
        """Pixels, uint16 [height, width], digital numbers."""
        return read_image(self._path, self._place)

    @property
    def header(self) -> Dict[str, str]:
        """Keywords of the FITS header, as text."""
        return dict(self._place.cards)

    @property
    def exposure_id(self) -> int:
        """Number of the exposure."""
        return int(self._place.cards.get("FRAMEID", self._number))

    @property
    def wcs(self) -> Any:
        """The astropy.wcs.WCS of the frame (needs astropy)."""
        return wcs_of(self._path, self._place)

    def __array__(self, dtype: Any = None, copy: Any = None) -> npt.NDArray[Any]:
        return self.data if dtype is None else self.data.astype(dtype)

    def __repr__(self) -> str:
        return f"<frame {self.exposure_id} of {self._path}>"

    def _repr_html_(self) -> str:
        from .frame import html_text
        from .picture import html_image
        return f"<p>{html_text(repr(self))}</p>{html_image(self.data)}"


class RecordedFrames(Sequence[RecordedFrame]):
    """The frames of a file in order."""

    def __init__(self, path: pathlib.Path):
        self.path = path
        self._places = images(path)

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> RecordedFrame: ...

    @overload
    def __getitem__(self, index: slice) -> List[RecordedFrame]: ...

    def __getitem__(self, index: Union[int, slice]) -> Union[RecordedFrame, List[RecordedFrame]]:
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        try:
            number = range(len(self))[index]
        except IndexError:
            raise IndexError(f"{self.path} has {len(self)} frames; there is no {index}") from None
        except TypeError:
            raise ArgumentError(f"a frame's index is a whole number, not "
                                f"{type(index).__name__}") from None
        return RecordedFrame(self.path, self._places[number], number)

    def __repr__(self) -> str:
        return f"<{len(self)} frames of {self.path}>"


class Run(HasTables):
    """The folder of a run, also of an interrupted one: manifest, scenario, tables and frames.

    The tables are attributes: run.tracks, run.detections, run.truth, run.events ...
    """

    def __init__(self, folder: Path, temporary: Optional[Path] = None):
        self.folder = pathlib.Path(folder)
        if temporary is not None:  # a folder that is removed with the run
            weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)
        if not self.folder.is_dir():
            raise NotFoundError(f"{folder}: there is no such folder")
        self.manifest = self._json("manifest.json", missing={})
        self._store = Store(self.folder / "run.sqlite")

    def _json(self, name: str, missing: Optional[Dict[str, Any]] = None) -> Dict[str, Any]:
        try:
            return dict(json.loads((self.folder / name).read_text(encoding="utf-8")))
        except FileNotFoundError:
            if missing is None:
                raise NotFoundError(f"{self.folder}: no {name} in it; is it the folder of a run?"
                                    ) from None
            return missing
        except OSError as error:
            raise FileError(f"{self.folder / name}: {error.strerror}") from None
        except ValueError as error:
            raise FormatError(f"{self.folder / name}: {error}") from None

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run, complete."""
        return Scenario.load(self.folder / "scenario.json")

    @property
    def summary(self) -> Dict[str, Any]:
        """Figures against the truth: of the first sensor, as the manifest has them."""
        return dict(self.manifest.get("summary", {}))

    @property
    def complete(self) -> bool:
        """False for a run that was interrupted or failed."""
        return bool(self.manifest.get("complete", False))

    def __getattr__(self, name: str) -> Table:
        if name.startswith("_") or name in ("folder", "manifest"):
            raise AttributeError(name)
        if name not in self.tables:
            raise AttributeError(f"a run has no {name!r}; its tables are {', '.join(self.tables)}")
        return self.table(name)

    def __dir__(self) -> List[str]:
        return [*super().__dir__(), *self.tables]

    @property
    def frames(self) -> RecordedFrames:
        """The frames of the first sensor."""
        return self.frames_of(None)

    def frames_of(self, sensor: Optional[str]) -> RecordedFrames:
        """The frames of a sensor "observer/sensor"; None: the first one."""
        paths = sorted(self.folder.glob("frames*.fits"))
        if sensor is not None:
            name = "frames_" + str(sensor).replace("/", "_") + ".fits"
            several = [p for p in paths if p.name == name]
            paths = several or (paths if len(paths) == 1 and paths[0].name == "frames.fits"
                                and self._is_only_sensor(str(sensor)) else [])
        elif len(paths) > 1:
            first = self.table("sensors")
            name = f"frames_{first['observer'][0]}_{first['name'][0]}.fits" \
                if "name" in first else paths[0].name
            paths = [p for p in paths if p.name == name] or paths
        if not paths:
            raise NotFoundError(f"{self.folder} has no frames{f' of {sensor}' if sensor else ''}: "
                                "set /record/frames to \"extensions\" to record them")
        return RecordedFrames(paths[0])

    def _is_only_sensor(self, sensor: str) -> bool:
        rows = self.table("sensors")
        names = [f"{o}/{s}" for o, s in zip(rows["observer"], rows[list(rows)[2]])]
        return names == [sensor]

    def __iter__(self) -> Iterator[Table]:
        raise TypeError("a run is no sequence: use run.frames or run.tables")

    def __reduce__(self) -> Any:
        return Run, (self.folder,)

    def __repr__(self) -> str:
        state = self.manifest.get("ended", "without a manifest")
        return f"<Run {self.manifest.get('scenario', '?')} in {self.folder}: {state}>"

    def _repr_html_(self) -> str:
        from .frame import html_text
        rows = "".join(f"<tr><th style='text-align:left'>{html_text(str(k))}</th>"
                       f"<td>{html_text(str(v))}</td></tr>" for k, v in self.summary.items())
        return f"<p>{html_text(repr(self))}</p><table>{rows}</table>"


def read_run(folder: Path) -> Run:
    """Opens the folder of a run (also of an interrupted one, FOLDER.partial)."""
    return Run(folder)
