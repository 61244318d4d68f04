#include "sim/run/run_losses.h"

#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/core/text.h"

/* A kind of loss of a sensor: an amount in some frames, or (noun NULL) frames. */
typedef struct kind {
    const char *key, *frames_key;
    size_t amount, frames;
    bst_run_severity severity;
    const char *what, *one, *many;
    const char *sql; /* query of the total amount and the number of frames */
} kind;

#define AT(member) offsetof(bst_run_losses, member)

/* The tables do not have it: an interrupted run without a manifest shows none. */
#define NOT_RECORDED "SELECT 0, 0 WHERE ?1 >= 0"

static const kind kinds[] = {
    {"detections", "detection_frames", AT(detections), AT(detection_frames), BST_SEVERITY_PROBLEM,
     "cut to imgproc's capacity", "detection", "detections",
     "SELECT sum(lost), sum(lost > 0) FROM detection_frames WHERE sensor = ?1"},
    {"tracks", "track_frames", AT(tracks), AT(track_frames), BST_SEVERITY_PROBLEM,
     "cut to the room for tracks", "track", "tracks",
     "SELECT sum(lost), sum(lost > 0) FROM track_frames WHERE sensor = ?1"},
    {"smoothed_tracks", "smoothed_track_frames", AT(smoothed_tracks), AT(smoothed_track_frames),
     BST_SEVERITY_PROBLEM, "cut to the room for smoothed tracks", "track", "tracks", NOT_RECORDED},
    {"identities", "identity_frames", AT(identities), AT(identity_frames), BST_SEVERITY_WARNING,
     "left out of comparisons with the catalogue (64 tracks, 64 objects)", "track or object",
     "tracks or objects", NOT_RECORDED},
    {"truth", "truth_frames", AT(truth), AT(truth_frames), BST_SEVERITY_WARNING,
     "cut to truth_capacity, labels are missing", "source of the truth", "sources of the truth",
     "SELECT sum(lost), sum(lost > 0) FROM exposures WHERE sensor = ?1"},
    {NULL, "dropped_frames", 0, AT(dropped_frames), BST_SEVERITY_WARNING, "lost on their way", NULL,
     NULL, "SELECT 0, sum(dropped) FROM exposures WHERE sensor = ?1"},
    {NULL, "no_attitude_frames", 0, AT(no_attitude_frames), BST_SEVERITY_WARNING,
     "no attitude from stars that is good enough to measure directions with", NULL, NULL,
     "SELECT 0, sum(attitude_valid = 0) FROM track_frames WHERE sensor = ?1"},
    {NULL, "earth_frames", 0, AT(earth_frames), BST_SEVERITY_WARNING,
     "the Earth covers part of the image", NULL, NULL,
     "SELECT 0, sum(earth_fraction > 0) FROM exposures WHERE sensor = ?1"},
    {NULL, "moon_frames", 0, AT(moon_frames), BST_SEVERITY_WARNING,
     "the Moon covers part of the image", NULL, NULL,
     "SELECT 0, sum(moon_fraction > 0) FROM exposures WHERE sensor = ?1"},
    {NULL, "sun_frames", 0, AT(sun_frames), BST_SEVERITY_WARNING,
     "the Sun covers part of the image", NULL, NULL,
     "SELECT 0, sum(sun_fraction > 0) FROM exposures WHERE sensor = ?1"},
    {NULL, "no_stars_frames", 0, AT(no_stars_frames), BST_SEVERITY_NOTE, "no star identified", NULL,
     NULL, "SELECT 0, sum(stars_identified = 0) FROM detection_frames WHERE sensor = ?1"},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

/* Counter of lost data at a byte offset of the struct. */
static int64_t get(const bst_run_losses *losses, size_t at) {
    int64_t value;
    memcpy(&value, (const char *)losses + at, sizeof value);
    return value;
}

/* Sets the counter at a byte offset of the struct. */
static void set(bst_run_losses *losses, size_t at, int64_t value) {
    memcpy((char *)losses + at, &value, sizeof value);
}

void bst_run_losses_report(const bst_run_losses *losses, bst_run_loss_fn fn, void *user) {
    for (int k = 0; k < KINDS; k++) {
        const kind *loss = &kinds[k];
        int64_t frames = get(losses, loss->frames);
        char text[300], amount[64], of[64];
        if (frames == 0) {
            continue;
        }
        bst_text_of_count(of, losses->frames, "frame", "frames");
        if (loss->one) {
            bst_text_of_count(amount, get(losses, loss->amount), loss->one, loss->many);
            snprintf(text, sizeof text, "%s: %s in %" PRId64 " of %s", loss->what, amount, frames,
                     of);
        } else {
            snprintf(text, sizeof text, "%s: %" PRId64 " of %s", loss->what, frames, of);
        }
        fn(user, loss->severity, text);
    }
}

void bst_run_losses_report_counter(const char *name, int64_t count, bst_run_loss_fn fn,
                                   void *user) {
    static const char *const left_out[] = {"link_messages",       "detections_overflow",
                                           "tracker_overflow",    "truth_overflow",
                                           "tracker_no_attitude", "frame_without_stars"};
    static const struct {
        const char *name;
        bst_run_severity severity;
        const char *what, *one, *many;
    } known[] = {
        {"queue_overflow", BST_SEVERITY_PROBLEM, "overwritten before they were read", "message",
         "messages"},
        {"stale_input", BST_SEVERITY_WARNING, "an input older than it may be was read", "time",
         "times"},
        {"tracker_no_navigation", BST_SEVERITY_WARNING, "no navigation telemetry", "frame",
         "frames"},
        {"tracker_no_catalogue", BST_SEVERITY_WARNING,
         "tracks were not compared with the catalogue: the spacecraft's place is not known",
         "frame", "frames"},
        {"tracker_frame_ignored", BST_SEVERITY_WARNING, "came to the tracker twice or out of order",
         "frame", "frames"},
        {"sensor_command_ignored", BST_SEVERITY_WARNING, "ignored", "command to a sensor",
         "commands to sensors"},
        {"target_state_refused", BST_SEVERITY_WARNING, "refused", "state or attitude of a target",
         "states or attitudes of targets"},
        {"frames_not_sent", BST_SEVERITY_WARNING, "not sent to the link's peer", "frame", "frames"},
        {"axis_stuck", BST_SEVERITY_PROBLEM, "an axis of a mount stuck", "time", "times"},
        {"wheels_saturated", BST_SEVERITY_WARNING, "reaction wheels saturated", "time", "times"},
        {"star_trackers_blind", BST_SEVERITY_WARNING, "no star tracker saw stars", "time", "times"},
        {"bad_pixels_overflow", BST_SEVERITY_WARNING,
         "the learned bad-pixel map had no room (bad_pixel_learning.capacity)", "frame", "frames"},
        {"bad_pixels_sky_at_rest", BST_SEVERITY_NOTE,
         "pixels look bad that cannot be learned, because the sky does not move over them", "frame",
         "frames"},
        {"tolerance_missed", BST_SEVERITY_WARNING,
         "the image's predicted error (error_sigma) is above fidelity.tolerance_sigma", "frame",
         "frames"},
        {"nodes_bounded", BST_SEVERITY_NOTE,
         "the tolerance asks for more nodes than fidelity.max_nodes allows: the image is coarser",
         "frame", "frames"},
        {"saturated", BST_SEVERITY_NOTE, "full pixels in the image", "frame", "frames"},
    };
    char text[300], amount[64];
    if (count <= 0) {
        return;
    }
    for (size_t k = 0; k < sizeof left_out / sizeof *left_out; k++) {
        if (strcmp(left_out[k], name) == 0) {
            return;
        }
    }
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        if (strcmp(known[k].name, name) == 0) {
            bst_text_of_count(amount, count, known[k].one, known[k].many);
            snprintf(text, sizeof text, "%s: %s (%s)", known[k].what, amount, name);
            fn(user, known[k].severity, text);
            return;
        }
    }
    /* counter of a plug-in or of the link */
    snprintf(text, sizeof text, "%.200s: counted %s", name,
             bst_text_of_count(amount, count, "time", "times"));
    fn(user, BST_SEVERITY_WARNING, text);
}

