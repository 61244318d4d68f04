#!/usr/bin/env python3
"""`boresight view` over its network interface: data equal to the files of the run, and what it refuses.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view.py BORESIGHT
"""
import fcntl
import glob
import hashlib
import json
import os
import re
import shutil
import signal
import socket
import sqlite3
import subprocess
import time
import unittest
import urllib.error
import urllib.request

import numpy
from astropy.io import fits

import runs

HOSTILE = "<script>alert(1)</script>\"'&\n\u202egnp"
TARGET = "/world/objects/0"
PATIENCE_S = 300  # more than the viewer waits for a command of its own on a busy machine


def digests(folder):
    """Names of the files of a folder and their content."""
    found = {}
    for name in os.listdir(folder):
        with open(os.path.join(folder, name), "rb") as file:
            found[name] = hashlib.sha256(file.read()).hexdigest()
    return found


class Viewer:
    """A running `boresight view`."""
    running = []  # to be ended where a test failed

    def __init__(self, folder, *words, command=None, cwd=None):
        """Of a folder or a scenario; `command`: all words of the command instead."""
        words = command or ["view", *([folder] if folder else []), "--no-browser", *words]
        self.process = subprocess.Popen([runs.BORESIGHT, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        cwd=cwd)
        self.running.append(self.process)
        self.url = self.process.stdout.readline().strip()
        match = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([0-9a-f]{32})/", self.url)
        if not match:
            raise AssertionError((self.url, self.process.communicate()[1]))
        self.rest = "" if command else self.process.stdout.readline()
        self.port, self.token = int(match.group(1)), match.group(2)

    def end(self):
        """Ends it by Ctrl-C: exit status, what it printed."""
        self.process.send_signal(signal.SIGINT)
        output, errors = self.process.communicate(timeout=30)
        return self.process.returncode, self.rest + output, errors

    def get(self, route):
        with urllib.request.urlopen(self.url + route, timeout=PATIENCE_S) as answer:
            return answer.read(), answer.headers

    def json(self, route):
        return json.loads(self.get(route)[0])

    def numbers(self, route):
        return numpy.frombuffer(self.get(route)[0], "<f8")

    def connect(self, receive_bytes=None):
        peer = socket.socket()
        if receive_bytes:
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        peer.settimeout(30)
        peer.connect(("127.0.0.1", self.port))
        return peer

    def raw(self, text):
        """Status of the answer to bytes; 0: the connection was closed without one."""
        with self.connect() as peer:
            answer = b""
            try:
                peer.sendall(text if isinstance(text, bytes) else text.encode("latin-1"))
                while b"\r\n\r\n" not in answer:
                    more = peer.recv(65536)
                    if not more:
                        break
                    answer += more
            except ConnectionError:
                pass
        match = re.match(rb"HTTP/1\.1 (\d{3}) ", answer)
        return int(match.group(1)) if match else 0

    def status(self, path="/{token}/api/run", method="GET", host="127.0.0.1:{port}", more=""):
        words = {"token": self.token, "port": self.port}
        lines = [f"{method} {path.format(**words)} HTTP/1.1"] + ([f"Host: {host.format(**words)}"] if host else [])
        return self.raw("\r\n".join(lines) + "\r\n" + more.format(**words) + "Connection: close\r\n\r\n")


def open_connections(viewer, ports):
    """Those of the peers' ports whose connections the server has not closed."""
    with open(f"/proc/{viewer.process.pid}/net/tcp", encoding="ascii") as file:
        rows = [line.split()[1:4] for line in file][1:]
    return [far for near, far, state in rows if state == "01" and near.endswith(f":{viewer.port:04X}")
            and int(far[-4:], 16) in ports]


class Checks(unittest.TestCase):
    """Comparisons with the files of a run."""

    def check_pixels(self, viewer, images):
        rows = viewer.numbers("api/frames?sensor=0").reshape(-1, 5)
        self.assertEqual(len(rows), len(images))
        for k, image in enumerate(images):
            self.assertEqual((rows[k][0], rows[k][3]), (k, k))
            data, headers = viewer.get(f"api/pixels?sensor=0&frame={k}")
            shape = int(headers["X-Frame-Height"]), int(headers["X-Frame-Width"])
            self.assertEqual(shape, image.shape)
            self.assertTrue(numpy.array_equal(numpy.frombuffer(data, "<u2").reshape(shape), image))
        return rows

    def check_marks(self, viewer, folder, frame):
        """Marks of a frame are the rows of its exposure, in its own pixels: a binned pixel is the mean of its pixels'
        places, and a length is shorter by the binning, an area by its square."""
        found = viewer.json(f"api/frame?sensor=0&frame={frame}")
        columns = {"truth": "kind, id, norad, v_mag, snr, x_centroid_px, y_centroid_px",
                   "detections": "label, star_id, flux_e, snr, angle_deg, v_mag, x_px, y_px, length_px, cov_xx_px2, cov_xy_px2,"
                                 " cov_yy_px2",
                   "tracks": "exposure_id, track_id, status, target_of_interest, snr, ra_deg, dec_deg, misses_in_row, v_mag,"
                             " x_px, y_px"}
        keys = {"truth": "kind id norad v_mag snr x y", "tracks": "now id status target snr ra_deg dec_deg misses v_mag x y",
                "detections": "label star_id flux_e snr angle_deg v_mag x y length xx xy yy"}
        with sqlite3.connect(os.path.join(folder, "run.sqlite")) as tables:
            x0, y0, binning = tables.execute("SELECT x0_px, y0_px, binning FROM frames WHERE exposure_id = ?",
                                             (frame,)).fetchone()
            for name, listed in columns.items():
                # the tracks of the 40 exposures before are the trail, behind those of the frame
                which = "BETWEEN max(0, ?1 - 40) AND ?1 ORDER BY exposure_id < ?1" if name == "tracks" else \
                    "= ?1 AND in_field = 1" if name == "truth" else "= ?1"
                rows = tables.execute(f"SELECT {listed} FROM {name} WHERE exposure_id {which}, rowid"
                                      if name == "tracks" else
                                      f"SELECT {listed} FROM {name} WHERE exposure_id {which}", (frame,)).fetchall()
                names = keys[name].split()
                self.assertEqual(len(found[name]), len(rows), name)
                for mark, row in zip(found[name], rows):
                    expected = dict(zip(names, row))
                    expected["x"] = (expected["x"] - x0 - (binning - 1) / 2) / binning
                    expected["y"] = (expected["y"] - y0 - (binning - 1) / 2) / binning
                    for key, power in (("length", 1), ("xx", 2), ("xy", 2), ("yy", 2)):
                        if expected.get(key) is not None:
                            expected[key] /= binning**power
                    if name == "tracks":
                        expected["now"] = expected["now"] == frame
                        expected["target"] = expected["target"] == 1
                    for key in names:
                        if isinstance(expected[key], float):
                            # differences of numbers below 1e4 in double precision, printed with 15 digits or more
                            numpy.testing.assert_allclose(mark[key], expected[key], rtol=1e-12, atol=1e-9, err_msg=f"{name} {key}")
                        else:
                            self.assertEqual(mark[key], expected[key], (name, key))
        self.assertGreater(len(found["detections"]), 0)


    def check_slow_uploads(self, viewer, seconds, whole=False):
        """`whole`: until their time is over."""
        begin, slow = time.monotonic(), []
        head = (f"POST /{viewer.token}/api/editor/{{}} HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\n"
                "Content-Length: {}\r\n\r\n")
        for k in range(30):
            peer = viewer.connect()
            peer.sendall(head.format(*(("file?name=a.tle", 30 << 20) if k % 3 else ("check", 1000 + k))).encode() + b"{")
            slow.append(peer)

        def trickle():
            for peer in slow:
                try:
                    peer.sendall(b" ")
                except OSError:
                    pass
        while time.monotonic() < begin + seconds:  # most are refused at once
            trickle()
            self.assertEqual(viewer.status("/{token}/api/pixels?frame=0"), 200)
            time.sleep(0.3)
        ports = [peer.getsockname()[1] for peer in slow]
        self.assertLessEqual(len(open_connections(viewer, ports)), 10)
        while whole and open_connections(viewer, ports):
            trickle()
            self.assertLess(time.monotonic(), begin + 60)
            time.sleep(0.3)
        statuses = set()
        for peer in slow:
            peer.settimeout(0.01)
            try:
                statuses.add(peer.recv(12)[9:])
            except (ConnectionError, TimeoutError):
                pass
            peer.close()
        self.assertLessEqual(statuses, {b"", b"503"} | ({b"408"} if whole else set()))
        end = time.monotonic() + 10
        while viewer.raw(head.format("satellites", 16) + '{"find":"44801"}') != 200:
            self.assertLess(time.monotonic(), end)


# the rows that exposure 20 has are said to be those of one of another sensor, behind it
MOVED = """
    UPDATE exposures SET rowid = -2 * rowid;
    UPDATE exposures SET rowid = -rowid;
    CREATE TEMP TABLE another AS SELECT * FROM exposures WHERE exposure_id = 20;
    UPDATE another SET sensor = 9;
    INSERT INTO exposures SELECT * FROM another;
    UPDATE exposures SET rowid = (SELECT rowid + 1 FROM exposures WHERE sensor = 0 AND exposure_id = 20) WHERE sensor = 9;
    UPDATE exposures SET sources = 0 WHERE sensor = 0 AND exposure_id = 20;
"""


class View(Checks):
    @classmethod
    def setUpClass(cls):
        folder = runs.scratch()
        cls.made = os.path.join(folder, "<b>run")
        runs.run(runs.STARE, cls.made, f"{TARGET}/name={json.dumps(HOSTILE)}", f"{runs.SENSOR}/cue/object={json.dumps(HOSTILE)}",
                 "/record/frames=extensions", "/record/compression=rice", duration=3)
        cls.before = digests(cls.made)
        cls.viewer = Viewer(cls.made)

    @classmethod
    def tearDownClass(cls):
        code, output, errors = cls.viewer.end()
        assert (code, errors) == (0, ""), (code, errors)
        assert output == "Ctrl-C ends it.\n", output
        assert digests(cls.made) == cls.before

    def test_pixels_of_extensions(self):
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            rows = self.check_pixels(self.viewer, [hdu.data for hdu in file[1:]])
            frame = self.viewer.json("api/frame?sensor=0&frame=2")
            header = file[3].header
            self.assertEqual(frame["wcs"]["crval_deg"], [header["CRVAL1"], header["CRVAL2"]])
            self.assertEqual(frame["wcs"]["cd_deg"], [header[key] for key in ("CD1_1", "CD1_2", "CD2_1", "CD2_2")])
            self.assertEqual(frame["gain_e_per_dn"], header["GAIN"])
            self.assertEqual(frame["utc"], header["DATE-AVG"][:23] + "Z")
            self.assertEqual(rows[2][2], header["EXPTIME"])
        cut = os.path.join(runs.scratch(), "cut")  # as after a kill: within the last frame
        shutil.copytree(self.made, cut)
        with open(os.path.join(cut, "frames.fits"), "r+b") as file:
            file.truncate(os.path.getsize(file.name) - 10000)
        viewer = Viewer(cut)
        found = viewer.json("api/frame?sensor=0&frame=1")["wcs"]
        self.assertTrue(found.pop("without_distortion"))
        from_header = self.viewer.json("api/frame?sensor=0&frame=1")["wcs"]  # this camera has no distortion
        self.assertEqual((from_header["A"], from_header["B"]), ([], []))
        for key in ("crpix", "crval_deg", "cd_deg"):  # a header has 15 digits
            numpy.testing.assert_allclose(found[key], from_header[key], rtol=1e-13, atol=1e-18)
        self.assertEqual(len(viewer.get("api/pixels?sensor=0&frame=1")[0]), 2 * 1024 * 1024)
        self.assertEqual(viewer.end()[0], 0)
        for k in range(3):
            with self.assertRaises(urllib.error.HTTPError) as refused:
                self.viewer.get("api/pixels?sensor=0&frame=" + ("3", "-1", "x")[k])
            self.assertEqual(refused.exception.code, (404, 400, 400)[k])

    def test_parts_of_frames(self):
        """Any part has the pixels of the file; bins are means; what is not within the frame is refused."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            image = file[2].data

            def ask(query):
                data, headers = self.viewer.get("api/pixels?sensor=0&frame=1&" + query)
                self.assertEqual(headers["X-Frame-Size"], "1024 1024")
                return numpy.frombuffer(data, "<u2").reshape(int(headers["X-Frame-Height"]), int(headers["X-Frame-Width"])), headers
            for x, y, width, height in ((0, 0, 1024, 1), (37, 900, 64, 64), (1000, 1020, 500, 500), (5, 0, 1, 1024)):
                part, headers = ask(f"x={x}&y={y}&width={width}&height={height}")
                self.assertEqual((headers["X-Frame-Part"], headers["X-Frame-Binning"]), (f"{x} {y}", "1"))
                self.assertTrue(numpy.array_equal(part, image[y:y + height, x:x + width]), (x, y))
            sums = image.astype(int).reshape(256, 4, 256, 4).sum(axis=(1, 3))
            self.assertTrue(numpy.array_equal(ask("binning=4")[0], (sums + 8) // 16))
            self.assertTrue(numpy.array_equal(ask("longest=256")[0], (sums + 8) // 16))
            self.assertTrue(numpy.array_equal(ask("binning=4&x=512&y=256&width=64&height=400")[0], ((sums + 8) // 16)[64:164, 128:144]))
        for query in ("x=1024", "y=2000", "x=-1", "width=0", "binning=0", "binning=257", "longest=3", "x=1.5", "x=1&x=1", "height=99999999999999999999"):
            self.assertEqual(self.viewer.status("/{token}/api/pixels?frame=1&" + query), 400, query)

    def test_thumbnails(self):
        """Peaks of 13 x 13 pixels, the same when they are asked for again."""
        with fits.open(os.path.join(self.made, "frames.fits")) as file:
            for frame in (0, 2, 0):
                data, headers = self.viewer.get(f"api/thumbnail?sensor=0&frame={frame}")
                peaks = numpy.maximum.reduceat(numpy.maximum.reduceat(file[1 + frame].data, range(0, 1024, 13), 0), range(0, 1024, 13), 1)
                self.assertEqual((int(headers["X-Frame-Height"]), int(headers["X-Frame-Width"])), (79, 79))
                self.assertTrue(numpy.array_equal(numpy.frombuffer(data, "<u2").reshape(79, 79), peaks))
        for query, refused in (("frame=3", 404), ("frame=-1", 400), ("sensor=1", 404)):
            self.assertEqual(self.viewer.status("/{token}/api/thumbnail?" + query), refused, query)

    def test_marks(self):
        for frame in range(3):
            self.check_marks(self.viewer, self.made, frame)

    def test_marks_of_a_binned_window(self):
        """The same tables with a window off the corner, binned by 3, and with lengths and slanting errors."""
        made = os.path.join(runs.scratch(), "binned")
        shutil.copytree(self.made, made)
        with sqlite3.connect(made + "/run.sqlite") as tables:
            tables.execute("UPDATE frames SET x0_px = 37, y0_px = 182, binning = 3")
            tables.execute("UPDATE detections SET length_px = 7.5, angle_deg = 31.0, cov_xy_px2 = 0.4 * cov_yy_px2")
        viewer = Viewer(made)
        self.assertEqual(viewer.json("api/frame?sensor=0&frame=2")["binning"], 3)
        self.check_marks(viewer, made, 2)
        self.assertEqual(viewer.end()[0], 0)

    def test_corners_in_space(self):
        """Those of the sensor's outermost pixels, from the first row on, round the field."""
        sensor, = self.viewer.json("api/space/scene")["sensors"]
        half = numpy.tan(numpy.radians(512 * 3 / 3600))  # 512 px of 3 arcsec to either side
        corners = numpy.array(sensor["corners"])
        numpy.testing.assert_allclose(corners[:, :2] / corners[:, 2:], half * numpy.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]),
                                      rtol=1e-4)  # the scale in the middle of a tangent plane

    def test_plots_modes_events(self):
        described = self.viewer.json("api/run")
        panels = {panel["name"]: panel["lines"] for panel in described["sensors"][0]["panels"]}
        with sqlite3.connect(os.path.join(self.made, "run.sqlite")) as tables:
            counts = tables.execute("SELECT mid_s, detections, stars_identified FROM detection_frames").fetchall()
            modes = tables.execute("SELECT time_s, mode FROM control").fetchall()
            events = tables.execute("SELECT time_s, source, kind, text FROM events").fetchall()
        self.assertEqual(panels["detections"], ["all", "identified stars"])
        numbers = self.viewer.numbers("api/plot?sensor=0&panel=detections&from=0&to=10&columns=100")
        expected = [len(counts)] + [x for row in counts for x in (row[0], row[1], row[1])]
        expected += [len(counts)] + [x for row in counts for x in (row[0], row[2], row[2])]
        self.assertEqual(list(numbers), expected)
        changes = [row for k, row in enumerate(modes) if k == 0 or row[1] != modes[k - 1][1]]
        self.assertEqual([(one["time_s"], one["mode"]) for one in self.viewer.json("api/modes?sensor=0")["modes"]], changes)
        found = self.viewer.json("api/events")
        self.assertEqual([tuple(one[key] for key in ("time_s", "source", "kind", "text")) for one in found["events"]], events)
        self.assertEqual(found["total"], len(events))
        for query in ("panel=no", "panel=detections&from=1&to=1", "panel=detections&columns=0", "panel=detections&to=nan",
                      "panel=detections&columns=1e3", "panel=a;b", "panel=detections&sensor=99"):
            self.assertIn(self.viewer.status("/{token}/api/plot?" + query), (400, 404), query)

    def test_truth_where_exposures_say(self):
        """Plots of the truth are the same where the exposures say how many rows they have, and where that is wrong."""
        made, plots = os.path.join(runs.scratch(), "track"), []
        runs.run(runs.TRACK, made, runs.GENERATOR, duration=40)
        with open(made + "/run.sqlite", "rb") as file:
            recorded = file.read()
        for change in ("", "UPDATE exposures SET sources = sources + 1 WHERE exposure_id = 3", "UPDATE exposures SET sources = "
                       "sources + CASE exposure_id WHEN 3 THEN -1 WHEN 20 THEN 1 ELSE 0 END", MOVED, "ALTER TABLE exposures DROP COLUMN sources"):
            with open(made + "/run.sqlite", "wb") as file:
                file.write(recorded)
            with sqlite3.connect(made + "/run.sqlite") as tables:
                tables.executescript(change)
                snr = tables.execute("SELECT mid_s, snr FROM truth WHERE kind = 'object' AND in_field = 1 ORDER BY mid_s").fetchall()
            tables.close()
            viewer = Viewer(made)
            plots.append([viewer.numbers(f"api/plot?sensor=0&panel={name}&from=0&to=40&columns=4000") for name in ("pointing_error", "snr", "track_error")])
            self.assertEqual(viewer.end()[0], 0)
            numbers = plots[-1][1]
            self.assertGreater(len(snr), 20)
            self.assertEqual([tuple(one) for one in numbers[1:1 + 3 * int(numbers[0])].reshape(-1, 3)], [(time, value, value) for time, value in snr])
        for other in plots[1:]:
            self.assertEqual([one.tobytes() for one in other], [one.tobytes() for one in plots[0]])

    def test_a_line_without_column(self):
        """Lines of a table are read at once; one whose column is missing is empty, the others are not."""
        made = os.path.join(runs.scratch(), "columns")
        runs.run(runs.TRACK, made, runs.GENERATOR, duration=20)
        with sqlite3.connect(made + "/run.sqlite") as tables:
            tables.execute("ALTER TABLE detection_frames DROP COLUMN noise_e")
            level = tables.execute("SELECT mid_s, background_e FROM detection_frames ORDER BY mid_s").fetchall()
        tables.close()
        viewer = Viewer(made)
        numbers = viewer.numbers("api/plot?sensor=0&panel=background&from=0&to=20&columns=4000")
        self.assertEqual(viewer.end()[0], 0)
        self.assertEqual([int(numbers[0]), int(numbers[1 + 3 * len(level)])], [len(level), 0])
        self.assertEqual([tuple(one) for one in numbers[1:1 + 3 * len(level)].reshape(-1, 3)], [(time, value, value) for time, value in level])

    def test_hostile_names_are_text(self):
        described = self.viewer.json("api/run")
        self.assertEqual(described["name"], "<b>run")
        self.assertEqual(described["sensors"][0]["target"], HOSTILE)
        self.assertEqual(self.viewer.json("api/names")["names"]["0"], HOSTILE)
        page, headers = self.viewer.get("")
        self.assertNotIn(b"<b>run", page)
        policy = headers["Content-Security-Policy"]
        for words in ("default-src 'none'", "script-src 'self'", "frame-ancestors 'none'", "base-uri 'none'"):
            self.assertIn(words, policy)
        self.assertNotIn("unsafe", policy)
        self.assertEqual((headers["X-Content-Type-Options"], headers["Referrer-Policy"]), ("nosniff", "no-referrer"))
        # no file of the page makes markup or code of text, or names another server
        files = glob.glob("view/page/*")
        self.assertGreater(len(files), 8)
        for path in files:
            with open(path, "rb") as file:
                text = file.read()
            self.assertEqual(self.viewer.get(os.path.basename(path))[0], text)
            self.assertNotRegex(text, rb"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(|new Function|\son[a-z]+=|"
                                      rb"(?:src|href)=\"(?:https?:)?//")

    def test_refused(self):
        status = self.viewer.status
        self.assertEqual(status(), 200)
        self.assertEqual(status(host="localhost:1"), 200)  # ssh -L
        self.assertEqual(status(method="HEAD"), 200)
        self.assertEqual(status(more="Origin: http://127.0.0.1:{port}\r\n"), 200)
        for host in ("evil.example", "evil.example:{port}", "127.0.0.1.evil.example:{port}", "192.168.0.1:{port}"):
            self.assertEqual(status(host=host), 403, host)
        self.assertEqual(status(host=None), 400)
        self.assertEqual(status(more="Host: evil.example\r\n"), 400)
        for origin in ("http://evil.example", "null", "https://127.0.0.1:{port}", "http://127.0.0.1:1"):
            self.assertEqual(status(more=f"Origin: {origin}\r\n"), 403, origin)
        wrong = self.viewer.token[:-1] + ("0" if self.viewer.token[-1] != "0" else "1")
        for path in ("/", "/api/run", f"/{wrong}/api/run", f"/{wrong}/", "/{token}", "/../{token}/", "/index.html"):
            self.assertEqual(status(path), 403, path)
        for path in ("../../../../etc/passwd", "..%2f..%2fetc/passwd", "%2e%2e/run.sqlite", "run.sqlite", "frames.fits",
                     "api/../../x", "./api/run", "api/run/", "API/RUN", "api//run", "manifest.json"):
            self.assertEqual(status("/{token}/" + path), 404, path)
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "x"):
            self.assertIn(status(method=method), (0, 400, 405, 501) if method != "POST" else (403,), method)
        own = "Origin: http://127.0.0.1:{port}\r\n"
        for path in ("/{token}/api/run", "/{token}/", "/{token}/app.js"):
            self.assertEqual(status(path, method="POST", more=own + "Content-Length: 0\r\n"), 405, path)
        self.assertEqual(status(method="POST", more=own + "Content-Length: 99999999\r\n"), 413)
        self.assertEqual(status(more="Content-Length: 5\r\n"), 413)
        self.assertEqual(status(more="Transfer-Encoding: chunked\r\n"), 413)
        self.assertEqual(status("/{token}/ws", more="Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"), 404)

    def test_encoded_paths(self):
        """A path is taken as it is: nothing in it is decoded. Nested bodies deeper than a thread's stack are refused."""
        token, own = self.viewer.token, "Origin: http://127.0.0.1:{port}\r\n"
        for path, refused in ((f"/%{ord(token[0]):02x}{token[1:]}/api/run", 403), ("/{token}/api/run%00", 404), ("/{token}/api%2frun", 404),
                              ("/{token}/%61pi/run", 404), ("/{token}/..\\..\\etc", 404), ("/{token}/api/run#x", 404)):
            self.assertEqual(self.viewer.status(path), refused, path)
        for target in ("http://127.0.0.1:{port}/{token}/api/run", "http://evil.example/{token}/api/run", "*", "127.0.0.1:1"):
            self.assertIn(self.viewer.status(target), (0, 400, 403), target)
        body = '{"a":' * 990 + "1" + "}" * 990
        text = f"POST /{token}/api/open HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nContent-Length: {len(body)}\r\n\r\n{body}"
        self.assertIn(self.viewer.raw(text), (400, 404))
        self.assertEqual(self.viewer.status(more=own), 200)

    def test_malformed(self):
        line = f"GET /{self.viewer.token}/ HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        for text in (b"\x00" * 5000 + b"\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "\r\n\r\n", "GET / HTTP/1.1\r\nHost\r\n\r\n",
                     line + "X: " + "a" * 100000 + "\r\n\r\n", line + "".join(f"X{i}: a\r\n" for i in range(500)) + "\r\n",
                     "GET /" + "a" * 100000 + " HTTP/1.1\r\n\r\n", line + "Content-Length: -1\r\n\r\n",
                     line + "Content-Length: 99999999999999999999\r\n\r\n", bytes(range(256)) * 50 + b"\r\n\r\n"):
            self.assertIn(self.viewer.raw(text), (0, 400, 403, 405, 411, 413, 414, 431, 500, 505), text[-60:])
        self.assertEqual(self.viewer.status(), 200)

    def test_slow_uploads(self):
        """Bodies that come slowly have few places; data, and the editor's texts, go on meanwhile."""
        self.check_slow_uploads(self.viewer, 1.2)

    def test_slow_readers_and_many_connections(self):
        """Readers that take nothing, and 500 connections that send nothing, lose theirs; others are served."""
        slow, begin = [], time.monotonic()
        for _ in range(14):  # more than there are answers at a time
            peer = self.viewer.connect(receive_bytes=4096)
            # together more than the system buffers
            peer.sendall(20 * f"GET /{self.viewer.token}/api/pixels?frame=1 HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            slow.append(peer)
        self.assertEqual(self.viewer.status("/{token}/style.css"), 200)
        idle = [self.viewer.connect() for _ in range(500)]
        end = time.monotonic() + 60
        while self.viewer.status() != 200:  # busy while the slow readers have their time
            self.assertLess(time.monotonic(), end)
            time.sleep(0.1)
        while open_connections(self.viewer, [peer.getsockname()[1] for peer in slow]):
            self.assertLess(time.monotonic(), begin + 120)
            time.sleep(0.2)
        for peer in slow:  # cut off before the end
            received = 0
            try:
                while more := peer.recv(1 << 20):
                    received += len(more)
            except ConnectionError:
                pass
            self.assertLess(received, 40 << 20)
            peer.close()
        for peer in idle:
            peer.close()
        self.assertEqual(self.viewer.status(), 200)

    def test_run_that_ends(self):
        """Between the end of its lock and its final name a run is not one that was killed."""
        final = os.path.join(runs.scratch(), "ends")
        shutil.copytree(self.made, final + ".partial")
        with open(final + ".partial/lock", "w", encoding="ascii") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            viewer = Viewer(final + ".partial")
        self.assertEqual(viewer.json("api/refresh")["state"], "still running")
        frames, = glob.glob(final + ".partial/*.fits")
        os.rename(frames, frames + ".later")  # before the first exposure: no problem of the run
        self.assertEqual(viewer.json("api/refresh")["problems"], [])
        self.assertEqual(viewer.numbers("api/frames?sensor=0").size % 5, 0)
        os.rename(frames + ".later", frames)
        os.remove(final + ".partial/lock")
        os.rename(final + ".partial", final)
        self.assertEqual(viewer.json("api/refresh")["state"], "complete")
        self.assertEqual(viewer.end()[0], 0)

    def test_hostile_tables(self):
        """Repeated exposures do not multiply, and a crowded trail leaves the frame its tracks."""
        made = os.path.join(runs.scratch(), "hostile")
        shutil.copytree(self.made, made)
        with sqlite3.connect(made + "/run.sqlite") as tables:
            for _ in range(14):  # 3 * 2^14 rows each
                tables.execute("INSERT INTO exposures SELECT * FROM exposures")
                tables.execute("INSERT INTO truth SELECT * FROM truth WHERE kind = 'object'")
            tables.execute("UPDATE frames SET fits_index = -9223372036854775808 WHERE exposure_id = 1")
            tables.execute("CREATE TABLE kept AS SELECT * FROM tracks WHERE exposure_id = 2")
            tables.execute("UPDATE tracks SET exposure_id = 1")
            own = tables.execute("SELECT count(*) FROM kept").fetchone()[0]
            for _ in range(14):
                tables.execute("INSERT INTO tracks SELECT * FROM tracks")
            tables.execute("INSERT INTO tracks SELECT * FROM kept")
        begin = time.monotonic()
        viewer = Viewer(made)
        found = viewer.json("api/frame?sensor=0&frame=2")["tracks"]
        self.assertGreater(own, 0)
        self.assertEqual((sum(mark["now"] for mark in found), len(found)), (own, 5000))
        self.assertGreater(viewer.numbers("api/plot?sensor=0&panel=pointing_error&from=0&to=10&columns=100")[0], 0)
        self.assertLess(time.monotonic(), begin + 30)  # a join of all has 800 million rows
        self.assertEqual(viewer.end()[0], 0)

    def test_options_of_a_live_run(self):
        """They are refused where no scenario runs, not left unused."""
        for path in ([], [self.made]):
            for words in (["--out", "x"], ["--overwrite"], ["--device", "x"], ["--threads", "1"], ["--set", "/seed=1"]):
                result = subprocess.run([runs.BORESIGHT, "view", *path, "--no-browser", *words], capture_output=True, text=True, check=False, timeout=30)
                self.assertEqual(result.returncode, 2, words)
                self.assertIn(f"{words[0]} is for a live run", result.stderr)

    def test_port_in_use(self):
        result = runs.call("view", self.made, "--no-browser", "--port", str(self.viewer.port))
        self.assertEqual((result.returncode, result.stdout), (1, ""))
        self.assertIn(f"boresight: port {self.viewer.port} of 127.0.0.1 cannot be opened", result.stderr)

    def test_only_loopback(self):
        with open(f"/proc/{self.viewer.process.pid}/net/tcp", encoding="ascii") as file:
            listening = [line.split()[1] for line in file if line.split()[3] == "0A"]
        self.assertEqual([one for one in listening if one.endswith(f":{self.viewer.port:04X}")], [f"0100007F:{self.viewer.port:04X}"])


def end_all():
    """Ends the viewers that failed tests left, and removes the folders."""
    for process in Viewer.running:
        process.kill()
        process.communicate()
    runs.clean()


def tearDownModule():
    end_all()


if __name__ == "__main__":
    unittest.main()
