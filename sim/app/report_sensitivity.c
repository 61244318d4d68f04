#include "sim/app/report_study.h"

bst_status bst_study_plot_sensitivity(bst_ctx *ctx, FILE *out, const bst_study_view *v) {
    (void)ctx;
    (void)out;
    (void)v;
    return BST_OK;
}
