"""Numbers of the package's own code, part by part, against closed forms, astropy and sums by hand."""
import binascii
import pathlib
import sqlite3
import struct
import tempfile
import types
import unittest
import zlib

import numpy as np

from support import bst, main
from boresight import commands, fits, messages, payload, picture, record, tables
from boresight.camera import Camera
from boresight.gym import baselines, catalogue, geometry, pointing_group, tasking
from boresight.pool import Columns

RNG = np.random.default_rng(5)


def camera(width, height, scale_arcsec):
    return Camera(width, height, scale_arcsec, *[float("nan")] * 16, 33.0)


def attitude(rng=RNG):
    """A quaternion and its matrix, GCRF to camera (Shuster 1993, equation 194)."""
    x, y, z, w = q = (lambda v: v / np.linalg.norm(v))(rng.normal(size=4))
    return q, np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


class Pictures(unittest.TestCase):
    def test_levels_are_roots_between_quantiles(self):
        data = RNG.integers(0, 60000, (700, 1300)).astype(np.uint16)
        grey = picture.stretched(data)
        self.assertEqual(grey.shape, (233, 433))  # steps of 3: ceil(1300 / 512)
        small = np.array([[data[3 * j:3 * j + 3, 3 * i:3 * i + 3].max() for i in range(433)] for j in range(233)], float)
        low, high = np.sort(small.ravel())[[round(f * (small.size - 1)) for f in (0.05, 0.998)]]
        want = 255 * np.sqrt(np.clip((small - low) / (high - low), 0, 1))
        self.assertLess(np.abs(grey - want).max(), 1.5)  # whole levels; quantiles between two values

    def test_frames_thinner_than_a_step_have_pictures(self):
        for shape in ((1, 2000), (3, 2048), (1500, 2), (1, 1)):
            data = RNG.integers(0, 900, shape).astype(np.uint16)
            self.assertGreater(picture.stretched(data).size, 0)
            self.assertIn("<img", picture.html_image(data))

    def test_png_by_its_chunks(self):
        grey = RNG.integers(0, 256, (5, 7)).astype(np.uint8)
        data, at, chunks = picture.png(grey), 8, {}
        self.assertEqual(data[:8], bytes([137, 80, 78, 71, 13, 10, 26, 10]))
        while at < len(data):
            length, kind = struct.unpack(">I4s", data[at:at + 8])
            chunks[kind] = data[at + 8:at + 8 + length]
            self.assertEqual(struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0], binascii.crc32(kind + chunks[kind]))
            at += 12 + length
        self.assertEqual(struct.unpack(">IIBBBBB", chunks[b"IHDR"]), (7, 5, 8, 0, 0, 0, 0))
        rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(5, 8)
        np.testing.assert_array_equal(rows, np.column_stack([np.zeros(5, np.uint8), grey]))


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_images_as_astropy_writes_them(self):
        from astropy.io import fits as af
        first = RNG.integers(0, 65536, (31, 47)).astype(np.uint16)
        cube = RNG.integers(0, 65536, (3, 13, 17)).astype(np.uint16)
        # calm and wild rows: all codes of Rice, from one value to pixels as they are
        packed = (1000 + RNG.normal(size=(24, 75)) * 4.0**np.arange(24)[:, None] / 4e4).clip(0, 65535).astype(np.uint16)
        packed[3], packed[20:] = 777, RNG.integers(0, 65536, (4, 75))
        compressed = af.CompImageHDU(packed, compression_type="RICE_1", tile_size=(75, 1))
        af.HDUList([af.PrimaryHDU(first), af.ImageHDU(np.zeros((4, 4), np.float32)), af.ImageHDU(cube), compressed]).writeto(
            self.folder / "a.fits")
        places = fits.images(self.folder / "a.fits")
        self.assertEqual([(p.hdu, p.plane) for p in places], [(0, None), (2, 0), (2, 1), (2, 2), (3, None)])
        for place, want in zip(places, [first, *cube, packed]):
            np.testing.assert_array_equal(fits.read_image(self.folder / "a.fits", place), want)

    def test_tables_by_their_types(self):
        with sqlite3.connect(self.folder / "a.sqlite") as store:
            store.executescript("""CREATE TABLE t (n INTEGER, m INTEGER, x REAL, s TEXT);
                INSERT INTO t VALUES (3, NULL, 0.25, 'a'), (1, 7, NULL, NULL), (2, 8, -1.5, 'c');
                CREATE TABLE "columns" ("table" TEXT, "column" TEXT, unit TEXT, doc TEXT);
                INSERT INTO "columns" VALUES ('u', 'x', 'm', 'wrong'), ('t', 'x', 'km', 'way'), ('t', 'n', NULL, 'number');""")
        store.close()
        table = tables.Store(self.folder / "a.sqlite").table("t")
        self.assertEqual((table.rows, len(table), list(table)), (3, 4, ["n", "m", "x", "s"]))
        np.testing.assert_array_equal(table.n, [3, 1, 2])
        np.testing.assert_array_equal(table["m"], [np.nan, 7, 8])
        np.testing.assert_array_equal(table.x, [0.25, np.nan, -1.5])
        self.assertEqual((table["n"].dtype, table["m"].dtype, list(table["s"])), (np.int64, float, ["a", "", "c"]))
        self.assertEqual((table.units, table.docs), ({"x": "km", "n": ""}, {"x": "way", "n": "number"}))
        np.testing.assert_array_equal(table.where(table.n > 1)["x"], [0.25, -1.5])
        self.assertEqual(str(table.to_astropy()["x"].unit), "km")
        self.assertEqual(table.to_astropy()["x"].description, "way")


