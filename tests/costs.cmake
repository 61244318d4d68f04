# Seconds of the processor's time of the longer tests of ./dev test, with the kernels that they are
# the first to compile (2026-11-27); of those that wait more than they compute, seconds. CTest starts
# the longest first, so that none is left at the end for one core alone; a clean clone has no times
# of its own. Only the order counts; a test that is not named counts as short.
set(bst_costs
  e2e_docs_commands 42  e2e_figures_kept 100  scenegen_renderer 35  scenegen_colour 29  e2e_study 24  e2e_link 23
  e2e_knowledge 21  e2e_discrimination 20  scenegen_fourier_render 19  e2e_resume 18
  e2e_faults 17  e2e_detector_effects 16  scenegen_detector 15  e2e_interrupted 20
  e2e_command_line 15  scenegen_tolerance_sweep 14  scenegen_fidelity 14  e2e_slurm 35
  e2e_passes 14  e2e_docs 13  imgproc_archive 12  e2e_orbit_consistency 12  e2e_tables 12
  e2e_acquisition 12  e2e_loop 12  e2e_frames 12  e2e_report 12  tracker_consistency 11
  e2e_export 11  e2e_planes 11  e2e_bad_input 11  imgproc_streaks 11  scenegen_hard_cases 11
  headers_compile_alone 11  optics_psf_colour 7  e2e_bench 10  e2e_random_labels 10  e2e_seeds 10
  e2e_calframes 10  e2e_loop_latency 10  imgproc_false_alarms 10  e2e_faint_sky 9  e2e_outputs 9
  e2e_settling 9
  e2e_constellation 9  e2e_day_modes 9  e2e_hostile_input 9  world_ephemeris 9  e2e_install 9
  control_archive 4  imgproc_statistics 8  python_program_plugins 8  scenegen_extended_source 8
  headers_words 8  python_examples 8  e2e_repeat 8  e2e_manoeuvre 8  e2e_pd 8  e2e_new 8
  e2e_skewed_frames 8  e2e_camera 8  e2e_propagate 8  e2e_plugins 8  obsgen_streak_detection 8
  e2e_pacing 12  e2e_view 12  e2e_cube_parts 7  e2e_recorded 7  control_loop 5  e2e_earth_in_field 7
  e2e_threads 7  e2e_info 7  e2e_figures 7  e2e_orbit_files 7  e2e_boxes 6  e2e_rules 6
  e2e_skewed_exports 6  e2e_random_scenes 6  e2e_generator 6  obsgen_deblend 6  python_runs 6
  scenegen_gpu_form 6  e2e_hostile_folders 6  e2e_inspection 6  scenegen_flags 6
  scenegen_calibrate_smear_rule 5  bad_scenario 5  optics_psf 5  scenegen_resolved_body 5
  e2e_former_names 5  api_sim 5  e2e_windows 5  e2e_satnet 5  e2e_study_populations 5
  imgproc_stack 5  python_modules 5  e2e_main_job 5  imgproc_extended 5  imgproc_pixel_learner 5
  tracker_orbit 5)

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
