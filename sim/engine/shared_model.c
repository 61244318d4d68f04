#include "sim/engine/shared_model.h"

#include <assert.h>
#include <stdlib.h>

#include "sim/core/file.h"
#include "sim/device/device.h"
#include "sim/io/fits_image.h"
#include "sim/io/psf_fits.h"

/* Creates the onboard knowledge of each sensor: camera, catalogue, cue. */
static bst_status make_knowledge(bst_ctx *ctx, const bst_scenario *scenario,
                                 bst_shared_model *model) {
    const bst_observer_config *observers = scenario->observers.items;
    int total = 0;
    for (int i = 0; i < scenario->observers.count; i++) {
        total += observers[i].sensors.count;
    }
    model->knowledge = calloc((size_t)total + 1, sizeof *model->knowledge);
    if (!model->knowledge) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d sensors", total);
    }
    for (int i = 0; i < scenario->observers.count; i++) {
        for (int s = 0; s < observers[i].sensors.count; s++) {
            bst_status status = bst_knowledge_create(ctx, model->world, i, s,
                                                     &model->knowledge[model->knowledge_count]);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", scenario->file);
            }
            model->knowledge_count++;
        }
    }
    return BST_OK;
}

/* Reads the PSFs of sensors from their files. */
static bst_status read_psfs(bst_ctx *ctx, const bst_scenario *scenario, bst_world *world) {
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        for (int s = 0; s < observers[o].sensors.count; s++) {
            const bst_optics_config *optics = &bst_world_camera(world, o, s)->optics;
            if (optics->psf != BST_PSF_FILE) {
                continue;
            }
            bst_psf_samples samples;
            bst_status status =
                bst_psf_fits_samples(ctx, optics->psf_file, optics->psf_oversampling, &samples);
            if (status == BST_OK) {
                status = bst_world_set_psf(ctx, world, o, s, &samples);
                free((float *)samples.samples);
            }
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status,
                                       "%s: /observers/%d/sensors/%d/camera/optics/psf_file",
                                       scenario->file, o, s);
            }
        }
    }
    return BST_OK;
}

bst_status bst_shared_model_read_stray_map(bst_ctx *ctx, const char *base_dir, bst_world *world,
                                           int observer, int sensor) {
    const bst_background_config *c = &bst_world_camera(world, observer, sensor)->background;
    if (!*c->stray_map_file) {
        return BST_OK;
    }
    char path[1100];
    int width, height;
    float *pixels = NULL;
    bst_file_resolve(base_dir, c->stray_map_file, path, sizeof path);
    bst_status status = bst_fits_read_image(ctx, path, &width, &height, &pixels);
    if (status == BST_OK) {
        status = bst_world_set_stray_map(ctx, world, observer, sensor, width, height, pixels);
        status = status == BST_OK ? status : bst_fail_prefix(ctx, status, "%s", path);
    }
    return status == BST_OK
               ? status
               : bst_fail_prefix(ctx, status,
                                 "/observers/%d/sensors/%d/camera/background/stray_map_file",
                                 observer, sensor);
}

/* Reads the maps of stray light of sensors from their files. */
static bst_status read_stray_maps(bst_ctx *ctx, const bst_scenario *scenario, bst_world *world) {
    const bst_observer_config *observers = scenario->observers.items;
    for (int o = 0; o < scenario->observers.count; o++) {
        for (int s = 0; s < observers[o].sensors.count; s++) {
            bst_status status =
                bst_shared_model_read_stray_map(ctx, scenario->base_dir, world, o, s);
            if (status != BST_OK) {
                return bst_fail_prefix(ctx, status, "%s", scenario->file);
            }
        }
    }
    return BST_OK;
}

bool bst_shared_model_needs_device(const bst_scenario *scenario) {
    for (int m = 0; m < scenario->module_count; m++) {
        const bst_scenario_module_config *module = &scenario->modules[m];
        if (!module->off && (module->desc->flags & BST_MODULE_NEEDS_DEVICE)) {
            return true;
        }
    }
    return false;
}

static bst_status build_model(bst_ctx *ctx, const bst_scenario *scenario,
                              const bst_shared_model_options *options, bst_shared_model *model) {
    BST_TRY(bst_world_create(ctx, scenario->file, &scenario->world, &scenario->observers,
                             scenario->base_dir, scenario->epoch, &model->world));
    BST_TRY(read_psfs(ctx, scenario, model->world));
    BST_TRY(read_stray_maps(ctx, scenario, model->world));
    BST_TRY(bst_world_check_spans(ctx, scenario->file, model->world, scenario->duration_s));
    BST_TRY(bst_world_prepare(ctx, model->world, options->threads));
    BST_TRY(make_knowledge(ctx, scenario, model));
    return !options->no_device && bst_shared_model_needs_device(scenario)
               ? bst_device_open(ctx, options->device ? options->device : "", options->threads,
                                 &model->device)
               : BST_OK;
}

bst_status bst_shared_model_create(bst_ctx *ctx, const bst_scenario *scenario,
                                   const bst_shared_model_options *options,
                                   bst_shared_model **out) {
    assert(scenario && options && out);
    *out = NULL;
    bst_shared_model *model = calloc(1, sizeof *model);
    if (!model) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the model");
    }
    bst_status status = build_model(ctx, scenario, options, model);
    if (status != BST_OK) {
        bst_shared_model_free(model);
        return status;
    }
    *out = model;
    return BST_OK;
}

void bst_shared_model_free(bst_shared_model *model) {
    if (model) {
        for (int i = 0; i < model->knowledge_count; i++) {
            bst_knowledge_free(model->knowledge[i]);
        }
        free(model->knowledge);
        bst_device_close(model->device);
        bst_world_free(model->world);
        free(model);
    }
}
