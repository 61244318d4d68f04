#include "sim/engine/scenario/module_substitution.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

static bool substitutes_for(const bst_module_desc *desc, const char *role) {
    for (const char *const *r = desc->substitutes_for; r && *r; r++) {
        if (strcmp(*r, role) == 0) {
            return true;
        }
    }
    return false;
}

static const bst_config_desc *find_key(const bst_config_desc *table, const char *key) {
    for (const bst_config_desc *d = table; d && d->key; d++) {
        if (strcmp(d->key, key) == 0) {
            return d;
        }
    }
    return NULL;
}

/* Checks whether a configuration value can be copied without ownership. */
static bool plain(bst_config_type type) {
    return type == BST_CONFIG_BOOL || type == BST_CONFIG_INT || type == BST_CONFIG_REAL ||
           type == BST_CONFIG_ENUM || type == BST_CONFIG_PATH || type == BST_CONFIG_STRING;
}

/* The module of the same sensor that supplies the value of a key; NULL: the key's own value. */
static const bst_scenario_module_config *value_source(const bst_scenario *s,
                                                      const bst_scenario_module_config *module,
                                                      const bst_config_desc *key,
                                                      const bst_config_desc **theirs) {
    for (int m = 0; module->desc->substitutes_for && m < s->module_count; m++) {
        const bst_scenario_module_config *other = &s->modules[m];
        if (other->observer != module->observer || other->sensor != module->sensor ||
            !other->desc || !substitutes_for(module->desc, other->desc->role)) {
            continue;
        }
        *theirs = find_key(other->desc->config, key->key);
        if (*theirs && plain(key->type) && (*theirs)->type == key->type &&
            (*theirs)->size == key->size) {
            return other;
        }
    }
    return NULL;
}

bool bst_module_substitution_taken(const bst_scenario *s, const bst_scenario_module_config *module,
                                   const char *key) {
    const bst_config_desc *own = find_key(module->desc->config, key), *theirs;
    return own && value_source(s, module, own, &theirs) != NULL;
}

bool bst_module_substitution_delayed(const bst_scenario *s,
                                     const bst_scenario_module_config *module) {
    for (int m = 0; m < s->module_count; m++) {
        const bst_scenario_module_config *other = &s->modules[m];
        if (other->observer == module->observer && other->sensor == module->sensor &&
            substitutes_for(module->desc, other->desc->role)) {
            return true;
        }
    }
    return false;
}

/* Copies settings of the substituted modules; rejects keys given twice. */
static bst_status take_settings(bst_ctx *ctx, const cJSON *node, const bst_scenario *s,
                                bst_scenario_module_config *module) {
    for (const bst_config_desc *d = module->desc->config; d && d->key; d++) {
        const bst_config_desc *theirs;
        const bst_scenario_module_config *other = value_source(s, module, d, &theirs);
        if (!other) {
            continue;
        }
        const cJSON *said = node ? cJSON_GetObjectItemCaseSensitive(node, d->key) : NULL;
        if (said) {
            char path[300], allowed[160];
            snprintf(path, sizeof path, "/observers/%d/sensors/%d/modules/%s/%s", module->observer,
                     module->sensor, module->name, d->key);
            snprintf(allowed, sizeof allowed,
                     "nothing here: it is the \"%s\" of this sensor's %s, which this module "
                     "replaces",
                     d->key, other->desc->role);
            return bst_config_fail(ctx, s->file, path, said, "given twice", allowed);
        }
        memcpy((char *)module->config + d->offset, (const char *)other->config + theirs->offset,
               d->size);
    }
    return BST_OK;
}

/* True if the module writes the channel. */
static bool writes(const bst_module_desc *desc, const char *channel) {
    for (int p = 0; p < desc->port_count; p++) {
        if (desc->ports[p].direction == BST_PORT_OUT &&
            strcmp(desc->ports[p].channel, channel) == 0) {
            return true;
        }
    }
    return false;
}

/* Checks whether a module that is substituted writes this channel. */
static bool is_inner(const bst_scenario *s, const bst_scenario_module_config *module,
                     const char *channel) {
    for (int m = 0; m < s->module_count; m++) {
        const bst_scenario_module_config *other = &s->modules[m];
        if (other->observer == module->observer && other->sensor == module->sensor &&
            substitutes_for(module->desc, other->desc->role) && writes(other->desc, channel)) {
            return true;
        }
    }
    return false;
}

