/* A scenario: one JSON document, read, checked and resolved to configuration structs. */
#ifndef BST_ENGINE_SCENARIO_SCENARIO_H
#define BST_ENGINE_SCENARIO_SCENARIO_H

#include "sim/engine/kernel/engine.h"
#include "sim/engine/recorder/recorder.h"
#include "sim/engine/scenario/plugin.h"
#include "sim/link/link.h"
#include "sim/world/world_config.h"

/* Treatment of "plugin" blocks in a scenario. */
typedef enum bst_scenario_plugin_policy {
    BST_PLUGINS_LOAD = 0,
    BST_PLUGINS_SKIP, /* skip blocks with a plug-in: for commands that view results, which must not
                         run foreign code */
    BST_PLUGINS_REFUSE, /* an error */
} bst_scenario_plugin_policy;

/* Registry of all modules that a scenario may name; the program or a test supplies it. */
typedef struct bst_scenario_registry {
    const bst_module_desc *const *modules;
    int count;
    bst_scenario_plugin_policy policy;
    /* the plug-ins that supplied some of these modules */
    const bst_plugin *plugins;
    int plugin_count;
} bst_scenario_registry;

/* A module or stage of a plug-in that a scenario uses. */
typedef struct bst_scenario_plugin_use {
    char where[300]; /* JSON pointer of its block */
    char file[512], sha256[BST_SHA256_TEXT];
    char type[64];
} bst_scenario_plugin_use;

/* One entry of a sensor's "modules" block, or of "tasking". */
typedef struct bst_scenario_module_config {
    int observer, sensor; /* -1: a multi-sensor module */
    char name[64];        /* key in the block; equals the role of the built-in modules */
    const bst_module_desc *desc;
    void *config;                  /* desc->config_bytes, filled */
    double given_rate_hz, rate_hz; /* as the block gives it; as used, 0: stepped by triggers only */
    double offset_s;
    int64_t period_ticks, offset_ticks;
    bst_input_delay delays[BST_MAX_DELAYS];
    int delay_count;
    bool off;    /* disabled: a substitute replaces it, or it is a substitute that is not used */
    bool plugin; /* its block names a plug-in */
} bst_scenario_module_config;

/* A change of the scenario while its run goes on. */
typedef struct bst_scenario_change {
    double time_s;
    char set[1024]; /* "/json/pointer=value" */
    int64_t tick;   /* of time_s */
} bst_scenario_change;

typedef struct bst_scenario {
    int64_t format; /* "boresight": version of the scenario format */
    char name[64];
    char epoch_utc[48];
    double duration_s;
    int64_t tick_rate_hz;
    uint64_t seed;
    int64_t run;
    bst_world_config world;
    bst_config_list observers; /* bst_observer_config */
    bst_recorder_config record;
    bst_link_config link;
    bst_pacing_config pacing;
    bst_config_list changes; /* bst_scenario_change, in the order of time */
    /* set by bst_scenario_read, not by the configuration table */
    struct cJSON *written; /* the document with the values that it gives, in present names; NULL:
                              not read from a document */
    char file[512];        /* name for messages */
    char base_dir[512];    /* base folder of relative paths */
    bst_time epoch;
    int64_t duration_ticks;
    bst_scenario_module_config *modules;
    int module_count;
    bst_scenario_plugin_use *plugins; /* all plug-ins in use, in reading order */
    int plugin_count;
} bst_scenario;

extern const bst_config_desc bst_scenario_table[];

/* Tables of the modules of a scenario: function `inside` of a bst_document_tables whose root is
 * bst_scenario_table.
 *
 * Given:     registry   bst_scenario_registry
 *            the others as bst_document_tables
 * Returned:  common table and those of all modules of the role, or of the module that node's "type"
 *            names; NULL after the last one */
const bst_config_desc *bst_scenario_tables_inside(const void *registry, const char *raw,
                                                  const char *key, const struct cJSON *node,
                                                  int index);

/* Reads and checks a scenario; it reads no other file than the JSON (bst_json_load_extended, or
 * bst_json_load_described to accept former names in "set" and overrides) and plug-ins.
 * Notes:     Paths of existing files become absolute. A file in a module's table must exist
 *            (BST_CONFIG_PATH, outside of lists). Plug-ins are loaded: see bst_plugin_open.
 * Ownership: free with bst_scenario_free, also after an error */
bst_status bst_scenario_read(bst_ctx *ctx, const bst_json *json,
                             const bst_scenario_registry *registry,
                             bst_scenario *out) BST_MUST_CHECK;
/* Frees the content of a scenario; the caller owns the struct. */
void bst_scenario_free(bst_scenario *scenario);

/* The module of a role ("gimbal", "control") that steps for a sensor. NULL: none, or a substitute
 * replaces it. The scenario owns it. */
const bst_scenario_module_config *bst_scenario_module(const bst_scenario *scenario, int observer,
                                                      int sensor, const char *role);

/* Value of a module's key of type real or integer, in the key's unit.
 *
 * Given:    module NULL: false is returned
 *           key     its name, as in the scenario
 * Returned: true and *out; false where the module has no such number, *out unchanged */
bool bst_scenario_module_number(const bst_scenario_module_config *module, const char *key,
                                double *out);

/* The scenario with every default written out; the caller deletes it. NULL when out of memory. */
struct cJSON *bst_scenario_echo(const bst_scenario *scenario);
/* JSON Schema (draft 2020-12) of scenarios with these modules; the caller deletes it. */
struct cJSON *bst_scenario_schema(const bst_scenario_registry *registry);

#endif
