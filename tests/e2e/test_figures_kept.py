#!/usr/bin/env python3
"""Notices change: the figures of everything that the program writes about some small, odd scenes, against those that are
kept in tests/e2e/kept/. That they are right is what the other tests compare with outside truth.

Usage, from the repository root:
  /usr/bin/python3 tests/e2e/test_figures_kept.py BORESIGHT [--update] [--scenes A,B] [--first] [--times]

--update writes the figures anew, prints which changed by how much, and measures each scene once more with the libm and the
kernels of another processor: where that differs, a column has a tolerance of its own; --scenes takes only some; --first ends with the
first scene that differs; --times prints the processor time of each scene.
"""
import argparse
import json
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
from astropy.io import fits

import kept_columns
import kept_scenes
import runs
from kept_commands import scene_checks, scene_measured, scene_sensor, scene_studies, scene_twin
from kept_views import scene_reported, scene_shown

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "kept")
LINES_SHOWN = 40
# Inputs, durations, states of one version, what gnuplot and its fonts draw, raw bytes
LEFT_OUT = ("scenario.json", "study.json", "wall_clock.csv", "pointing.png", "plot.png", "link.packets")
PROGRESS = re.compile(r"\d of \d+ .*, \d+ a second")  # lines of what takes some seconds
TRIES = 3  # of a run that is to be killed before it ends
ENDINGS_LEFT_OUT = (".mp4", ".state", ".rows")
FIGURES = kept_columns.FIGURES
# How far figures may be apart, in parts of their column's RMS: GCC 12 and clang 19 agree to 1e-8. Columns in which another
# libm and other kernels differ by more have tolerances of their own ("apart" in the files).
TOLERANCE = 1e-6
ROUNDING = 1.1e-6  # of figures of seven digits: one of the last digit


def children_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def letters_only(folder):
    """The folder by a name that is always as long and has no digit: pages break paths at some characters."""
    name = folder[:-8] + "".join(chr(97 + ord(c) % 26) for c in folder[-8:])
    os.rename(folder, name)
    runs._folders[runs._folders.index(folder)] = name
    return name


