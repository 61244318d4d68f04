# Seconds that the longer tests of ./dev test take beside another one on two cores (2026-11-26). CTest
# starts the longest first, so that none is left at the end for one core alone; a clean clone has no
# times of its own. Only the order counts; a test that is not named counts as short.
set(bst_costs
  e2e_docs_commands 80  e2e_bench 50  e2e_study 50  e2e_command_line 45
  e2e_detector_effects 42  e2e_frames 36  e2e_seeds 30
  e2e_link 34  e2e_day_modes 24  e2e_docs 24  e2e_passes 22  e2e_faults 33  e2e_resume 32  e2e_interrupted 30  e2e_slurm 30  e2e_tables 27
  e2e_camera 26  e2e_random_scenes 26  e2e_planes 26  e2e_acquisition 24  e2e_rules 22
  e2e_discrimination 22  e2e_loop_latency 20  e2e_repeat 20  e2e_threads 20  e2e_pd 20  e2e_loop 20  e2e_study_files 20
  e2e_new 19  e2e_bad_input 18  e2e_random_labels 16  e2e_info 15  e2e_manoeuvre 14
  e2e_constellation 12  e2e_boxes 11  e2e_export 10  e2e_hostile_folders 10
  e2e_orbit_consistency 10  e2e_pacing 10
  scenegen_fidelity 52  tracker_hard_cases 43  scenegen_flags 42  scenegen_background 34
  obsgen_streak_detection 30  control_loop 30  scenegen_rolling_shutter 28  scenegen_hard_cases 25
  scenegen_tolerance_sweep 16)

# bst_cost(test [device])
# Tests that use the OpenCL device run one at a time: they are a queue, and begin before all others.
function(bst_cost test)
  set(seconds 0)
  list(FIND bst_costs ${test} at)
  if(at GREATER_EQUAL 0)
    math(EXPR at "${at} + 1")
    list(GET bst_costs ${at} seconds)
  endif()
  if("device" IN_LIST ARGN)
    math(EXPR seconds "${seconds} + 1000")
  endif()
  if(seconds GREATER 0)
    set_tests_properties(${test} PROPERTIES COST ${seconds})
  endif()
endfunction()
