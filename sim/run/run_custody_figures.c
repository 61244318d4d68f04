/* Figures of the custody of the catalogue: in the manifest, and printed. */
#include <stdio.h>

#include <cjson/cJSON.h>

#include "sim/core/json_number.h"
#include "sim/run/run_custody.h"
#include "sim/run/run_summary.h"

void bst_run_custody_add(const bst_run_custody *c, cJSON *manifest) {
    bst_custody_figures figures;
    const bst_custody_figures *f = &figures;
    if (!bst_run_custody_figures(c, &figures)) {
        return;
    }
    cJSON *node = cJSON_AddObjectToObject(manifest, "custody");
    cJSON_AddNumberToObject(node, "objects", (double)f->objects);
    cJSON_AddNumberToObject(node, "updated", (double)f->updated);
    cJSON_AddNumberToObject(node, "in_custody", (double)f->in_custody);
    cJSON_AddNumberToObject(node, "tracks", (double)f->tracks);
    cJSON_AddNumberToObject(node, "correlated", (double)f->correlated);
    cJSON_AddNumberToObject(node, "ambiguous", (double)f->ambiguous);
    cJSON_AddNumberToObject(node, "uncorrelated", (double)f->uncorrelated);
    cJSON_AddNumberToObject(node, "cross_tags", (double)f->cross_tags);
    cJSON_AddNumberToObject(node, "unknown", (double)f->unknown);
    cJSON_AddNumberToObject(node, "candidates", (double)f->candidates);
    cJSON_AddNumberToObject(node, "candidates_confirmed", (double)f->candidates_confirmed);
    cJSON_AddNumberToObject(node, "candidates_wrong", (double)f->candidates_wrong);
    cJSON_AddNumberToObject(node, "new_objects", (double)f->new_objects);
    cJSON_AddNumberToObject(node, "new_tracks", (double)f->new_tracks);
    cJSON_AddNumberToObject(node, "new_wrong", (double)f->new_wrong);
    cJSON_AddNumberToObject(node, "new_matched", (double)f->new_matched);
    bst_json_add_number(node, "new_sigma_median_m", f->new_sigma_median_m);
    bst_json_add_number(node, "new_nees_mean", f->new_nees_mean);
    bst_json_add_number(node, "age_mean_s", f->age_mean_s);
    bst_json_add_number(node, "sigma_median_m", f->sigma_median_m);
    bst_json_add_number(node, "sigma_p90_m", f->sigma_p90_m);
    bst_json_add_number(node, "sigma_updated_median_m", f->sigma_updated_median_m);
    bst_json_add_number(node, "nees_mean", f->nees_mean);
    bst_json_add_number(node, "nees_low", f->nees_low);
    bst_json_add_number(node, "nees_high", f->nees_high);
}

void bst_run_custody_print(const bst_run_custody *c) {
    bst_custody_figures figures;
    const bst_custody_figures *f = &figures;
    if (!bst_run_custody_figures(c, &figures)) {
        return;
    }
    printf("custody\n");
    bst_run_print_row("objects", "%.0f", (double)f->objects, "");
    bst_run_print_row("updated", "%.0f", (double)f->updated, "");
    bst_run_print_row("in custody", "%.0f", (double)f->in_custody, "");
    bst_run_print_row("tracks", "%.0f", (double)f->tracks, "");
    bst_run_print_row("correlated", "%.0f", (double)f->correlated, "");
    bst_run_print_row("ambiguous", "%.0f", (double)f->ambiguous, "");
    bst_run_print_row("uncorrelated", "%.0f", (double)f->uncorrelated, "");
    bst_run_print_row("cross-tags", "%.0f", (double)f->cross_tags, "");
    bst_run_print_row("candidate objects", "%.0f", (double)f->candidates, "of two tracks or more");
    bst_run_print_row("of three or more", "%.0f", (double)f->candidates_confirmed, "");
    bst_run_print_row("with wrong tracks", "%.0f", (double)f->candidates_wrong, "");
    bst_run_print_row("new objects", "%.0f", (double)f->new_objects, "");
    bst_run_print_row("wrong ones", "%.0f", (double)f->new_wrong, "");
    bst_run_print_row("mean age", "%.0f", f->age_mean_s, "s");
    bst_run_print_row("median uncertainty", "%.0f", f->sigma_median_m, "m");
    bst_run_print_row("of updated objects", "%.0f", f->sigma_updated_median_m, "m");
    bst_run_print_row("NEES of updated objects", "%.3f", f->nees_mean, "(6 if consistent)");
}
