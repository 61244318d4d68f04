/* Analysis of a spacecraft's attitude control loop. */
#include "gimbal/spacecraft/spacecraft_response.h"
#include "sim/analysis/loop/loop_model.h"

static double complex body_open(const void *user, double omega) {
    const bst_loop_body *body = user;
    bst_spacecraft_response r =
        bst_spacecraft_response_at(body->config, body->number, omega / (2.0 * BST_PI));
    return (r.plant[0] + I * r.plant[1]) * (r.controller[0] + I * r.controller[1]);
}

bst_status bst_loop_build_body(bst_ctx *ctx, const bst_spacecraft_config *config,
                               bst_loop_model *model) {
    static const char *const names[BST_LOOP_BODY] = {"x", "y", "z"};
    if (config->type != BST_CRAFT_RIGID_BODY || config->attitude.law == BST_LAW_FREE) {
        return BST_OK;
    }
    const bst_spacecraft_mode_config *modes = config->modes.items;
    for (int i = 0; i < BST_LOOP_BODY; i++) {
        bst_loop_body *body = &model->body[i];
        body->name = names[i];
        body->number = i;
        body->config = config;
        int hints = 0;
        for (int k = 0; k < config->modes.count && hints < BST_LOOP_HINTS; k++) {
            body->hint_hz[hints++] = modes[k].frequency_hz;
        }
        body->loop = (bst_loop){.open = body_open,
                                .user = body,
                                .dt_s = bst_spacecraft_attitude_control_of(config).dt_s,
                                .hint_hz = body->hint_hz,
                                .hints = hints};
        BST_TRY(bst_loop_analyse(ctx, &body->loop, &body->margins));
    }
    model->bodies = BST_LOOP_BODY;
    return BST_OK;
}
