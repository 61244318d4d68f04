"""boresight bench: the keys of its JSON, its Markdown and its messages; with --full its curve and each benchmark."""
import json
import math
import os
import re
import subprocess
import sys
import tempfile

PROGRAM = sys.argv[1]

RESULT_KEYS = ["name", "frames_per_s", "ms_median", "ms_min", "cpu_ms", "latency_ms",
               "error_sigma_max", "error_sigma_rms", "error_peak_max", "predicted_error_sigma",
               "flux_error_rel", "centroid_error_px", "peak_rss_mib", "device", "threads"]
MACHINE_KEYS = ["cpu", "cores", "memory_mib", "os", "kernel", "compiler", "device", "driver",
                "version", "git_revision", "date"]


def bench(*arguments):
    return subprocess.run([PROGRAM, "bench", *arguments], capture_output=True, text=True)


FULL = "--full" in sys.argv[2:]


def check_first_frame():
    """What cold_start starts nine times: when each step of the first frame was done."""
    done = bench("--first-frame", "--threads", "1")
    assert done.returncode == 0, done.stderr
    ends = [float(line) for line in done.stdout.splitlines()]
    assert len(ends) == 5 and ends == sorted(ends), ends


def check_results(folder):
    path = os.path.join(folder, "bench.json")
    done = bench("small", *(["cold_start"] if FULL else []), "--threads", "1", "--json", path)
    assert done.returncode == 0, done.stderr
    with open(path, encoding="utf-8") as file:
        report = json.load(file)
    for key in MACHINE_KEYS:
        assert report["machine"][key] not in (None, "") or key == "git_revision", key
    assert report["machine"]["cores"] == os.cpu_count()
    by_name = {r["name"]: r for r in report["results"]}
    assert sorted(by_name) == (["cold_start", "small"] if FULL else ["small"])
    for result in by_name.values():
        assert [k for k in RESULT_KEYS if k not in result] == []
        assert 0 < result["ms_min"] <= result["ms_median"]
        assert math.isclose(result["frames_per_s"], 1e3 / result["ms_median"], rel_tol=1e-9)
        assert result["cpu_ms"] > 0 and result["threads"] == 1
        assert 10 < result["peak_rss_mib"] < 1536
    small = by_name["small"]
    assert small["latency_ms"] > small["ms_min"]  # two frames are under way
    assert 0 < small["error_sigma_max"] <= small["predicted_error_sigma"]
    assert small["error_sigma_rms"] < small["error_sigma_max"]
    # the scene's tolerance; light and places follow from it
    assert small["error_sigma_max"] < 0.05
    assert small["flux_error_rel"] < 1e-4 and 0 < small["centroid_error_px"] < 0.01
    if not FULL:
        return
    cold = by_name["cold_start"]
    assert cold["error_sigma_max"] is None
    assert sorted(cold["phases_ms"]) == ["device", "first_frame", "kernels", "process", "scene"]
    # medians of the parts, of nine processes, are about the median of the whole
    assert sum(cold["phases_ms"].values()) < 3 * cold["ms_median"]


def check_markdown_in_another_folder():
    """The scenarios that benchmarks run are found wherever the program is started."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([os.path.abspath(PROGRAM), "bench", "sgp4", "--markdown"],
                              capture_output=True, text=True, cwd=folder)
        assert done.returncode == 0, done.stderr
        assert os.listdir(folder) == []
    rows = [line for line in done.stdout.splitlines() if line.startswith("|")]
    assert len(rows) == 3 and rows[2].startswith("| `sgp4` |")
    assert len({row.count("|") for row in rows}) == 1


def check_curve(folder):
    done = bench("--curve", "small", "--report", folder)
    assert done.returncode == 0, done.stderr
    with open(os.path.join(folder, "speed_error.md"), encoding="utf-8") as file:
        text = file.read()
    knobs = ["tolerance_sigma", "temporal_oversample", "renderer", "spatial_oversample",
             "stamp_radius_px", "psf_degree", "faint_limit_mag"]
    for knob in knobs:
        assert f"## `{knob}`" in text, knob
        image = os.path.join(folder, "images", f"speed_error_{knob}.png")
        shown = f"images/speed_error_{knob}.png" in text
        assert shown == os.path.exists(image)  # without gnuplot neither
    rows = [[c.strip() for c in line.split("|")[1:-1]] for line in text.splitlines()
            if line.startswith("| `small` |")]
    points = [(float(r[2]), float(r[5]), r[8]) for r in rows]
    best = [(ms, error) for ms, error, mark in points if mark]
    assert best, "no point is marked"
    # of the marked ones, quicker is less exact (figures as printed)
    best.sort()
    assert all(a[1] >= b[1] for a, b in zip(best, best[1:])), best
    factors = [line for line in text.splitlines()
               if line.split("|")[2:3] in ([" single "], [" multi "])]
    assert len(factors) == 12


def check_plants():
    """The benchmarks of plants keep the plants' preconditions: unit directions, among others."""
    done = bench("plant_second_order", "plant_full", "plant_all", "--markdown")
    assert done.returncode == 0, done.stderr
    for name in ("plant_second_order", "plant_full", "plant_all"):
        assert f"| `{name}` |" in done.stdout, done.stdout


def check_every_benchmark():
    """All benchmarks that the help lists run to their end, one at a time."""
    listed = subprocess.run([PROGRAM, "help", "bench"], capture_output=True, text=True).stdout
    names = re.findall(r"^  ([a-z][a-z0-9_]+) {2,}", listed.split("benchmarks (", 1)[1].split("options:")[0], re.M)
    assert len(names) > 35, names
    failed = {}
    for name in names:
        done = bench(name)
        if done.returncode != 0:
            failed[name] = done.stderr
    assert failed == {}, failed


def check_messages():
    done = bench("nonsense")
    assert done.returncode == 2 and "nonsense" in done.stderr
    done = bench("--curve", "sgp4", "--report", tempfile.gettempdir())
    assert done.returncode == 1 and "sgp4" in done.stderr
    done = bench("--curve", "sgp4", "--report", "/nonexistent/folder")
    assert done.returncode == 2 and "there is no folder /nonexistent" in done.stderr
    done = bench("small", "--device", "no such device")
    assert done.returncode == 1 and "no such device" in done.stderr


def main():
    with tempfile.TemporaryDirectory() as folder:
        check_results(folder)
        check_markdown_in_another_folder()
        if FULL:  # some thirty sets of kernels; the report and the marks: tests/bench/test_bench_report.c
            check_curve(os.path.join(folder, "report"))
        check_messages()
    check_first_frame()
    check_plants()
    if FULL:
        check_every_benchmark()


main()
