# Seconds that the longer tests of ./dev test take beside another one on two cores (2026-11-26). CTest
# starts the longest first, so that none is left at the end for one core alone; a clean clone has no
# times of its own. Only the order counts; a test that is not named counts as short.
set(bst_costs
  e2e_docs_commands 100  e2e_bench 50  e2e_study 50  e2e_command_line 35
  e2e_detector_effects 32  e2e_frames 27  e2e_seeds 14
  e2e_link 33  e2e_day_modes 24  e2e_docs 24  e2e_passes 22  e2e_faults 25  e2e_resume 32  e2e_interrupted 24  e2e_slurm 30  e2e_tables 27
  e2e_camera 26  e2e_random_scenes 18  e2e_planes 26  e2e_acquisition 24  e2e_rules 9
  e2e_discrimination 22  e2e_loop_latency 20  e2e_repeat 20  e2e_threads 15  e2e_pd 20  e2e_loop 20  e2e_study_files 20
  e2e_new 19  e2e_bad_input 18  e2e_random_labels 16  e2e_info 15  e2e_manoeuvre 14
  e2e_constellation 12  e2e_boxes 11  e2e_export 10  e2e_hostile_folders 10
  e2e_orbit_consistency 10  e2e_pacing 10
  scenegen_fidelity 52  tracker_hard_cases 43  scenegen_flags 42  scenegen_background 34
  obsgen_streak_detection 14  control_loop 30  scenegen_rolling_shutter 28  scenegen_hard_cases 25
  scenegen_tolerance_sweep 12
  optics_psf_colour 10
  scenegen_renderer 52 python_examples 44 scenegen_detector 44 scenegen_colour 37
  scenegen_cosmic_rays 34 python_gym 32 e2e_knowledge 29 scenegen_fourier_render 26
  tracker_consistency 12 e2e_report 22 python_program_plugins 21 e2e_calframes 20
  scenegen_module 19 e2e_plugins 17 e2e_skewed_frames 17 scenegen_extended_source 16
  engine_executor 15 bad_scenario 14 e2e_install 14 imgproc_streaks 14
  python_misuse 12 e2e_earth_in_field 11 io_fits_reader 11 e2e_outputs 11
  imgproc_archive 11 e2e_figures 11 scenegen_resolved_body 10 scenegen_gpu_form 10
  e2e_view 19 e2e_hostile_input 10 scenegen_vignetting 9 headers_compile_alone 9 e2e_faint_sky 9
  imgproc_false_alarms 9 io_fits 9 gimbal_attitude_filter 9 world_field 9
  scenegen_jitter 9 e2e_link_keys 8 e2e_former_names 8 tracker_orbit 8
  e2e_study_populations 8 e2e_orbit_files 8 e2e_propagate 8)

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
