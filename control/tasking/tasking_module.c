#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

#include "control/modules.h"
#include "control/tasking/tasking.h"
#include "sim/messages/message_invariants.h"

enum { PORT_TRACKS, PORT_NAV, PORT_MOUNT, PORT_TASK, PORT_COUNT };

static const bst_port ports[PORT_COUNT] = {
    [PORT_TRACKS] = {.channel = BST_CHANNEL_TRACKS,
                     .direction = BST_PORT_IN,
                     .flags = BST_PORT_OPTIONAL},
    [PORT_NAV] = {.channel = BST_CHANNEL_NAV_TELEMETRY,
                  .direction = BST_PORT_IN,
                  .flags = BST_PORT_OPTIONAL},
    [PORT_MOUNT] = {.channel = BST_CHANNEL_MOUNT_STATUS,
                    .direction = BST_PORT_IN,
                    .flags = BST_PORT_OPTIONAL},
    [PORT_TASK] = {.channel = BST_CHANNEL_TASK, .direction = BST_PORT_OUT},
};

static void destroy(void *self) {
    if (self) {
        bst_tasking_free(self);
        free(self);
    }
}

static bst_status create(const bst_module_env *env, const void *config, void **self) {
    bst_tasking *t = calloc(1, sizeof *t);
    if (!t) {
        return bst_fail(env->ctx, BST_ERR_MEMORY, "out of memory for the tasks");
    }
    bst_status status = bst_tasking_init(env->ctx, t, config, env->members, env->member_count,
                                         (double)env->tick_rate_hz);
    if (status != BST_OK) {
        destroy(t);
        return status;
    }
    *self = t;
    return BST_OK;
}

static bst_status report(bst_tasking *t, struct bst_step *step) {
    double now_s = bst_step_seconds(step);
    if (!(t->config.report_every_s > 0.0) || now_s < t->next_report_s) {
        return BST_OK;
    }
    t->next_report_s = now_s + t->config.report_every_s;
    bst_tasking_report r;
    BST_TRY(bst_tasking_survey(bst_step_ctx(step), t, now_s, &r));
    char text[360] = "";
    int used = 0;
    for (int i = BST_WHY_NOT + 1; i < BST_WHY_COUNT && used < (int)sizeof text; i++) {
        if (r.why[i] > 0) {
            used += snprintf(text + used, sizeof text - (size_t)used, "%s%d %s",
                             used ? ", " : "; not: ", r.why[i], bst_tasking_reason(i));
        }
    }
    bst_step_event(step, "visible", "%d of %d targets can be seen, %d have been%s", r.visible,
                   r.targets, r.seen, text);
    return BST_OK;
}

static bst_status step(void *self, struct bst_step *s) {
    bst_tasking *t = self;
    for (int i = 0; i < t->sensor_count; i++) {
        int base = bst_member_port(PORT_COUNT, i, 0);
        bst_tasking_telemetry(t, i, bst_step_latest(s, base + PORT_NAV).payload,
                              bst_step_latest(s, base + PORT_MOUNT).payload);
        for (bst_sample next = bst_step_next(s, base + PORT_TRACKS); next.payload;
             next = bst_step_next(s, base + PORT_TRACKS)) {
            bst_tasking_tracks(t, i, next.payload);
        }
    }
    for (int i = 0; i < t->sensor_count; i++) {
        bool given;
        BST_TRY(bst_tasking_plan(bst_step_ctx(s), t, i, bst_step_tick(s), &given));
        if (given) {
            bst_task *task = bst_step_write(s, bst_member_port(PORT_COUNT, i, PORT_TASK), NULL);
            *task = t->sensors[i].task;
            assert(bst_task_is_valid(task));
        }
        bst_step_set_lookahead(s, bst_member_port(PORT_COUNT, i, PORT_TASK),
                               bst_tasking_quiet_until(t, i));
    }
    return report(t, s);
}

static bst_status archive_tasks(void *self, bst_archive *archive) {
    return bst_tasking_archive(self, archive);
}

const bst_module_desc bst_tasking_priority_module = {
    .abi = BST_MODULE_ABI,
    .role = "tasking",
    .type = "priority",
    .doc =
        "Gives free sensors what is due: by priority, time since it was seen, visibility and "
        "keep-out angles.",
    .flags = BST_MODULE_MULTI_SENSOR | BST_MODULE_HAS_LOOKAHEAD,
    .config = bst_tasking_config_table,
    .config_bytes = sizeof(bst_tasking_config),
    .default_rate_hz = 1.0,
    .ports = ports,
    .port_count = PORT_COUNT,
    .create = create,
    .step = step,
    .destroy = destroy,
    .archive = archive_tasks,
};
