"""Saved states from Python: restored, cloned and pickled simulations go on as the saved one."""
import multiprocessing
import pathlib
import pickle
import tempfile
import unittest

from support import SMALL, bst, main


def course(sim, until_s):
    """What happens until a time: frames by their bytes, and all messages of the loop."""
    seen = []
    sim.observe(message=seen.append, channels=["tracks", "detections", "los_command", "truth",
                                               "control_status"])
    frames = [(f.exposure_id, f.data.tobytes()) for f in sim.frames(until_s=until_s)]
    sim.observe()
    return frames, seen


def in_process(argument):
    """The course of a restored simulation in another process."""
    snapshot, until_s = argument
    with bst.Simulation(SMALL) as sim:
        sim.restore(snapshot)
        return course(sim, until_s)


class States(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = bst.Model(SMALL).prepare()
        with bst.Simulation(cls.model) as sim:
            sim.run_until(6.37)
            cls.snapshot = sim.save()
            cls.expected = course(sim, 11)

    def test_restored(self):
        with bst.Simulation(self.model) as sim:
            sim.run_until(2)
            sim.restore(self.snapshot)
            self.assertAlmostEqual(sim.time_s, 6.37, delta=1 / sim.tick_rate_hz)
            self.assertEqual(course(sim, 11), self.expected)

    def test_cloned(self):
        with bst.Simulation(self.model) as sim:
            sim.run_until(6.37)
            with sim.clone() as other:
                sim.run_until(8)  # independent of each other
                self.assertEqual(course(other, 11), self.expected)

    def test_pickled(self):
        with bst.Simulation(self.model) as sim:
            sim.run_until(6.37)
            with pickle.loads(pickle.dumps(sim)) as other:
                self.assertEqual(course(other, 11), self.expected)

    def test_in_another_process(self):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            self.assertEqual(pool.map(in_process, [(self.snapshot, 11)])[0], self.expected)

    def test_in_a_file(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "state"
            self.snapshot.write(path)
            again = bst.Snapshot.read(path)
        self.assertEqual(again, self.snapshot)
        self.assertEqual(pickle.loads(pickle.dumps(again)), again)

    def test_with_an_external_module(self):
        with bst.Simulation(SMALL, external=["imgproc"]) as sim:
            sim.step("frame")
            sim.detections = {"x_px": [3.0], "y_px": [4.0]}
            snapshot = sim.save()
            found = sim.step("detections")
            sim.restore(snapshot)
            self.assertEqual(sim.step("detections"), found)

    def test_damaged_and_foreign_states_are_refused(self):
        with bst.Simulation(self.model) as sim:
            for at in (0, 20, 100, len(self.snapshot) // 2, len(self.snapshot) - 1):
                spoilt = bytearray(self.snapshot)
                spoilt[at] ^= 0xFF
                with self.assertRaises((bst.FormatError, bst.StateError)):
                    sim.restore(spoilt)
            for size in (1, 50, 300, len(self.snapshot) - 1):
                with self.assertRaises(bst.FormatError):
                    sim.restore(self.snapshot[:size])
            sim.restore(self.snapshot)
            self.assertEqual(course(sim, 11), self.expected)
        with bst.Simulation(SMALL.with_(objects__0__area_m2=9)) as other:
            with self.assertRaisesRegex(bst.StateError, "another scenario"):
                other.restore(self.snapshot)

    def test_frames_outlive_a_restore(self):
        with bst.Simulation(self.model, run=3) as sim:
            frame = sim.step("frame")
            total = int(frame.data.sum())
            sim.restore(self.snapshot)  # of another run: its modules are made anew
            sim.run_until(11)
            self.assertEqual(int(frame.data.sum()), total)
        self.assertEqual(int(frame.data.sum()), total)


if __name__ == "__main__":
    main()
