/* Draws random values from the distributions of a study. */
#include <cjson/cJSON.h>
#include <math.h>

#include "sim/studies/study_internal.h"

bst_study_value bst_study_listed(const bst_study_axis *axis, int64_t index) {
    const cJSON *item = cJSON_GetArrayItem(axis->values, (int)index);
    bool number = cJSON_IsNumber(item);
    return (bst_study_value){true, number, number ? item->valuedouble : 0.0, item};
}

bst_study_value bst_study_draw(const bst_study_axis *axis, bst_rng_key key, uint64_t a,
                               uint64_t b) {
    const bst_study_dispersion_config *c = axis->dispersion;
    double u = bst_rng_uniform(key, a, b), z;
    bst_study_value value = {true, true, 0.0, NULL};
    switch ((bst_study_distribution)c->distribution) {
        case BST_DISTRIBUTION_UNIFORM:
            value.number = c->from + u * (c->to - c->from);
            break;
        case BST_DISTRIBUTION_LOG_UNIFORM:
            value.number = c->from * exp(u * log(c->to / c->from));
            break;
        case BST_DISTRIBUTION_NORMAL:
            /* 8 % of the draws are within the narrowest limit */
            do {
                z = bst_rng_normal(key, a, ++b);
            } while (fabs(z) > c->truncate_sigma);
            value.number = c->mean + c->sigma * z;
            break;
        case BST_DISTRIBUTION_TABLE: {
            int i = 0, n = axis->value_count;
            if (axis->cumulative) {
                while (i < n - 1 && u >= axis->cumulative[i]) {
                    i++;
                }
            } else {
                i = (int)fmin(u * n, n - 1.0);
            }
            return bst_study_listed(axis, i);
        }
    }
    return value;
}