class Messages(unittest.TestCase):
    def test_rings_begin_with_the_oldest(self):
        for written in (0, 3, 5, 12):
            header = np.zeros((), messages.LosHistory.dtype)
            header["written"], header["capacity"] = written, 5
            slots = np.zeros(5, messages.LosHistory.item_dtype)
            for n in range(written):
                slots["tick"][n % 5] = 100 + n
            memory = np.frombuffer(header.tobytes() + slots.tobytes(), np.uint8).copy()
            got = payload.message_at("los_history", memory.ctypes.data, "eye/camera", 8, 3)
            self.assertEqual(list(got.items["tick"]), list(range(100 + max(0, written - 5), 100 + written)))
            self.assertEqual((got.scope, got.written_tick, got.sequence), ("eye/camera", 8, 3))

    def test_columns_of_array_members(self):
        samples = commands.pointing_samples([4, 9], [[1, 2, 3, 4], [5, 6, 7, 8]])
        columns = record.columns_of(samples)
        self.assertEqual({k: list(v) for k, v in columns.items()}, {
            "tick": [4, 9], **{f"q_cam_from_gcrf_{k}": [k + 1, k + 5] for k in range(4)}})

    def test_frames_have_places_and_times_of_their_own(self):
        about = messages.FrameMessage(exposure_id=9, start_tick=1500, end_tick=2100, binning=3, bits=14,
                                      window={"x0": 20, "y0": 44, "width": 60, "height": 30})
        frame = bst.Frame(np.zeros((10, 20), np.uint16), about, "eye/camera", 1000)
        self.assertEqual((frame.start_s, frame.end_s, frame.exposure_s), (1.5, 2.1, 0.6))
        # the first pixel covers columns 20 to 22 and rows 44 to 46, the last ones 77 to 79 and 71 to 73
        np.testing.assert_array_equal(np.array(frame.sensor_px([0, 19, -0.5], [0, 9, 1])), [[21, 78, 19.5], [45, 72, 48]])

    def test_attitudes_between_samples(self):
        axis, ticks = np.array([2, -1, 3]) / 14**0.5, [100, 160, 260]
        def turned(angle):
            return np.append(axis * np.sin(angle / 2), np.cos(angle / 2))
        rows = np.zeros(3, messages.PointingTelemetry.item_dtype)
        rows["tick"] = ticks
        rows["q_cam_from_gcrf"] = [turned(0.1), -turned(0.104), turned(0.11)]
        telemetry = messages.PointingTelemetry(rows)
        # linear in the angle but for its cube; the same up to the sign
        for tick, angle in ((0, 0.1), (100, 0.1), (115, 0.101), (160, 0.104), (235, 0.1085), (260, 0.11), (999, 0.11)):
            q = commands.attitude_at(telemetry, tick)
            self.assertAlmostEqual(abs(q @ turned(angle)), 1, delta=1e-13)
            self.assertLess(np.abs(np.abs(q) - np.abs(turned(angle))).max(), 1e-9)
        np.testing.assert_array_equal(commands.attitude_at(messages.PointingTelemetry(), 5), np.zeros(4))
        found = commands.complete_detections(
            messages.Detections({"x_px": [1, 2, 3], "cov_xx": [0, 0.5, 0], "cov_yy": [0, 0.25, 0.125]}),
            messages.FrameMessage(exposure_id=4, start_tick=100, end_tick=130), telemetry)
        self.assertEqual((found.exposure_id, found.start_tick, found.end_tick), (4, 100, 130))
        np.testing.assert_allclose(found.q_cam_from_gcrf, commands.attitude_at(telemetry, 115))
        np.testing.assert_array_equal(found.q_telemetry_from_gcrf, found.q_cam_from_gcrf)
        self.assertEqual((list(found.items["cov_xx"]), list(found.items["cov_yy"])), ([0.01, 0.5, 0], [0.01, 0.25, 0.125]))

    def test_commands_have_a_direction_of_length_one(self):
        sent = commands.los_command([3, -4, 12], [1e-4, 2e-4, 3e-4], (4e-6, 5e-6, 6e-6), tick=70)
        np.testing.assert_allclose(sent.direction_gcrf, np.array([3, -4, 12]) / 13)
        self.assertEqual((list(sent.rate_gcrf_radps), list(sent.accel_gcrf_radps2), sent.tick),
                         ([1e-4, 2e-4, 3e-4], [4e-6, 5e-6, 6e-6], 70))

    def test_pixels_in_radians(self):
        self.assertAlmostEqual(camera(10, 20, 7.0).pixel_scale_rad, 7 * np.pi / 648000, delta=1e-18)


