#!/usr/bin/env python3
"""Scenarios and command lines of a careless or hostile user: each is refused with a message that
says what is wrong where and what is allowed; nothing is written, nothing crashes or hangs.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_hostile_input.py BORESIGHT
"""
import copy
import json
import os
import re
import subprocess
import unittest

import runs

SECONDS = 60  # hangs are longer; sanitizers are slow
S = runs.SENSOR
CAMERA, EXPOSURE, MODULES = S + "/camera", S + "/exposure", S + "/modules"
TARGET, ELEMENTS = "/world/objects/0", "scenarios/catalogue_2022-06.tle"
NOT_JSON = "this is not valid JSON .*allowed: "
RANGE = "out of range (found {}; allowed: "

# JSON pointer, value, what the message says beside the file
VALUES = [
    ("/duration_s", True, "wrong type (found true; allowed: a number from 0 to"),
    ("/duration_s", "60", 'wrong type (found "60"; allowed: a number'),
    ("/duration_s", None, "wrong type (found null; allowed: a number"),
    ("/name", {"a": 1}, 'wrong type (found {"a":1}; allowed: a string'),
    ("/name", "n" * 5000, "too long (found "),
    ("/durations_s", 3, 'unknown key; did you mean "duration_s"?'),
    ("/Duration_s", 3, 'unknown key; did you mean "duration_s"?'),
    ("/boresight", 2, "out of range (found 2; allowed: 1)"),
    ("/epoch_utc", "2022-02-30T00:00:00Z", "month 02 of 2022 has no day 30"),
    ("/epoch_utc", "9999-06-16T22:10:00Z", "the years for which UTC is accepted, 1960 to 2099"),
    ("/epoch_utc", "2022-06-16T22:10:60Z", "60 is allowed only where a leap second was inserted"),
    ("/tick_rate_hz", 1000.5, "not an integer (found 1000.5; allowed: "),
    ("/seed", "banana", 'not a seed (found "banana"; allowed: '),
    ("/seed", 9007199254740993, "out of range (found 9007199254740992; allowed: "),
    ("/link", {"address": "http://x"}, '/link/address: link: "http://x" is no address (allowed: '),
    ("/observers", [], "wrong number of elements (found an array of 0; allowed: "),
    ("/observers/0/name", "../../x", '"../../x" is no name (allowed: letters'),
    ("/observers/0/name", "", '"" is no name (allowed: '),
    (S + "/name", "t\x1b[31m\n", "no name (allowed: "),
    (CAMERA + "/width_px", [512], "wrong type (found [512]; allowed: an integer"),
    (CAMERA + "/width_px", 0, "out of range (found 0; allowed: an integer from 1 to"),
    (CAMERA + "/width_px", 1000000000, "out of range (found 1000000000; allowed: "),
    (CAMERA + "/pixel_scale_arcsec", 1e-300, "out of range (found 1e-300; allowed: "),
    (CAMERA + "/aperture_m", -0.15, "out of range (found -0.15; allowed: "),
    (CAMERA + "/aperture", 0.15, 'unknown key; did you mean "aperture_m"?'),
    (CAMERA + "/distortion", {"k1": [0] * 300000}, "/k1: wrong type (found ["),
    (EXPOSURE + "/window_px", [1000, 1000, 100, 100], "is no window of the sensor (allowed: "),
    (EXPOSURE + "/window_px", [0, 0, 100], "wrong type (found [0,0,100]; allowed: "),
    (EXPOSURE + "/binning", 1000000, "out of range (found 1000000; allowed: "),
    (EXPOSURE + "/dropped_fraction", 1.5, "out of range (found 1.5; allowed: "),
    (MODULES + "/imgprocc", {"type": "standard"}, 'no module of this name (allowed: "gimbal"'),
    (MODULES + "/tracker", None, 'wrong type (found null; allowed: an object with a "type")'),
    (MODULES + "/tracker/type", "ukff", 'there is no tracker of type "ukff" (allowed: '),
    (MODULES + "/control/delay_s", {"trakcs": 1}, "trakcs: not an input of this module (allowed: "),
    (MODULES + "/gimbal/platform/jitter_high_band_hz", [200, 5], "is empty; give the lower"),
    (TARGET + "/orbit", {}, 'source "sgp4" needs either "elements_file" and "norad", or "tle_line1"'),
    (TARGET + "/orbit/position_gcrf_m", [7e6, 0, 0], "unknown key (allowed: source, "),
    (TARGET + "/orbit/norad", -1, "out of range (found -1; allowed: "),
    (TARGET + "/orbit/elements_file", "a\nb.tle", "a?b.tle: cannot be opened: No such file"),
    (TARGET + "/orbit/elements_file", "{}/cut.tle", "the file ends within an element set"),
    (TARGET + "/burns", [{"time_s": 9, "dv_rtn_mps": [0, 1, 0]}, {"time_s": 5, "dv_rtn_mps": [0, 1, 0]}],
     "/burns/1/time_s: burns must be in the order of time (found 5 after 9)"),
    (TARGET + "/burns", [{"time_s": 9, "dv_gcrf_mps": [0, 1, 0]}], "/burns/0/dv_gcrf_mps: unknown key"),
    (MODULES + "/imgproc/dark_file", "{}/cut.fits", "cut.fits: HDU 1: is cut short: "),
    (S + "/cue/object", "neossat", 'there is no object "neossat" in /world/objects'),
]
# the same as text: what stands for the whole file, or for "duration_s": 300 in it
TEXTS = [
    ('"duration_s": NaN', r":\d+:\d+: " + NOT_JSON),
    ('"duration_s": -1e999', r":\d+:\d+: the number is too large \(found .-1e999.; allowed: "),
    ('"duration_s": 0300', r":\d+:\d+: this is not a JSON number \(found .0300.; allowed: "),
    ('"duration_s": 300,,', r":\d+:\d+: " + NOT_JSON),
    ('"duration_s": 30, "duration_\\u0073": 300', ": /duration_s: the key is given twice"),
    ('"duration_s\\u0000": 30', r":\d+:\d+: \\u0000 within a string is not allowed"),
    ('"duration_s": ' + "[" * 5000 + "]" * 5000, r":\d+:\d+: nested too deep \(allowed: 64"),
    ("\xff", ":1:1: byte 0xFF is not UTF-8 text"),
]
FILES = [
    ("", ":1:1: the file is empty"), ('"hello"', ": /: wrong type .found .hello.; allowed: an object"),
    ('{"extends": "{own}"}', "extends itself by way of 1 file"),
    ('{"extends": "{folder}/pipe"}', "/pipe: is a pipe; give a JSON file"),
    ('{"extends": "{base}", "set": {"duration_s": 3}}', 'set: "duration_s" is no JSON pointer .allowed: '),
    ('{"extends": "{base}", "set": {"/observers/00/name": "x"}}', '"00" .allowed: 0 to 0'),
    ('{"extends": "{base}", "set": {"/world//objects": []}}', "is no JSON pointer .allowed: "),
    ('{"extends": "{base}", "duration_s": 3, "set": {"/duration_s": 4}}',
     ': /duration_s: is given beside "set" and in it'),
    ('{"extends": "{base}", "set": {"/observers/7/name": "x"}}', '"7" .allowed: 0 to 0'),
]

