#!/usr/bin/env python3
"""A study on a Slurm of three nodes, with faults: a node loses its slurmd, a shard is killed, the
controller starts anew. Its tables are those of a local run, to the last digit; no run is lost or
counted twice. A driver that is killed leaves jobs, which the one that goes on cancels.

Usage, from the repository root, with Debian's slurm-wlm and munge:
  /usr/bin/python3 tests/e2e/slurm/test_slurm.py BORESIGHT [Slurm.test_faults ...]
"""
import filecmp
import glob
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir))
import runs  # noqa: E402

CLUSTER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "cluster.sh")
FULL = len(sys.argv) < 2  # all tests; single ones are the short form
EXPOSURES = [0.4, 0.6, 0.8, 1.0]
REPLICATES = 6 if FULL else 3
SITE = {"partition": "test", "poll_s": 0.5, "grace_s": 3, "patience_s": 60, "time_min": 10}


def write_json(path, value):
    with open(path, "w", encoding="utf-8") as file:
        json.dump(value, file)


def wait_until(condition, seconds, what):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"not within {seconds} s: {what}"
        time.sleep(0.05)


def rows(out):
    """All tables of results but those of time."""
    with sqlite3.connect(f"file:{out}/study.sqlite?mode=ro", uri=True) as db:
        names = [name for name, in db.execute(
            "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
        return {name: list(db.execute(f'SELECT * FROM "{name}"'))
                for name in names if "speed" not in name and "timing" not in name}


class Slurm(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.cluster = os.path.join(cls.folder, "cluster")
        cls.addClassCleanup(subprocess.run, [CLUSTER, "stop", cls.cluster], check=False)
        subprocess.run([CLUSTER, "start", cls.cluster], check=True, timeout=60)
        cls.environment = dict(os.environ, SLURM_CONF=os.path.join(cls.cluster, "slurm.conf"),
                               PATH=os.environ["PATH"] + ":/usr/sbin")
        cls.site = os.path.join(cls.folder, "site.json")
        write_json(cls.site, SITE)
        cls.study = os.path.join(cls.folder, "study.json")
        write_json(cls.study, {
            "boresight_study": 1, "name": "exposures",
            "scenarios": [{"file": os.path.abspath("scenarios/day_generator.json")}],
            "set": {"/duration_s": 1500 if FULL else 1000, "/world/star_catalogue": "embedded"},
            "sweeps": [{"axes": [{"path": runs.SENSOR + "/exposure/exposure_s",
                                  "values": EXPOSURES}]}],
            "replicates": REPLICATES})
        cls.local = os.path.join(cls.folder, "local")
        done = subprocess.run([runs.BORESIGHT, "study", cls.study, "--quiet", "--out", cls.local],
                              capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stdout + done.stderr

    def start(self, out, *words):
        return subprocess.Popen(
            [runs.BORESIGHT, "study", *words, "--slurm", "--site", self.site, "--out", out,
             "--shard-runs", "2", "--quiet"],
            env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def pid(self, name):
        with open(os.path.join(self.cluster, "pid", name), encoding="utf-8") as file:
            return int(file.read())

    def queue(self):
        done = subprocess.run(["squeue", "--noheader", "--array", "--format=%T"],
                              env=self.environment, capture_output=True, text=True, check=False)
        return done.stdout.split() if done.returncode == 0 else None

    def shards_at_work(self, out):
        """Processes that execute shards of a study."""
        found = []
        for name in glob.glob("/proc/[0-9]*/cmdline"):
            try:
                with open(name, "rb") as file:
                    words = file.read().split(b"\0")
                where = os.readlink(os.path.join(os.path.dirname(name), "cwd"))
            except OSError:
                continue
            if b"--shard" in words and where.startswith(out):
                found.append(int(name.split("/")[2]))
        return found

    def check_equal(self, out):
        local, cluster = rows(self.local), rows(out)
        self.assertEqual(list(local), list(cluster))
        self.assertEqual(len(cluster["runs"]), len(EXPOSURES) * REPLICATES)
        for name in local:
            self.assertEqual(local[name], cluster[name], name)
        for name in sorted(os.listdir(self.local)):
            if name.endswith(".csv") and "speed" not in name:
                self.assertTrue(filecmp.cmp(os.path.join(self.local, name),
                                            os.path.join(out, name), shallow=False), name)

    def test_faults(self):
        out = os.path.join(self.folder, "faults")
        driver = self.start(out, self.study)
        wait_until(lambda: len(self.shards_at_work(out)) >= 3, 200, "three shards at work")
        os.kill(self.pid("node1"), signal.SIGKILL)  # its tasks go on without a report
        os.kill(self.shards_at_work(out)[-1], signal.SIGKILL)
        os.kill(self.pid("slurmctld"), signal.SIGKILL)
        time.sleep(2)
        subprocess.run([CLUSTER, "control", self.cluster], check=True, timeout=60)
        time.sleep(2)
        subprocess.run([CLUSTER, "node", self.cluster, "1"], check=True, timeout=60)
        said, errors = driver.communicate(timeout=300)
        self.assertEqual(driver.returncode, 0, said + errors)
        self.assertIn("signal 9", errors)
        self.check_equal(out)

    def test_driver_killed(self):
        out = os.path.join(self.folder, "killed")
        driver = self.start(out, self.study)
        wait_until(lambda: len(self.shards_at_work(out)) >= 2, 200, "two shards at work")
        driver.kill()
        driver.communicate(timeout=60)
        self.assertTrue(self.queue())
        driver = self.start(out, self.study, "--resume")
        said, errors = driver.communicate(timeout=300)
        self.assertEqual(driver.returncode, 0, said + errors)
        self.check_equal(out)

    def test_interrupted(self):
        out = os.path.join(self.folder, "interrupted")
        driver = self.start(out, self.study)
        wait_until(lambda: len(self.shards_at_work(out)) >= 2, 200, "two shards at work")
        driver.send_signal(signal.SIGINT)
        said, errors = driver.communicate(timeout=60)
        self.assertEqual(driver.returncode, 130, said + errors)
        wait_until(lambda: self.queue() == [], 30, "an empty queue")
        self.assertEqual(self.shards_at_work(out), [])

    def test_refused(self):
        site = os.path.join(self.folder, "wrong.json")
        write_json(site, dict(SITE, partition="nowhere"))
        done = subprocess.run([runs.BORESIGHT, "study", self.study, "--slurm", "--site", site,
                               "--out", os.path.join(self.folder, "refused")],
                              env=self.environment, capture_output=True, text=True, timeout=60,
                              check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("invalid partition", done.stderr)
        write_json(site, dict(SITE, partitoin="test"))
        done = subprocess.run([runs.BORESIGHT, "study", self.study, "--slurm", "--site", site,
                               "--out", os.path.join(self.folder, "refused2")],
                              env=self.environment, capture_output=True, text=True, timeout=60,
                              check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("partitoin", done.stderr)
        self.assertIn("partition", done.stderr)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    if not shutil.which("slurmctld", path=os.environ["PATH"] + ":/usr/sbin"):
        sys.exit("slurmctld is missing: install slurm-wlm and munge")
    unittest.main()