class Kept:
    """What one scene gave: columns of all its outputs."""

    def __init__(self, name):
        self.folder = letters_only(runs.scratch())
        self.columns = kept_columns.Columns((self.folder, os.getcwd()))
        self.name, self.environment = name, {}

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, content):
        with open(self.path(name), "w", encoding="utf-8") as file:
            json.dump(content, file)
        return self.path(name)

    def write_text(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)
        return self.path(name)

    def draw_scripts(self):
        """From here on plots are the scripts that draw them."""
        folder = self.path("bin")
        os.mkdir(folder)
        with open(os.path.join(folder, "gnuplot"), "w", encoding="utf-8") as file:
            file.write("#!/bin/sh\nscript=$(cat)\nout=$(printf '%s' \"$script\" | sed -n \"s/^set output '\\(.*\\)'$/\\1/p\")\n"
                       "printf '%s' \"$script\" | grep -v '^set output' > \"$out\"\n")
            os.fchmod(file.fileno(), 0o755)
        self.environment["PATH"] = folder + ":" + os.environ["PATH"]

    def add_script(self, name, path):
        """The script of a plot, drawn after draw_scripts."""
        with open(path, "rb") as file:
            self.columns.put_bytes(name, file.read(), ".txt")

    def add(self, name, path):
        """A file, or all files of a folder, sorted."""
        if os.path.isdir(path):
            for root, folders, files in os.walk(path):
                folders.sort()
                for file in sorted(files):
                    if file not in LEFT_OUT and not file.endswith(ENDINGS_LEFT_OUT):
                        place = os.path.relpath(os.path.join(root, file), path)
                        kind = re.sub(r"\d+", "#", place) if place.count(os.sep) or place.endswith(".png") else place
                        self.columns.put_file(f"{name}/{kind}", os.path.join(root, file))
        elif os.path.exists(path):
            self.columns.put_file(name, path)

    def call(self, name, *words, adds=(), text=True):
        """A command: its exit code, what it said, and what it wrote."""
        result = runs.call(*words, timeout=300, env={**os.environ, "SOURCE_DATE_EPOCH": "1655416800", **self.environment})
        self.columns.put(f"{name} exit", float(result.returncode))
        if text:
            end = ".json" if result.stdout[:1] in ("{", "[") else ".txt"
            self.columns.put_bytes(f"{name} says", result.stdout.encode(), end)
        self.columns.put_lines(f"{name} warns", "\n".join(line for line in result.stderr.split("\n") if not PROGRESS.search(line)))
        if os.environ.get("KEPT_SHOW") and result.returncode:
            print(name, result.stderr[:600], result.stdout[-600:], file=sys.stderr)
        for path in adds:
            self.add(f"{name} {os.path.basename(path)}", path)

    def run(self, name, scene, *words, pictures=False):
        path, out = self.write(name + ".json", scene), self.path(name)
        more = [] if pictures else ["--no-pictures"]
        self.call(name + " run", "run", path, "--quiet", "--out", out, "--threads", "1", *more, *words, adds=[out])
        return out

    def run_in_two(self, name, scene, save_every_s, saves, *words):
        """A run that is killed after some saved states and goes on from the last of them. One that is over before is tried again."""
        path, out = self.write(name + ".json", scene), self.path(name)
        line = [runs.BORESIGHT, "run", path, "--quiet", "--out", out, "--threads", "1", "--no-pictures",
                "--save-every", str(save_every_s), *words]
        state = os.path.join(out + ".partial", "state")
        for _ in range(TRIES):
            shutil.rmtree(out, ignore_errors=True)
            shutil.rmtree(out + ".partial", ignore_errors=True)
            seen = set()
            with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
                while process.poll() is None and len(seen) < saves:
                    try:
                        seen.add(os.stat(state).st_mtime_ns)
                    except OSError:
                        pass
                    time.sleep(0.001)
                process.send_signal(signal.SIGKILL)
                said = process.stderr.read().decode()
            if os.path.exists(state) and len(seen) == saves:
                break
        else:
            raise RuntimeError(f"{name}: {len(seen)} of {saves} saved states seen, then the run was over: {said}")
        self.call(name + " run", *line[1:], "--restore", state, adds=[out])
        return out

    def view(self, name, out, *routes):
        """What `boresight view` answers."""
        import test_view
        viewer = test_view.Viewer(out)
        for route in routes:
            try:
                data = viewer.get(route)[0]
            except OSError as error:
                data = json.dumps({"error": str(error)}).encode()
            kind = ".json" if data[:1] in (b"{", b"[") else ".f8" if re.search("plot|states|coast|pose", route) and len(data) % 8 == 0 else ""
            self.columns.put_bytes(f"{name} view {route}", data, kind)
        viewer.end()

    def export(self, name, run, *words):
        out = self.path("out_" + name)
        self.call(name, "export", run, *words, "--out", out, adds=[out])


def scene_unlike(k):
    out = k.run("unlike", kept_scenes.unlike(), pictures=True)
    k.call("info", "info", out, "--json")
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])
    k.export("csv", out, "--observations", "csv")
    k.export("filtered", out, "--observations", "json", "--angles", "filtered")
    k.export("oem", out, "--orbits", "oem", "--step", "5", "--observations", "tdm")
    k.export("czml", out, "--orbits", "czml", "--step", "5")
    k.export("png", out, "--frames", "png", "--annotate", "--every", "9", "--sensor", "skewed")
    k.export("yolo", out, "--yolo", "yolo", "--sensor", "skewed", "--every", "6")
    k.export("coco", out, "--coco", "coco", "--sensor", "far", "--every", "5")
    k.export("satnet", out, "--satnet", "satnet", "--sensor", "skewed", "--every", "7")
    k.call("page", "export", out, "--page", k.path("page.html"), "--size", "640", "--page-limit", "1", adds=[k.path("page.html")])
    k.call("score", "score", out, "--truth", out, "--json", "-", "--resamples", "20")
    k.call("score tracks", "score", out, "--truth", out, "--what", "tracks", "--json", "-", "--resamples", "0", "--least-snr", "6")
    k.call("score satnet", "score", out, "--truth", os.path.join(k.path("out_satnet"), "satnet"), "--json", "-", "--sensor", "skewed")
    k.view("unlike", out, "api/run", "api/frames?sensor=1", "api/frame?sensor=0&frame=12", "api/why?sensor=0&frame=14", "api/space/scene",
           "api/space/states", "api/plot?sensor=1&panel=pointing_error&from=0&to=24&columns=60",
           "api/plot?sensor=0&panel=detections&from=0&to=24&columns=50", "api/plot?sensor=0&panel=background&from=0&to=24&columns=50",
           "api/track?sensor=1&track=1", "api/pixels?sensor=0&frame=9", "api/modes?sensor=1", "api/events")


