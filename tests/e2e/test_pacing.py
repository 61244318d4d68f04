"""Runs by the wall clock. Nothing here depends on how fast the machine is: what has to be late sleeps,
and what is not late is not asserted to be on time; but with --full, ten minutes of a quiet machine, at
most 1 % of the frames may be late."""
import signal
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import runs

sys.path.insert(0, "python")
import boresight  # noqa: E402
from boresight import link as client  # noqa: E402

FULL = "--full" in sys.argv
if FULL:
    sys.argv.remove("--full")
GENERATOR = runs.SENSOR + "/observation_source=generator"


def tearDownModule():
    runs.clean()


def paced(out, mode, *sets, duration=4, external=None, peer=None):
    """A run without images; `peer` plays its part `external` in a thread. Wall seconds, manifest."""
    sets = (GENERATOR, runs.NO_FRAMES, "/link/timeout_s=30", *sets)
    words = runs.command(runs.TRACK, out, *sets, duration=duration) + ["--pacing", mode]
    if external:
        address = f"ipc://{runs.scratch()}/link"
        words += ["--link", address, "--external", external]
        thread = threading.Thread(target=peer, args=(address,))
        thread.start()
    began = time.monotonic()
    result = subprocess.run(words, capture_output=True, text=True, timeout=120)
    wall = time.monotonic() - began
    if external:
        thread.join()
    if result.returncode != 0:
        raise AssertionError(result.stderr)
    return wall, runs.manifest(out), result.stdout + result.stderr


def slow_tracker(seconds):
    def play(address):
        with client.Link(address, serves="tracker") as link:
            for step in link.steps():
                time.sleep(seconds)
                tracks = client.new_record("tracks")
                tracks["exposure_id"], tracks["tick"] = step.get("detections")["exposure_id"], step.tick
                step.send("tracks", tracks, client.new_items("tracks", 0))
    return play


class RealTime(unittest.TestCase):
    def test_it_takes_its_time_and_changes_nothing(self):
        free, timed = runs.scratch() + "/free", runs.scratch() + "/timed"
        runs.run(runs.TRACK, free, GENERATOR, runs.NO_FRAMES, duration=4)
        wall, manifest, said = paced(timed, "realtime", "/pacing/speed=8")
        self.assertGreaterEqual(wall, 0.47)  # the last step is before 4 s
        pacing = manifest["pacing"]
        self.assertEqual((pacing["mode"], pacing["overrun"], pacing["repeats"]),
                         ("realtime", "slip", True))
        self.assertEqual(pacing["frames"], 4)
        self.assertEqual(sum(pacing["response_frames"]), pacing["done"])
        self.assertEqual(len(pacing["response_frames"]), len(pacing["response_up_to_ms"]))
        self.assertAlmostEqual(pacing["deadline_s"], 0.125)
        self.assertIn("late frames", said)
        a, b = boresight.read_run(free), boresight.read_run(timed)
        for name in a.tables:
            if name != "events":
                for column, values in a.table(name).items():
                    np.testing.assert_array_equal(values, b.table(name)[column], f"{name}.{column}")
        self.assertEqual(a.manifest["pacing"], {"mode": "lockstep", "repeats": True})

    def test_overruns(self):
        """Periods of 50 ms of the clock, and a peer that takes three of them for each frame."""
        for policy in ("slip", "drop"):
            out = runs.scratch() + "/run"
            wall, manifest, _ = paced(out, "realtime", "/pacing/speed=20",
                                      f"/pacing/overrun={policy}", duration=5, external="tracker",
                                      peer=slow_tracker(0.15))
            pacing, taken = manifest["pacing"], boresight.read_run(out).table("exposures")
            self.assertEqual(pacing["frames"], 5)
            self.assertGreaterEqual(pacing["overruns"], 2)
            events = boresight.read_run(out).table("events")
            self.assertEqual(np.sum(events["kind"] == "overrun"), pacing["overruns"])
            if policy == "slip":
                self.assertEqual(pacing["dropped"], 0)
                self.assertGreater(pacing["slipped_s"], 0.2)
                self.assertTrue(pacing["repeats"])
                self.assertEqual(manifest["counters"]["link_messages"], 2 * 5 + 1)
                self.assertGreaterEqual(wall, 5 * 0.15)
            else:
                self.assertGreaterEqual(pacing["dropped"], 2)
                self.assertEqual(pacing["dropped"], pacing["overruns"])
                self.assertEqual(pacing["slipped_s"], 0)
                self.assertFalse(pacing["repeats"])
                self.assertEqual(pacing["done"] + pacing["dropped"], 5)
            self.assertEqual(np.sum(taken["dropped"]), pacing["dropped"])

    def test_hold_does_not_wait(self):
        out = runs.scratch() + "/run"
        _, manifest, said = paced(out, "realtime", "/pacing/speed=20", "/pacing/overrun=hold",
                                  "/pacing/deadline_s=0.01", duration=6, external="tracker",
                                  peer=slow_tracker(0.15))
        count = manifest["counters"]
        self.assertGreaterEqual(count["link_held"] + count.get("link_skipped", 0), 3)
        self.assertFalse(manifest["pacing"]["repeats"])
        self.assertEqual(manifest["pacing"]["dropped"], 0)
        self.assertIn("results repeat", said)

    def test_interrupted_while_it_waits_for_the_clock(self):
        words = runs.command(runs.TRACK, runs.scratch() + "/run", GENERATOR, runs.NO_FRAMES,
                             "/pacing/speed=0.01", duration=100) + ["--pacing", "realtime"]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        self.assertIn(process.wait(timeout=60), (130, -signal.SIGINT))
        process.communicate()

    def test_priority_and_processor(self):
        """Granted, or a warning and a run all the same."""
        _, manifest, said = paced(runs.scratch() + "/run", "realtime", "/pacing/speed=100",
                                  "/pacing/priority=10", "/pacing/cpu=1023", duration=2)
        self.assertFalse(manifest["pacing"]["cpu"])
        self.assertIn("cannot stay on processor 1023", said)
        self.assertEqual(manifest["pacing"]["priority"], "no real-time priority" not in said)


