cmake_minimum_required(VERSION 3.25)

# The folders that hold sources, lowest layer first.
set(sim_folders sim/core sim/astro sim/device sim/world sim/io sim/link sim/engine sim/eval sim/studies)
set(subsystems scenegen gimbal imgproc tracker control obsgen)
set(all_folders ${sim_folders} ${subsystems} sim/app)
