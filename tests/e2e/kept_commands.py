"""Scenes of test_figures_kept.py that are a command's own: the rules of check, studies, Pd, the twin of a recorded frame, a sensor's
and a camera's calibration."""
import os

import kept_scenes
import runs


def scene_checks(k):
    for name, scene in kept_scenes.checks().items():
        warned = runs.call("check", k.write(name + ".json", scene), "--quiet")
        k.columns.put(f"{name} exit", float(warned.returncode))
        for i, line in enumerate(warned.stderr.splitlines()):  # each has numbers of its own size
            k.columns.put_text(f"{name} {i}", line)
    k.call("figures", "check", k.write("infrared.json", kept_scenes.infrared()), "--figures", "-")


def scene_studies(k):
    noise = kept_scenes.SENSOR + "/camera/read_noise_e"
    scene = kept_scenes.changed(kept_scenes.track(), {**kept_scenes.SMALL, kept_scenes.SENSOR + "/observation_source": "generator", "/duration_s": 14,
                                                      "/record": {"frames": "none"}})
    other = kept_scenes.changed(scene, {"/name": "other", kept_scenes.SENSOR + "/camera/rotation_deg": 80})
    base = {"boresight_study": 1, "seed": "0x51", "scenarios": [{"file": k.write("base.json", scene)}, {"file": k.write("other.json", other)}]}
    k.write("loop.json", {**base, "name": "loop", "kind": "loop", "replicates": 3, "resamples": 100,
                          "sweeps": [{"axes": [{"path": noise, "values": [5, 25]}, {"path": kept_scenes.SENSOR + "/camera/aperture_m", "values": [0.1, 0.15]}]}],
                          "dispersions": [{"path": "/world/objects/0/area_m2", "distribution": "log_uniform", "from": 1, "to": 16}]})
    out = k.path("loop")
    k.call("study", "study", k.path("loop.json"), "--out", out, "--quiet", "--workers", "1", text=False)
    for name in ("runs.csv", "statistics.csv", "settings.csv"):
        k.add(name, os.path.join(out, name))
    k.call("report", "report", out, "--out", k.path("report.html"), adds=[k.path("report.html")])
    cube = kept_scenes.rolling()
    cube.update(duration_s=3, record={"frames": "cube"})
    k.write("cube.json", cube)
    k.write("cubes.json", {"boresight_study": 1, "seed": "0x52", "name": "cubes", "kind": "cubes", "scenarios": [{"file": k.path("cube.json")}],
                           "replicates": 2, "dispersions": [{"path": kept_scenes.SENSOR + "/camera/rotation_deg", "from": -180, "to": 180}]})
    k.call("cubes", "study", k.path("cubes.json"), "--out", k.path("cubes"), "--quiet", "--workers", "1", text=False, adds=[k.path("cubes")])


def scene_measured(k):
    """Detection, false alarms and location in every form; the same as a study."""
    k.draw_scripts()
    scene = kept_scenes.measured()
    tabulated = k.write("tabulated.json", kept_scenes.changed(scene, kept_scenes.tabulated_psf(k.path("psf.fits"))))
    gaussian = k.write("gaussian.json", scene)
    for name, words in (("stars", [tabulated, "--stars", "--star-streak", "7", "--snr", "5:13:4", "--trials", "30", "--false-alarms", "3"]),
                        ("stack", [gaussian, "--snr", "3:7:4", "--trials", "12", "--stack", "4", "--rates", "2"]),
                        ("magnitude", [gaussian, "--magnitude", "12:14:1", "--trials", "12", "--module", "--jitter", "0.3"])):
        k.call(name, "pd", *words, "--empty-frames", "6", "--threads", "1", "--json", k.path("pd.json"), "--plot", k.path("pd.png"), text=False,
               adds=[k.path("pd.json")])
        k.add_script(name + " plot", k.path("pd.png"))
    for name, words in (("pairs", [tabulated, "--trials", "2"]), ("pairs of streaks", [gaussian, "--trials", "4", "--streak", "5"])):
        k.call(name, "pd", *words, "--pair", "--snr", "60", "--ratio", "2", "--separation", "1.2,1.9", "--false-splits", "0.01", "--threads", "1",
               "--json", k.path("pd.json"), "--plot", k.path("pd.png"), text=False, adds=[k.path("pd.json")])
        k.add_script(name + " plot", k.path("pd.png"))
    turned = k.write("turned.json", kept_scenes.changed(scene, {"/name": "turned", kept_scenes.SENSOR + "/camera/rotation_deg": 75,
                                                                kept_scenes.SENSOR + "/camera/aperture_m": 0.2}))
    k.write("study.json", {"boresight_study": 1, "seed": "0x53", "name": "pd", "kind": "pd", "scenarios": [{"file": gaussian}, {"file": turned}],
                           "resamples": 100, "pd": {"snr_first": 5, "snr_last": 9, "snr_step": 4, "trials": 12, "false_alarms_per_frame": 4, "empty_frames": 5,
                                                    "known_rate": True, "min_separation_px": 31, "background_e": 40, "jitter_px": 0.2},
                           "sweeps": [{"axes": [{"path": "/pd/streak_px", "values": [4, 6]}]}]})
    k.call("study", "study", k.path("study.json"), "--out", k.path("study"), "--quiet", "--workers", "1", text=False)
    for name in sorted(n for n in os.listdir(k.path("study")) if n.endswith(".csv")):
        k.add("study " + name, os.path.join(k.path("study"), name))


