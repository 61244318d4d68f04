#!/usr/bin/env python3
"""Live runs of `boresight view SCENARIO.json` and `boresight run --view` over their WebSocket: steps, changes that are
recorded and repeat, rewinding, branches, spectators, and what is refused.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_view_live.py BORESIGHT [--full]
--full: with images, whose pixels equal the file's; takes some ten times as long.
"""
import json
import os
import resource
import sqlite3
import subprocess
import sys
import time
import unittest
import urllib.error
import urllib.request

import numpy

import chromium
import live_page
import runs
import test_view

FULL = "--full" in sys.argv[1:]
if FULL:
    sys.argv.remove("--full")
SETS = ["--set", "/world/star_catalogue=embedded"] + ([] if FULL else ["--set", runs.GENERATOR])
CONTROL = runs.SENSOR + "/modules/control"


def tables(folder):
    """Rows of all tables of a run."""
    with sqlite3.connect(f"file:{folder}/run.sqlite?mode=ro", uri=True) as database:
        names = [name for name, in database.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
        found = {name: database.execute(f'SELECT * FROM "{name}"').fetchall() for name in names}
    database.close()
    return found


class Tables(unittest.TestCase):
    def assert_equal(self, one, other, but=()):
        first, second = tables(one), tables(other)
        self.assertEqual(first.keys(), second.keys())
        for name, rows in first.items():
            if name not in but:
                self.assertEqual(rows, second[name], name)
        self.assertGreater(len(first["truth"]), 0)


class Live(Tables):
    def setUp(self):
        self.folder = runs.scratch()
        self.out = os.path.join(self.folder, "run")
        self.viewer = test_view.Viewer(runs.TRACK, "--out", self.out, "--duration", "26", "--threads", "1", *SETS)
        self.page = live_page.Socket(self.viewer)
        self.assertEqual(self.page.status, 101)

    def tearDown(self):
        self.page.close()

    def command(self, until=None, **command):
        """State after a command, once it fits a condition."""
        return self.page.state(until, command)

    def run_to(self, time_s):
        """Frame by frame until a time."""
        state = self.page.state()
        while state["time_s"] < time_s:
            state = self.command(lambda now: now["paused"] and not now["steps"], do="step", frames=1)
        return state

    def test_changes_repeat(self):
        """A run with changes by hand, and the repetition of its scenario.json: equal tables. A branch from before the changes
        is a run without them; one that was rewound has those that were made after."""
        state = self.page.state(lambda now: now["run"] == 0)
        self.assertTrue(state["paused"])
        self.assertEqual([one["why"] for one in state["states"]], ["start"])
        frames = state = self.command(lambda now: now["paused"] and now["time_s"] > 0, do="step", frames=1)
        self.assertLess(frames["time_s"], 1.5)
        self.command(lambda now: now["time_s"] >= 3, do="run", rate=20)
        state = self.command(lambda now: now["paused"] and now["states"][-1]["time_s"] == now["time_s"], do="pause")
        early = state["states"][-1]["id"]
        state = self.command(lambda now: now["changes"] == 1, do="set", set=f"{CONTROL}/exposure_s=0.25")
        self.assertEqual(state["message"], "")
        self.command(lambda now: now["changes"] == 2, do="burn", object="INMARSAT GX5", dv_rtn_mps=[0, 40, 0])
        for bad in ("/duration_s=3", f"{CONTROL}/exposure_s=-1", "nothing", f"{runs.SENSOR}/cue/object=nobody"):
            state = self.command(lambda now: now["message"], do="set", set=bad)
            self.assertEqual(state["changes"], 2, bad)
        state = self.command(lambda now: now["message"], do="burn", object="nobody", dv_rtn_mps=[0, 0, 1])
        self.assertIn("name", state["message"])
        # modules of other names: what was saved does not fit, so the change is taken back
        state = self.command(lambda now: now["message"], do="set", set='/observers/0/name="other"')
        self.assertIn("cannot go on with this change", state["message"])
        self.assertEqual(state["changes"], 2)
        late = self.run_to(state["time_s"] + 2)["time_s"]
        state = self.command(lambda now: now["time_s"] < late, do="rewind", state=state["states"][-1]["id"])
        self.assertEqual((state["changes"], state["paused"]), (2, True))
        self.command(lambda now: now["ended"], do="run", rate=0)
        self.assertEqual(self.viewer.json("api/refresh")["state"], "complete")
        state = self.command(lambda now: now["run"] == 1, do="branch", state=early)
        self.assertEqual(state["changes"], 0)
        self.assertEqual(self.viewer.json("api/refresh?run=1")["state"], "still running")
        self.command(lambda now: now["ended"], do="run", rate=0)
        self.assertEqual(self.viewer.json("api/refresh?run=1")["name"], "run-2")
        self.assertEqual(self.viewer.end()[0], 0)

        with open(self.out + "/scenario.json", encoding="utf-8") as file:
            self.assertEqual(len(json.load(file)["changes"]), 2)
        self.assertEqual([row[4] for row in tables(self.out)["events"] if row[3] == "change"][0], f"{CONTROL}/exposure_s=0.25")
        exposures = {round(end - start) for start, end in ((row[2], row[3]) for row in tables(self.out)["exposures"])}
        self.assertEqual(exposures, {1500, 3000})
        again, plain = os.path.join(self.folder, "again"), os.path.join(self.folder, "plain")
        runs.run(self.out + "/scenario.json", again)
        self.assert_equal(self.out, again)
        self.live_equals_run()
        runs.run(runs.TRACK, plain, *SETS[3::2], duration=26)
        self.assert_equal(self.out + "-2", plain)
        if FULL:
            for one, other in ((self.out, again), (self.out + "-2", plain)):
                with open(one + "/frames.fits", "rb") as first, open(other + "/frames.fits", "rb") as second:
                    self.assertEqual(first.read(), second.read())

    def live_equals_run(self):
        """A scenario with changes of its own, live: they are made, and rewinding leaves them. The folder's name ends in "/"."""
        out = os.path.join(self.folder, "live")
        self.page.close()
        self.viewer = test_view.Viewer(self.out + "/scenario.json", "--out", out + "//", "--threads", "1")
        self.page = live_page.Socket(self.viewer)
        state = self.page.state(lambda now: now["run"] == 0)
        start = state["states"][0]["id"]
        early = self.command(lambda now: now["changes"] == 2, do="run", rate=20)["time_s"]
        state = self.command(lambda now: now["time_s"] < early, do="rewind", state=start)
        self.assertEqual((state["changes"], state["time_s"]), (0, 0))
        # a change by hand before them, which rewinding takes back
        self.command(lambda now: now["changes"] == 1, do="set", set=f"{CONTROL}/exposure_s=0.3")
        self.command(lambda now: now["changes"] == 0, do="rewind", state=start)
        self.command(lambda now: now["ended"], do="run", rate=0)
        self.assertEqual(self.viewer.end()[0], 0)
        self.assert_equal(self.out, out)
        with open(self.out + "/scenario.json", encoding="utf-8") as one, open(out + "/scenario.json", encoding="utf-8") as other:
            self.assertEqual(json.load(one)["changes"], json.load(other)["changes"])

    def test_states_and_branches(self):
        """The run goes back to the oldest state when there is no room for another one. A branch that fails is a message."""
        self.page.state(lambda now: now["run"] == 0)
        state = self.run_to(1)
        while len(state["states"]) < 24:
            count = len(state["states"])
            state = self.command(lambda now, count=count: len(now["states"]) > count, do="save")
        oldest = state["states"][1]
        self.run_to(oldest["time_s"] + 1)
        state = self.page.state()
        oldest = state["states"][1]
        self.assertGreater(oldest["time_s"], 0)
        state = self.command(lambda now: now["paused"] and now["time_s"] == oldest["time_s"], do="rewind", state=oldest["id"])
        self.assertIn(oldest["id"], [one["id"] for one in state["states"]])
        self.command(lambda now: now["ended"], do="end")
        tables_file = self.out + "/run.sqlite"
        os.rename(tables_file, tables_file + ".kept")
        os.symlink(tables_file + ".kept", tables_file)
        state = self.command(lambda now: now["message"], do="branch", state=oldest["id"])
        self.assertIn("there is no branch: ", state["message"])
        self.assertEqual((state["ended"], os.path.exists(self.out + "-2.partial")), (True, False))
        os.rename(tables_file + ".kept", tables_file)
        state = self.command(lambda now: now["run"] == 1, do="branch", state=oldest["id"])
        self.assertEqual(state["time_s"], oldest["time_s"])
        self.command(lambda now: now["ended"], do="end")
        self.assertEqual(self.viewer.end()[0], 0)
        # two at a time take two folders, which are there when the address is
        pair = [test_view.Viewer(os.path.abspath(runs.TRACK), "--threads", "1", *SETS, cwd=self.folder) for _ in range(2)]
        names = sorted(os.listdir(self.folder + "/runs"))
        self.assertEqual([one.end()[0] for one in pair], [0, 0])
        self.assertEqual([name.split("-live")[-1] for name in names], ["-2.partial", ".partial"])
        # no address where there will be no page
        result = subprocess.run([runs.BORESIGHT, "view", runs.TRACK, "--no-browser", "--out", self.out, *SETS], capture_output=True,
                                text=True, check=False)
        self.assertEqual((result.returncode, result.stdout), (1, ""))
        self.assertIn("exists already", result.stderr)

    def test_frames_and_spectators(self):
        """What is shown is what is recorded; a second page sees it and has no control until the first one is gone."""
        shown = []
        self.page.state(lambda now: now["run"] == 0)
        self.page.ask()  # watched from now on
        while len(shown) < 3:
            answer, pixels = self.page.ask({"do": "step", "frames": 1})
            while not answer["sequence"]:
                answer, pixels = self.page.ask()
            shown.append((answer["frame"], pixels))
        # the newest frames follow a change of the camera
        self.assertEqual(shown[-1][0]["gain_e_per_dn"], 1.6)
        self.command(lambda now: now["changes"] == 1, do="set", set=f"{runs.SENSOR}/camera/gain_e_per_dn=3.25")
        answer, pixels = self.page.ask({"do": "step", "frames": 1})
        while not answer["sequence"]:
            answer, pixels = self.page.ask()
        self.assertEqual(answer["frame"]["gain_e_per_dn"], 3.25)
        shown.append((answer["frame"], pixels))
        for n in (2, 3, 1, 0, 65, -1e300, 1e300):  # a page with fewer pixels asks for means of n x n; other numbers are none
            again, means = self.page.ask(after=0, binning=n)
            self.assertEqual(again["frame"], answer["frame"])
            if FULL and n in (2, 3):
                size = -(-1024 // n)
                self.assertEqual((again["binning"], again["frame_width"], means.shape), (n, 1024, (size, size)))
                whole = 1024 // n
                blocks = pixels[:whole * n, :whole * n].astype(int).reshape(whole, n, whole, n).sum(axis=(1, 3))
                self.assertTrue(numpy.array_equal(means[:whole, :whole], (2 * blocks + n * n) // (2 * n * n)))
            elif FULL:
                self.assertTrue(numpy.array_equal(means, pixels))
        spectator = live_page.Socket(self.viewer)
        answer, pixels = spectator.ask({"do": "end"})
        self.assertEqual((answer["controller"], answer["problem"]), (False, "another page controls the run"))
        self.assertEqual(answer["frame"], shown[-1][0])
        self.page.close()
        while not answer["controller"]:
            answer, _ = spectator.ask(take=True)
        answer, _ = spectator.ask({"do": "dance"})
        self.assertIn("no command", answer["problem"])
        spectator.state(lambda now: now["ended"], {"do": "end"})
        self.assertEqual(self.viewer.end()[0], 0)
        rows = tables(self.out)
        self.assertGreaterEqual(len(rows["exposures"]), 3)
        for frame, pixels in shown:
            number = frame["exposure_id"]
            found = [row for row in rows["detections"] if row[1] == number]
            self.assertEqual(len(frame["detections"]), len(found))
            # 1e-9 px: rounding of the shift to pixels of the frame
            numpy.testing.assert_allclose([mark["x"] for mark in frame["detections"]], [row[6] for row in found], rtol=0, atol=1e-9)
            self.assertEqual(pixels is not None, FULL)
            if FULL:
                from astropy.io import fits  # takes half a second
                with fits.open(self.out + "/frames.fits") as file:
                    self.assertTrue(numpy.array_equal(file[1 + number].data, pixels))

    def test_refused(self):
        """Foreign pages, wrong tokens, malformed and giant messages, too many clients: the run goes on."""
        for words, status in (({"origin": "http://evil.example"}, 403), ({"origin": None}, 404), ({"host": "evil.example"}, 403),
                              ({"path": "/{token}/live/"}, 404), ({"path": "/" + "0" * 32 + "/live"}, 403)):
            page = live_page.Socket(self.viewer, **words)
            self.assertEqual(page.status, status, words)
            page.close()
        self.assertEqual(self.viewer.status("/{token}/live"), 404)
        upgrade = "Origin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n" \
                  "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
        self.assertEqual(self.viewer.status("/{token}/live", method="POST", more=upgrade + "Content-Length: 2\r\n"), 405)
        for data, opcode in ((b"{", 0x81), (b"[]", 0x81), (b"\xff\xfe", 0x81), (b"{}" + b" " * 9000, 0x81), (b"{}", 0x82), (b"{}", 0x01),
                             (b"[" * 7000, 0x81), (b'{"a":' * 1000, 0x81)):  # deeper than a small stack
            page = live_page.Socket(self.viewer)
            with self.assertRaises((ConnectionError, TimeoutError)):
                page.peer.settimeout(5)
                page.send(data, opcode)
                while page.receive()[0] not in (8,):
                    pass
                raise ConnectionError
            page.close()
        for number in (1e300, -1e300):
            state = self.command(lambda now: now["message"], do="rewind", state=number)
            self.assertIn("no such saved state", state["message"])
            self.page.ask(after=number)
        giant = live_page.Socket(self.viewer)
        giant.peer.sendall(b"\x81\xff" + (1 << 62).to_bytes(8, "big") + bytes(4096))
        many = [live_page.Socket(self.viewer) for _ in range(60)]
        self.assertLess(sum(page.status == 101 for page in many), 50)
        state = self.command(lambda now: now["paused"] and now["time_s"] > 0, do="step", frames=1)
        self.assertGreater(state["time_s"], 0)
        for page in many + [giant]:
            page.close()
        self.assertEqual(self.viewer.end()[0], 0)


    def test_half_sent(self):
        """Half-sent messages hold no place, and a message that says it is giant is refused before it comes: both were waited for."""
        for length in (8193, 2 ** 31 - 1, 2 ** 63):
            giant = live_page.Socket(self.viewer)
            giant.peer.sendall(b"\x81\xff" + length.to_bytes(8, "big") + bytes(4))
            self.assertEqual(giant.receive(), (8, (1009).to_bytes(2, "big")))
            self.assertEqual(giant.peer.recv(1), b"")
            giant.close()
        half = [live_page.Socket(self.viewer) for _ in range(47)]  # with the page's own one all places are taken
        for k, one in enumerate(half):
            if one.status == 101:
                one.peer.sendall((b"\x81", b"\x81\xfe\x10", b"\x81\xfe\x10\x00abcdhalf")[k % 3])
        page, end = live_page.Socket(self.viewer), time.monotonic() + 25
        while page.status != 101 and time.monotonic() < end:
            page.close()
            time.sleep(0.2)
            page = live_page.Socket(self.viewer)
        self.assertEqual(page.status, 101)
        for one in half:
            self.assertEqual(one.rest + one.peer.recv(1), b"")
            one.close()
        self.assertIn("state", page.ask()[0])
        page.close()
        self.assertEqual(self.viewer.end()[0], 0)


class Watched(Tables):
    def test_run_with_a_page(self):
        """`run --view`: the run is the same with a page as without."""
        folder = runs.scratch()
        sets = [runs.GENERATOR] if not FULL else []
        words = runs.command(runs.TRACK, folder + "/seen", *sets, duration=25)[1:]
        viewer = test_view.Viewer(None, command=[*words, "--view"])
        page, frames = live_page.Socket(viewer), 0
        self.assertEqual(page.status, 101)
        try:
            while True:
                answer, _ = page.ask({"do": "pause"})
                self.assertIn("problem", answer)
                frames += answer["sequence"] > 0
        except (ConnectionError, TimeoutError):
            pass
        self.assertEqual(viewer.process.wait(60), 0)
        viewer.process.communicate()
        runs.run(runs.TRACK, folder + "/plain", *sets, duration=25)
        self.assertGreater(frames, 0)
        self.assert_equal(folder + "/seen", folder + "/plain")


def processor_s(process):
    """Processor time of a process and of all below it, s."""
    rows = {}
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat", encoding="ascii", errors="replace") as file:
                words = file.read().rsplit(")", 1)[1].split()
        except OSError:
            continue  # it has ended
        rows[int(name)] = int(words[1]), (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
    tree, size = {process.pid}, 0
    while len(tree) > size:
        size = len(tree)
        tree |= {one for one, (parent, _) in rows.items() if parent in tree}
    return sum(rows[one][1] for one in tree if one in rows)


@unittest.skipUnless(FULL and chromium.PROGRAM, "with --full, and a chromium")
class Drawn(unittest.TestCase):
    """While a run goes on, a worker draws; when it pauses, is zoomed, or an older frame is shown, the page does."""
    # share of the stage that has grey pixels of the frame, and pixels in the colours of marks: of both canvases of the page, and the worker's
    LOOK = """(() => {
        const colours = (id) => {
            const from = document.getElementById(id), copy = document.createElement('canvas');
            if (from.hidden || !from.width) return [0, 0];
            [copy.width, copy.height] = [from.width, from.height];
            const context = copy.getContext('2d');
            context.drawImage(from, 0, 0);
            const { data } = context.getImageData(0, 0, copy.width, copy.height);
            let grey = 0, marks = 0;
            for (let k = 0; k < data.length; k += 4) {
                if (data[k] === data[k + 1] && data[k] === data[k + 2] && data[k + 3] === 255 && data[k] > 0) grey++;
                else if (data[k + 3] > 0 && Math.max(data[k], data[k + 1], data[k + 2]) - Math.min(data[k], data[k + 1], data[k + 2]) > 60) marks++;
            }
            return [grey / (copy.width * copy.height), marks];
        };
        return { worker: colours('live-image'), page: [colours('image')[0], colours('overlay')[1]], shown: document.getElementById('stage').classList.contains('live-shown') };
    })()"""
    LIVE = "document.boresight.live"

    def test_drawn(self):
        viewer = test_view.Viewer(runs.TRACK, "--out", os.path.join(runs.scratch(), "run"), "--duration", "6000", *SETS)
        with chromium.Chromium(1280, 720) as page:
            page.command("Page.navigate", url=viewer.url)
            page.wait_for(f"document.boresight && document.boresight.run && {self.LIVE} && {self.LIVE}.state.run === 0")
            page.evaluate(f"{self.LIVE}.command({{ do: 'run', rate: 0 }})")
            page.wait_for(f"{self.LIVE}.state.time_s > 25 && document.getElementById('stage').classList.contains('live-shown')")
            before = page.evaluate(f"{self.LIVE}.picture.count()")
            page.wait_for(f"{self.LIVE}.shown > {before} + 10")
            seen = page.evaluate(self.LOOK)
            self.assertTrue(seen["shown"])
            self.assertGreater(seen["worker"][0], 0.2)
            self.assertGreater(seen["worker"][1], 100)
            # a pause: the page has the newest frame with all its pixels
            page.evaluate(f"{self.LIVE}.command({{ do: 'pause' }})")
            page.wait_for(f"{self.LIVE}.state.paused && document.boresight.frameView.image.binning === 1 && {self.LIVE}.shownExposure() === document.boresight.frameView.details.exposure_id")
            page.wait_for("!document.getElementById('stage').classList.contains('live-shown')")
            seen = page.evaluate(self.LOOK)
            self.assertEqual(seen["worker"], [0, 0])
            self.assertGreater(seen["page"][0], 0.2)
            self.assertGreater(seen["page"][1], 100)
            # a frame from before while it goes on, and the newest one again
            page.evaluate(f"{self.LIVE}.command({{ do: 'run', rate: 20 }})")
            page.wait_for("document.getElementById('stage').classList.contains('live-shown')")
            page.wait_for("document.boresight.count > 5")
            page.key("Home")
            page.wait_for("document.boresight.current === 0 && !document.getElementById('stage').classList.contains('live-shown')")
            page.evaluate("document.getElementById('live-newest').click()")
            page.wait_for("document.getElementById('stage').classList.contains('live-shown')")
            # zoomed: the page draws, with all pixels
            page.evaluate("document.boresight.frameView.zoomTo(8)")
            page.wait_for("!document.getElementById('stage').classList.contains('live-shown') && document.boresight.frameView.image.binning === 1")
            page.evaluate("document.boresight.frameView.fit()")
            page.wait_for("document.getElementById('stage').classList.contains('live-shown')")
            # commands are obeyed while the worker goes on
            obeyed = page.evaluate(f"{self.LIVE}.state.obeyed")
            page.evaluate(f"{self.LIVE}.command({{ do: 'save' }}, {{ do: 'save' }}, {{ do: 'pause' }})")
            page.wait_for(f"{self.LIVE}.state.obeyed === {obeyed + 3} && {self.LIVE}.state.paused")
            # a worker that fails: the page draws, and still controls the run
            page.evaluate(f"{self.LIVE}.command({{ do: 'run', rate: 20 }})")
            page.wait_for("document.getElementById('stage').classList.contains('live-shown')")
            page.evaluate(f"{self.LIVE}.picture.worker.dispatchEvent(new Event('error'))")
            page.wait_for(f"!document.getElementById('stage').classList.contains('live-shown') && {self.LIVE}.socket instanceof WebSocket && {self.LIVE}.socket.readyState === 1")
            shown = page.evaluate(f"{self.LIVE}.shown")
            page.wait_for(f"{self.LIVE}.shown > {shown} + 3")
            page.evaluate(f"{self.LIVE}.command({{ do: 'pause' }})")
            page.wait_for(f"{self.LIVE}.state.paused")
            self.assertEqual(page.messages, [])
        viewer.end()


@unittest.skipUnless(FULL and chromium.PROGRAM, "with --full, and a chromium")
class Figures(unittest.TestCase):
    """What a page that watches the main scenario flat out costs. The figures are printed (`ctest -V`), with those that were
    asked for; only what no other load of the machine can change is checked."""
    SECONDS, TURNS = 6, 5

    def state(self):
        self.steering.send(b"{}")
        data = self.steering.receive()[1]
        length = int.from_bytes(data[:4], "little")
        return json.loads(data[4:4 + length])["state"]

    def phase(self, page=None):
        """Simulated seconds a second, processor time of the program for each, ms; with a page: frames shown a second and
        processor time of the browser for each, ms."""
        def look():
            shown = page.evaluate("document.boresight.live.picture.count()") if page else 0
            return self.state()["time_s"], time.monotonic(), processor_s(self.viewer.process), shown, processor_s(page.process) if page else 0
        before = look()
        time.sleep(self.SECONDS)
        simulated, wall, program, shown, browser = (now - then for now, then in zip(look(), before))
        return simulated / wall, 1e3 * program / simulated, shown / wall, 1e3 * browser / max(1, shown)

    def test_watched(self):
        """The same run with and without a page, in turns."""
        self.viewer = test_view.Viewer(runs.TRACK, "--out", os.path.join(runs.scratch(), "run"), "--duration", "60000", *SETS)
        self.steering = live_page.Socket(self.viewer)
        self.steering.send(b'{"command": {"do": "run", "rate": 0}}')
        self.steering.receive()
        alone, watched = [], []
        with chromium.Chromium(1280, 720, "--disable-gpu-compositing") as page:
            time.sleep(3)
            for _ in range(self.TURNS):
                alone.append(self.phase())
                page.command("Page.navigate", url=self.viewer.url)
                page.wait_for("document.boresight && document.boresight.live && document.boresight.live.shown > 30")
                watched.append(self.phase(page))
                page.command("Page.navigate", url="about:blank")
                time.sleep(1.5)  # a sensor counts as watched for a second
            self.assertEqual(page.messages, [])
        self.steering.close()
        self.viewer.process.kill()
        (speed, cost, _, _), (slower, dearer, shown, browser) = (numpy.median(rows, axis=0) for rows in (alone, watched))
        kept = numpy.median([there[0] / without[0] for there, without in zip(watched, alone)])  # of neighbours: other load changes slowly
        print(f"\nlive main scenario, {self.TURNS} x {self.SECONDS} s in turns, medians, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}:"
              f"\n  frames shown         {shown:.1f} a second (asked: 15 or more), {browser:.1f} ms of the browser each"
              f"\n  simulated seconds    {speed:.1f} a second alone, {slower:.1f} watched: {100 * (1 - kept):.1f} % slower (asked: 10 % or less)"
              f"\n  processor time       {cost:.1f} ms a simulated second alone, {dearer:.1f} watched: {100 * (dearer / cost - 1):.1f} % more", flush=True)
        self.assertGreater(shown, 1)
        self.assertLess(dearer, 1.5 * cost)

    def test_nobody_watches(self):
        """`run --view` without a page, and `run`: processor time, in turns. What a frame costs is the difference of a long run and a
        short one; the rest is the server's start, once a run."""
        def cost(duration, *words):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            with open(os.devnull, "wb") as nothing:
                subprocess.run([*runs.command(runs.TRACK, os.path.join(runs.scratch(), "run"), duration=duration), *words], check=True, stdout=nothing)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        costs = {(words, duration): [] for duration in (2, 152) for words in ((), ("--view",))}
        for _ in range(6):
            for (words, duration), times in costs.items():
                times.append(cost(duration, *words))
        start, viewed_start, alone, viewed = (min(costs[key]) for key in (((), 2), (("--view",), 2), ((), 152), (("--view",), 152)))
        slope = (viewed - viewed_start) / (alone - start) - 1
        print(f"\nmain scenario, 6 runs each in turns, least processor time: of 150 s after the first 2 s, run {alone - start:.2f} s, run --view "
              f"with nobody watching {viewed - viewed_start:.2f} s: {100 * slope:.1f} % more (asked: 0 %); start of the server {1e3 * (viewed_start - start):.0f} ms", flush=True)
        self.assertLess(viewed, 1.25 * alone)


class Start(unittest.TestCase):
    def test_start_page(self):
        """Runs of runs/ and shipped scenarios; a run is opened by its name and by no path."""
        folder = runs.scratch()
        os.mkdir(folder + "/runs")
        runs.run(runs.TRACK, folder + "/runs/one", runs.GENERATOR, duration=1)
        os.mkdir(folder + "/runs/empty")
        viewer = test_view.Viewer(None, cwd=folder)
        listed = viewer.json("api/start")
        self.assertEqual([(one["name"], one["state"]) for one in listed["runs"]], [("one", "complete")])
        self.assertIn("neossat_geo_track.json", [one["file"] for one in listed["scenarios"]])
        self.assertNotIn("boresight.schema.json", [one["file"] for one in listed["scenarios"]])
        self.assertEqual(viewer.json("api/session"), {"live": False, "study": False, "runs": 0})
        self.assertEqual(viewer.status("/{token}/api/run"), 404)
        with open(folder + "/runs/one/quicklook.png", "wb") as file:
            file.write(b"\x89PNG")
        self.assertEqual(viewer.get("api/picture?name=one")[0], b"\x89PNG")

        def post(route, body):
            request = urllib.request.Request(viewer.url + route, json.dumps(body).encode(),
                                             {"Origin": f"http://127.0.0.1:{viewer.port}"}, method="POST")
            try:
                with urllib.request.urlopen(request, timeout=60) as answer:
                    return json.load(answer)
            except urllib.error.HTTPError as error:
                return error.code
        for name in ("../runs/one", "/etc", ".", "..", "", "empty", "no"):
            self.assertEqual(post("api/open", {"run": name}), 404, name)
        self.assertEqual(post("api/launch", {"scenario": "../scenarios/neossat_geo_track.json"}), 404)
        self.assertEqual(post("api/open", {"run": "one"}), {"run": 0})
        self.assertEqual(viewer.json("api/run?run=0")["name"], "one")
        self.assertEqual(viewer.json("api/session")["run"], viewer.json("api/run"))
        self.assertEqual(viewer.end()[0], 0)


class Scenarios(unittest.TestCase):
    def test_only_run_makes_changes(self):
        """A scenario with changes is refused where they are not made, and where they are wrong."""
        path = os.path.join(runs.scratch(), "changes.json")

        def with_changes(*changes):
            with open(path, "w", encoding="utf-8") as file:
                json.dump({"extends": os.path.abspath(runs.TRACK), "changes": [{"time_s": t, "set": s} for t, s in changes]}, file)
            return subprocess.run(runs.command(path, runs.scratch() + "/x", runs.GENERATOR, duration=2), capture_output=True,
                                  text=True, check=False)
        ends = {((1, "/seed=3"),): "/changes/0: set: \"/seed=3\" cannot change during a run",
                ((1, "/world/objects/0/area_m2=1"), (0.5, "/world/objects/0/area_m2=2")): "put them in the order of time",
                ((1, "/world/objects/0/area_m2=-1"),): "after /changes/0",
                ((1e-5, "/world/objects/0/area_m2=1"),): "no whole number of ticks"}
        for changes, message in ends.items():
            result = with_changes(*changes)
            self.assertEqual(result.returncode, 1)
            self.assertIn(message, result.stderr)

    def test_changes_of_the_standard_input(self):
        """A scenario with changes that is piped is read once; its orbits are exported with the burn that was added."""
        folder = runs.scratch()
        changes = [{"time_s": 1, "set": '/world/objects/0/burns=[{"time_s": 2, "dv_rtn_mps": [0, 40, 0]}]'}]
        with open(runs.TRACK, encoding="utf-8") as file:
            text = json.load(file)
        for name, more in (("changed", {"changes": changes}), ("plain", {})):
            result = subprocess.run(runs.command("-", f"{folder}/{name}", runs.GENERATOR, duration=60), text=True, check=False,
                                    input=json.dumps({**text, **more}), cwd=os.path.dirname(runs.TRACK), capture_output=True)
            self.assertEqual(result.returncode, 0, result.stderr)
            runs.export(f"{folder}/{name}", "--orbits", "oem", "--objects", "INMARSAT GX5")
        states = []
        for name in ("changed", "plain"):
            with open(f"{folder}/{name}.export/orbits.oem", encoding="utf-8") as file:
                states.append([line for line in file if line.startswith("20")])
        self.assertEqual(states[0][0], states[1][0])
        self.assertNotEqual(states[0][-1], states[1][-1])


def tearDownModule():
    test_view.end_all()


if __name__ == "__main__":
    unittest.main()
