cmake_minimum_required(VERSION 3.25)

# The folders that hold sources, lowest layer first.
set(sim_folders sim/core sim/messages sim/dynamics sim/astro sim/device sim/catalogue sim/optics sim/satellite sim/world
    sim/onboard sim/io sim/link sim/engine sim/eval sim/studies)
set(subsystems scenegen gimbal imgproc tracker control obsgen)
set(programs sim/registry sim/api sim/cli sim/run sim/analysis sim/export sim/report sim/process sim/study_kinds sim/bench view sim/app)
set(all_folders include ${sim_folders} ${subsystems} ${programs})