def scene_restored(k):
    scene = kept_scenes.unlike()
    scene["observers"][0]["sensors"][0]["observation_source"] = "generator"
    scene.update(name="restored", duration_s=30, seed="0x77", record={"frames": "none", "telemetry_hz": 5})
    k.run_in_two("restored", scene, 3, 5)


def scene_unlike_derived(k):
    path = k.write("unlike.json", kept_scenes.unlike())
    k.call("check", "check", path)
    k.call("figures", "check", path, "--figures", "-")
    for sensor in ("neossat/skewed", "neossat/turned", "follower/far"):
        k.call(f"loop {sensor}", "loop", path, "--json", "-", "--sensor", sensor)
    k.call("loop", "loop", path)
    k.call("lightcurve", "lightcurve", path, "--duration", "600", "--step", "40", "--output", k.path("l.csv"), "--object", "NEIGHBOUR",
           "--observer", "follower", adds=[k.path("l.csv")])
    k.call("pd", "pd", path, "--sensor", "follower/far", "--snr", "4:8:2", "--trials", "60", "--empty-frames", "12",
           "--streak", "6", "--known-rate", "--threads", "1", "--json", k.path("pd.json"), text=False, adds=[k.path("pd.json")])


def scene_charge(k):
    scene = kept_scenes.charge()
    out = k.run("charge", scene)
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])
    cal = k.path("cal")
    k.call("calframes", "calframes", k.path("charge.json"), "--out", cal, "--bias", "4", "--dark", "4", "--flat", "4", "--linearity", "6",
           "--threads", "1", adds=[cal])
    names = {n.rsplit("_", 1)[1][:-5]: os.path.join(cal, n) for n in os.listdir(cal)} if os.path.isdir(cal) else {}
    words = [w for n in ("bias", "dark", "flat", "linearity") if n in names for w in ("--" + n, names[n])]
    k.call("characterize", "characterize", "--map", "boresight", *words, "--out", k.path("made"), "--maps", adds=[k.path("made")])


def scene_rolling(k):
    scene = kept_scenes.rolling()
    y, x = np.mgrid[:53, :39]
    image = np.exp(-((x - 17) / 4.5)**2 - ((y - 28) / 3.5)**2) + 0.2 * np.exp(-((x - 22) / 6)**2 - ((y - 22) / 6)**2)
    fits.writeto(k.path("psf.fits"), image.astype(np.float32))
    scene["observers"][0]["sensors"][0]["camera"]["optics"].update(
        psf="file", psf_file=k.path("psf.fits"), psf_oversampling=3, file_centre="array")
    scene["observers"][0]["sensors"][0]["camera"]["optics"].pop("moffat_beta")
    out = k.run("rolling", scene)
    k.export("png", out, "--frames", "png", "--every", "3", "--stretch", "frame", "--size", "100")


def scene_infrared(k):
    out = k.run("infrared", kept_scenes.infrared())
    k.export("coco", out, "--coco", "coco", "--every", "5")
    k.call("lightcurve", "lightcurve", k.path("infrared.json"), "--duration", "60", "--step", "6", "--output", k.path("l.csv"), adds=[k.path("l.csv")])
    k.call("turntable", "turntable", os.path.join(kept_scenes.SHAPES, "inmarsat_gx_like.json"), "--png", k.path("t.png"), "--glb", k.path("t.glb"), "--size-px", "60",
           adds=[k.path("t.png"), k.path("t.glb")])


def scene_visible(k):
    out = k.run("visible", kept_scenes.visible())
    k.export("boxes", out, "--yolo", "yolo", "--every", "4")
    k.view("visible", out, "api/space/shape?object=0", "api/space/poses?sensor=0", "api/why?frame=3", "api/thumbnail?sensor=0&frame=2")


