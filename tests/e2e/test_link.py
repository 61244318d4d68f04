"""Modules outside: runs whose parts other processes play, in C and in Python."""
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import unittest

import numpy as np

import runs
from link_runs import (EMBEDDED, SECONDS, ended, free_port, ipc, near, python, serve, start_run,
                       wait_until_open)

sys.path.insert(0, "python")
import boresight  # noqa: E402
from boresight import link as client  # noqa: E402

SOURCES = [os.path.join("python", "examples", name)
           for name in ("own_detector.py", "own_controller.py")]


def tearDownModule():
    runs.clean()


def counters(folder):
    return boresight.read_run(folder).manifest["counters"]


class SameResults(unittest.TestCase):
    """A part that `boresight serve` plays does what it does inside."""

    def same(self, a, b):
        one, other = boresight.read_run(a), boresight.read_run(b)
        self.assertEqual(one.tables, other.tables)
        for name in one.tables:
            if name == "events":  # what a part says of itself stays with it
                continue
            x, y = one.table(name), other.table(name)
            self.assertEqual(list(x), list(y))
            for column in x:
                np.testing.assert_array_equal(x[column], y[column], f"{name}.{column}")

    def test_one_part_or_all_outside(self):
        scenario, inside = near(), runs.scratch() + "/inside"
        runs.run(scenario, inside, runs.NO_FRAMES, duration=SECONDS)
        self.assertGreater(len(boresight.read_run(inside).table("tracks")["track_id"]), 1)
        tcp = f"tcp://127.0.0.1:{free_port()}"
        for address, parts, memory in ((ipc(), "tracker", []),
                                       (ipc(), "imgproc", ["--shared-memory"]),
                                       (tcp, "imgproc,tracker,control", [])):
            out = runs.scratch() + "/outside"
            shared = ["--set", "/link/shared_memory=true"] if memory else []
            # peers may be there before the simulation
            peers = [serve(scenario, address, part, *memory) for part in parts.split(",")]
            ended(start_run(scenario, out, address, parts, *shared))
            for peer in peers:
                self.assertIn("complete", ended(peer))
            self.same(inside, out)
            count = counters(out)
            self.assertEqual(count["link_hello"], len(peers))
            self.assertFalse([name for name in count if name.startswith("link_") and name not in (
                "link_hello", "link_messages", "link_connected")], count)


