"""The commands of the program as functions: run, pd, study, loop, lightcurve, orbit, report, check,
new.

Options have the names of the program's with "_" for "-"; a tuple stands for numbers with ":"
between them (snr=(3, 9, 0.5)), a list for words with ",". `boresight COMMAND --help` lists them.
Plug-ins in Python (`register`) that a scenario names are called in this process. With `plugins`,
names of Python modules that register them, a new process imports these and runs the command.
"""
from __future__ import annotations

import csv
import json
import os
import pathlib
import shutil
import tempfile
from typing import Any, Dict, List, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from .errors import ArgumentError, FormatError
from .host import host_of
from .model import external_names
from .program import execute, options_of, scenario_arguments, work_folder
from .run_folder import Path, Run
from .scenario import Scenario
from .tables import HasTables, Store, Table


def run(scenario: Any, out: Optional[Path] = None, *, progress: bool = False,
        overwrite: bool = False, duration_s: Optional[float] = None,
        seed: Union[int, str, None] = None, run_number: Optional[int] = None,
        device: Optional[str] = None, threads: Optional[int] = None, external: Sequence[str] = (),
        link: Optional[str] = None, plugins: Sequence[str] = ()) -> Run:
    """Runs a scenario with the program and records it.

    Given:     scenario  a Scenario, a path or a dictionary
               out       folder of the results; None: a temporary one, removed with the Run
               progress  shows the program's progress
               plugins   names of Python modules that register plug-ins; the run is that of a new
                         process, which imports them
               others    as the options of `boresight run`
    Returned:  the run: summary, tables and frames
    Errors:    ProgramError: what the program says; KeyboardInterrupt: the results so far are in
               OUT.partial, if `out` is given
    """
    temporary = None
    if out is None:
        temporary = tempfile.mkdtemp(prefix="boresight-run-")
        out = pathlib.Path(temporary) / "run"
    names = external_names(external)
    options = options_of(out=_path(out, "out"), overwrite=overwrite, duration=duration_s, seed=seed,
                         run_number=run_number, device=device, threads=threads, link=link,
                         external=list(names) or None, quiet=not progress)
    try:
        host = host_of(plugins, scenario)
        with scenario_arguments(scenario) as words:
            execute(["run", *words, *options], progress, host=host)
        return Run(out, temporary)
    except BaseException:
        if temporary is not None:
            shutil.rmtree(temporary, ignore_errors=True)
        raise


def pd(scenario: Any, *, plugins: Sequence[str] = (), **options: Any) -> Dict[str, Any]:
    """Measures the detector of a scenario against theory: probability of detection, false alarms,
    errors of place and flux (`boresight pd`). A detector in Python is called in this process.

    >>> pd("neossat_geo_stare", snr=(3, 9, 0.5), trials=2000)
    """
    return _with_json("pd", scenario, plugins, options)


def loop(scenario: Any, *, plugins: Sequence[str] = (), **options: Any) -> Dict[str, Any]:
    """Margins and predicted pointing of the control loops of a scenario (`boresight loop`)."""
    return _with_json("loop", scenario, plugins, options)


def lightcurve(scenario: Any = None, *, plugins: Sequence[str] = (),
               **options: Any) -> npt.NDArray[np.void]:
    """Magnitude against time (`boresight lightcurve`): of an object of a scenario as its observer
    sees it, or of a satellite's shape (`satellite`) on the orbit of an element set.

    Returned:  [n] rows with the columns of the table: `time_utc` (datetime64), `seconds`, `v_mag`
               (NAN: in the shadow, behind the Earth, below the horizon, or no lit side is seen),
               `phase_deg`, `range_km`, `sunlit_fraction`, `earth_share`, and for sites
               `elevation_deg` and `azimuth_deg`

    >>> lightcurve(satellite="starlink_v1_5.json", elements="all.tle", norad=44713,
    ...            start="2022-06-16T04:00:00Z", site=[32.44, -110.79, 2790])["v_mag"]
    """
    if "output" in options:
        raise ArgumentError("lightcurve returns the table: leave output out")
    if scenario is None:
        return _light_rows(execute(["lightcurve", *options_of(**options)]))
    host = host_of(plugins, scenario)
    with scenario_arguments(scenario) as words:
        return _light_rows(execute(["lightcurve", *words, *options_of(**options)], host=host))


def _light_rows(text: str) -> npt.NDArray[np.void]:
    names, *rows = csv.reader(text.splitlines())
    out = np.zeros(len(rows), [(names[0], "M8[ms]"), *((name, "f8") for name in names[1:])])
    for column, name in enumerate(names):
        values = [row[column] for row in rows]
        out[name] = ([np.datetime64(value.rstrip("Z"), "ms") for value in values] if column == 0
                     else [float(value or "nan") for value in values])
    return out