class Directions(unittest.TestCase):
    def test_camera_axes_by_matrices(self):
        for _ in range(5):
            q, matrix = attitude()
            v = RNG.normal(size=(4, 3))
            np.testing.assert_allclose(geometry.gcrf_of_cam(q, v), v @ matrix, atol=1e-14)
            np.testing.assert_allclose(geometry.cam_of_gcrf(q, v[0]), matrix @ v[0], atol=1e-14)
            seen = matrix @ geometry.tilted(q, 0.02, -0.05)
            np.testing.assert_allclose([np.arctan2(seen[0], seen[2]), np.arctan2(seen[1], seen[2])], [0.02, -0.05], atol=1e-14)

    def test_a_cubic_is_interpolated_exactly(self):
        c = RNG.normal(size=(2, 3, 4))
        at = np.arange(12) * catalogue.STEP_S
        table = catalogue.Catalogue(["a", "b"], np.array([1, 2]), np.stack([np.moveaxis([
            np.polyval(c[k, i] * [1e-3, 1e-2, 1, 1e3], at) for i in range(3)], 0, 1) for k in range(2)]))
        for t in (0.0, 3.5, 27.0, 61.25, 99.9):
            want = [[np.polyval(c[k, i] * [1e-3, 1e-2, 1, 1e3], t) for i in range(3)] for k in range(2)]
            np.testing.assert_allclose(table.at(t), want, rtol=1e-10, atol=1e-8)

    def test_what_is_visible_by_walking_the_line(self):
        sun = np.array([1.0, 0.2, -0.1]) * 1.5e11
        seen = 0
        for _ in range(40):
            eye = (lambda v: v / np.linalg.norm(v) * 7.1e6)(RNG.normal(size=3))
            targets = np.array([v / np.linalg.norm(v) * RNG.choice([7.4e6, 4.2e7]) for v in RNG.normal(size=(20, 3))])
            got = catalogue.visible(eye, targets, sun, 40.0, 150.0)
            for target, flag in zip(targets, got):
                way = eye + np.linspace(0, 1, 4001)[:, None] * (target - eye)
                lowest = np.linalg.norm(way, axis=1).min()
                to = (target - eye) / np.linalg.norm(target - eye)
                off = np.degrees(np.arccos(np.clip(to @ sun / np.linalg.norm(sun), -1, 1)))
                shadow = target + np.linspace(0, 5e7, 4001)[:, None] * sun / np.linalg.norm(sun)
                dark = np.linalg.norm(shadow, axis=1).min()
                if abs(lowest - 6528137) < 2e3 or abs(dark - 6378137) < 1e4 or abs(off - 40) < 1e-6:
                    continue  # nearer than the steps of the walk
                self.assertEqual(bool(flag), bool(lowest > 6528137 and off > 40 and dark > 6378137))
                seen += flag
        self.assertGreater(seen, 50)

    def test_geostationary_sets_are_taken_evenly(self):
        with tempfile.TemporaryDirectory() as folder:
            file, text = pathlib.Path(folder) / "a.tle", ""
            for k in range(9):
                motion, e = (15.1, 100) if k == 4 else (1.0027, 200000 if k == 6 else 2000)
                text += f"OBJECT {k}\n1 {40000 + k}U\n2 {40000 + k}   0.1000 100.0000 {e:07d} 100.0000 100.0000 {motion:11.8f}    10\n"
            file.write_text(text, encoding="utf-8")
            found = catalogue.geostationary(file, 3)
            self.assertEqual([name for name, _, _ in found], ["OBJECT 0", "OBJECT 2", "OBJECT 5"])  # of 0 1 2 3 5 7 8
            self.assertTrue(all(a.startswith("1 ") and b.startswith("2 ") for _, a, b in found))
            with self.assertRaises(bst.ArgumentError):
                catalogue.geostationary(file, 8)