T, RUN, OUT, F = runs.TRACK, "{run}", "{folder}/none", "{folder}"
SPAN = ("propagate", "--tle", ELEMENTS, "--start", "2022-06-16T00:00:00Z", "--stop",
        "2022-06-17T00:00:00Z")
SHAPE = ("--satellite", "scenarios/satellites/gps_iif.json", "--elements", ELEMENTS, "--norad", "39089", "--start",
         "2022-06-16T02:00:00Z")
STUDY = ("study", "{folder}/study.json")
# words, exit code, what the message says
LINES = [
    (("RUN", T), 2, 'there is no command "RUN"'),
    (("run", T, "--out", ""), 2, "--out needs a value: --out FOLDER"),
    (("run", T, "--out", OUT, "--seed", "1", "--seed", "2"), 2, "--seed is given twice"),
    (("run", T, "--out", OUT, "--out=" + OUT + "2"), 2, "--out is given twice"),
    (("run", T, "--out", OUT, "--duration", "nan"), 2, "--duration nan: give a number from 0"),
    (("run", T, "--out", OUT, "--duration", "0x10"), 2, "--duration 0x10: give a number from 0"),
    (("run", T, "--out", OUT, "--duration", " 5"), 2, "--duration  5: give a number from 0"),
    (("run", T, "--out", OUT, "--duration", "1e-9"), 1, "/duration_s: a time of 1e-09 s is no whole"),
    (("run", T, "--out", OUT, "--threads", "1000000000"), 2, "give an integer from 1 to 1024"),
    (("run", T, "--out", OUT, "--frames", "png"), 2, "unknown option --frames"),
    (("run", T, "--out", OUT, "--link", "http://x"), 1, "/link/address: .*is no address .allowed: "),
    (("run", T, "--out", OUT, "--link", "tcp://127.0.0.1:5998"), 1, "--link: no module .*--external"),
    (("run", T, "--out", OUT, "--external", "nothing"), 1, 'no module "nothing" .*allowed: '),
    (("run", T, "--out", OUT, "--set", "//duration_s=1"), 2, "expected /json/path=value"),
    (("run", T, "--out", OUT, "--set", "/duration_s/=1"), 2, "expected /json/path=value"),
    (("run", T, "--out", OUT, "--set", "/duration_s="), 1, "track.json: --set .*the value is missing"),
    (("run", T, "--out", OUT, "--set", '/name={"a": 1, "a": 2}'), 1, "/a: the key is given twice"),
    (("run", T, "--out", OUT, "--set", "/duration_s=1e999"), 1, "/duration_s: wrong type .found .1e999"),
    (("run", T, "--out", OUT, "--set", "/observers/3/name=x"), 1, 'element "3" .allowed: 0 to 0'),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/ghosts=[{"intensity": 2}]'), 1,
     "ghosts/0/intensity: out of range"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/ghosts=[{"intensity": 1, "map_file": "no.csv"}]'), 1,
     "ghosts/0/map_file: .*no.csv"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/background={"stray_map_file": "no.fits"}'), 1,
     "background/stray_map_file: .*no.fits"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"ramp": {"reads": 1}}'), 1,
     "ramp/reads: 1 read gives no slope; allowed are 0"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"ramp": {"reads": 4}, "em_gain": 9}'), 1,
     "ramp/reads: 4 non-destructive reads cannot be combined with em_gain"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"ramp": {"reads": 4}}', "--set",
      runs.SENSOR + "/exposure/binning=2"), 1, "exposure: binning: 2, but the camera's detector/ramp reads each"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"persistence": {"trapped_share": [1, 1, 0, 0, 0]}}'),
     1, "persistence/trapped_share: all species together trap 2 of"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"pixel_flicker_noise": {"rms_e": 1, "lowest_hz": 2}}'),
     1, "pixel_flicker_noise: highest_hz is 1 and lowest_hz 2; allowed are 1 to 262144 times"),
    (("run", T, "--out", OUT, "--set", runs.SENSOR + '/camera/detector={"pixel_flicker_noise": {"rms_e": 1}}', "--set",
      runs.SENSOR + "/exposure/binning=2"), 1, "exposure: binning: 2, but the camera's detector/pixel_flicker_noise is"),
    (("run", T, "--out", OUT, "--set", "/extends=x.json"), 1, "/extends: the file that it names has not"),
    (("run", T, "--out", F + "/pipe", "--duration", "0"), 2, "pipe: Not a directory"),
    (("check", T, "--out", OUT), 2, "unknown option --out"),
    (("info", RUN, "x"), 2, "one folder of a run is expected, 2 were given"),
    (("report", RUN, "--out", F + "/pipe"), 2, "is not a regular file; give another path"),
    (("export", RUN, "--table", "csv", "--out", OUT, "--every", "2"), 2,
     "--every has no effect without --frames, --satnet, --coco, --yolo or --page"),
    (("export", RUN, "--table", "csv", "--out", OUT, "--sensor", "nix"), 2, "--sensor has no effect"),
    (("export", RUN, "--table", "csv", "--out", OUT, "--star-limit", "3"), 2, "without --satnet, --coco or"),
    (("export", RUN, "--frames", "png", "--out", OUT, "--fps", "5"), 2, "no effect without --frames mp4"),
    (("export", RUN, "--frames", "png", "--out", OUT, "--first", "5", "--last", "2"), 2,
     "--last 2 is before --first 5"),
    (("export", RUN, "--coco", OUT, "--first", "99"), 1, "none of its frames is among .*it has 0 to 1"),
    (("export", RUN, "--coco", OUT, "--yolo", OUT), 2, "goes there too; give two paths"),
    (("orbit", F + "/file", "--track", "3"), 2, "--track is for the tracks of a run, and .*/file is a file: give a"),
    (("orbit", F + "/file", "--sensor", "x"), 2, "--sensor is for the tracks of a run"),
    (("orbit", RUN, "--step", "5"), 2, "--step has no effect without --oem"),
    (("solve", F + "/none.fits", "--scale", "3", "--utc", "2024-08-26T17:45:45Z"), 1, "none.fits"),
    (("solve", T, "--scale", "3", "--utc", "2024-08-26T17:45:45Z"), 1, "track.json"),
    (("solve", T, "--scale", "0", "--utc", "2024-08-26T17:45:45Z"), 2, "--scale 0: give a number from"),
    (("view", RUN, "--port", "65536"), 2, "--port 65536: give an integer from 0 to 65535"),
    (("view", RUN, RUN, RUN), 2, "3 were given"),
    (("view", F), 1, "is not the folder of a run"),
    (("view", F + "/file"), 1, "file:1:1: this is not valid JSON"),
    (("process", F + "/none.fits", "--map", "neossat", "--out", OUT), 1, "none.fits: cannot be opened"),
    (("process", F + "/rows.csv", "--map", "table", "--out", OUT), 1, "rows.csv: line 2: column file: .*none.png: cannot be opened"),
    (("process", T, "--map", "neossat", "--out", OUT), 1, "track.json: does not begin as a FITS file"),
    (("process", RUN, "--map", "nix", "--out", OUT), 1, "--map nix: there is no such keyword map .allowed: "),
    (("process", RUN, "--map", "neossat", "--out", OUT), 1, "frames.fits: HDU 1, plane 1: TRIMSEC .section of the map"),
    (("process", "--map", "neossat", "--out", OUT), 2, "at least one file of frames is expected"),
    (("twin", "--map", "neossat", "--out", F + "/t.json"), 2, "at least one file of frames is expected"),
    (("twin", RUN, "--map", "neossat", "--out", OUT), 1, "the scenario's name must end in .json"),
    (("twin", RUN, "--map", "neossat", "--out", F + "/t.json"), 1, "frames.fits: HDU 1, plane 1: TRIMSEC .section of the map"),
    (("score", RUN), 2, "--truth is missing"),
    (("score", "--truth", RUN), 2, "one source of detections or tracks is expected, 0 were given"),
    (("score", F + "/none.csv", "--truth", RUN), 1, "none.csv: cannot be opened"),
    (("score", RUN, "--truth", T), 1, "track.json: /: is no list of points"),
    (("score", ELEMENTS, "--truth", RUN), 1, ":3: the first line must name the columns x, y and frame"),
    (("score", RUN, "--truth", RUN, "--sensor", "nix"), 1, "nix"),
    (("score", F + "/points.csv", "--truth", RUN, "--least-score", "3"), 1, "--least-score 3: no point of .*points.csv has a"),
    (("score", RUN, "--truth", F + "/points.csv", "--least-snr", "0"), 1, "--least-snr 0: no point of .*points.csv has a"),
    (("score", F + "/points.csv", "--truth", RUN, "--what", "detections"), 2, "--what has no effect as"),
    (("score", F + "/points.csv", "--truth", RUN, "--unknown"), 2, "--unknown has no effect as"),
    (("score", F + "/points.csv", "--truth", F + "/points.csv", "--sensor", "a"), 2, "--sensor has no effect as neither"),
    (("score", RUN, "--truth", RUN, "--what", "tracks", "--unknown"), 2, "--unknown has no effect with --what tracks"),
    (("score", "scenarios/orbits", "--truth", RUN), 1, "orbits: holds neither a run nor annotations"),
    (("calibrate-camera", T, "--out", OUT), 1, "calibrate-camera: scenarios/neossat_geo_track.json: is not a folder"),
    (("calibrate-camera", RUN, RUN, "--out", OUT), 2, "one folder of a run is expected, 2 were given"),
    (("calibrate-camera", RUN, "--out", OUT, "--psf-radius", "9"), 2, "--psf-radius has no effect without --psf-col"),
    (("calibrate-camera", RUN, "--out", OUT, "--sensor", "nix"), 1, "nix"),
    (("characterize", "--map", "neossat", "--out", OUT), 2, "--bias, --dark or --flat is expected"),
    (("characterize", "--map", "nix", "--bias", RUN, "--out", OUT), 1, "--map nix: there is no such keyword map"),
    (("characterize", "--map", "boresight", "--dark", T, "--out", OUT), 1, "track.json: does not begin as a FITS file"),
    (("characterize", "--map", "neossat", "--dark", RUN, "--out", OUT), 1, "frames.fits: HDU 1, plane 1: "),
    (("characterize", "--map", "boresight", "--bias", RUN, "--warm", RUN, "--out", OUT), 2, "--warm and --warmer belong together"),
    (("characterize", "--map", "boresight", "--bias", RUN, "--linearity", T, "--out", OUT), 1, "track.json: does not begin as a FITS file"),
    (("characterize", "--map", "boresight", "--bias", RUN, "--linearity", RUN, "--out", OUT), 1, "the flats have 1 exposures .allowed: 6 or more"),
    (("characterize", "--map", "boresight", "--bias", RUN, "--pitch", "9", "--out", OUT), 2, "--pitch has no effect without"),
    (("characterize", "--map", "boresight", "--bias", RUN, "--maps", "--out", OUT), 2, "--maps has no effect without --dark or"),
    (("characterize", "--map", "boresight", "--bias", RUN, "--pitch", "0", "--out", OUT), 2, "--pitch 0: give a number from 0.5"),
    (("challenge", "x", "--out", OUT), 2, "one seed is expected, such as 42 or 0x2A"),
    (("challenge", "-1", "--out", OUT), 2, "unknown option -1|one seed is expected"),
    (("challenge", "1", "--out", OUT, "--sequences", "0"), 2, "--sequences 0: give an integer from 1"),
    (("check", T, "--rules"), 2, "--rules lists the rules and checks no scenario: give it alone"),
    (("check", T, "--figures", F), 2, "--figures .*: is a folder; give the name of a file in it"),
    (("loop", T, "--plot", F + "/x.gif"), 2, "x.gif: the name says neither PNG nor SVG"),
    (("loop", T, "--sensor", "nix"), 1, r"--sensor nix: .*track.json has no such sensor \(allowed: neossat/tel"),
    (("lightcurve", T, "--object", "nix"), 1, "--object nix: the scenario has no such object"),
    (("lightcurve", T, "--step", "0"), 2, "--step 0: give a number from"),
    *((("lightcurve", T, "--" + name, *value), 2, f"--{name} has no effect without --satellite")
      for name, *value in (("elements", ELEMENTS), ("norad", "5"), ("observer-norad", "5"), ("attitude", "sun"),
                           ("earthshine",))),
    (("lightcurve", T, "--extinction", "1"), 2, "--extinction has no effect without --site"),
    (("lightcurve", T, "--site", "1,1,1", "--observer", "neossat"), 2, "--site and --observer exclude each other"),
    *((("lightcurve", *SHAPE, *words), 2, says) for words, says in (
        (("--observer-norad", "44801", "--extinction", "1"), "--extinction has no effect without --site"),
        (("--observer-norad", "44801", "--site", "1,1,1"), "--site and --observer-norad exclude each other"),
        (("--site", "1,1,1", "--object", "x"), "--object is for a scenario, and --satellite was given"),
        (("--site", "1,1,1", "--observer", "x"), "--observer is for a scenario"),
        (("--site", "1,1,1", "--set", "/seed=3"), "--set is for a scenario"))),
    (("turntable", T + "/x"), 1, "x: "),
    (("turntable", "scenarios/satellites/gps_iif.json", "--size-px", "0"), 2, "--size-px 0: give an integer"),
    (("turntable", "scenarios/satellites/gps_iif.json", "--size-px", "50"), 2, "--size-px has no effect without --png"),
    (("pd", T, "--sensor", "nix"), 1, r"--sensor nix: .*\(allowed: neossat/telescope\)"),
    (("pd", T, "--plot", F + "/x.pdf", "--trials", "1"), 2, "x.pdf: the name says neither PNG nor"),
    (("pd", T, "--rates", "2"), 2, "--rates has no effect without --stack"),
    (("pd", T, "--ratio", "4"), 2, "--ratio has no effect without --pair"),
    (("pd", T, "--pair", "--ratio", "nan"), 2, r'--ratio "nan" is not a list of numbers'),
    (("pd", T, "--pair", "--separation", "1e999"), 2, r'--separation "1e999" is not a list of numbers'),
    (("pd", T, "--pair", "--separation", ""), 2, r'--separation "" is not a list of numbers|needs a value'),
    (("pd", T, "--pair", "--snr", "9:1:1"), 2, r'--snr "9:1:1": 3 to 10000, the first not above the last'),
    (("pd", T, "--pair", "--separation", "1", "--trials", "1000000000", "--cell", "5"), 1, r"--cell 5: at least"),
    (("calframes", T, "--out", OUT, "--sensor", "nix"), 1, r"\(allowed: neossat/telescope\)"),
    (("calframes", T, "--out", OUT, "--bias", "0", "--dark", "0", "--flat", "0"), 2, "nothing would be made"),
    (("calframes", T, "--out", OUT, "--flat", "0", "--level", "5"), 2, "--level has no effect, as --flat and"),
    (("calframes", T, "--out", OUT, "--flat", "0", "--dark", "0", "--exposure", "5"), 2, "--exposure has no effect, as"),
    (("calframes", T, "--out", OUT, "--linearity", "-1"), 2, "--linearity -1: give an integer from 0"),
    (("calibrate-obsgen", "--check", T, T, "--json", OUT), 2, "--json takes the figures of one scenario"),
    (("calibrate-obsgen", T, "--out", OUT, "--json", OUT + "2"), 2, "--json has no effect without --check"),
    (("bench", "--curve", "--json", F + "/new"), 2, "--json has no effect with --curve"),
    (("bench", "--first-frame", "--markdown"), 2, "--markdown has no effect with --first-frame"),
    (("bench", "--first-frame", "--curve"), 2, "--curve and --first-frame exclude each other"),
    (("bench", "--curve", "small", "worst_case"), 2, "--curve: 2 benchmark names were given .allowed: one scene, or none"),
    (("bench", "--first-frame", "small"), 2, "--first-frame: 1 benchmark names were given .allowed: none"),
    (("bench", "small", "--scenario", T), 2, "--scenario has no effect on the benchmarks that are named"),
    (("bench", "loop_full", "--tle", ELEMENTS), 2, "--tle has no effect on the benchmarks that are named"),
    (("bench", "--curve", "--scenario", T), 2, "--scenario has no effect with --curve"),
    (("bench", "small", "--report", F), 2, "--report has no effect without --curve"),
    ((*SPAN, "--step", "1e-6"), 2, "8.64e.10 rows of each satellite .allowed: 100000000"),
    ((*SPAN, "--step", "600", "--elements", ELEMENTS), 2, "are the same: give one of them"),
    ((*SPAN, "--step", "600", "--eop", "none"), 2, "--eop has no effect in TEME"),
    ((*SPAN, "--step", "600", "--format", "czml", "--frame", "teme"), 2, "czml is always in GCRF"),
    (("serve", T, "--link", "ipc://" + F + "/no", "--part", "control", "--timeout", "0.1"), 1,
     "ipc://.*/no: link: nothing has come for 0.1 s"),
    ((*STUDY, "--site", F + "/none"), 2, "--site has no effect without --slurm"),
    ((*STUDY, "--gather"), 2, "--gather: name the folders that --shard has made"),
    ((*STUDY, "--out", F + "/new", "--gather", F), 1, "is no folder of a study"),
    ((*STUDY, "--out", F + "/new", "--scheduler", F + "/none"), 1, "none: cannot be opened: No such file"),
    ((*STUDY, "--dry-run", "--scheduler", F + "/none"), 1, "none: cannot be opened: No such file"),
    ((*STUDY, "--dry-run", "--slurm", "--site", F + "/none"), 1, "none: cannot be opened: No such file"),
    ((*STUDY, "--out", F + "/new", "--slurm", "--site", F + "/none"), 1, "none: cannot be opened: No such file"),
    *(((*STUDY, *action, *words), 2, f"{words[0]} has no effect with {action[0]}: ") for action, option in (
        (("--emit", "0"), ("out", "workers", "cores", "device", "scheduler", "slurm", "shard-runs", "unpinned")),
        (("--gather", F), ("workers", "cores", "device", "scheduler", "slurm", "shard-runs", "unpinned")),
        (("--shard", "1/2"), ("workers", "scheduler", "slurm", "shard-runs", "unpinned")),
        (("--scheduler", F + "/none"), ("cores", "unpinned")), (("--slurm",), ("cores", "unpinned")))
      for words in (("--" + name, *([] if name in ("slurm", "unpinned") else [OUT if name == "out" else "3"]))
                    for name in option)),
    ((*STUDY, "--out", F + "/new", "--shard", "env/4"), 2, "set BORESIGHT_SHARD_INDEX"),
    ((*STUDY, "--scheduler", "x", "--slurm"), 2, "--slurm and --scheduler exclude each other"),
    ((*STUDY, "--dry-run", "--resume"), 2, "--dry-run and --resume exclude each other"),
    ((*STUDY, "--schema"), 2, "with --schema no study file is expected, 1 were given"),
    (("new", OUT + ".json", "--observer-tle", ELEMENTS + ":1"), 1, "no element set of satellite 1, "),
    (("new", OUT + ".json", "--observer-tle", ELEMENTS + ":x"), 1, '"x" is no catalogue number .allowed: '),
    (("new", OUT + ".json", "--pixel-scale", "3", "--focal-length", "1"), 2, "give one of them"),
    (("stars", "info", "--json"), 2, "unknown option --json"),
    (("stars", "info", "embedded", "-1"), 2, "no identity of a star: -1"),
    (("stars", "info", "embedded", "1073741824"), 1, "star 1073741824 is not in the catalogue"),
    (("stars", "import", F + "/file", "--out", OUT), 1, "file: has no column of right ascensions"),
    (("stars", "import", F + "/file", "--out", OUT, "--cone", "1,2,3"), 2, "--cone has no effect without --complete-to"),
    (("version", "x"), 2, "x. is not expected here"),
    (("schema", "--plugin", F + "/file"), 1, "cannot be loaded"),
    (("link-keys", "--out", F + "/file"), 1, "file: cannot be made: File exists"),
]


