#include "sim/bench/bench_list.h"

#include <string.h>

const bst_bench bst_bench_list[BST_BENCHES] = {
    {"sgp4", "SGP4, 1,000 satellites x 1,000 epochs of a week, one thread", bst_bench_sgp4},
    {"sgp4_batch", "the same, eight states at a time", bst_bench_sgp4},
    {"numerical_leo", "a day of a numerical low orbit, all forces, from its state",
     bst_bench_numerical},
    {"star_cull", "catalogue query of a 1.5 degree field, file warm", bst_bench_star_cull},
    {"ephemeris_5000", "field query, 5,000 objects, 3 observers, per frame and observer",
     bst_bench_ephemeris},
    {"ephemeris_30000", "the same with 30,000 objects", bst_bench_ephemeris},
    {"worst_case", "2048x2048, 3220 stars, 300 px streaks, rotation, acceleration, jitter",
     bst_bench_scene_run},
    {"worst_case_plain", "the same, without the detector's patterns, hits, noise tails and bends",
     bst_bench_scene_run},
    {"worst_case_diffraction_q1", "worst_case, PSF by diffraction of an aberrated aperture, Q = 1",
     bst_bench_scene_run},
    {"worst_case_diffraction_q2", "the same, Q = 2", bst_bench_scene_run},
    {"acquisition", "2048x2048, 500 stars, 3 px of motion, 3 targets", bst_bench_scene_run},
    {"acquisition_plain", "the same, without the detector's patterns, hits, noise tails and bends",
     bst_bench_scene_run},
    {"rate_track_slow", "2048x2048, target at rest, stars 10 px", bst_bench_scene_run},
    {"rate_track_medium", "2048x2048, target at rest, stars 60 px", bst_bench_scene_run},
    {"rate_track_fast", "2048x2048, target at rest, stars 200 px", bst_bench_scene_run},
    {"galactic_core", "2048x2048, 100,000 stars, 5 px of motion", bst_bench_scene_run},
    {"window", "256x256 read-out window on a tracked target", bst_bench_scene_run},
    {"resolved_small", "2048x2048, a satellite of 2,000 triangles and 64 px at rest",
     bst_bench_resolved},
    {"resolved_large", "a satellite of 50,000 triangles and 600 px, 4 % of a turn in the exposure",
     bst_bench_resolved},
    {"imgproc_acquisition", "image processing of the frames of acquisition, rendered beforehand",
     bst_bench_imgproc},
    {"imgproc_worst_case", "of worst_case", bst_bench_imgproc},
    {"imgproc_galactic_core", "of galactic_core, the 2,048 brightest", bst_bench_imgproc},
    {"imgproc_crowded", "of galactic_core, all of some 30,000", bst_bench_imgproc},
    {"imgproc_window", "of window", bst_bench_imgproc},
    {"imgproc_stack", "stacks of 16 frames of 2048x2048, rates to 3 px per frame: per frame",
     bst_bench_stack},
    {"tracker_main", "the tracker with 40 stars, an object and a false alarm: per frame",
     bst_bench_tracker},
    {"tracker_200", "the tracker with 40 stars, 200 objects and 200 false alarms: per frame",
     bst_bench_tracker},
    {"lightcurve", "light curve of a satellite of 498 facets with shadows: per epoch",
     bst_bench_lightcurve},
    {"loop_full", "closed loop of the main scenario, per frame", bst_bench_loop},
    {"loop_obsgen",
     "a day of the closed loop with the observation generator, per frame of 2 s, plant at 100 Hz",
     bst_bench_loop_obsgen},
    {"open_loop", "run of an open-loop scenario with recording, per frame, and with --serial",
     bst_bench_open_loop},
    {"link_tcp", "frame of 2048x2048 out over tcp, looked at, pointing in: per round trip",
     bst_bench_link},
    {"link_ipc", "the same over ipc", bst_bench_link},
    {"link_shm", "the same, frames by shared memory", bst_bench_link},
    {"cold_start", "first frame of a fresh process, kernels in the cache", bst_bench_cold_start},
    {"plant_second_order", "plant step of the gimbal type second_order, as in the main scenario",
     bst_bench_plant_second_order},
    {"plant_full", "of azimuth_elevation with friction, cable, a flexible mode and encoders",
     bst_bench_plant_full},
    {"plant_spacecraft", "of a rigid_body with 4 wheels, 2 modes, sensors and control",
     bst_bench_plant_spacecraft},
    {"plant_all", "of both together", bst_bench_plant_all},
    {"sim_create", "a second simulation on the model of the main scenario, per simulation",
     bst_bench_sim_create},
    {"sim_clone", "a clone of a running simulation of the main scenario, per clone",
     bst_bench_sim_clone},
    {"env_1", "a simulation with the observation generator, commanded each frame: per frame",
     bst_bench_env},
    {"env_64", "64 of them in threads that share a model: per frame of one", bst_bench_envs},
    {"study_100000", "expansion and aggregation of 100,000 runs, per run", bst_bench_study},
    {"small", "256x256, 30 stars, 20 px streaks: a quick trial (only when named)",
     bst_bench_scene_run},
};

bool bst_bench_is_wanted(const bst_bench *bench, int count, char *const *names) {
    for (int i = 0; i < count; i++) {
        if (strcmp(names[i], bench->name) == 0) {
            return true;
        }
    }
    return count == 0 && strcmp(bench->name, "small") != 0;
}

bst_status bst_bench_check_names(bst_ctx *ctx, int count, char *const *names) {
    for (int i = 0; i < count; i++) {
        bool known = false;
        for (int b = 0; b < BST_BENCHES; b++) {
            known |= strcmp(names[i], bst_bench_list[b].name) == 0;
        }
        if (!known) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "there is no benchmark \"%s\"; --help lists them", names[i]);
        }
    }
    return BST_OK;
}

static bool reads_elements(const bst_bench *b) {
    return b->run == bst_bench_sgp4 || b->run == bst_bench_ephemeris;
}

static bool reads_scenario(const bst_bench *b) {
    return b->run == bst_bench_loop || b->run == bst_bench_sim_create ||
           b->run == bst_bench_sim_clone || b->run == bst_bench_env || b->run == bst_bench_envs ||
           b->run == bst_bench_study;
}

bst_status bst_bench_check_files(bst_ctx *ctx, bool tle, bool scenario, int count,
                                 char *const *names) {
    bool elements_read = false, scenario_read = false;
    for (int b = 0; b < BST_BENCHES; b++) {
        bool wanted = bst_bench_is_wanted(&bst_bench_list[b], count, names);
        elements_read |= wanted && reads_elements(&bst_bench_list[b]);
        scenario_read |= wanted && reads_scenario(&bst_bench_list[b]);
    }
    const char *unused = tle && !elements_read        ? "tle"
                         : scenario && !scenario_read ? "scenario"
                                                      : NULL;
    return unused ? bst_fail(ctx, BST_ERR_ARGUMENT,
                             "--%s has no effect on the benchmarks that are named: leave it out, "
                             "or see --help for those that read it",
                             unused)
                  : BST_OK;
}