def columns(kind, rows, **members):
    """Columns of as many simulations as there are lists of items, some shorter than others."""
    most = max(len(r) for r in rows)
    headers, items = np.zeros(len(rows), kind.dtype), np.zeros((len(rows), most + 2), kind.item_dtype)
    for k, row in enumerate(rows):
        for j, item in enumerate(row):
            for name, value in item.items():
                items[name][k, j] = value
    for name, values in members.items():
        headers[name] = values
    return Columns(headers, items, np.array([len(r) for r in rows], np.int32), np.zeros(len(rows), np.int64))


class Environments(unittest.TestCase):
    def group(self, count):
        group = pointing_group.PointingGroup.__new__(pointing_group.PointingGroup)
        group.count, group.camera = count, camera(400, 300, 3.0)
        group.settings = pointing_group.PointingSettings(3, 20.0, 200.0, 10)
        return group

    def test_objects_come_first_and_the_brightest_of_them(self):
        star, thing, unknown = messages.Label.STAR, messages.Label.OBJECT, messages.Label.UNKNOWN
        found = columns(messages.Detections, [
            [{"x_px": 0, "y_px": 299, "snr": 500, "label": star}, {"x_px": 99.5, "y_px": 74.5, "snr": 10, "label": thing},
             {"x_px": 399, "y_px": 0, "snr": 100, "label": unknown}, {"x_px": 1, "y_px": 1, "snr": 7, "label": star}],
            [{"x_px": 249.5, "y_px": 224.5, "snr": 1e-9, "label": thing}], []])
        rows = self.group(3)._observed(found)
        want = np.zeros((3, 3, 5))
        want[0] = [[0.9975, -1 + 1 / 300, 2, 0.5, 1], [-0.5, -0.5, 1, 0, 1], [-0.9975, 1 - 1 / 300, np.log10(500), 1, 1]]
        want[1, 0] = [0.25, 0.5, -2, 0, 1]
        np.testing.assert_allclose(rows, want, atol=1e-6)  # float32

    def test_errors_are_those_of_the_object(self):
        kinds, flags = messages.SourceKind, messages.TruthFlag
        group = self.group(3)
        group._score(columns(messages.Truth, [
            [{"kind": kinds.STAR, "x_mid_px": 9, "y_mid_px": 9, "flags": flags.IN_FIELD},
             {"kind": kinds.OBJECT, "x_mid_px": 103, "y_mid_px": 54, "flags": flags.IN_FIELD}],
            [{"kind": kinds.OBJECT, "x_mid_px": 10, "y_mid_px": 20, "flags": flags.OCCULTED}],
            [{"kind": kinds.STAR, "x_mid_px": 9, "y_mid_px": 9, "flags": flags.IN_FIELD}]],
            boresight_x_px=[100, 10, 5], boresight_y_px=[50, 8, 5]))
        np.testing.assert_allclose(group.error_px, [5, 12, np.inf])
        np.testing.assert_array_equal(group.in_field, [True, False, False])

    def test_rewards_and_ends_of_a_step(self):
        group = self.group(4)
        group.model = types.SimpleNamespace(tick_rate_hz=1000, duration_s=20.0)
        group._found = columns(messages.Detections, [[{}]] * 4)._replace(ticks=np.array([3000, 19500, 3000, 3000]))
        group.rate, group._missed = np.zeros((4, 2)), np.array([0, 0, 9, 9])
        group.sims, group._command = [], lambda held, where: np.full(4, 1.0)
        group._pool = types.SimpleNamespace(hold=lambda sims: tempfile.TemporaryDirectory())
        group._advance = lambda held, number: np.array([1, 1, 1, 4])
        group.error_px, group.in_field = np.array([5.0, 15.0, np.inf, 1.0]), np.array([True, True, False, True])
        out = group.step(np.array([[0.5, -2.0], [0, 0], [1, 1], [1, 1]]), np.array([False, False, False, True]))
        np.testing.assert_allclose(out.reward, [0.5, 0.1, 0, 0])
        np.testing.assert_array_equal(out.truncated, [False, True, False, False])
        np.testing.assert_array_equal(out.terminated, [False, False, True, False])
        np.testing.assert_allclose(group.rate, [[0.5, -1], [0, 0], [1, 1], [0, 0]])
        np.testing.assert_array_equal(group._missed, [0, 0, 10, 0])

    def test_the_gain_of_tasks_is_their_age(self):
        kind, flags = messages.SourceKind, messages.TruthFlag
        score = tasking.Score(np.array([11, 22, 33, 44]), 300.0)
        def frame(*norads, snr=6.0, flag=flags.IN_FIELD, kinds=kind.OBJECT):
            score.take(messages.Truth({"kind": [int(kinds)] * len(norads), "norad": norads, "snr": [snr] * len(norads),
                                       "flags": [int(flag)] * len(norads)}))
        frame(11, 22, 99)
        frame(22)
        frame(22, snr=5.9)
        frame(33, flag=flags.IN_FIELD | flags.OCCULTED)
        frame(33, flag=0)
        frame(33)
        frame(44, kinds=kind.STAR)
        self.assertEqual(score.gain(20.0), 1.0)  # 22 in two frames, at an age of 320 s; the others in one at most
        np.testing.assert_array_equal(score.age_s, [320, 0, 320, 320])
        for _ in range(2):
            frame(22, 33)
        self.assertAlmostEqual(score.gain(30.0), 1.0 + 0.1, delta=1e-12)
        self.assertEqual(score.gain(30.0), 0.0)

    def test_greedy_policies_by_hand(self):
        env = types.SimpleNamespace(camera=camera(400, 300, 3.0), rate_step_px=20.0)
        act = baselines.greedy_policy(env, gain=0.3, damping=0.9)
        def seen(x, y):
            return {"detections": np.array([[0.9, 0.9, 3, 1, 1], [x, y, 2, 0.5, 1], [0.1, 0.1, 1, 0, 1], [0.96, 0, 4, 0, 1], [0, 0, 9, 0, 0]])}
        # 2 and -1 steps of 20 px from the middle, then nearer by 0.2 of them
        np.testing.assert_allclose(act(seen(0.2, -2 / 15)), [0.6, -0.3], rtol=1e-6)
        np.testing.assert_allclose(act(seen(0.18, -0.8 * 2 / 15)), [0.3 * 1.8 - 0.18, -0.24 + 0.18], rtol=1e-6)
        tasks = types.SimpleNamespace(count=4, decision_s=20.0, shared=types.SimpleNamespace(model=types.SimpleNamespace(duration_s=100.0)))
        choose = tasking.greedy_tasks(tasks, slew_weight=3.0, wait=2)
        rows = np.zeros((2, 4, 4))
        rows[0] = [[0.5, 1, 0, 1.0], [0.1, 1, 0, 0.6], [0.0, 0, 0, 2.0], [0.2, 1, 0, 0.7]]  # 0.4, 0.46, 0, 0.4375
        rows[1] = [[0.3, 1, 0, 1.0], [0.1, 1, 0, 0.6], [0.0, 0, 0, 2.0], [0.0, 1, 0, 0.2]]  # 0.53, taken, 0, 0.2
        np.testing.assert_array_equal(choose({"targets": rows, "time": np.array([0.1])}), [1, 0])
        rows[0, 1] = [0.001, 1, 1, 0.9]  # looked at and not detected: left out, the next best ones
        np.testing.assert_array_equal(choose({"targets": rows, "time": np.array([0.5])}), [3, 0])


