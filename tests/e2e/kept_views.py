"""Scenes of test_figures_kept.py that look at one short run from all sides: every route of the viewer, and pages and exports of
tables that a run of hours would have."""
import json
import os
import re
import shutil
import sqlite3
import urllib.error
import urllib.request

import numpy as np

import kept_scenes

PANELS = ("pointing_error", "snr", "track_error", "innovation", "mount", "third_axis", "limits", "body_rate", "detections", "attitude_error",
          "background", "latency", "wheels")
REPEATS, SLOWER = 12, 40  # of a run that is made longer


def run_of_two(k):
    scene = kept_scenes.unlike()
    sensor = scene["observers"][0]["sensors"][0]
    sensor["camera"].update(width_px=200, height_px=312)
    sensor["exposure"].update(binning=1, window_px=[0, 0, 0, 0])
    scene.update(name="shown", duration_s=9)
    scene["record"].update(planes=["stars", "targets", "background"], telemetry_hz=7)
    path, out = k.write("shown.json", scene), k.path("shown")
    k.call("run", "run", path, "--quiet", "--out", out, "--threads", "1", "--no-pictures")
    return out


def post(viewer, route, body):
    """What a viewer answers to a body: bytes."""
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(viewer.url + route, data, {"Origin": viewer.url[:viewer.url.index("/", 7)]})
    try:
        with urllib.request.urlopen(request, timeout=60) as answer:
            return answer.read()
    except urllib.error.HTTPError as error:
        return json.dumps({"error": error.code}).encode()


def routes_of_run(sensors, span_s, frames):
    """All that the page asks of a run."""
    for s in range(sensors):
        yield from (f"api/frames?sensor={s}", f"api/modes?sensor={s}", f"api/space/poses?sensor={s}", f"api/why?sensor={s}&frame={frames[s][0]}")
        for panel in PANELS:
            yield f"api/plot?sensor={s}&panel={panel}&from=1&to={span_s - 1}&columns=37"
        for f in frames[s]:
            yield from (f"api/frame?sensor={s}&frame={f}", f"api/reason?sensor={s}&frame={f}")
        for f in frames[s][:1] if s == 1 else frames[s]:
            yield from (f"api/thumbnail?sensor={s}&frame={f}", f"api/pixels?sensor={s}&frame={f}&x=31&y=20&width=80&height=50&binning=3",
                        f"api/noise_free?sensor={s}&frame={f}&x=17&y=40&width=90&height=61")
        for t in (1, 2, 3):
            yield f"api/track?sensor={s}&object={t}&frame={frames[s][-1]}"
    yield from ("api/run", "api/events", "api/names", "api/refresh", "api/space/scene", "api/space/coast", "api/space/states?from=3", "api/space/states?from=7&sensor=1")


def scene_shown(k):
    out = run_of_two(k)
    k.view("shown", out, *routes_of_run(3, 9, ((3, 6), (2, 6), (1, 4))))
    # the file is higher than it is wide, and higher than a picture of the page
    k.call("page", "export", out, "--page", k.path("page.html"), "--size", "90", "--every", "2", adds=[k.path("page.html")])
    stretched(k, out)


def repeat(db, times, span_s, tick_rate_hz):
    """The rows of exposures and times again, each time later. Exposures are numbered on; none of them has pixels."""
    counts = dict(db.execute("SELECT sensor, max(exposure_id) + 1 FROM exposures GROUP BY sensor"))
    later = {"time_s": span_s, "mid_s": span_s, "start_s": span_s, "end_s": span_s, "first_s": span_s, "last_s": span_s}
    for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
        keys = [row[1] for row in db.execute(f'PRAGMA table_info("{table}")')]
        if "sensor" not in keys or table in ("sensors", "frames", "events") or not {"exposure_id", "tick", "time_s"} & set(keys):
            continue
        rows = db.execute(f'SELECT * FROM "{table}" ORDER BY rowid').fetchall()
        for k in range(1, times):
            for row in rows:
                cells = dict(zip(keys, row))
                for key in keys:
                    if cells[key] is None:
                        continue
                    if key == "exposure_id":
                        cells[key] += k * counts[cells["sensor"]]
                    elif key in later:
                        cells[key] += k * later[key]
                    elif key.endswith("tick"):
                        cells[key] += int(k * span_s * tick_rate_hz)
                db.execute(f'INSERT INTO "{table}" VALUES ({", ".join("?" * len(keys))})', list(cells.values()))


