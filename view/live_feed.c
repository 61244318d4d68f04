#include "view/live_feed.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"
#include "sim/core/wall_clock.h"
#include "view/live_marks.h"
#include "view/live_pace.h"

/* Exposures of a sensor that wait for their detections and tracks. */
enum { WAITING = 4 };
/* A sensor counts as watched for so long after a request, s. */
static const double WATCHED_S = 1.0;

/* An exposure that is not complete. */
typedef struct waiting_exposure {
    bool used;
    int64_t id;
    /* truth and frame come in any order */
    bst_truth *truth; /* until the frame is there; malloc */
    bool has_frame;
    bst_frame_message frame;
    cJSON *node; /* NULL: truth or frame is not there yet */
    uint16_t *pixels;
    int width, height;
} waiting_exposure;

typedef struct feed_sensor {
    bst_camera camera;
    double watched_until; /* wall seconds */
    bst_view_pace pace;
    int64_t asked_id; /* exposure about which `due` was asked; -1: none */
    bool due;         /* it is shown */
    waiting_exposure waiting[WAITING];
    int64_t sequence;           /* of `ready`; 0: none yet */
    int64_t sent;               /* newest that a client has got */
    bst_view_live_frame *ready; /* NULL: none */
} feed_sensor;

struct bst_view_feed {
    pthread_mutex_t lock; /* of all below */
    pthread_cond_t changed;
    int64_t wakes;
    bool watched; /* a client has asked for a frame; read without the lock */
    bool every;   /* each frame is kept */
    double tick_rate_hz;
    bst_time epoch;
    int sensors;
    feed_sensor sensor[];
};

/* Takes the cameras of a scenario. */
static void take_cameras(bst_view_feed *feed, const bst_scenario *scenario) {
    const bst_observer_config *observers = scenario->observers.items;
    int count = 0;
    for (int o = 0; o < scenario->observers.count; o++) {
        const bst_sensor_config *sensors = observers[o].sensors.items;
        for (int s = 0; s < observers[o].sensors.count && count < feed->sensors; s++) {
            feed->sensor[count++].camera = sensors[s].camera;
        }
    }
}

bst_status bst_view_feed_create(bst_ctx *ctx, const bst_scenario *scenario, bst_view_feed **out) {
    const bst_observer_config *observers = scenario->observers.items;
    int count = 0;
    *out = NULL;
    for (int o = 0; o < scenario->observers.count; o++) {
        count += observers[o].sensors.count;
    }
    bst_view_feed *feed = calloc(1, sizeof *feed + (size_t)count * sizeof feed->sensor[0]);
    pthread_condattr_t clock;
    if (!feed || pthread_mutex_init(&feed->lock, NULL) != 0 || pthread_condattr_init(&clock) != 0) {
        free(feed);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the newest frames");
    }
    pthread_condattr_setclock(&clock, CLOCK_MONOTONIC);
    pthread_cond_init(&feed->changed, &clock);
    pthread_condattr_destroy(&clock);
    feed->tick_rate_hz = (double)scenario->tick_rate_hz;
    feed->epoch = scenario->epoch;
    feed->sensors = count;
    take_cameras(feed, scenario);
    for (int i = 0; i < count; i++) {
        feed->sensor[i].asked_id = -1;
    }
    *out = feed;
    return BST_OK;
}

static void empty(waiting_exposure *w) {
    free(w->truth);
    free(w->pixels);
    cJSON_Delete(w->node);
    *w = (waiting_exposure){.used = false};
}

void bst_view_feed_free(bst_view_feed *feed) {
    if (feed) {
        for (int i = 0; i < feed->sensors; i++) {
            for (int k = 0; k < WAITING; k++) {
                empty(&feed->sensor[i].waiting[k]);
            }
            bst_view_feed_release(feed->sensor[i].ready);
        }
        pthread_cond_destroy(&feed->changed);
        pthread_mutex_destroy(&feed->lock);
        free(feed);
    }
}

/* Makes an exposure the newest frame of its sensor. */
static void publish(bst_view_feed *feed, feed_sensor *s, waiting_exposure *w) {
    static const char *const lists[] = {"truth", "detections", "tracks"};
    for (size_t i = 0; w->node && i < sizeof lists / sizeof *lists; i++) {
        if (!cJSON_HasObjectItem(w->node, lists[i])) { /* it did not come in time */
            cJSON_AddArrayToObject(w->node, lists[i]);
        }
    }
    bst_view_live_frame *frame = w->node ? calloc(1, sizeof *frame) : NULL;
    char *json = frame ? cJSON_PrintUnformatted(w->node) : NULL;
    if (json) {
        *frame = (bst_view_live_frame){.sequence = ++s->sequence,
                                       .json = json,
                                       .pixels = w->pixels,
                                       .width = w->pixels ? w->width : 0,
                                       .height = w->pixels ? w->height : 0,
                                       .holders = 1};
        bst_view_feed_release(s->ready);
        s->ready = frame;
        w->pixels = NULL;
        pthread_cond_broadcast(&feed->changed);
    } else {
        free(frame);
    }
    empty(w);
}

