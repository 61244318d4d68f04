"""Figures of a study's run against what the same run leaves that was started by hand."""
import math

import runs


class StudyFigures:
    """Checks for a unittest.TestCase."""

    def check_sightings(self, row, out):
        """What is of all sensors together."""
        reported = runs.manifest(out)["sightings"]
        for name, of in (("tasks", "tasks"), ("tasks_done", "tasks_done"),
                         ("passes_seen", "passes_seen"), ("objects_detected", "objects_seen"),
                         ("revisit_mean_s", "revisit_mean_s"),
                         ("longest_gap_mean_s", "longest_gap_mean_s"),
                         ("object_custody", "custody_fraction_all"),
                         ("object_custody_seen", "custody_fraction_seen"),
                         ("place_rms_arcsec", "place_rms_arcsec"),
                         ("tracks_rms_arcsec", "track_rms_arcsec")):
            self.assertEqual(row[name] == "", reported[of] is None, name)
            if row[name]:
                # JSON has 15 digits where they do
                self.assertTrue(math.isclose(float(row[name]), reported[of], rel_tol=1e-14), name)

    def check_sensors(self, run, reported, out):
        """A row each of sensors that see other things, counted in the run's own tables; the first
        one's figures are those of the run."""
        self.assertEqual([int(r["sensor"]) for r in reported], list(range(5)))
        summaries = list(runs.manifest(out)["sensors"].values())
        with runs.database(out) as database:
            for i, row in enumerate(reported):
                frames, = database.execute("SELECT count(*) FROM exposures WHERE sensor = ?",
                                           (i,)).fetchone()
                self.assertEqual(int(row["frames"]), frames, i)
                tracks, = database.execute("SELECT count(DISTINCT track_id) FROM tracks WHERE "
                                           "sensor = ? AND status != 'tentative'", (i,)).fetchone()
                self.assertEqual(int(row["tracks"]), tracks, i)
                for name in ("custody", "track_fraction", "pointing_rms_px", "track_rms_px",
                             "visible_frames", "time_to_confirm_s", "false_tracks"):
                    found = float(row[name]) if row[name] else None
                    self.assertEqual(found is None, summaries[i][name] is None, (i, name))
                    if found is not None:
                        self.assertTrue(math.isclose(found, summaries[i][name], rel_tol=1e-14))
        self.assertGreater(len({r["detections"] for r in reported}), 2)
        self.assertEqual([int(r["frames"]) for r in reported], [30, 30, 30, 40, 30])
        for name in ("frames", "detections", "tracks", "pointing_rms_px", "track_rms_px"):
            self.assertEqual(run[name], reported[0][name], name)
