/* Commands of a live run. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/core/json_member.h"
#include "sim/core/wall_clock.h"
#include "view/live_internal.h"

static const char *const words[] = {"pause",  "run",    "step", "save", "end",
                                    "rewind", "branch", "set",  "burn"};

static const char *word_of(const cJSON *command) {
    const char *word = cJSON_GetStringValue(bst_json_member(command, "do"));
    for (size_t i = 0; word && i < sizeof words / sizeof *words; i++) {
        if (strcmp(word, words[i]) == 0) {
            return words[i];
        }
    }
    return NULL;
}

bool bst_view_live_command(bst_view_live *live, const cJSON *command) {
    bool taken = false;
    if (!word_of(command) || !live->parts) {
        return false;
    }
    pthread_mutex_lock(&live->lock);
    if (live->command_count < BST_VIEW_LIVE_COMMANDS) {
        cJSON *copy = cJSON_Duplicate(command, true);
        taken = copy != NULL;
        if (taken) {
            live->commands[live->command_count++] = copy;
            pthread_cond_broadcast(&live->commanded);
        }
    }
    pthread_mutex_unlock(&live->lock);
    return taken;
}

void bst_view_live_anchor(bst_view_live *live) {
    live->anchor_s = live->speed_s = live->asked_s = bst_wall_seconds();
    live->anchor_tick = live->speed_tick = live->tick;
    live->speed = 0.0;
}

const bst_view_state *bst_view_live_find(const bst_view_live *live, int64_t id) {
    for (int i = 0; i < live->state_count; i++) {
        if (live->states[i].id == id) {
            return &live->states[i];
        }
    }
    return NULL;
}

static double number_of(const cJSON *command, const char *key, double otherwise) {
    const cJSON *item = bst_json_member(command, key);
    return cJSON_IsNumber(item) && isfinite(item->valuedouble) ? item->valuedouble : otherwise;
}

static void refuse(bst_view_live *live, const char *why) {
    snprintf(live->message, sizeof live->message, "%s", why);
}

/* Adds a change now. True: the run begins another part with it. */
static bool change(bst_view_live *live, int64_t tick, const char *set) {
    if (!set) {
        refuse(live, "a change is \"/json/pointer=value\"");
        return false;
    }
    if (bst_run_parts_change(&live->ctx, live->parts, tick, set) != BST_OK) {
        refuse(live, live->ctx.message);
        return false;
    }
    live->why = "change";
    return true;
}

/* Number of an object in the scenario's list; -1: none. */
static int find_object(const cJSON *objects, const char *name) {
    for (int i = 0; name && i < cJSON_GetArraySize(objects); i++) {
        const char *own =
            cJSON_GetStringValue(bst_json_member(cJSON_GetArrayItem(objects, i), "name"));
        if (own && strcmp(own, name) == 0) {
            return i;
        }
    }
    return -1;
}

/* Adds a burn of an object to those that it has. It begins at the next tick. */
static bool burn(bst_view_live *live, int64_t tick, const cJSON *command) {
    cJSON *document = bst_run_parts_document(live->parts, tick);
    const cJSON *objects = bst_json_member(bst_json_member(document, "world"), "objects");
    const char *name = cJSON_GetStringValue(bst_json_member(command, "object"));
    const int object = find_object(objects, name);
    const cJSON *dv = bst_json_member(command, "dv_rtn_mps");
    bool done = false;
    if (object < 0 || cJSON_GetArraySize(dv) != 3) {
        refuse(live, "a burn needs the name of one of /world/objects and three components in m/s");
    } else {
        const cJSON *had = bst_json_member(cJSON_GetArrayItem(objects, object), "burns");
        cJSON *burns = cJSON_IsArray(had) ? cJSON_Duplicate(had, true) : cJSON_CreateArray();
        cJSON *node = cJSON_CreateObject();
        cJSON_AddNumberToObject(node, "time_s", (double)(tick + 1) / live->tick_rate_hz);
        cJSON_AddItemToObject(node, "dv_rtn_mps", cJSON_Duplicate(dv, true));
        cJSON_AddItemToArray(burns, node);
        char *list = cJSON_PrintUnformatted(burns), set[1024];
        const int bytes =
            snprintf(set, sizeof set, "/world/objects/%d/burns=%s", object, list ? list : "");
        if (bytes < 0 || (size_t)bytes >= sizeof set) {
            refuse(live, "the object has too many burns for a change");
        } else {
            done = change(live, tick, set);
        }
        cJSON_free(list);
        cJSON_Delete(burns);
    }
    cJSON_Delete(document);
    return done;
}

/* Goes to a saved state: in this run, or in a branch. */
static bool go_to(bst_view_live *live, const cJSON *command, bool branch) {
    const bst_view_state *state =
        bst_view_live_find(live, bst_json_whole(bst_json_member(command, "state"), 0));
    if (!state) {
        refuse(live, "there is no such saved state");
        return false;
    }
    if (live->ended && !branch) {
        refuse(live, "the run is complete: branch from the state instead");
        return false;
    }
    live->go_to = state->id;
    live->branching = branch;
    live->why = "automatic";
    return true;
}

static void set_pace(bst_view_live *live, const cJSON *command, const char *word) {
    live->settled = false;
    live->paused = strcmp(word, "pause") == 0;
    live->steps = strcmp(word, "step") == 0
                      ? (int64_t)fmin(fmax(number_of(command, "frames", 1.0), 1.0), 1e6)
                      : 0;
    if (strcmp(word, "run") == 0) {
        live->rate = fmin(fmax(number_of(command, "rate", live->rate), 0.0), 1e6);
    }
    live->frames_then = __atomic_load_n(&live->frames, __ATOMIC_RELAXED);
    live->chunk_ticks = live->period_ticks;
    bst_view_feed_set_every(live->feed, live->steps > 0);
    bst_view_live_anchor(live);
}

bool bst_view_live_obey(bst_view_live *live, int64_t tick, bst_run_action *action) {
    cJSON *command = live->commands[0];
    const char *word = word_of(command);
    bool acts = false;
    memmove(live->commands, live->commands + 1,
            (size_t)--live->command_count * sizeof *live->commands);
    live->message[0] = '\0';
    live->obeyed++;
    if (strcmp(word, "set") == 0 || strcmp(word, "burn") == 0) {
        acts = !live->ended &&
               (*word == 's'
                    ? change(live, tick, cJSON_GetStringValue(bst_json_member(command, "set")))
                    : burn(live, tick, command));
        *action = BST_RUN_PART;
    } else if (strcmp(word, "rewind") == 0) {
        acts = go_to(live, command, false);
        *action = BST_RUN_PART;
    } else if (strcmp(word, "branch") == 0) {
        acts = go_to(live, command, true);
        *action = BST_RUN_END;
    } else if (strcmp(word, "save") == 0 && !live->ended) {
        live->why = "saved";
        acts = true;
        *action = BST_RUN_SAVE;
    } else if (strcmp(word, "end") == 0) {
        acts = true;
        *action = BST_RUN_END;
    } else {
        set_pace(live, command, word);
    }
    cJSON_Delete(command);
    return acts;
}