class Loop(unittest.TestCase):
    """30 frames of 1024 x 1024 pixels a second, detection, tracking and control in processes of their
    own: `boresight serve` is a peer in C."""
    SCENARIO = "scenarios/link_realtime.json"

    def test_three_peers_in_c(self):
        seconds = 600 if FULL else 1
        inside, outside = runs.scratch() + "/inside", runs.scratch() + "/outside"
        runs.run(self.SCENARIO, inside, "/pacing/mode=lockstep", duration=seconds)
        address = f"ipc://{runs.scratch()}/link"
        words = ["--duration", str(seconds), "--link", address]
        parts = ("imgproc", "tracker", "control")
        peers = [subprocess.Popen([runs.BORESIGHT, "serve", self.SCENARIO, "--part", part, *words,
                                   "--set", "/world/star_catalogue=embedded", "--threads", "1"],
                                  stderr=subprocess.DEVNULL) for part in parts]
        result = subprocess.run(
            runs.command(self.SCENARIO, outside, "/link/timeout_s=60", duration=seconds) +
            ["--link", address, "--external", ",".join(parts)], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        for peer in peers:
            self.assertEqual(peer.wait(timeout=60), 0)
        pacing = runs.manifest(outside)["pacing"]
        self.assertEqual(pacing["frames"], 30 * seconds)
        self.assertLessEqual(pacing["frames"] - pacing["done"], 1)  # the last one's were not due
        self.assertEqual(sum(pacing["response_frames"]), pacing["done"])
        self.assertGreaterEqual(pacing["late"], 0)
        if FULL:
            print(pacing)
            self.assertLessEqual(pacing["late"], 0.01 * pacing["frames"])
        # the run waits for its peers and its clock is set back where they are late: the same loop
        a, b = boresight.read_run(inside), boresight.read_run(outside)
        for name in ("detections", "tracks", "los_commands", "truth"):
            x, y = a.table(name), b.table(name)
            self.assertGreater(len(x["sensor"]), 0)
            for column in x:
                np.testing.assert_array_equal(x[column], y[column], f"{name}.{column}")
        rms = [runs.manifest(out)["summary"]["pointing_rms_px"] for out in (inside, outside)]
        self.assertEqual(*rms)


class Fast(unittest.TestCase):
    def test_nobody_is_waited_for(self):
        out = runs.scratch() + "/run"
        _, manifest, said = paced(out, "fast", duration=30, external="tracker",
                                  peer=slow_tracker(0.2))
        count = manifest["counters"]
        # 30 frames; two may be with the peer, which is 0.2 s at each
        self.assertGreater(count["link_skipped"], 0)
        self.assertGreater(count["link_held"], 0)
        self.assertFalse(manifest["pacing"]["repeats"])
        self.assertIn("will not repeat", said)

    def test_a_quick_peer_is_heard(self):
        out = runs.scratch() + "/run"
        _, manifest, _ = paced(out, "fast", duration=30, external="tracker", peer=slow_tracker(0.0))
        self.assertGreater(len(boresight.read_run(out).table("track_frames")["exposure_id"]), 0)
        self.assertEqual(manifest["pacing"]["mode"], "fast")

    def test_without_a_link_it_is_lockstep(self):
        _, manifest, _ = paced(runs.scratch() + "/run", "fast")
        self.assertTrue(manifest["pacing"]["repeats"])


if __name__ == "__main__":
    unittest.main()
