#include "sim/run/run_saving.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cjson/cJSON.h>

#include "boresight/state.h"
#include "sim/engine/simulation_state.h"
#include "sim/io/run_files.h"
#include "sim/run/run_internal.h"

struct bst_run_restored {
    const char *path;
    const char *bytes;
    char *own; /* `bytes` of a file; else NULL */
    size_t size;
    bst_state_head head;
    bst_archive *archive; /* of the recording, after the simulation is restored */
};

/* ---- the state from which a run begins ---- */

/* Restores the simulation; the archive then continues with the recording. */
static bst_status restore(bst_ctx *ctx, bst_simulation *sim, void *user) {
    bst_run_restored *r = user;
    BST_TRY(bst_archive_open(ctx, r->bytes + sizeof r->head, (size_t)r->head.bytes, &r->archive));
    bst_status status = bst_simulation_archive(ctx, sim, r->archive, BST_STATE_ALL);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", r->path);
}

void bst_run_restored_free(bst_run_restored *r) {
    if (r) {
        bst_archive_free(r->archive);
        free(r->own);
        free(r);
    }
}

/* Checks that the state of a recording lies in the unfinished folder of the run `out`. */
static bst_status check_folder(bst_ctx *ctx, const char *path, const char *out) {
    char expected[4200];
    struct stat given, there;
    size_t length = bst_run_folder_length(out);
    snprintf(expected, sizeof expected, "%.*s.partial/" BST_RUN_STATE, (int)length, out);
    if (stat(path, &given) == 0 && stat(expected, &there) == 0 && given.st_ino == there.st_ino &&
        given.st_dev == there.st_dev) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_ARGUMENT,
                    "the saved state is that of an interrupted run and goes on in that run's own "
                    "folder: it is not %s; leave it there, and give --out RUN for RUN.partial",
                    expected);
}

/* Checks that the state fits the scenario and the folder. */
static bst_status check_state(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                              const bst_run_restored *r) {
    const double rate = (double)scenario->tick_rate_hz;
    if (r->head.run != (uint64_t)scenario->run) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the saved state is that of run %llu of the scenario, this is run %lld: "
                        "give --run-number %llu",
                        (unsigned long long)r->head.run, (long long)scenario->run,
                        (unsigned long long)r->head.run);
    }
    if (r->head.tick >= scenario->duration_ticks) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "the saved state is at %.9g s, the scenario ends at %.9g s: give a longer "
                        "--duration",
                        (double)r->head.tick / rate, scenario->duration_s);
    }
    return r->head.recording ? check_folder(ctx, r->path, out) : BST_OK;
}

/* Reads and checks the state of saving->restore. */
static bst_status read_state(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                             bst_run_restored *r) {
    char digest[BST_SHA256_TEXT];
    BST_TRY(bst_scenario_digest(ctx, scenario, digest));
    BST_TRY(bst_state_file_read(ctx, r->path, &r->own, &r->size));
    r->bytes = r->own;
    bst_status status = bst_state_head_read(ctx, r->bytes, r->size, digest, &r->head);
    if (status == BST_OK) {
        status = check_state(ctx, scenario, out, r);
    }
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "%s", r->path);
}

/* Checks that the run can be saved or begin from a state at all. */
static bst_status check_options(bst_ctx *ctx, const bst_scenario *scenario,
                                const bst_run_saving *saving, bool replay) {
    const char *option = saving->restore ? "restore" : "save-every";
    if (!saving->restore && saving->save_every_s == 0.0) {
        return BST_OK;
    }
    if (replay) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s: a replay begins at the start of its run and is not saved: leave "
                        "--replay or --%s out",
                        option, option);
    }
    if (scenario->pacing.mode != BST_PACING_LOCKSTEP) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "--%s: a run that follows the clock is not saved (found pacing \"%s\"; "
                        "allowed: lockstep)",
                        option, bst_pacing_mode_name(scenario->pacing.mode));
    }
    return BST_OK;
}