class Hostile(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = cls.folder = runs.scratch()
        cls.base = json.loads(cls.call("check", T)[0].stdout)
        os.mkfifo(folder + "/pipe")
        with open(ELEMENTS, encoding="ascii") as file:
            elements = file.read()
        cls.write("cut.tle", elements[:elements.index("1 44801") + 40])
        cls.write("file", "hello\n")
        cards = ["SIMPLE  = T", "BITPIX  = -32", "NAXIS   = 2", "NAXIS1  = 1024", "NAXIS2  = 1024", "END"]
        head = "".join(f"{card[:10]}{card[10:].strip():>20}".ljust(80) if "=" in card else card.ljust(80)
                       for card in cards)
        cls.write("rows.csv", "file,time_utc\nnone.png,2024-08-26T17:45:45Z\n")
        cls.write("points.csv", "x,y,frame\n3,4,1\n")
        cls.write("cut.fits", head.ljust(2880) + "\0" * 2880)
        cls.write("study.json", json.dumps({"boresight_study": 1, "name": "s", "kind": "loop", "seed": "0x1",
                                            "scenarios": [{"file": os.path.abspath(T)}], "replicates": 1}))
        cls.made = folder + "/run"
        runs.run(runs.STARE, cls.made, duration=2)
        cls.before = cls.content()

    @classmethod
    def write(cls, name, text):
        path = os.path.join(cls.folder, name)
        with open(path, "w", encoding="latin-1") as file:
            file.write(text)
        return path

    @classmethod
    def content(cls):
        return {os.path.join(folder, name): os.lstat(os.path.join(folder, name)).st_mtime_ns
                for folder, _, names in os.walk(cls.folder) for name in names}

    @staticmethod
    def call(*words):
        return runs.call(*words, timeout=SECONDS, stdin=subprocess.DEVNULL), words

    def refused(self, result, code, pattern):
        done, words = result
        what = ([word[-200:] for word in words], done.stdout[-300:], done.stderr[-2000:])
        self.assertEqual(done.returncode, code, what)
        # where the full star catalogue is not installed, the program says so first
        lines = [line for line in done.stderr.splitlines()
                 if not line.startswith(("Try: ", "boresight: warning: the full star catalogue"))]
        self.assertEqual(len(lines), 1, what)
        self.assertTrue(lines[0].startswith("boresight"), what)
        self.assertTrue(lines[0].isprintable(), what)
        self.assertRegex(lines[0], pattern, what)
        self.assertEqual(done.stdout if words[0] != "bench" else "", "", what)

    def unchanged(self):
        """Nothing is there but what the tests themselves wrote, and that as it was."""
        now = {path: when for path, when in self.content().items()
               if not re.search(r"/(value|text|file)\d+\.json$", path)}
        self.assertEqual(now, self.before)

    def refuse_files(self, cases):
        """(path, pattern): refused by check and run alike."""
        jobs = [(path, pattern, words) for path, pattern in cases
                for words in (("check", path), ("run", path, "--out", self.folder + "/none"))]
        for (path, pattern, _), result in zip(jobs, runs.parallel(lambda job: self.call(*job[2]), jobs)):
            with self.subTest(file=os.path.basename(path), pattern=pattern):
                self.refused(result, 1, pattern)
                self.assertIn(path, result[0].stderr)
        self.unchanged()

    def test_values(self):
        cases = []
        for number, (pointer, value, says) in enumerate(VALUES):
            scenario = copy.deepcopy(self.base)
            *way, last = pointer.split("/")[1:]
            node = scenario
            for key in way:
                node = node[int(key) if isinstance(node, list) else key]
            node[last] = value.format(self.folder) if isinstance(value, str) and "{}" in value else value
            cases.append((self.write(f"value{number}.json", json.dumps(scenario)), re.escape(says)))
        self.refuse_files(cases)

    def test_texts(self):
        text = json.dumps(self.base)
        self.assertIn('"duration_s": 300', text)
        cases = [(self.write(f"text{i}.json", text.replace('"duration_s": 300', with_, 1)
                             if with_.startswith('"') else with_ + text), pattern)
                 for i, (with_, pattern) in enumerate(TEXTS)]
        for i, (content, pattern) in enumerate(FILES):
            path = os.path.join(self.folder, f"file{i}.json")
            content = content.replace("{own}", path).replace("{folder}", self.folder)
            cases.append((self.write(f"file{i}.json", content.replace("{base}", os.path.abspath(T))), pattern))
        self.refuse_files(cases)
        self.assertGreaterEqual(len(VALUES) + len(cases), 55)

    def test_command_lines(self):
        self.assertGreaterEqual(len(LINES), 40)
        jobs = [[word.replace("{folder}", self.folder).replace("{run}", self.made) for word in words]
                for words, _, _ in LINES]
        for (_, code, pattern), result in zip(LINES, runs.parallel(lambda words: self.call(*words), jobs)):
            with self.subTest(words=result[1]):
                self.refused(result, code, pattern)
        self.unchanged()

    def test_every_command_is_among_them(self):
        listed = self.call("help")[0].stdout.split("commands:")[1].split("\n\n")[0]
        self.assertEqual({line.split()[0] for line in listed.splitlines() if line} - {"icd"},
                         {words[0] for words, _, _ in LINES} - {"RUN"})


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