def scene_wide(k):
    k.run("wide", kept_scenes.wide())


def scene_files(k):
    k.run("files", kept_scenes.files())


def scene_oem(k):
    out = k.run_in_two("oem", kept_scenes.oem(), 10, 2)
    k.call("orbit", "orbit", out, "--report", k.path("o.json"), "--oem", k.path("o.oem"), "--tdm", k.path("o.tdm"),
           "--omm", k.path("omm.json"), adds=[k.path(n) for n in ("o.json", "o.oem", "o.tdm", "omm.json")])
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])
    without_scenario(k, out)


def without_scenario(k, out):
    """Report and summary of a run whose scenario is lost: from its tables alone."""
    os.remove(os.path.join(out, "scenario.json"))
    k.call("report of tables", "report", out, "--out", k.path("tables.html"), adds=[k.path("tables.html")])
    k.call("info of tables", "info", out, "--json")


def scene_linked(k):
    """Two modules that other processes play."""
    scene = kept_scenes.oem()
    scene.update(name="linked", duration_s=40)
    path, out, address = k.write("linked.json", scene), k.path("linked"), "ipc://" + k.path("link")
    words = [["run", path, "--out", out, "--threads", "1", "--no-pictures", "--link", address, "--external", "tracker,control"],
             *(["serve", path, "--threads", "1", "--link", address, "--part", part] for part in ("tracker", "control"))]
    parts = [subprocess.Popen([runs.BORESIGHT, *w], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) for w in words]
    try:
        for name, part in zip(("run", "tracker", "control"), parts):
            said = part.communicate(timeout=120)[1].decode()
            if part.returncode:
                raise RuntimeError(f"linked: {name} ended with {part.returncode}: {said}")
            k.columns.put(f"linked {name} exit", float(part.returncode))
    finally:
        for part in parts:
            part.kill()
            part.wait()
            part.stderr.close()
    k.add("linked", out)
    for name in ("tick", "time_s", "source~"):  # when a peer came, and which part noticed
        k.columns.columns.pop(f"linked/run.sqlite events.{name}", None)


def scene_lost(k):
    out = k.run("lost", kept_scenes.lost())
    k.call("info", "info", out)


def scene_tasking(k):
    out = k.run_in_two("tasking", kept_scenes.tasking(), 100, 2)
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])
    k.call("info", "info", out, "--json")
    k.export("orbits", out, "--orbits", "oem", "--objects", "seen", "--step", "60")
    k.export("angles", out, "--observations", "json")


def scene_search(k):
    out = k.run_in_two("search", kept_scenes.search(), 120, 2)
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])


def scene_rate(k):
    k.run("rate", kept_scenes.rate())


def scene_passing(k):
    k.run_in_two("passing", kept_scenes.passing(), 4, 2)
    k.call("loop", "loop", k.path("passing.json"), "--json", "-")


def scene_recorded(k):
    """Frames of a run as if another program had made them: attitude, detections, camera."""
    scene = kept_scenes.track()
    scene = kept_scenes.changed(scene, {**kept_scenes.SMALL, "/duration_s": 6, kept_scenes.SENSOR + "/camera/aperture_m": 0.25,
                                        kept_scenes.SENSOR + "/camera/rotation_deg": -37, "/name": "source", "/record/compression": "none",
                                        kept_scenes.SENSOR + "/camera/pixel_scale_arcsec": 8})
    out = k.run("source", scene)
    made = k.path("real")
    k.call("process", "process", os.path.join(out, "frames.fits"), "--map", "boresight", "--out", made, "--threads", "1", "--quiet",
           "--catalogue", "embedded", adds=[made])
    k.call("camera", "calibrate-camera", os.path.join(made, "run"), "--out", k.path("camera"), adds=[k.path("camera")])
    k.call("solve", "solve", os.path.join(out, "frames.fits"), "--scale", "8", "--utc", "2022-06-16T22:10:00.25Z", "--catalogue", "embedded")
    k.call("challenge", "challenge", "77", "--out", k.path("challenge"), "--sequences", "1", "--size-px", "160", "--threads", "1",
           "--catalogue", "embedded", adds=[k.path("challenge")])