def stretched(k, out):
    """The tables of the run as if it had lasted hours, with many changes of mode."""
    folder, span_s = k.path("slow"), 9.0
    shutil.copytree(out, folder)
    db = sqlite3.connect(os.path.join(folder, "run.sqlite"))
    rate = db.execute("SELECT tick_rate_hz FROM run").fetchone()[0]
    repeat(db, REPEATS, span_s, rate)
    db.execute("UPDATE run SET tick_rate_hz = ?", (rate // SLOWER,))
    for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
        for column in [row[1] for row in db.execute(f'PRAGMA table_info("{table}")')]:
            if column in ("time_s", "mid_s", "start_s", "begin_s", "end_s", "first_s", "last_s"):
                db.execute(f'UPDATE "{table}" SET {column} = {column} * {SLOWER}')
    modes = [row[0] for row in db.execute("SELECT DISTINCT mode FROM control ORDER BY mode")] + ["track", "search", "coast"]
    keys = [row[1] for row in db.execute("PRAGMA table_info(control)")]
    first = dict(zip(keys, db.execute("SELECT * FROM control WHERE sensor = 2 ORDER BY rowid LIMIT 1").fetchone()))
    db.execute("DELETE FROM control WHERE sensor = 2")
    for i in range(900):
        seconds = REPEATS * span_s * SLOWER * ((i + 0.3) / 900) ** 1.5
        row = {**first, "tick": int(seconds * (rate // SLOWER)), "time_s": seconds, "mode": modes[(i * 7 + i // 5) % len(modes)]}
        db.execute(f"INSERT INTO control ({', '.join(keys)}) VALUES ({', '.join('?' * len(keys))})", [row[key] for key in keys])
    db.commit()
    db.close()
    for name in ("scenario.json", "manifest.json"):
        path = os.path.join(folder, name)
        with open(path, encoding="utf-8") as file:
            text = file.read()
        with open(path, "w", encoding="utf-8") as file:
            file.write(re.sub(r'"duration_s":\s*9\b(\.0)?', f'"duration_s": {REPEATS * span_s * SLOWER}', text))
    k.call("slow info", "info", folder)
    k.call("slow report", "report", folder, "--out", k.path("slow.html"), adds=[k.path("slow.html")])
    k.view("slow", folder, *(f"api/plot?sensor={s}&panel={p}&from=431&to=3025&columns=40" for s in (0, 2) for p in PANELS),
           "api/modes?sensor=2", "api/frame?sensor=2&frame=60", "api/track?sensor=2&object=1&frame=63", "api/why?sensor=2&frame=50")


def study_tables(k, name, axes, settings, metrics, seed, kind="loop", curves=False):
    """A folder with the tables of a study: axes [(name, role, design)], settings [values of the swept axes]."""
    folder = k.path(name)
    os.mkdir(folder)
    rng = np.random.default_rng(seed)
    db = sqlite3.connect(os.path.join(folder, "study.sqlite"))
    swept = [a[0] for a in axes if a[1] == "sweep"]
    names = [a[0] for a in axes] + metrics
    db.executescript(
        "CREATE TABLE about (key, value); CREATE TABLE axes (axis, name, path, role, design); CREATE TABLE scenarios (scenario, name);"
        "CREATE TABLE metrics (metric, unit, doc, kind); CREATE TABLE columns (tab, name, unit);"
        "CREATE TABLE statistics (setting, metric, runs, missing, mean, low, high, std, minimum, median, p95, maximum);"
        f"CREATE TABLE settings (setting, {', '.join(swept)}); CREATE TABLE speed (run, wall_s, cpu_s);"
        f"CREATE TABLE runs (run, setting, status, error, {', '.join(names)});"
        + "".join(f"CREATE TABLE {t} (sweep, rank, design, metric, axis, effect, effect_error, spread, effects);" for t in ("sensitivity", "speed_sensitivity")))
    db.executemany("INSERT INTO about VALUES (?, ?)", {"name": name, "kind": kind, "seed": "0x5", "version": "1", "digest": "d", "runs": str(2 * len(settings) + 1),
                                                       "replicates": "2"}.items())
    db.executemany("INSERT INTO axes VALUES (?, ?, ?, ?, ?)", [(i, n, "/a/" + n, role, design) for i, (n, role, design) in enumerate(axes)])
    db.execute("INSERT INTO scenarios VALUES (0, 'base')")
    db.executemany("INSERT INTO metrics VALUES (?, 'px', ?, ?)", [(m, f"What {m} is.", "rate" if m == "acquired" else "mean") for m in metrics])
    for s, values in enumerate(settings):
        db.execute(f"INSERT INTO settings VALUES ({', '.join('?' * (1 + len(swept)))})", (s, *values))
        for r in range(2):
            drawn = [dict(zip(swept, values)).get(a[0], rng.uniform(-3, 9)) for a in axes]
            results = [None if (s + r) % 11 == 7 and m == metrics[-1] else float(rng.gamma(2 + i) + 0.2 * s) for i, m in enumerate(metrics)]
            bad = s == 3 and r == 1
            db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * (4 + len(names)))})", (2 * s + r, s, "failed" if bad else "done", "no light" if bad else "", *drawn, *results))
            if (s, r) != (1, 0):
                db.execute("INSERT INTO speed VALUES (?, ?, ?)", (2 * s + r, 3 + rng.uniform(), 8 + rng.uniform()))
        for i, m in enumerate(metrics):
            mean = None if s == 2 and i == 1 else 2.0 + i + 0.3 * s + rng.uniform()
            db.execute("INSERT INTO statistics VALUES (?, ?, 2, 0, ?, ?, ?, 1, 2, 3, 4, 5)", (s, m, mean, mean and mean - 0.4 - rng.uniform(), mean and mean + 0.9))
    for i, m in enumerate(metrics):
        db.execute("INSERT INTO statistics VALUES (NULL, ?, 9, 1, ?, ?, ?, 1, 2, 3, 4, 5)", (m, 3.5 + i, 3.1 + i, 4.4 + i))
    for table, listed in (("sensitivity", metrics), ("speed_sensitivity", ["wall_s", "cpu_s"])):
        for m in listed:
            for rank, a in enumerate(a for a in axes if a[2] in ("morris", "one_at_a_time")):
                db.execute(f"INSERT INTO {table} VALUES (0, ?, ?, ?, ?, ?, ?, ?, 12)", (rank + 1, a[2], m, a[0], 5.0 / (rank + 1.3), None if rank == 1 else 0.4, 0.7 + 0.2 * rank))
    if curves:
        db.executemany("INSERT INTO columns VALUES ('pd_statistics', ?, ?)", [("setting", ""), ("runs", ""), ("snr", ""), ("v_mag", "mag"), ("rate", ""), ("rate_low", ""),
                                                                               ("rate_high", ""), ("ideal_pd", "")])
        db.execute("CREATE TABLE pd_statistics (setting, runs, snr, v_mag, rate, rate_low, rate_high, ideal_pd)")
        for s in range(len(settings)):
            for snr in range(3, 9):
                rate = 1 / (1 + np.exp(6 - snr - 0.3 * s))
                db.execute("INSERT INTO pd_statistics VALUES (?, 2, ?, ?, ?, ?, ?, ?)", (s, snr, 17.3 - 0.8 * snr, rate, 0.9 * rate, rate + 0.1 * (1 - rate), min(1, 1.1 * rate)))
    db.commit()
    db.close()
    k.call(f"{name} report", "report", folder, "--out", k.path(name + ".html"), adds=[k.path(name + ".html")])
    k.view(name, folder, "api/study")


def scene_reported(k):
    """Reports of studies of every design, from tables of numbers that mean nothing."""
    metrics = ["pointing_rms_px", "custody", "acquired", "loss_db_pd50"]
    study_tables(k, "grid", [("gain", "sweep", "grid"), ("noise", "sweep", "grid"), ("filter", "sweep", "grid"), ("drawn", "dispersion", "")],
                 [(g, n, f) for g in (1, 3, 9, 30) for n in (4, 5) for f in ("red", "blue")], metrics, 1, curves=True)
    study_tables(k, "hypercube", [("wide", "sweep", "latin_hypercube"), ("narrow", "sweep", "latin_hypercube"), ("orbit", "population", "")],
                 [(0.5 * 1.08**i, 7 + (i * 29 % 70) / 9) for i in range(70)], metrics, 2)
    study_tables(k, "morris", [(f"axis_{i}", "sweep", "morris") for i in range(4)], [tuple(1 + (i >> b & 1) for b in range(4)) for i in range(12)], metrics, 3)
    study_tables(k, "one", [(f"axis_{i}", "sweep", "one_at_a_time") for i in range(3)],
                 [(2, 30, 0.1), (1, 30, 0.1), (5, 30, 0.1), (2, 10, 0.1), (2, 90, 0.1), (2, 30, 0.7)], metrics, 4)