void bst_run_losses_print(void *user, bst_run_severity severity, const char *text) {
    static const char *const words[] = {"problem", "warning", "note"};
    bst_run_losses_printer *p = user;
    if (!p->begun) {
        puts("losses");
        p->begun = true;
    }
    printf("  %s: %s%s%s\n", words[severity], p->sensor ? p->sensor : "", p->sensor ? ": " : "",
           text);
}

void bst_run_losses_add(cJSON *manifest, const char *sensor, const bst_run_losses *losses) {
    cJSON *all = cJSON_GetObjectItemCaseSensitive(manifest, "losses");
    if (!all) {
        all = cJSON_AddObjectToObject(manifest, "losses");
    }
    cJSON *node = cJSON_AddObjectToObject(all, sensor);
    cJSON_AddNumberToObject(node, "frames", (double)losses->frames);
    for (int k = 0; k < KINDS; k++) {
        if (get(losses, kinds[k].frames) == 0) {
            continue;
        }
        if (kinds[k].key) {
            cJSON_AddNumberToObject(node, kinds[k].key, (double)get(losses, kinds[k].amount));
        }
        cJSON_AddNumberToObject(node, kinds[k].frames_key, (double)get(losses, kinds[k].frames));
    }
}

/* Count stored in the manifest; 0: none or invalid. */
static int64_t count_of(const cJSON *node, const char *key) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(node, key);
    return cJSON_IsNumber(item) && item->valuedouble >= 0.0 && item->valuedouble < 1e15
               ? (int64_t)item->valuedouble
               : 0;
}

void bst_run_losses_read(const bst_run_reader *run, const char *sensor, int64_t index,
                         bst_run_losses *out) {
    const cJSON *all = cJSON_GetObjectItemCaseSensitive(bst_run_reader_manifest(run), "losses");
    const cJSON *node = cJSON_GetObjectItemCaseSensitive(all, sensor);
    *out = (bst_run_losses){.frames = count_of(node, "frames")};
    if (!node) {
        static const char *const counts[] = {
            "SELECT count(*) FROM exposures WHERE sensor = ?1",
            "SELECT count(*) FROM detection_frames WHERE sensor = ?1"};
        for (int k = 0; k < 2 && out->frames == 0; k++) {
            out->frames = bst_run_reader_int(run, counts[k], index, 0);
        }
    }
    for (int k = 0; k < KINDS; k++) {
        int64_t amount = 0, frames = 0;
        if (node) {
            amount = kinds[k].key ? count_of(node, kinds[k].key) : 0;
            frames = count_of(node, kinds[k].frames_key);
        } else {
            bst_ctx unheard = {0};
            bst_io_rows *rows;
            bool more;
            if (bst_io_rows_open(&unheard, run, kinds[k].sql, index, 0, &rows) == BST_OK) {
                if (bst_io_rows_next(&unheard, rows, &more) == BST_OK && more) {
                    amount = bst_io_rows_int(rows, 0);
                    frames = bst_io_rows_int(rows, 1);
                }
                bst_io_rows_close(rows);
            }
        }
        if (kinds[k].key) {
            set(out, kinds[k].amount, amount);
        }
        set(out, kinds[k].frames, frames);
    }
}
