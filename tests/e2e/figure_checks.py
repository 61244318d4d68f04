"""The comparison of a recomputed summary (figures.py) with the program's, and with its page; a mixin for
unittest.TestCase."""
import math
import re

import runs
from test_report import Page

# exact but for the rounding of the recorded angles (1e-16 of a turn in degrees: 1e-11 px) and the
# same formulae in another order
EXACT = ("time_to_confirm_s", "time_to_acquire_s", "time_to_settle_s", "custody", "track_fraction",
         "pointing_rms_px", "pointing_max_px", "pointing_bias_px", "detected_fraction",
         "track_rms_px", "track_max_px")
COUNTS = ("frames", "visible_frames", "breaks", "pointing_frames", "track_frames")
PERCENTILES = ("pointing_median_px", "pointing_p95_px", "pointing_p99_px", "track_median_px",
               "track_p95_px")


class FigureChecks:
    def compare(self, mine, summary):
        """What has no value in one has none in the other."""
        for key in COUNTS:
            self.assertEqual(mine[key], summary[key], key)
        for key in EXACT + PERCENTILES:
            self.assertEqual(mine[key] is None, summary.get(key) is None, (key, mine[key], summary.get(key)))
        for key in EXACT:
            if mine[key] is not None:
                self.assertAlmostEqual(mine[key], summary[key], delta=1e-8 + 1e-9 * mine[key], msg=key)
        for key in PERCENTILES:  # nearest rank, from bins of 0.1 %
            if mine[key] is not None:
                self.assertAlmostEqual(mine[key] / summary[key], 1, delta=0.00051, msg=key)

    def read_page(self, out):
        made = runs.call("report", out)
        self.assertEqual((made.returncode, made.stderr), (0, ""))
        return Page(out + "/report.html")

    def near(self, text, value, digits=3):
        """A printed number, `digits` of which are shown."""
        self.assertLessEqual(abs(float(text) - value),
                             0.51 * 10 ** (math.floor(math.log10(abs(value) or 1.0)) + 1 - digits), text)

    def check_page(self, page, mine, summary):
        """Cards and captions say the same, and it is that. Figures that the run has not are not looked for."""
        cards = page.cards()
        for card, key, factor, digits in (("GOSPA", "gospa_px", 1, 3), ("track purity", "track_purity", 100, 4)):
            self.assertEqual(card in cards, summary.get(key) is not None, card)
            if card in cards:
                self.near(cards[card], factor * summary[key], digits)
        if mine["custody"] is not None:
            self.near(cards["custody"], 100 * mine["custody"], 4)
        if mine["time_to_acquire_s"] is not None:
            self.near(cards["time to acquire"], mine["time_to_acquire_s"], 4)
        if mine["pointing_rms_px"] is not None:
            self.near(cards["pointing RMS"], mine["pointing_rms_px"])
            pointing = re.search(r"In the (\d+) frames in mode track with the visible target, from "
                                 r"settling on: RMS ([\d.]+), .*? largest ([\d.]+) px", page.text)
            self.assertEqual(int(pointing[1]), mine["pointing_frames"])
            self.assertEqual(pointing[2], cards["pointing RMS"].strip())
            self.near(pointing[3], mine["pointing_max_px"])
        if mine["track_rms_px"] is not None:
            track = re.search(r"In the (\d+) processed frames with the target in the field and in "
                              r"track: RMS ([\d.]+), .*? largest ([\d.]+) px", page.text)
            self.assertEqual(int(track[1]), mine["track_frames"])
            self.near(track[2], mine["track_rms_px"])
            self.near(track[3], mine["track_max_px"])
