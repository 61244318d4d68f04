"""Which end-to-end tests judge a bug in a file: those that compare its results with outside truth, quickest
first. All of them take half an hour; a bug's trial by those that concern it takes one to three minutes."""
import re

# first match holds; names without "e2e_"
CONCERNED = [
    (r"sim/export/export_boxes", "boxes"),
    (r"sim/export/mask_labels", "boxes satnet inspection"),
    (r"sim/export/export_satnet", "satnet boxes"),
    (r"sim/export/(video|export_views)|sim/io/frame_picture", "film skewed_exports export"),
    (r"sim/app/cmd_propagate|sim/export/(export_states|propagate)", "propagate"),
    (r"sim/app/cmd_export|sim/export/|sim/io/(oem|czml|tdm|csv)|sim/run/run_observations", "skewed_exports export boxes satnet"),
    (r"sim/report/report_sightings", "report"),
    (r"sim/study_kinds/(cubes|study_labels|study_card)", "cube_parts study"),
    (r"sim/report/report_study|sim/studies|sim/study_kinds|sim/app/cmd_study", "study_files report_study study"),
    (r"sim/app/cmd_info|sim/report/report_info|sim/io/(manifest|run_)", "info figures"),
    (r"sim/app/cmd_report|sim/report/|sim/io/(chart|html)", "figures tables report skewed_exports"),
    (r"sim/app/cmd_orbit|sim/analysis/orbit|sim/run/track_files|sim/io/omm", "orbit orbit_files"),
    (r"sim/app/cmd_loop|sim/analysis/loop", "loop"),
    (r"sim/app/cmd_calframes|sim/analysis/calibration/calibration_frames", "calframes"),
    (r"sim/app/cmd_calibrate|sim/analysis/calibration", "generator"),
    (r"sim/app/cmd_pd|sim/analysis/pd", "pd"),
    (r"sim/app/cmd_new|sim/analysis/new", "new"),
    (r"sim/app/cmd_bench|sim/bench", "bench"),
    (r"sim/link|sim/run/(link_|run_link)|sim/app/cmd_serve", "link"),
    (r"sim/app/cmd_check|sim/analysis/check", "rules earth_in_field"),
    (r"sim/app/cmd_(challenge|score)|sim/analysis/(challenge|score)", "challenge skewed_exports satnet"),
    (r"sim/io/(fits_(source|tiles)|recorded|side_table|image_file)", "recorded"),
    (r"imgproc/module_lost", "generator"),
    (r"imgproc/(module_calibration|calibrate/camera)", "knowledge"),
    (r"sim/analysis/camera", "calibrate_camera"),
    (r"sim/app/cmd_characterize|sim/analysis/characterize", "characterize"),
    (r"sim/app/cmd_twin|sim/process/twin", "twin"),
    (r"sim/app/cmd_(process|solve)|sim/process|sim/analysis/solve|sim/io/keyword", "solve recorded detections characterize"),
    (r"sim/app/cmd_(lightcurve|turntable)|sim/analysis/shape", "shapes"),
    (r"imgproc/(extended|module)", "inspection main_job detections"),
    (r"obsgen/", "generator seeds discrimination"),
    (r"view/", "view"),
    (r"sim/app/(main|cmd_)|sim/cli|sim/core/(json|config)", "command_line hostile_input outputs"),
    (r"sim/io/(fits|wcs|sip)", "skewed_frames frames detector_effects"),
    (r"sim/eval/sightings|sim/engine/recorder/recorder_tasks|sim/run/run_sightings", "passes constellation"),
]
# what the tables, headers and figures of a run hold, in scenes whose axes, windows and clocks differ
GENERAL = "tables skewed_frames figures skewed_exports main_job frames"


def concerned(path, names):
    """Those of `names` that judge `path`, in the order in which to run them."""
    wanted = next((tests for pattern, tests in CONCERNED if re.match(pattern, path)), GENERAL).split()
    wanted.insert(0, "figures_kept")
    return [n for n in (f"e2e_{name}" for name in wanted) if n in names]