/* Adds a delay to an input of the substituting module. */
static bst_status add_delay(bst_ctx *ctx, bst_scenario_module_config *module, int port,
                            int64_t ticks) {
    for (int i = 0; i < module->delay_count; i++) {
        if (module->delays[i].port == port) {
            module->delays[i].ticks += ticks;
            return BST_OK;
        }
    }
    if (module->delay_count == BST_MAX_DELAYS) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "/observers/%d/sensors/%d/modules: too many delays for the module %s",
                        module->observer, module->sensor, module->name);
    }
    module->delays[module->delay_count++] = (bst_input_delay){port, ticks};
    return BST_OK;
}

/* Copies input delays from the substituted modules. Delays between these modules are added to the
 * last trigger. */
static bst_status take_delays(bst_ctx *ctx, const bst_scenario *s,
                              bst_scenario_module_config *module) {
    const bst_module_desc *own = module->desc;
    int last = -1;
    if (!bst_module_substitution_delayed(s, module)) {
        return BST_OK;
    }
    if (module->delay_count > 0) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /observers/%d/sensors/%d/modules/%s/delay_s: given twice (allowed: "
                        "nothing here: delays are those of the modules that this one "
                        "replaces)",
                        s->file, module->observer, module->sensor, module->name);
    }
    for (int p = 0; p < own->port_count; p++) {
        last = own->ports[p].flags & BST_PORT_TRIGGER ? p : last;
    }
    for (int m = 0; m < s->module_count; m++) {
        const bst_scenario_module_config *other = &s->modules[m];
        if (other->observer != module->observer || other->sensor != module->sensor ||
            !substitutes_for(own, other->desc->role)) {
            continue;
        }
        for (int d = 0; d < other->delay_count; d++) {
            const char *channel = other->desc->ports[other->delays[d].port].channel;
            if (is_inner(s, module, channel)) {
                if (last >= 0) {
                    BST_TRY(add_delay(ctx, module, last, other->delays[d].ticks));
                }
                continue;
            }
            for (int p = 0; p < own->port_count; p++) {
                if (own->ports[p].direction == BST_PORT_IN &&
                    strcmp(own->ports[p].channel, channel) == 0) {
                    BST_TRY(add_delay(ctx, module, p, other->delays[d].ticks));
                }
            }
        }
    }
    return BST_OK;
}

/* Adds the default observation generator module to a sensor. */
static bst_status make_default(bst_ctx *ctx, const bst_scenario_registry *registry, int observer,
                               int sensor, bst_scenario *s, bst_scenario_module_config **out) {
    const bst_module_desc *desc = NULL;
    for (int i = 0; i < registry->count && !desc; i++) {
        desc = registry->modules[i]->substitutes_for ? registry->modules[i] : NULL;
    }
    if (!desc) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "%s: /observers/%d/sensors/%d/observation_source: there is no module that "
                        "generates observations (allowed: \"image\")",
                        s->file, observer, sensor);
    }
    bst_scenario_module_config *module = &s->modules[s->module_count++];
    *module = (bst_scenario_module_config){.observer = observer, .sensor = sensor, .desc = desc};
    snprintf(module->name, sizeof module->name, "%s", desc->role);
    module->config = calloc(1, desc->config_bytes + 1);
    if (!module->config) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for module %s", desc->role);
    }
    *out = module;
    return bst_config_defaults(ctx, desc->config, module->config);
}

bst_status bst_module_substitution(bst_ctx *ctx, const bst_scenario_registry *registry,
                                   const cJSON *block, int observer, int sensor, bst_scenario *s) {
    const bst_observer_config *observers = s->observers.items;
    const bst_sensor_config *sensors = observers[observer].sensors.items;
    bool generator = sensors[sensor].observation_source == BST_OBSERVE_GENERATOR;
    bst_scenario_module_config *substitute = NULL;
    for (int m = 0; m < s->module_count; m++) {
        bst_scenario_module_config *module = &s->modules[m];
        if (module->observer == observer && module->sensor == sensor &&
            module->desc->substitutes_for) {
            substitute = module;
        }
    }
    const cJSON *node =
        substitute ? cJSON_GetObjectItemCaseSensitive(block, substitute->name) : NULL;
    if (!substitute && !generator) {
        return BST_OK;
    }
    if (!substitute) {
        BST_TRY(make_default(ctx, registry, observer, sensor, s, &substitute));
    }
    substitute->off = !generator;
    for (int m = 0; m < s->module_count; m++) {
        bst_scenario_module_config *module = &s->modules[m];
        if (module->observer == observer && module->sensor == sensor &&
            substitutes_for(substitute->desc, module->desc->role)) {
            module->off = generator;
        }
    }
    BST_TRY(take_settings(ctx, node, s, substitute));
    return take_delays(ctx, s, substitute);
}