def _with_json(command: str, scenario: Any, plugins: Sequence[str],
               options: Dict[str, Any]) -> Dict[str, Any]:
    if "json" in options:
        raise ArgumentError(f"{command} returns what --json writes: leave json out")
    host = host_of(plugins, scenario)
    with scenario_arguments(scenario) as words, work_folder() as folder:
        file = folder / "figures.json"
        execute([command, *words, "--json", str(file), *options_of(**options)],
                host=host)
        return dict(_read_json(file))


def _read_json(file: pathlib.Path) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise FormatError(f"{file}: {error}") from None


def check(scenario: Any, *, plugins: Sequence[str] = ()) -> Dict[str, Any]:
    """Reads and validates a scenario, opens what it names, wires its modules, and returns it with
    every default written out (`boresight check`). Warnings go to the logger "boresight"."""
    host = host_of(plugins, scenario)
    with scenario_arguments(scenario) as words:
        return dict(json.loads(execute(["check", *words], host=host)))


def schema() -> Dict[str, Any]:
    """The JSON Schema of scenarios (`boresight schema`)."""
    return dict(json.loads(execute(["schema"])))


new = Scenario.new


def orbit(source: Any, **options: Any) -> Dict[str, Any]:
    """Finds the orbit of a track from its measured directions (`boresight orbit`).

    Given:     source   a Run, its folder, or a TDM file (with observer=FILE.oem)
    Returned:  state, covariance, elements and residuals
    """
    if "report" in options:
        raise ArgumentError("orbit returns what --report writes: leave report out")
    with work_folder() as folder:
        file = folder / "orbit.json"
        execute(["orbit", _path(source, "source"), "--report", str(file), *options_of(**options)])
        return dict(_read_json(file))


def report(source: Any, out: Optional[Path] = None) -> pathlib.Path:
    """Writes a page of HTML about a run or a study (`boresight report`).

    Given:     source  a Run, a Study, or a folder
               out     file; None: report.html in the folder
    Returned:  the file
    """
    folder = pathlib.Path(_path(source, "source"))
    file = folder / "report.html" if out is None else pathlib.Path(_path(out, "out"))
    execute(["report", str(folder), "--out", str(file)])
    return file


class Study(HasTables):
    """The folder of a study: its tables, as attributes or by `table`."""

    def __init__(self, folder: Path, exit_code: int = 0):
        self.folder, self.exit_code = pathlib.Path(folder), exit_code
        self._store = Store(self.folder / "study.sqlite")

    def __getattr__(self, name: str) -> Table:
        if name.startswith("_") or name in ("folder", "exit_code") or name not in self.tables:
            raise AttributeError(name)
        return self.table(name)

    def __dir__(self) -> List[str]:
        return [*super().__dir__(), *self.tables]

    def __repr__(self) -> str:
        return f"<Study in {self.folder}: {', '.join(self.tables)}>"


def study(source: Any, out: Optional[Path] = None, *, progress: bool = False,
          plugins: Sequence[str] = (), **options: Any) -> Study:
    """Goes through the settings of a study and makes tables of the results (`boresight study`).

    Given:     source   a study file, a dictionary, or the folder of a study (with resume=True)
               out      folder of the results; None: studies/NAME
               plugins  names of Python modules that register the plug-ins of its scenarios. The
                        workers are processes, which what this one has registered does not reach
               options  workers=2, dry_run is not one: use `boresight study --dry-run`
    Errors:    ProgramError: runs are missing. Runs that failed by themselves are rows of the table
               of runs
    """
    host = host_of(plugins)
    if host is not None and options.get("slurm"):
        raise ArgumentError("plugins: the jobs of Slurm know no plug-ins in Python: leave slurm "
                            "out, or write the plug-in in C")
    with work_folder() as folder:
        if isinstance(source, dict):
            file = folder / "study.json"
            file.write_text(json.dumps(source), encoding="utf-8")
        else:
            file = pathlib.Path(_path(source, "source"))
        target = pathlib.Path(_path(out, "out")) if out is not None else _study_folder(file)
        to = [] if file.is_dir() else ["--out", str(target)]
        execute(["study", str(file), *to, *options_of(quiet=not progress, **options)], progress,
                allowed=(0, 4), host=host)
    return Study(target)


def _study_folder(file: pathlib.Path) -> pathlib.Path:
    """Where the results of a study go by default."""
    if file.is_dir():
        return file
    name = _read_json(file).get("name") if file.is_file() else None
    return pathlib.Path("studies") / str(name or file.stem)


def _path(value: Any, what: str) -> str:
    """A path as a text; a Run or a Study stands for its folder."""
    value = value.folder if isinstance(value, (Run, Study)) else value
    if not isinstance(value, (str, os.PathLike)):
        raise ArgumentError(f"{what} takes a path, not {type(value).__name__}")
    return os.fspath(value)