static waiting_exposure *find(feed_sensor *s, int64_t id) {
    for (int k = 0; k < WAITING; k++) {
        if (s->waiting[k].used && s->waiting[k].id == id) {
            return &s->waiting[k];
        }
    }
    return NULL;
}

/* True if an exposure of which there is no message yet is shown: asked about once, as a message
 * that comes later makes no whole frame. Their numbers rise. */
static bool is_due(const bst_view_feed *feed, feed_sensor *s, int64_t id) {
    if (id > s->asked_id) {
        const double now = bst_wall_seconds();
        s->asked_id = id;
        bst_view_pace_adapt(&s->pace, now, bst_view_read_processors);
        /* none in the place of one that no page has got yet: it would be lost */
        s->due = s->sent >= s->sequence && bst_view_pace_take(&s->pace, now);
    }
    return feed->every || (s->due && id == s->asked_id);
}

/* The place of an exposure, which is new if there is none; in place of the oldest one if there is
 * no room. NULL: it is not shown. */
static waiting_exposure *place_of(bst_view_feed *feed, feed_sensor *s, int64_t id) {
    waiting_exposure *place = find(s, id);
    if (place || !is_due(feed, s, id)) {
        return place;
    }
    for (int k = 0; k < WAITING; k++) {
        waiting_exposure *w = &s->waiting[k];
        if (!place || (place->used && (!w->used || w->id < place->id))) {
            place = w;
        }
    }
    if (place->used) {
        publish(feed, s, place);
    }
    *place = (waiting_exposure){.used = true, .id = id};
    return place;
}

/* Describes an exposure when its truth is there, and its frame, or will not come. */
static void describe(const bst_view_feed *feed, const feed_sensor *s, waiting_exposure *w) {
    const bst_truth *t = w->truth;
    const bst_frame_message *frame = &w->frame;
    const double mid_s = 0.5 * (double)(t->start_tick + t->end_tick) / feed->tick_rate_hz;
    char utc[48];
    w->node = cJSON_CreateObject();
    bst_time_to_utc(bst_time_add(feed->epoch, mid_s), 3, utc, sizeof utc);
    cJSON_AddNumberToObject(w->node, "exposure_id", (double)w->id);
    cJSON_AddNumberToObject(w->node, "time_s", mid_s);
    cJSON_AddNumberToObject(w->node, "exposure_s",
                            (double)(t->end_tick - t->start_tick) / feed->tick_rate_hz);
    cJSON_AddStringToObject(w->node, "utc", utc);
    cJSON_AddNumberToObject(w->node, "binning", frame->binning > 1 ? frame->binning : 1);
    cJSON_AddBoolToObject(w->node, "dropped", t->dropped);
    bst_json_add_number(w->node, "gain_e_per_dn", s->camera.gain_e_per_dn);
    bst_json_add_number(w->node, "offset_dn", s->camera.offset_dn);
    bst_view_add_live_truth(w->node, t, frame, &s->camera);
    free(w->truth);
    w->truth = NULL;
}

/* Describes an exposure without a frame: dropped, or of the observation generator. */
static void describe_bare(const bst_view_feed *feed, const feed_sensor *s, waiting_exposure *w) {
    w->frame = (bst_frame_message){
        .window = {0, 0, (int)s->camera.width_px, (int)s->camera.height_px}, .binning = 1};
    describe(feed, s, w);
}

static void take_truth(bst_view_feed *feed, feed_sensor *s, const bst_truth *truth) {
    waiting_exposure *w = place_of(feed, s, truth->exposure_id);
    const size_t bytes = sizeof *truth + (size_t)truth->count * sizeof truth->items[0];
    if (!w || w->truth || w->node) {
        return;
    }
    w->truth = malloc(bytes);
    if (!w->truth) {
        empty(w);
        return;
    }
    memcpy(w->truth, truth, bytes);
    if (truth->dropped) {
        describe_bare(feed, s, w);
        publish(feed, s, w);
    } else if (w->has_frame) {
        describe(feed, s, w);
    }
}

static bst_status take_frame(bst_view_feed *feed, bst_ctx *ctx, feed_sensor *s,
                             const bst_frame_message *m) {
    waiting_exposure *w = m->frame ? place_of(feed, s, m->exposure_id) : NULL;
    const uint16_t *pixels;
    if (!w || w->has_frame || w->node) {
        return BST_OK;
    }
    BST_TRY(bst_frame_map(m->frame, ctx, &pixels));
    const size_t bytes = (size_t)m->frame->width * (size_t)m->frame->height * sizeof *pixels;
    w->pixels = malloc(bytes);
    if (w->pixels) {
        memcpy(w->pixels, pixels, bytes);
        w->width = m->frame->width;
        w->height = m->frame->height;
    }
    bst_frame_unmap(m->frame);
    w->has_frame = true;
    w->frame = *m;
    w->frame.frame = NULL;
    if (w->truth) {
        describe(feed, s, w);
    }
    return BST_OK;
}