def scene_crowded(k):
    k.run("crowded", kept_scenes.crowded())


def scene_drawn(k):
    k.run("drawn", kept_scenes.drawn())


def scene_streaked(k):
    k.run("streaked", kept_scenes.streaked())


def scene_orbits(k):
    """Commands without a run."""
    span = ["--start", "2022-06-16T22:10:00Z", "--stop", "2022-06-17T10:10:00Z", "--step", "3000"]
    for frame in ("teme", "gcrf"):
        k.call(f"propagate {frame}", "propagate", "--elements", kept_scenes.ELEMENTS, *span, "--frame", frame, "--output", k.path(frame + ".csv"), adds=[k.path(frame + ".csv")])
    k.call("propagate oem", "propagate", "--elements", kept_scenes.ELEMENTS, "--norad", "39089", *span, "--format", "oem", "--gravity", "wgs84",
           "--output", k.path("p.oem"), adds=[k.path("p.oem")])
    k.call("propagate czml", "propagate", "--elements", kept_scenes.ELEMENTS, "--norad", "44801", *span, "--format", "czml", "--output", k.path("p.czml"), adds=[k.path("p.czml")])
    k.call("lightcurve", "lightcurve", "--satellite", os.path.join(kept_scenes.SHAPES, "starlink_v1_5.json"), "--elements", kept_scenes.ELEMENTS,
           "--norad", "39089", "--start", "2022-06-16T04:00:00Z", "--duration", "6000", "--step", "300", "--observer-norad", "44801", "--earthshine",
           "--output", k.path("l.csv"), adds=[k.path("l.csv")])
    k.call("new", "new", k.path("new.json"), "--observer-tle", "39089", "--target-tle", "44801", "--aperture", "0.12", "--duration", "60", adds=[k.path("new.json")])
    sets = ""
    for name in (kept_scenes.ELEMENTS, os.path.abspath("scenarios/objects_2022-06.tle")):
        with open(name, encoding="utf-8") as file:
            sets += file.read()
    both = k.write_text("both.tle", sets)
    k.call("new of two", "new", k.path("two.json"), "--observer-tle", "39089", "--target-tle", both + ":44801", "--start", "2022-06-15T20:00:00Z",
           "--duration", "30", adds=[k.path("two.json")])
    mesh = k.write_text("mesh.obj", kept_scenes.MESH)
    k.call("mesh", "turntable", mesh, "--png", k.path("m.png"), "--glb", k.path("m.glb"), "--size-px", "60", adds=[k.path("m.png"), k.path("m.glb")])
    k.call("icd", "icd")


SCENES = {name[len("scene_"):]: function for name, function in sorted(globals().items()) if name.startswith("scene_")}
# quick ones and those that are odd in the most ways first
ORDER = ["unlike", "restored", "orbits", "checks", "unlike_derived", "charge", "tasking", "oem", "rolling", "wide", "visible", "infrared", "passing",
         "studies", "crowded", "drawn", "streaked", "measured", "sensor", "twin", "linked", "shown",
         "reported", "files", "lost", "search", "rate", "recorded"]


def kept_path(name):
    return os.path.join(FOLDER, name + ".json")


def load(name):
    """Figures and {column: tolerance, or None: not compared} where that is not TOLERANCE."""
    try:
        with open(kept_path(name), encoding="utf-8") as file:
            folded = json.load(file)
            return unfold(folded["figures"]), unfold(folded["apart"])
    except FileNotFoundError:
        return {}, {}


def fold(figures):
    """{"group": {"name": figures}}: the beginnings of names once."""
    folded = {}
    for name, value in figures.items():
        group, dot, rest = name.rpartition(".")
        folded.setdefault(group + dot, {})[rest] = value
    return folded


def unfold(folded):
    return {group + name: value for group, names in folded.items() for name, value in names.items()}


def save(name, figures, apart):
    def lines(part):
        return ",\n".join(f'{json.dumps(group)}:{json.dumps(names, separators=(",", ":"))}' for group, names in sorted(fold(part).items()))
    os.makedirs(FOLDER, exist_ok=True)
    with open(kept_path(name), "w", encoding="utf-8") as file:
        file.write(f'{{"apart":{{\n{lines(apart)}\n}},"figures":{{\n{lines(figures)}\n}}}}\n')