bst_status bst_run_restored_read(bst_ctx *ctx, const bst_scenario *scenario,
                                 const bst_run_saving *saving, const char *out, bool replay,
                                 bst_simulation_options *options, bst_run_restored **restored) {
    *restored = NULL;
    BST_TRY(check_options(ctx, scenario, saving, replay));
    if (!saving->restore) {
        return BST_OK;
    }
    bst_run_restored *r = calloc(1, sizeof *r);
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a saved state");
    }
    r->path = saving->restore;
    bst_status status = read_state(ctx, scenario, out, r);
    if (status != BST_OK) {
        bst_run_restored_free(r);
        return status;
    }
    options->restore = restore;
    options->restore_user = r;
    *restored = r;
    return BST_OK;
}

bst_status bst_run_restored_take(bst_ctx *ctx, const void *bytes, size_t size,
                                 bst_simulation_options *options, bst_run_restored **restored) {
    bst_run_restored *r = calloc(1, sizeof *r);
    *restored = NULL;
    if (!r) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a saved state");
    }
    assert(size >= sizeof r->head);
    r->path = "the state of the run";
    r->bytes = bytes;
    r->size = size;
    memcpy(&r->head, bytes, sizeof r->head);
    options->restore = restore;
    options->restore_user = r;
    *restored = r;
    return BST_OK;
}

/* ---- the plan of a run ---- */

/* Ticks of an option's time. */
static bst_status ticks_of(const bst_run_execution *run, const char *option, double seconds,
                           int64_t *out) {
    bst_status status = bst_seconds_to_ticks(run->ctx, run->scenario->tick_rate_hz, seconds, out);
    return status == BST_OK ? BST_OK : bst_fail_prefix(run->ctx, BST_ERR_ARGUMENT, "--%s", option);
}

bool bst_run_resumes(const bst_run_request *request) {
    return request->restored && request->restored->head.recording;
}

bst_status bst_run_plan(bst_run_execution *run, const bst_run_request *request) {
    const bst_run_saving none = {.restore = NULL};
    const bst_run_saving *saving = request->saving ? request->saving : &none;
    const double rate = (double)run->scenario->tick_rate_hz;
    run->start_tick = request->restored ? request->restored->head.tick : 0;
    run->begin_tick = bst_run_resumes(request) ? 0 : run->start_tick;
    run->end_tick = run->scenario->duration_ticks;
    if (saving->until_s > 0.0) {
        int64_t until;
        BST_TRY(ticks_of(run, "until", saving->until_s, &until));
        if (until <= run->start_tick || until > run->end_tick) {
            return bst_fail(run->ctx, BST_ERR_ARGUMENT,
                            "--until %.9g: allowed is more than %.9g s, where the run begins, up "
                            "to %.9g s, where the scenario ends (see --duration)",
                            saving->until_s, (double)run->start_tick / rate,
                            run->scenario->duration_s);
        }
        run->end_tick = until;
    }
    if (saving->save_every_s > 0.0) {
        BST_TRY(ticks_of(run, "save-every", saving->save_every_s, &run->save_ticks));
        if (run->save_ticks < 1) {
            return bst_fail(run->ctx, BST_ERR_ARGUMENT,
                            "--save-every %.9g: is less than a tick of %.9g s",
                            saving->save_every_s, 1.0 / rate);
        }
        /* a module that cannot be saved is reported before anything is written */
        bst_archive *archive;
        BST_TRY(bst_archive_create(run->ctx, &archive));
        bst_status status = bst_simulation_archive(run->ctx, run->sim, archive, BST_STATE_ALL);
        bst_archive_free(archive);
        return status == BST_OK ? BST_OK : bst_fail_prefix(run->ctx, status, "--save-every");
    }
    return BST_OK;
}

/* ---- the recording in a saved state ---- */

/* Digest of what is recorded. */
static bst_status digest_record(bst_ctx *ctx, const bst_scenario *scenario,
                                char digest[BST_SHA256_TEXT]) {
    cJSON *echo = bst_scenario_echo(scenario);
    char *text =
        echo ? cJSON_PrintUnformatted(cJSON_GetObjectItemCaseSensitive(echo, "record")) : NULL;
    cJSON_Delete(echo);
    if (!text) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a saved state");
    }
    bst_sha256_text(text, strlen(text), digest);
    cJSON_free(text);
    return BST_OK;
}