/* Takes a message of a watched sensor. */
static bst_status take(bst_view_feed *feed, bst_ctx *ctx, feed_sensor *s, const char *channel,
                       const void *payload) {
    if (strcmp(channel, BST_CHANNEL_TRUTH) == 0) {
        take_truth(feed, s, payload);
    } else if (strcmp(channel, BST_CHANNEL_FRAME) == 0) {
        return take_frame(feed, ctx, s, payload);
    } else if (strcmp(channel, BST_CHANNEL_DETECTIONS) == 0) {
        const bst_detections *detections = payload;
        waiting_exposure *w = find(s, detections->exposure_id);
        if (w && !w->node && w->truth) {
            describe_bare(feed, s, w);
        }
        if (w && w->node && !cJSON_HasObjectItem(w->node, "detections")) {
            bst_view_add_live_detections(w->node, detections, &w->frame);
        }
    } else if (strcmp(channel, BST_CHANNEL_REGIONS_OF_INTEREST) == 0) {
        const bst_regions_of_interest *regions = payload;
        waiting_exposure *w = find(s, regions->exposure_id);
        if (w && w->node && !cJSON_HasObjectItem(w->node, "windows")) {
            bst_view_add_live_windows(w->node, regions, &w->frame);
        }
    } else if (strcmp(channel, BST_CHANNEL_TRACKS) == 0) {
        const bst_tracks *tracks = payload;
        waiting_exposure *w = find(s, tracks->exposure_id);
        if (w && w->node) {
            bst_view_add_live_tracks(w->node, tracks, &w->frame);
            publish(feed, s, w);
        }
    }
    return BST_OK;
}

bst_status bst_view_feed_message(void *user, bst_ctx *ctx, int sensor, const char *channel,
                                 const void *payload, int64_t tick) {
    bst_view_feed *feed = user;
    (void)tick;
    if (sensor >= feed->sensors || !__atomic_load_n(&feed->watched, __ATOMIC_RELAXED)) {
        return BST_OK;
    }
    bst_status status = BST_OK;
    pthread_mutex_lock(&feed->lock);
    feed_sensor *s = &feed->sensor[sensor];
    if (s->watched_until > 0.0) {
        if (bst_wall_seconds() < s->watched_until) {
            status = take(feed, ctx, s, channel, payload);
        } else {
            s->watched_until = 0.0;
            for (int k = 0; k < WAITING; k++) {
                empty(&s->waiting[k]);
            }
        }
    }
    pthread_mutex_unlock(&feed->lock);
    return status;
}

void bst_view_feed_release(const bst_view_live_frame *frame) {
    bst_view_live_frame *held = (bst_view_live_frame *)frame;
    if (held && __atomic_sub_fetch(&held->holders, 1, __ATOMIC_ACQ_REL) == 0) {
        free(held->json);
        free(held->pixels);
        free(held);
    }
}

const bst_view_live_frame *bst_view_feed_get(bst_view_feed *feed, int64_t sensor, int64_t after,
                                             double wait_s) {
    struct timespec until;
    bst_view_live_frame *found = NULL;
    if (sensor < 0 || sensor >= feed->sensors) {
        return NULL;
    }
    clock_gettime(CLOCK_MONOTONIC, &until);
    int64_t nanoseconds = until.tv_nsec + (int64_t)(1e9 * wait_s);
    until.tv_sec += nanoseconds / 1000000000;
    until.tv_nsec = nanoseconds % 1000000000;
    pthread_mutex_lock(&feed->lock);
    feed_sensor *s = &feed->sensor[sensor];
    __atomic_store_n(&feed->watched, true, __ATOMIC_RELAXED);
    const int64_t wakes = feed->wakes;
    s->sent = after > s->sent ? after : s->sent;
    s->watched_until = bst_wall_seconds() + WATCHED_S;
    while (s->sequence <= after && feed->wakes == wakes &&
           pthread_cond_timedwait(&feed->changed, &feed->lock, &until) == 0) {
    }
    if (s->ready && s->sequence > after) {
        found = s->ready;
        s->sent = s->sequence;
        __atomic_add_fetch(&found->holders, 1, __ATOMIC_RELAXED);
    }
    pthread_mutex_unlock(&feed->lock);
    return found;
}

void bst_view_feed_wake(bst_view_feed *feed) {
    pthread_mutex_lock(&feed->lock);
    feed->wakes++;
    pthread_cond_broadcast(&feed->changed);
    pthread_mutex_unlock(&feed->lock);
}

void bst_view_feed_set_every(bst_view_feed *feed, bool every) {
    pthread_mutex_lock(&feed->lock);
    feed->every = every;
    pthread_mutex_unlock(&feed->lock);
}

void bst_view_feed_restart(bst_view_feed *feed, const bst_scenario *scenario) {
    pthread_mutex_lock(&feed->lock);
    take_cameras(feed, scenario);
    for (int i = 0; i < feed->sensors; i++) {
        for (int k = 0; k < WAITING; k++) {
            empty(&feed->sensor[i].waiting[k]);
        }
        feed->sensor[i].asked_id = -1;
    }
    pthread_mutex_unlock(&feed->lock);
}