class Replay(unittest.TestCase):
    """A recorded run without its peers."""

    def replayed(self, scenario, recorded, *more, frames=False, duration=6):
        again = runs.scratch() + "/again"
        words = runs.command(scenario, again, *([] if frames else [runs.NO_FRAMES]), duration=duration)
        result = subprocess.run(words + ["--replay", recorded, *more], capture_output=True,
                                text=True, timeout=60)
        return again, result

    def same(self, a, b):
        one, other = boresight.read_run(a), boresight.read_run(b)
        self.assertEqual(one.tables, other.tables)
        for name in one.tables:
            x, y = one.table(name), other.table(name)
            if name == "events":  # the link had peers to speak of, the run a clock
                x, y = ({c: t[c][~np.isin(t["kind"], ("link", "overrun"))] for c in t}
                        for t in (x, y))
            for column in x:
                np.testing.assert_array_equal(x[column], y[column], f"{name}.{column}")

    def test_three_parts_in_lockstep(self):
        address, out = f"tcp://127.0.0.1:{free_port()}", runs.scratch() + "/run"
        parts = "imgproc,tracker,control"
        peers = [serve(runs.TRACK, address, part) for part in parts.split(",")]
        # one is external already: --external leaves its keys
        ended(start_run(runs.TRACK, out, address, parts, "--set",
                        runs.SENSOR + '/modules/tracker={"type": "external", "max_items": 77}', duration=6))
        for peer in peers:
            ended(peer)
        with open(out + "/scenario.json", encoding="utf-8") as file:
            modules = json.load(file)["observers"][0]["sensors"][0]["modules"]
        self.assertEqual((modules["imgproc"]["max_items"], modules["tracker"]["max_items"]), (2048, 77))
        again, result = self.replayed(runs.TRACK, out, "--external", parts)
        self.assertEqual(result.returncode, 1)  # no address, which even a replay's scenario has
        again, result = self.replayed(out + "/scenario.json", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.same(out, again)
        self.assertFalse(os.path.exists(again + "/link.packets"))
        # what is not the recorded run is reported, not used
        _, result = self.replayed(out + "/scenario.json", out, duration=9)
        self.assertEqual(result.returncode, 1)
        self.assertIn("the recorded run was shorter", result.stderr)
        _, result = self.replayed(out + "/scenario.json", out, "--set",
                                  runs.SENSOR + "/modules/control/rate_hz=10")
        self.assertEqual(result.returncode, 1)
        self.assertIn("is replayed by the scenario, seed and options of its run", result.stderr)
        with open(out + "/link.packets", "r+b") as file:
            file.seek(1000)
            byte = file.read(1)
            file.seek(1000)
            file.write(bytes([byte[0] ^ 1]))
        _, result = self.replayed(out + "/scenario.json", out)
        self.assertEqual(result.returncode, 1)
        self.assertIn("link.packets", result.stderr)
        _, result = self.replayed(runs.TRACK, out)
        self.assertIn("no module of the scenario is of type", result.stderr)

    def test_a_run_that_waits_for_nobody(self):
        """Which answers came when, and which frames the clock dropped, is in the recording."""
        for policy, more in (("hold", ["/pacing/deadline_s=0.001", "/pacing/speed=20"]),
                             ("drop", ["/pacing/deadline_s=0.0001", "/pacing/speed=1000"])):
            address, out = ipc(), runs.scratch() + "/run"
            peer = serve(runs.TRACK, address, "control")
            words = [w for one in (f"/pacing/overrun={policy}", *more)
                     for w in ("--set", one)]
            ended(start_run(runs.TRACK, out, address, "control", "--pacing", "realtime", *words,
                            duration=6))
            ended(peer)
            if policy == "drop":  # 6 s of simulated time in 6 ms: no machine makes it
                self.assertGreater(boresight.read_run(out).manifest["pacing"]["dropped"], 0)
            again, result = self.replayed(out + "/scenario.json", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.same(out, again)


class Client(unittest.TestCase):
    """python/boresight/link against the document, and by itself."""

    def test_records_are_those_of_the_document(self):
        with open("docs/reference/icd.md", encoding="utf-8") as file:
            text = file.read()
        text = text[text.index("## Payloads"):text.index("## A message, byte by byte")]
        formats = {"float64": "<f8", "int64": "<i8", "int32": "<i4", "uint32": "<u4"}
        seen = set()
        for part in text.split("\n### ")[1:]:
            name = re.match(r"`(\w+)`", part).group(1)
            seen.add(name)
            pieces = re.split(r"\nItems, ", part)
            ours = [client.RECORDS[name]]
            ours += [client.ITEMS[name]] if len(pieces) > 1 else []
            for piece, dtype in zip(pieces, ours):
                rows = re.findall(r"^\| (\d+) \| (\w+)(?:\[(\d+)\])? \| `([^`]+)` \|", piece, re.M)
                self.assertEqual([row[3] for row in rows], list(dtype.names))
                self.assertEqual(int(re.search(r"(\d+) bytes", piece).group(1)), dtype.itemsize)
                for offset, kind, count, member in rows:
                    one, at = dtype.fields[member][:2]
                    self.assertEqual(at, int(offset))
                    expected = np.dtype("S" + count) if kind == "char" else np.dtype(
                        (formats[kind], (int(count),) if count else ()))
                    self.assertEqual(one, expected, f"{name}.{member}")
        self.assertEqual(seen, set(client.RECORDS))

    def test_the_worked_example_is_made_the_same(self):
        with open("docs/reference/icd.md", encoding="utf-8") as file:
            text = file.read()
        text = text[text.index("## A message, byte by byte"):]
        header, dump = re.findall(r"```text\n(.*?)\n```", text, re.S)
        payload = bytes.fromhex("".join(line[4:] for line in dump.splitlines()))
        record = client.new_record("los_command")
        record["tick"] = 12600
        record["direction_gcrf"] = 0.6, 0.0, 0.8
        record["rate_gcrf_radps"] = 0.0, 7.292115e-5, 0.0
        parts = client.encode("los_command", 5, record, tick=12000, step=40,
                                      instance="neossat/camera/control")
        self.assertEqual(parts[1], payload)
        # the same members; JSON leaves the rest free
        theirs, ours = json.loads(header), json.loads(parts[0])
        self.assertEqual({**theirs, "crc32c": ""}, {**ours, "crc32c": ""})
        message = client.decode([header.encode(), payload])
        self.assertEqual(message["direction_gcrf"][2], 0.8)

    def test_checksums(self):
        self.assertEqual(client.crc32c(b"123456789"), 0xE3069283)
        self.assertEqual(client.crc32c(bytes(32)), 0x8A9136AA)  # RFC 3720, B.4
        bits = np.random.default_rng(1).integers(0, 256, 70001).astype(np.uint8).tobytes()
        crc = 0xFFFFFFFF
        wanted = {0, 1, 2047, 2048, 2049, 4095, 5000, 70001}
        for n, byte in enumerate(bits, 1):
            crc ^= byte
            for _ in range(8):
                crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
            if n in wanted:
                self.assertEqual(client.crc32c(bits[:n]), crc ^ 0xFFFFFFFF, n)

    def test_a_spoilt_message_is_refused(self):
        record = client.new_record("done")
        parts = client.encode("done", 0, record)
        client.decode(parts)
        for index in range(2):
            for at in range(len(parts[index])):
                spoilt = [bytearray(part) for part in parts]
                spoilt[index][at] ^= 1
                with self.assertRaises(client.LinkError):
                    client.decode(spoilt)

    def test_run_folders(self):
        from astropy.io import fits
        out = runs.scratch() + "/run"
        runs.run(runs.STARE, out, duration=3)
        run = boresight.read_run(out)
        with fits.open(out + "/frames.fits") as file:
            theirs = [image for hdu in file if hdu.is_image and hdu.data is not None
                      for image in (hdu.data if hdu.data.ndim == 3 else [hdu.data])]
        ours = [frame.data for frame in run.frames]
        self.assertEqual(len(ours), len(theirs))
        for one, other in zip(ours, theirs):
            np.testing.assert_array_equal(one, other)
        self.assertEqual(len(run.table("frames")["exposure_id"]), len(ours))
        self.assertEqual(run.manifest["summary"]["frames"], len(ours))


class Examples(unittest.TestCase):
    def test_a_detector_of_ones_own(self):
        address, out = ipc(), runs.scratch() + "/run"
        peer = python(SOURCES[0], address)
        ended(start_run(runs.STARE, out, address, "imgproc", "--set", "/link/shared_memory=true",
                        duration=8))
        ended(peer)
        run = boresight.read_run(out)
        found, truth = run.table("detections"), run.table("truth")
        self.assertEqual(len(run.table("detection_frames")["exposure_id"]), 8)
        near = total = 0
        for exposure in range(8):
            here = found["exposure_id"] == exposure
            # bright, whole and not smeared out of the 3 x 3 pixels
            bright = ((truth["exposure_id"] == exposure) & (truth["in_field"] == 1) &
                      (truth["snr"] > 30) & (truth["saturated"] == 0) &
                      (np.hypot(truth["x_end_px"] - truth["x_start_px"],
                                truth["y_end_px"] - truth["y_start_px"]) < 3))
            for x, y in zip(truth["x_chief_px"][bright], truth["y_chief_px"][bright]):
                if not (3 < x < 1020 and 3 < y < 1020):
                    continue
                total += 1
                distance = np.hypot(found["x_px"][here] - x, found["y_px"][here] - y)
                near += distance.size > 0 and distance.min() < 1.0
        self.assertGreater(total, 20)
        self.assertGreater(near, 0.9 * total)  # the others have a neighbour as near as they are wide

    def test_a_controller_of_ones_own(self):
        inside, out, address = runs.scratch() + "/inside", runs.scratch() + "/run", ipc()
        runs.run(near(), inside, runs.NO_FRAMES, duration=SECONDS)
        truth = boresight.read_run(inside).table("truth")
        target = truth["kind"] == "object"
        t, ra, dec = (truth[name][target] for name in ("mid_s", "ra_deg", "dec_deg"))
        rate_ra, ra_0 = np.polyfit(t, ra, 1)
        rate_dec, dec_0 = np.polyfit(t, dec, 1)
        peer = python(SOURCES[1], address, "--ra", str(ra_0), "--dec", str(dec_0),
                      "--rate-ra", str(rate_ra), "--rate-dec", str(rate_dec))
        ended(start_run(runs.TRACK, out, address, "control", duration=20))
        self.assertIn("follows the target", ended(peer))
        summary = boresight.read_run(out).manifest["summary"]
        self.assertEqual(summary["final_mode"], "track")
        # telemetry drifts by 5 arcsec/s, 1.7 px a second that passes between frame and command
        self.assertLess(summary["pointing_rms_px"], 4.0)


class Driver(unittest.TestCase):
    """A peer that moves the line of sight, steers an object and sets the sensor, and gets frames."""
    RATE, UPDATE = 6000, 600  # ticks per second, and from step to step
    DIRECTION = np.array([0.36, 0.48, 0.8])

    @classmethod
    def attitude(cls, tick):
        """The boresight on DIRECTION at 1 s, turning about camera y by 0.001 rad/s: each attitude is
        on the shortest way between those around it."""
        z = cls.DIRECTION
        x = np.cross([0.0, 0.0, 1.0], z)
        x /= np.linalg.norm(x)
        angle = 0.001 * (tick / cls.RATE - 1.0)
        x, z = np.cos(angle) * x - np.sin(angle) * z, np.cos(angle) * z + np.sin(angle) * x
        rows = np.array([x, np.cross(z, x), z])
        w = np.sqrt(1.0 + np.trace(rows)) / 2.0
        return np.array([rows[2, 1] - rows[1, 2], rows[0, 2] - rows[2, 0], rows[1, 0] - rows[0, 1],
                         4.0 * w * w]) / (4.0 * w)

    def scenario(self):
        with open(runs.STARE, encoding="utf-8") as file:
            scenario = json.load(file)
        folder = os.path.abspath(os.path.dirname(runs.STARE))
        for orbit in (scenario["world"]["objects"][0]["orbit"], scenario["observers"][0]["orbit"]):
            orbit["elements_file"] = os.path.join(folder, orbit["elements_file"])
        del scenario["$schema"]
        scenario["world"]["objects"][0]["external_states"] = True
        scenario["world"]["objects"].append({
            "name": "shaped", "external_states": True, "brightness": {"model": "shape"},
            "orbit": scenario["world"]["objects"][0]["orbit"],
            "shape": {"materials": [{"name": "w", "diffuse": 0.5}],
                      "parts": [{"name": "p", "kind": "plate", "material": "w"}]}})
        sensor = scenario["observers"][0]["sensors"][0]
        sensor["modules"] = {"gimbal": {"type": "external"},
                             "scenegen": {"type": "opencl"}}
        sensor["modules"]["gimbal"]["send_truth"] = True
        scenario["record"] = {"frames": "extensions"}
        path = runs.scratch() + "/driver.json"
        with open(path, "w", encoding="utf-8") as file:
            json.dump(scenario, file)
        return path

    def drive(self, out, state, gap=False, duration=5):
        """Runs it; the frames that the peer got."""
        address, frames = ipc(), []
        words = runs.command(self.scenario(), out, duration=duration)
        run = subprocess.Popen(words + ["--link", address], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
        self.truths = []
        with client.Link(address, serves="gimbal") as link:
            for step in link.steps():
                self.truths += [int(m["exposure_id"]) for m in step.inputs if m.type == "truth"]
                frames += [(m.record.copy(), m.pixels.copy()) for m in step.inputs
                           if m.type == "frame"]
                ticks = [step.tick, step.tick + self.UPDATE]
                if not (gap and step.tick >= 4 * self.RATE):
                    step.send_pointing(ticks, [self.attitude(t) for t in ticks])
                if state and step.tick == self.RATE:
                    step.send_states([("INMARSAT GX5", step.tick, *state)])
                if step.tick == 2 * self.RATE:
                    step.send_sensor(exposure_s=0.2, window=(100, 200, 256, 128), binning=2,
                                     pixel_scale_arcsec=4.0)
        said = ended(run)
        return frames, boresight.read_run(out), said

    def test_pointing_frames_sensor_and_target(self):
        out = runs.scratch() + "/first"
        frames, run, _ = self.drive(out, None)
        # pointing: what was sent, at each of the plant's ticks
        los = run.table("los_truth")
        q = np.stack([los["q_cam_from_gcrf_" + c] for c in "xyzw"], axis=1)
        expected = np.array([self.attitude(t) for t in los["tick"]])
        self.assertGreaterEqual(len(q), 5)  # at mid-exposures
        # quaternions of the same rotation; 1e-9 rad is a thousandth of a microradian
        self.assertLess(np.max(1.0 - np.abs(np.sum(q * expected, axis=1))), 1e-12)
        # frames: those of the record, the last one ended too late for the peer
        recorded = [frame.data for frame in run.frames]
        self.assertEqual(len(recorded), 5)
        self.assertEqual(len(frames), 5)
        for (record, pixels), other in zip(frames, recorded):
            np.testing.assert_array_equal(pixels, other)
        # the sensor, from the exposure at 3 s on: the one at 2 s had opened
        self.assertEqual(self.truths, list(range(5)))
        stated = run.table("frames")
        self.assertEqual([p.shape for _, p in frames], 3 * [(1024, 1024)] + 2 * [(64, 128)])
        np.testing.assert_allclose(stated["exposure_s"], [0.5] * 3 + [0.2] * 2)
        np.testing.assert_allclose(run.table("exposures")["pixel_scale_arcsec"], [3] * 3 + [4] * 2)
        self.assertEqual(frames[3][0]["window.x0"], 100)
        # the target: 1000 km from the observer on the boresight at 1.25 s, at rest against it
        exposures = run.table("exposures")
        position = np.array([exposures[f"observer_gcrf_{c}_m"][1] for c in "xyz"])
        velocity = np.array([exposures[f"observer_gcrf_{c}_mps"][1] for c in "xyz"])
        state = (position + 1e6 * self.DIRECTION - 0.25 * velocity, velocity)
        _, run, _ = self.drive(runs.scratch() + "/second", state, duration=2)
        truth = run.table("truth")
        there = (truth["kind"] == "object") & (truth["exposure_id"] == 1)
        self.assertEqual(np.sum(there), 1)
        # its own motion and the Earth's in 3.3 ms of light time are 25 and 100 m
        self.assertAlmostEqual(truth["range_m"][there][0], 1e6, delta=200.0)
        ra, dec = (np.radians(truth[n][there][0]) for n in ("ra_deg", "dec_deg"))
        seen = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
        self.assertLess(np.linalg.norm(seen - self.DIRECTION), 1.5e-4)
        # on the image: 0.00025 rad from the boresight, 17 px along x; aberration is up to 9 px
        self.assertLess(abs(truth["y_mid_px"][there][0] - 511.5), 10.0)
        self.assertLess(abs(abs(truth["x_mid_px"][there][0] - 511.5) - 17.2), 10.0)
        self.assertFalse(np.any(truth["range_m"][truth["exposure_id"] == 0] < 2e6))

    def test_what_is_refused_and_what_is_missing(self):
        state = (np.array([7e6, 0, 0]), np.array([0, 7.5e3, 0]))
        address, out = ipc(), runs.scratch() + "/run"
        words = runs.command(self.scenario(), out, duration=1)
        run = subprocess.Popen(words + ["--link", address], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
        with client.Link(address, serves="gimbal") as link:
            for step in link.steps():
                if step.tick == 0:
                    step.send_pointing([0, 600], [self.attitude(0), self.attitude(600)])
                elif step.tick == 1200:
                    step.send_states([("nobody", 1200, *state), ("INMARSAT GX5", 1000, *state),
                                      ("INMARSAT GX5", 1300, *state),
                                      ("INMARSAT GX5", 1300, *state)])
                    turn = ([0, 0, 0, 1], [0, 0, 0.1])
                    step.send_attitudes([("nobody", 1200, *turn), ("shaped", 1000, *turn),
                                         ("INMARSAT GX5", 1300, *turn), ("shaped", 1300, *turn),
                                         ("shaped", 1300, *turn)])
        ended(run)
        count = counters(out)
        self.assertEqual(count["target_state_refused"], 7)
        self.assertEqual(count["pointing_held"], 1)
        events = "\n".join(boresight.read_run(out).table("events")["text"])
        for text in ('no object "nobody"', "before the step", "in the order of time",
                     'no object "INMARSAT GX5" with a shape', "an attitude at",
                     "target_attitudes, item 1: its tick",
                     "the line of sight stays"):
            self.assertIn(text, events)


    def test_beside_a_controller(self):
        """Control's commands come to the peer, and the sensor is control's."""
        address, out, commands = ipc(), runs.scratch() + "/run", 0
        run = start_run(runs.TRACK, out, address, "gimbal", "--set",
                        runs.SENSOR + "/observation_source=generator", duration=2)
        with client.Link(address, serves="gimbal") as link:
            for step in link.steps():
                command = step.get("los_command")
                if command is not None:
                    commands += 1
                    self.assertAlmostEqual(np.linalg.norm(command["direction_gcrf"]), 1.0)
                step.send_pointing([step.tick], [self.attitude(step.tick)])
                step.send_sensor(exposure_s=0.1)
        ended(run)
        self.assertGreater(commands, 10)
        self.assertEqual(counters(out)["sensor_command_ignored"], 20)
        commanded = boresight.read_run(out).table("sensor_commands")["exposure_s"]
        self.assertFalse(np.any(commanded == 0.1))


class BadPeers(unittest.TestCase):
    def test_nobody_comes(self):
        out = runs.scratch() + "/run"
        began = time.monotonic()
        said = ended(start_run(runs.STARE, out, ipc(), "imgproc", "--set",
                               "/link/connect_timeout_s=0.3"), expected=1)
        self.assertIn("no peer plays neossat/telescope/imgproc", said)
        self.assertLess(time.monotonic() - began, 60)  # a hang, not a slow machine
        self.assertFalse(os.path.exists(out))
        self.assertTrue(os.path.exists(out + ".partial/manifest.json"))

    def test_interrupted_while_waiting(self):
        # control steps first: no kernel is being built, which a signal would disturb
        process = start_run(runs.TRACK, runs.scratch() + "/run", ipc(), "control")
        wait_until_open(process)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        ended(process, expected=130)

    def test_what_is_at_the_path_of_a_socket(self):
        """A file there stays, a live socket is not stolen, and none is left behind."""
        folder = runs.scratch()
        path = os.path.join(folder, "thesis.tex")
        with open(path, "w", encoding="ascii") as file:
            file.write("mine")
        for words in (["--link", "ipc://" + path], ["--set", "/link/address=ipc://" + path]):
            result = subprocess.run(
                runs.command(runs.STARE, runs.scratch() + "/run", duration=1) +
                ["--external", "imgproc", *words], capture_output=True, text=True, timeout=60)
            self.assertEqual(result.returncode, 1)
            self.assertIn("a file that is no socket is there, and is left alone", result.stderr)
            with open(path, encoding="ascii") as file:
                self.assertEqual(file.read(), "mine")
        address = f"ipc://{folder}/socket"
        first = start_run(runs.TRACK, runs.scratch() + "/run", address, "control")
        wait_until_open(first)
        said = ended(start_run(runs.TRACK, runs.scratch() + "/run", address, "control"), expected=1)
        self.assertIn("another program listens there; choose another path", said)
        first.send_signal(signal.SIGINT)
        ended(first, expected=130)
        self.assertEqual(os.listdir(folder), ["thesis.tex"])

    def test_a_message_of_endless_parts(self):
        """Each part is within the bound, the message has no end: the run does not keep it."""
        port = free_port()
        out = runs.scratch() + "/run"
        run = start_run(runs.TRACK, out, f"tcp://127.0.0.1:{port}", "control", "--set",
                        "/link/connect_timeout_s=20")
        wait_until_open(run)
        # ZMTP 3.0 (RFC 23): greeting, READY, then parts of 1 MiB that all say that more come
        name, kind = b"Socket-Type", b"DEALER"
        ready = (b"\x05READY" + bytes([len(name)]) + name + len(kind).to_bytes(4, "big") + kind)
        with socket.create_connection(("127.0.0.1", port)) as peer:
            peer.sendall(b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(16 + 32))
            peer.sendall(bytes([4, len(ready)]) + ready)
            peer.settimeout(10)
            part, sent = b"\x03" + (1 << 20).to_bytes(8, "big") + bytes(1 << 20), 0
            try:
                while sent < 600:
                    peer.sendall(part)
                    sent += 1
            except OSError:
                pass
        self.assertLess(sent, 400)
        peer = serve(runs.TRACK, f"tcp://127.0.0.1:{port}", "control")
        self.assertIsNone(run.poll(), run.poll() is not None and run.communicate())
        with open(f"/proc/{run.pid}/status", encoding="ascii") as file:
            peak = int(re.search(r"VmHWM:\s+(\d+) kB", file.read()).group(1))
        ended(run)
        ended(peer)
        self.assertLess(peak, 600 << 10)  # the run itself takes about 200 MiB
        self.assertEqual(counters(out)["link_oversized"], 1)

    def test_a_recording_that_is_a_pipe(self):
        folder = runs.scratch()
        os.mkfifo(folder + "/link.packets")
        result = subprocess.run(
            runs.command(runs.STARE, folder + "/run", duration=1) +
            ["--external", "imgproc", "--link", ipc(), "--replay", folder],
            capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 1)
        self.assertIn("link.packets: is a pipe; give a run's", result.stderr)

    def test_what_is_called_wrongly(self):
        for words, says in (
                (["--link", "tcp://0.0.0.0:5555", "--external", "imgproc"],
                 "ssh -L 5555:127.0.0.1:5555"),
                (["--external", "imgproc"], "/link/address"),
                (["--external", "scenegen"], "imgproc, tracker, control, gimbal"),
                (["--external", "imgproc", "--link", "http://127.0.0.1"], "is no address")):
            out = runs.scratch() + "/run"
            result = subprocess.run(runs.command(runs.STARE, out, duration=1) + words,
                                    capture_output=True, text=True, timeout=60)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn(says, result.stderr)
            self.assertFalse(os.path.exists(out + ".partial"))
        result = subprocess.run([runs.BORESIGHT, "serve", runs.STARE, "--link", ipc(), "--part",
                                 "gimbal", *EMBEDDED], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 1)
        self.assertIn("imgproc, tracker, control", result.stderr)

    def test_a_peer_is_killed_and_another_goes_on(self):
        """The detector keeps nothing between frames: any of its processes gives the same answer."""
        whole, broken = runs.scratch() + "/whole", runs.scratch() + "/broken"
        for out in (whole, broken):
            address = ipc()
            peer = python(SOURCES[0], address)
            run = start_run(runs.STARE, out, address, "imgproc", "--set", "/link/timeout_s=30",
                            duration=4)
            if out == broken:
                peer.stdout.readline()
                peer.kill()
                peer.communicate()
                peer = python(SOURCES[0], address)
            ended(run)
            ended(peer)
        a, b = (boresight.read_run(folder).table("detections") for folder in (whole, broken))
        for column in a:
            np.testing.assert_array_equal(a[column], b[column], column)

    def test_the_run_goes_on_without_a_peer_that_has_died(self):
        address, out = ipc(), runs.scratch() + "/run"
        peer = python(SOURCES[0], address)
        run = start_run(runs.STARE, out, address, "imgproc", "--set", "/link/on_timeout=go_on",
                        "--set", "/link/timeout_s=3", duration=20)
        for _ in range(2):  # the second step is begun when the first is answered
            peer.stdout.readline()
        peer.kill()
        peer.communicate()
        said = ended(run, timeout=240)
        self.assertIn("of neossat/telescope/imgproc is not answered: no peer plays it", said)
        found = boresight.read_run(out).table("detection_frames")
        self.assertGreater(len(found["exposure_id"]), 0)
        self.assertLess(len(found["exposure_id"]), 20)
        self.assertGreaterEqual(counters(out)["link_unanswered"], 1)

    def test_a_refused_answer_raises_in_python(self):
        address = ipc()
        run = start_run(runs.STARE, runs.scratch() + "/run", address, "imgproc", "--set",
                        "/link/timeout_s=2", duration=3)
        with self.assertRaisesRegex(client.LinkError, "bad_value.*x_px of item 0"):
            with client.Link(address, serves="imgproc") as link:
                for step in link.steps():
                    step.send_detections(x_px=np.nan, y_px=5.0)
        self.assertIn("its peer has left", ended(run, expected=1))


if __name__ == "__main__":
    unittest.main()
