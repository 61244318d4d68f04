"""The examples of the documentation, executed."""
import importlib.util
import unittest

from support import ROOT, main


def example(name):
    """An example as a module."""
    path = ROOT / "docs" / "examples" / "python" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Examples(unittest.TestCase):
    def test_closed_loop(self):
        self.assertEqual(example("closed_loop").main(until_s=60), "TRACK")

    def test_own_detector(self):
        for snr, found in example("own_detector").main(frames=4).items():
            if snr.startswith("25"):
                self.assertGreater(found, 0.95)

    def test_branch_manoeuvre(self):
        without, burnt = example("branch_manoeuvre").main()
        # the loop holds the target; a burn of 400 m/s adds to the tracking error
        self.assertLess(without, 0.5)
        self.assertGreater(burnt, without)
        self.assertLess(burnt, 5)

    def test_labelled_frames(self):
        self.assertEqual(example("labelled_frames").main(runs=2, until_s=2), 4)


if __name__ == "__main__":
    main()