/* Archives what the manifest says of the run so far. */
static bst_status archive_run(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive) {
    char digest[BST_SHA256_TEXT], saved[BST_SHA256_TEXT];
    BST_TRY(digest_record(ctx, run->scenario, digest));
    memcpy(saved, digest, sizeof saved);
    double wall_s = bst_archive_is_restoring(archive) ? 0.0 : bst_run_wall_s(run);
    int64_t warnings = (int64_t)run->ctx->warnings + run->hooks.warnings;
    BST_ARCHIVE(archive, saved);
    BST_ARCHIVE(archive, run->begin_tick);
    BST_ARCHIVE(archive, wall_s);
    BST_ARCHIVE(archive, warnings);
    if (bst_archive_is_restoring(archive)) {
        if (memcmp(saved, digest, sizeof saved) != 0) {
            return bst_fail(ctx, BST_ERR_STATE,
                            "/record is not that of the interrupted run: give its overrides");
        }
        run->earlier_s = wall_s;
        run->ctx->warnings = (unsigned)warnings; /* the same ones came again before this point */
    }
    return BST_OK;
}

static bst_status archive_tables(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive) {
    return bst_run_archive(ctx, run->store, archive);
}

static bst_status archive_recorder(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive) {
    return bst_recorder_archive(ctx, run->recorder, archive);
}

static bst_status archive_sightings(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive) {
    (void)ctx;
    BST_TRY(bst_run_sightings_archive(run->sightings, archive));
    return bst_run_custody_archive(run->custody, archive);
}

/* Archives selection, evaluation and pictures of each sensor. */
static bst_status archive_sensors(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive) {
    (void)ctx;
    for (int i = 0; i < run->sensor_count; i++) {
        bst_run_sensor_watch *sensor = &run->sensors[i];
        sensor->channel_count =
            bst_archive_count(archive, sensor->channel_count, BST_RUN_WATCHED_CHANNELS);
        for (int c = 0; c < sensor->channel_count; c++) {
            bst_run_watched_archive(&sensor->channels[c], archive);
            if (bst_archive_is_restoring(archive)) {
                const bst_run_pixels pixels = bst_run_pixels_of(run, sensor);
                bst_run_watch_again(&sensor->channels[c], run->recorder, &pixels);
            }
        }
        bst_loop_summary_archive(sensor->summary, archive);
        BST_TRY(bst_run_metrics_archive(sensor->metrics, archive));
        BST_TRY(sensor->pictures ? bst_run_pictures_archive(sensor->pictures, archive) : BST_OK);
    }
    return BST_OK;
}

/* Archives the recording. */
static bst_status archive_recording(bst_ctx *ctx, void *user, bst_archive *archive) {
    static const struct {
        const char *name;
        bst_status (*part)(bst_ctx *ctx, bst_run_execution *run, bst_archive *archive);
    } parts[] = {{"recording", archive_run},
                 {"tables", archive_tables},
                 {"recorder", archive_recorder},
                 {"sightings", archive_sightings},
                 {"sensors", archive_sensors}};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        BST_TRY(bst_archive_begin(ctx, archive, parts[i].name));
        bst_status status = parts[i].part(ctx, user, archive);
        bst_ctx ending = *ctx;
        bst_status ended = bst_archive_end(status == BST_OK ? ctx : &ending, archive);
        BST_TRY(status == BST_OK ? ended : status);
    }
    return BST_OK;
}

bst_status bst_run_resume(bst_run_execution *run, bst_run_restored *restored) {
    /* written at the interrupt; they belong to its end */
    static const char *const endings[] = {"manifest.json", "quicklook.png", "pointing.png"};
    bst_status status = archive_recording(run->ctx, run, restored->archive);
    for (size_t i = 0; status == BST_OK && i < sizeof endings / sizeof *endings; i++) {
        char path[4200];
        BST_TRY(bst_run_file(run->ctx, run->store, endings[i], path, sizeof path));
        if (unlink(path) != 0 && errno != ENOENT) {
            return bst_fail(run->ctx, BST_ERR_IO, "%s: cannot be removed: %s", path,
                            strerror(errno));
        }
    }
    return status == BST_OK ? BST_OK : bst_fail_prefix(run->ctx, status, "%s", restored->path);
}

/* ---- stepping ---- */

/* Saves the state of simulation and recording to memory. `tick`: modules due earlier have stepped.
 */