def scene_twin(k):
    """A frame whose line of sight follows a bent path, and its twin."""
    path, camera = kept_scenes.bent_path(7.0, 150)
    import test_twin
    scenario = test_twin.write_scenario(k.folder, path, camera, "embedded")
    k.call("source", "run", scenario, "--quiet", "--out", k.path("source"), "--threads", "1", text=False)
    k.call("twin", "twin", k.path("source"), "--map", "boresight", "--v-limit", "6.5", "--least-snr", "8", "--catalogue", "embedded", "--quiet",
           "--threads", "1", "--out", k.path("twin.json"), adds=[k.path("twin" + n) for n in (".json", "_path.json", "_psf.fits", "_dark.fits", "_report.json",
                                                                                                 "_report.html", "_report.png", "_stars.bin")])
    k.add("twin frames", k.path("twin_run/frames.fits"))


def scene_sensor(k):
    """A sensor and a camera from frames of their own."""
    k.draw_scripts()
    scene = k.write("sensor.json", kept_scenes.sensor())
    for folder, words in (("cal", ["--bias", "4", "--dark", "5", "--flat", "4", "--linearity", "6"]),
                          ("warm", ["--bias", "0", "--dark", "4", "--flat", "0", "--set", kept_scenes.SENSOR + "/camera/dark_current_e_per_s=40"])):
        k.call(folder, "calframes", scene, "--out", k.path(folder), "--exposure", "4", "--threads", "1", *words)
    names = {f"{folder} {n.rsplit('_', 1)[1][:-5]}": os.path.join(k.path(folder), n) for folder in ("cal", "warm") for n in os.listdir(k.path(folder))}
    for name, words in (("darks", ["--dark", names["cal dark"], "--pitch", "9"]),
                        ("bias", ["--bias", names["cal bias"], "--simulated", names["cal bias"]]),
                        ("all", ["--dark", names["cal dark"], "--bias", names["cal bias"], "--flat", names["cal flat"], "--linearity", names["cal linearity"], "--warm", names["warm dark"],
                                 "--warmer", "8", "--simulated", names["cal dark"], "--extends", scene])):
        k.call(name, "characterize", "--map", "boresight", *words, "--out", k.path(name), adds=[k.path(name)])
        k.add_script(name + " plot", os.path.join(k.path(name), "plot.png"))
    k.call("loop", "loop", scene, "--plot", k.path("loop.png"), text=False)
    k.add_script("loop plot", k.path("loop.png"))
    k.export("oem", k.run("stars", kept_scenes.starry()), "--orbits", "oem", "--step", "0.2")
    k.call("camera", "calibrate-camera", k.path("stars"), "--out", k.path("camera"), "--psf-columns", "1", "--psf-rows", "1", "--psf-radius", "7",
           adds=[k.path("camera")])
    k.call("images and generator", "calibrate-obsgen", "--check", k.path("stars.json"), "--seeds", "2", "--duration", "3", "--json", k.path("check.json"),
           "--threads", "1", adds=[k.path("check.json")])