def spread(figures):
    """All FIGURES of a short form."""
    if isinstance(figures, list) and len(figures) == 2 and isinstance(figures[1], float):
        n, v = figures
        return [n, 0, v, abs(v), v, v, v, v, None]
    return figures


def distance(old, new):
    """(how far figures are apart in parts of the RMS, what it is as a text); infinite: they have other forms or counts."""
    if old == new:
        return 0.0, ""
    if old is None or new is None:
        return math.inf, "is new" if old is None else "is no longer there"
    a, b = spread(old), spread(new)
    if not (isinstance(a, list) and isinstance(b, list) and len(a) == len(b) == len(FIGURES)):
        return math.inf, f"{old} -> {new}"
    if a[:2] != b[:2]:
        return math.inf, f"count {a[0]} -> {b[0]}, nulls {a[1]} -> {b[1]}"
    scale = max(abs(a[3]), 1e-30)
    worst, figure, was, now = max((max(0.0, abs(w - v) - ROUNDING * abs(v)) / scale, figure, v, w) for figure, v, w in zip(FIGURES[2:], a[2:], b[2:])
                                  if v is not None and w is not None)
    return worst, f"{figure} {was:.9g} -> {now:.9g} ({worst:.1e} of the RMS)"


def tolerances(old, new):
    """{column: tolerance} from what another processor gives: ten times the distance, to one digit."""
    found = {}
    for column in set(old) | set(new):
        apart, _ = distance(old.get(column), new.get(column))
        if apart > 0.1:
            found[column] = None
        elif 10 * apart > TOLERANCE:
            found[column] = float(f"{10 * apart:.0e}")
    return dict(sorted(found.items()))


def compare(name, old, new, apart):
    """Lines, one for each column that differs."""
    lines = []
    for column in list(old) + [c for c in new if c not in old]:
        allowed = apart.get(column, TOLERANCE)
        far, text = distance(old.get(column), new.get(column))
        if allowed is not None and far > allowed:
            lines.append(f"{name}: {column}: {text}")
    return lines


def measure(name, **environment):
    # no star catalogue but the one inside the program
    environment["XDG_DATA_HOME"] = os.path.join(tempfile.gettempdir(), "boresight-without-data")
    before = {key: os.environ.get(key) for key in environment}
    os.environ.update(environment)
    try:
        kept = Kept(name)
        SCENES[name](kept)
        return kept.columns.figures()
    finally:
        runs.clean()
        for key, value in before.items():
            os.environ.pop(key)
            if value is not None:
                os.environ[key] = value


def measure_elsewhere(name):
    """As a processor without AVX-512 and fused multiplication gives it: libm and kernels for that."""
    kernels = os.path.join(tempfile.gettempdir(), f"boresight-kept-kernels-{os.getuid()}")
    os.makedirs(kernels, exist_ok=True)
    return measure(name, GLIBC_TUNABLES="glibc.cpu.hwcaps=-AVX2,-AVX512F,-FMA,-FMA4", POCL_LLVM_CPU_NAME="x86-64-v3",
                   POCL_CACHE_DIR=kernels)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--scenes")
    parser.add_argument("--first", action="store_true")
    parser.add_argument("--times", action="store_true")
    options = parser.parse_args()
    failed = False
    for name in options.scenes.split(",") if options.scenes else ORDER:
        begun = children_seconds()
        new = measure(name)
        kept, apart = load(name)
        lines = compare(name, kept, new, apart)
        if options.times:
            print(f"{name}: {children_seconds() - begun:.2f} s, {len(new)} columns, {len(lines)} differ", flush=True)
        print("\n".join(lines[:LINES_SHOWN] + ([f"{name}: {len(lines) - LINES_SHOWN} more"] if len(lines) > LINES_SHOWN else [])), flush=True)
        if options.update:
            save(name, new, tolerances(new, measure_elsewhere(name)))
        elif lines:
            failed = True
            if options.first:
                break
    if failed:
        print("Figures changed. If they are to change: test_figures_kept.py BORESIGHT --update, and say why in CHANGELOG.md.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
