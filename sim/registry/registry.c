#include "sim/registry/registry.h"

#include "control/modules.h"
#include "gimbal/modules.h"
#include "imgproc/imgproc.h"
#include "obsgen/obsgen.h"
#include "scenegen/module.h"
#include "scenegen/recorded_module.h"
#include "sim/link/external.h"
#include "tracker/module.h"

static const bst_module_desc *const modules[] = {
    &bst_gimbal_second_order_module,
    &bst_gimbal_azimuth_elevation_module,
    &bst_gimbal_cross_elevation_module,
    &bst_gimbal_ideal_module,
    &bst_gimbal_scripted_module,
    &bst_gimbal_external_module,
    &bst_scenegen_module,
    &bst_scenegen_recorded_module,
    &bst_imgproc_module,
    &bst_tracker_module,
    &bst_control_standard_module,
    &bst_tracker_ukf_module,
    &bst_tracker_imm_module,
    &bst_obsgen_module,
    &bst_external_imgproc_module,
    &bst_external_tracker_module,
    &bst_external_control_module,
    &bst_tasking_priority_module,
};

static const bst_scenario_registry registry = {.modules = modules,
                                               .count = sizeof modules / sizeof *modules};

const bst_scenario_registry *bst_registry_shipped(void) {
    return &registry;
}

static const bst_document_tables tables = {bst_scenario_table, bst_scenario_tables_inside,
                                           &registry};

const bst_document_tables *bst_registry_tables(void) {
    return &tables;
}
