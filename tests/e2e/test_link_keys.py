#!/usr/bin/env python3
"""Authentication of a link's peers.

Usage, from the repository root: /usr/bin/python3 tests/e2e/test_link_keys.py BORESIGHT
"""
import os
import subprocess
import sys
import unittest

import runs
from link_runs import ended, free_port, ipc, serve, start_run

sys.path.insert(0, "python")
from boresight import link as client  # noqa: E402


class Keys(unittest.TestCase):
    """A link with keys takes the peers that have them, in C and in Python, and no others."""

    @classmethod
    def setUpClass(cls):
        cls.folder = runs.scratch()
        cls.keys = cls.make("link.keys")

    @classmethod
    def make(cls, name):
        path = os.path.join(cls.folder, name)
        subprocess.run([runs.BORESIGHT, "link-keys", "--out", path], check=True,
                       stdout=subprocess.DEVNULL, timeout=60)
        return path

    def test_file(self):
        self.assertEqual(os.stat(self.keys).st_mode & 0o777, 0o600)
        result = subprocess.run([runs.BORESIGHT, "link-keys", "--out", self.keys],
                                capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 1)
        self.assertIn("cannot be made: File exists", result.stderr)
        known = self.make("known.keys")
        os.chmod(known, 0o640)
        said = ended(start_run(runs.TRACK, runs.scratch() + "/run", ipc(), "control", "--link-keys",
                               known), expected=1)
        self.assertIn("others than this user can read or change it (found mode 0640", said)
        with self.assertRaisesRegex(client.LinkError, "found mode 0640"):
            client.read_keys(known)

    def test_peers_with_the_keys(self):
        address = f"tcp://127.0.0.1:{free_port()}"
        run = start_run(runs.TRACK, runs.scratch() + "/run", address, "control", "--link-keys",
                        self.keys, duration=3)
        peer = serve(runs.TRACK, address, "control", "--link-keys", self.keys, duration=3)
        ended(run)
        ended(peer)
        address = ipc()
        out = runs.scratch() + "/run"
        run = start_run(runs.STARE, out, address, "imgproc", "--link-keys", self.keys, duration=3)
        with client.Link(address, serves="imgproc", keys_file=self.keys) as link:
            for step in link.steps():
                step.send_detections(x_px=[10.0], y_px=[20.0], flux_e=1000.0, snr=10.0)
        ended(run)
        self.assertGreater(runs.manifest(out)["counters"]["link_messages"], 3)
        self.assertEqual(runs.manifest(out)["counters"].get("link_no_key", 0), 0)

    def test_peers_without_the_keys(self):
        """One with no keys, one with others, one that knows the run's public key but not the peer's."""
        other = self.make("other.keys")
        with open(self.keys, encoding="ascii") as a, open(other, encoding="ascii") as b:
            own, foreign = a.read().splitlines(), b.read().splitlines()
        mixed = os.path.join(self.folder, "mixed.keys")
        with open(os.open(mixed, os.O_WRONLY | os.O_CREAT, 0o600), "w", encoding="ascii") as file:
            file.write("\n".join([line for line in own if line.startswith("simulation")] +
                                 [line for line in foreign if line.startswith("peer")]) + "\n")
        for keys, refused in ((None, False), (other, False), (mixed, True)):
            address, out = f"tcp://127.0.0.1:{free_port()}", runs.scratch() + "/run"
            run = start_run(runs.TRACK, out, address, "control", "--link-keys", self.keys, "--set",
                            "/link/connect_timeout_s=1.5")
            link = client.Link(address, serves="*", keys_file=keys)
            said = ended(run, expected=1)
            link._socket.close(linger=0)
            self.assertIn("no peer plays neossat/telescope/control", said)
            counters = runs.manifest(out + ".partial")["counters"]
            self.assertEqual(counters.get("link_hello", 0), 0)
            self.assertEqual(counters.get("link_no_key", 0) > 0, refused, counters)


def tearDownModule():
    runs.clean()


if __name__ == "__main__":
    unittest.main()