static bst_status save_bytes(bst_run_execution *run, bst_ctx *ctx, int64_t tick, void **bytes,
                             size_t *size) {
    char digest[BST_SHA256_TEXT];
    BST_TRY(bst_scenario_digest(ctx, run->scenario, digest));
    const bst_state_origin origin = {.digest = digest,
                                     .seed = run->scenario->seed,
                                     .tick = tick,
                                     .recording = archive_recording,
                                     .user = run};
    return bst_simulation_save(ctx, run->sim, &origin, bytes, size);
}

/* Saves the state to the run's folder. */
static bst_status save(bst_run_execution *run, bst_ctx *ctx, int64_t tick) {
    char path[4200];
    void *bytes;
    size_t size;
    BST_TRY(bst_run_file(ctx, run->store, BST_RUN_STATE, path, sizeof path));
    BST_TRY(save_bytes(run, ctx, tick, &bytes, &size));
    bst_status status = bst_state_file_write(ctx, path, bytes, size);
    free(bytes);
    return status;
}

/* Saves the state of an interrupted run; the message gets how it goes on. */
static void save_interrupted(bst_run_execution *run) {
    bst_ctx saving = *run->ctx;
    int64_t tick = bst_engine_tick(bst_simulation_engine(run->sim)) + 1;
    if (save(run, &saving, tick) != BST_OK) {
        bst_log(run->ctx, BST_LOG_WARNING, "the state at the interrupt is not saved: %s",
                saving.message);
        return;
    }
    bst_status status =
        bst_fail(run->ctx, BST_ERR_INTERRUPTED, "%s; --restore %.300s/" BST_RUN_STATE " goes on",
                 saving.message, bst_run_folder(run->store));
    (void)status; /* that of the run already */
}

/* Steps as the steering says. */
static bst_status advance_steered(bst_run_execution *run) {
    const bst_run_steering *steering = run->steering;
    bst_engine *engine = bst_simulation_engine(run->sim);
    bst_status status = BST_OK;
    int64_t tick = run->start_tick;
    while (status == BST_OK && tick < run->end_tick) {
        int64_t until = run->end_tick;
        bst_run_wall_clock_stop(run->wall_clock); /* a pause, or a rate that was chosen */
        bst_run_action action = steering->next(steering->user, tick, &until);
        bst_run_wall_clock_go(run->wall_clock);
        if (action == BST_RUN_END) {
            run->end_tick = tick;
        } else if (action == BST_RUN_ADVANCE) {
            until = until < run->end_tick ? until : run->end_tick;
            status = bst_engine_advance(run->ctx, engine, until);
            tick = until;
        } else {
            void *bytes;
            size_t size;
            status = save_bytes(run, run->ctx, tick, &bytes, &size);
            if (status == BST_OK) {
                steering->saved(steering->user, tick, bytes, size);
                run->part_ended = action == BST_RUN_PART;
            }
            if (run->part_ended) {
                return bst_fail(run->ctx, BST_ERR_INTERRUPTED, "a part of the run has ended");
            }
        }
    }
    if (status != BST_OK && status != BST_ERR_INTERRUPTED) {
        return status;
    }
    bst_ctx finishing = *run->ctx;
    bst_status finished = bst_engine_finish(&finishing, engine);
    if (finished != BST_OK) {
        *run->ctx = finishing;
        return finished;
    }
    return status;
}

bst_status bst_run_advance(bst_run_execution *run) {
    bst_engine *engine = bst_simulation_engine(run->sim);
    if (run->steering && run->steering->next) {
        return advance_steered(run);
    }
    if (run->save_ticks == 0) {
        return bst_engine_run(run->ctx, engine, run->end_tick);
    }
    bst_status status = BST_OK;
    for (int64_t tick = run->start_tick; status == BST_OK && tick < run->end_tick;) {
        int64_t next = (tick / run->save_ticks + 1) * run->save_ticks;
        tick = next < run->end_tick ? next : run->end_tick;
        status = bst_engine_advance(run->ctx, engine, tick);
        if (status == BST_OK && tick < run->end_tick) {
            status = save(run, run->ctx, tick);
        }
    }
    if (status == BST_ERR_INTERRUPTED) {
        save_interrupted(run);
    }
    if (status == BST_OK || status == BST_ERR_INTERRUPTED) {
        bst_ctx finishing = *run->ctx;
        bst_status finished = bst_engine_finish(&finishing, engine);
        if (finished != BST_OK) {
            *run->ctx = finishing;
            return finished;
        }
    }
    return status;
}
