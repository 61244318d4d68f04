"""Which end-to-end tests judge a bug in a file: those that compare its results with outside truth, quickest
first. All of them take half an hour; a bug's trial by those that concern it takes one to three minutes."""
import re

# first match holds; names without "e2e_"
CONCERNED = [
    (r"sim/app/export_boxes", "boxes"),
    (r"sim/app/export_satnet", "satnet boxes"),
    (r"sim/app/(video|export_views)|sim/io/frame_picture", "film skewed_exports export"),
    (r"sim/app/(cmd_export|export|frame_marks)|sim/io/(oem|czml|tdm|csv)", "skewed_exports export boxes satnet"),
    (r"sim/app/report_study|sim/studies|sim/app/(cmd_study|study)", "study_files report_study study"),
    (r"sim/app/report|sim/io/(chart|html)", "figures report skewed_exports"),
    (r"sim/app/cmd_orbit|sim/analysis/orbit|sim/run/track_files|sim/io/omm", "orbit orbit_files"),
    (r"sim/app/(loop|cmd_loop)", "loop"),
    (r"sim/app/(calibrate|equivalence|pairing|cmd_calibrate)", "generator"),
    (r"sim/app/(pd|cmd_pd)", "pd"),
    (r"sim/app/(new|cmd_new)", "new"),
    (r"sim/app/cmd_calframes|sim/analysis/calibration/calibration_frames", "calframes"),
    (r"sim/app/cmd_info|sim/report/report_info|sim/io/(manifest|run_)", "info figures"),
    (r"sim/app/cmd_propagate|sim/export/export_states", "propagate"),
    (r"sim/app/bench", "bench"),
    (r"sim/link|sim/app/(link_|run_link|cmd_serve)", "link"),
    (r"sim/app/(check_|scenario_rules)", "rules earth_in_field"),
    (r"sim/app/(options|outputs|load|main|plugins)|sim/core/(json|config)", "command_line hostile_input outputs"),
    (r"sim/io/(fits|wcs|sip)", "skewed_frames frames detector_effects"),
    (r"sim/eval/sightings|sim/engine/recorder_tasks|sim/app/run_sightings", "passes constellation"),
]
# what the tables, headers and figures of a run hold, in scenes whose axes, windows and clocks differ
GENERAL = "tables skewed_frames figures skewed_exports main_job frames"


def concerned(path, names):
    """Those of `names` that judge `path`, in the order in which to run them."""
    wanted = next((tests for pattern, tests in CONCERNED if re.match(pattern, path)), GENERAL).split()
    return [n for n in (f"e2e_{name}" for name in wanted) if n in names]