class LinkNumbers(unittest.TestCase):
    def setUp(self):
        try:
            from boresight import link
        except ImportError:
            self.skipTest("pyzmq is not installed")
        self.link = link

    def test_checksums_bit_by_bit(self):
        data = RNG.integers(0, 256, 9001).astype(np.uint8).tobytes()
        register, want = 0xFFFFFFFF, {}
        for k, byte in enumerate(data):
            want[k] = register ^ 0xFFFFFFFF
            register ^= byte
            for _ in range(8):
                register = register >> 1 ^ (0x82F63B78 if register & 1 else 0)
        for length in (0, 1, 7, 2047, 2048, 2049, 4999, 8192, 9000):
            self.assertEqual(self.link.crc32c(data[:length]), want[length])
        self.assertEqual(self.link.crc32c(b"123456789"), 0xE3069283)  # RFC 3720

    def step(self):
        """A step of a part with a frame of exposure 7 in the middle of two samples, and what it answers."""
        from boresight.link import connection, step
        peer = types.SimpleNamespace(tick_rate_hz=500)
        peer._telemetry = {"eye/camera/imgproc": (np.array([1000, 1100]), np.array([[0, 0, 0, 1.0], [0, 0.6, 0, -0.8]]))}
        peer.attitude_at = lambda part, tick: connection.Link.attitude_at(peer, part, tick)
        part = step.Part("eye/camera/imgproc", "imgproc", None)
        frame = self.link.new_record("frame")
        frame["exposure_id"], frame["start_tick"], frame["end_tick"] = 7, 1020, 1080
        header = {"tick": 1250, "step": 3, "instance": "eye/camera/imgproc"}
        return self.link.Step(peer, part, header, [self.link.Message({"type": "frame"}, frame)])

    def test_answers_of_a_step(self):
        step = self.step()
        self.assertEqual((step.tick, step.seconds), (1250, 2.5))
        step.send_detections([1, 2], [30, 40], flux_e=[5, 6], cov_yy=0.5, label=2)
        head, items = step.sent["detections"]
        self.assertEqual([int(head[n]) for n in ("exposure_id", "start_tick", "end_tick")], [7, 1020, 1080])
        middle = np.array([0, -0.6, 0, 1.8]) / np.hypot(0.6, 1.8)
        np.testing.assert_allclose(head["q_cam_from_gcrf"], middle, atol=1e-14)
        np.testing.assert_allclose(head["q_telemetry_from_gcrf"], middle, atol=1e-14)
        for name, want in (("x_px", [1, 2]), ("y_px", [30, 40]), ("flux_e", [5, 6]), ("cov_xx", [0.01] * 2), ("cov_yy", [0.5] * 2), ("label", [2, 2])):
            np.testing.assert_array_equal(items[name], want)
        step.send_command([0, 3, -4], [1, 2, 3], tick=1300)
        sent = step.sent["los_command"][0]
        np.testing.assert_allclose(sent["direction_gcrf"], [0, 0.6, -0.8])
        self.assertEqual((int(sent["tick"]), list(sent["rate_gcrf_radps"])), (1300, [1, 2, 3]))
        step.send_status("track", target_id=12)
        sent = step.sent["control_status"][0]
        self.assertEqual((int(sent["tick"]), int(sent["mode"]), int(sent["target_id"])), (1250, self.link.MODES["track"], 12))
        step.send_sensor(0.2, 0.9, (3, 5, 70, 90), 2, 4.5)
        self.assertEqual([float(step.sent["sensor_command"][0][n]) for n in (
            "exposure_s", "period_s", "window.x0", "window.y0", "window.width", "window.height", "binning", "pixel_scale_arcsec")],
            [0.2, 0.9, 3, 5, 70, 90, 2, 4.5])
        step.send_states([("a", 5, (1, 2, 3), (4, 5, 6))])
        row = step.sent["target_states"][1][0]
        self.assertEqual((row["object"], row["tick"], list(row["position_gcrf_m"]), list(row["velocity_gcrf_mps"])), (b"a", 5, [1, 2, 3], [4, 5, 6]))
        step.send_attitudes([("b", 6, (1, 2, 3, 4), (5, 6, 7))])
        row = step.sent["target_attitudes"][1][0]
        self.assertEqual((row["object"], row["tick"], list(row["q_body_from_gcrf"]), list(row["rate_body_radps"])), (b"b", 6, [1, 2, 3, 4], [5, 6, 7]))

    def test_messages_come_back_as_they_were(self):
        record_, items = self.link.new_record("pointing"), self.link.new_items("pointing", 3)
        items["tick"], items["q_cam_from_gcrf"] = [1, 2, 3], RNG.normal(size=(3, 4))
        parts = self.link.encode("pointing", 41, record_, items, tick=9, step=2, instance="eye")
        back = self.link.decode(parts)
        self.assertEqual([back.header[n] for n in ("type", "sequence", "tick", "step", "instance")], ["pointing", 41, 9, 2, "eye"])
        np.testing.assert_array_equal(back.items, items)
        wrong = bytearray(parts[1])
        wrong[-1] ^= 1
        with self.assertRaises(self.link.LinkError):
            self.link.decode([parts[0], bytes(wrong)])

    def test_frames_in_shared_memory_by_their_slot(self):
        from boresight.link.shared_frames import SharedFrames
        with tempfile.NamedTemporaryFile(prefix="boresight-test-", dir="/dev/shm") as file:
            pixels = {n: RNG.integers(0, 65536, (3, 5)).astype("<u2") for n in (7, 8)}
            for n, image in pixels.items():
                file.seek(n % 3 * 8192)
                file.write(struct.pack("<qq", n, image.nbytes))
                file.seek(n % 3 * 8192 + 4096)
                file.write(image.tobytes())
            file.truncate(3 * 8192)
            file.flush()
            ring = SharedFrames("/" + pathlib.Path(file.name).name, 3, 8192)
            for n, image in pixels.items():
                np.testing.assert_array_equal(ring.pixels(n, 3, 5), image)
            with self.assertRaises(self.link.LinkError):
                ring.pixels(4, 3, 5)


if __name__ == "__main__":
    main()
