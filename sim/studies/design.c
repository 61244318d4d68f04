/* Experimental designs: the values of a run from its index. */
#include <cjson/cJSON.h>
#include <math.h>
#include <string.h>

#include "boresight/rng.h"
#include "sim/studies/study_internal.h"

bst_study_place bst_study_place_of(const bst_study *study, int64_t run) {
    bst_study_place place = {.run = run,
                             .setting = run / study->config.replicates,
                             .replicate = run % study->config.replicates};
    int64_t per_base = study->settings / study->base_count;
    place.base = (int)(place.setting / per_base);
    place.run_number =
        (uint64_t)(study->config.random == BST_RANDOM_COMMON ? place.replicate : place.run);
    return place;
}

void bst_study_levels(const bst_study *study, int64_t setting, int64_t *levels) {
    for (int f = study->factor_count - 1; f >= 0; f--) {
        levels[f] = setting % study->factors[f].levels;
        setting /= study->factors[f].levels;
    }
}

/* Value of an axis at `unit`: 0 the first, 1 the last. */
static bst_study_value at_unit(const bst_study_axis *axis, double unit) {
    const bst_study_axis_config *c = axis->axis;
    double value = unit <= 0.0                     ? c->from
                   : unit >= 1.0                   ? c->to
                   : c->spacing == BST_SPACING_LOG ? c->from * exp(unit * log(c->to / c->from))
                                                   : c->from + unit * (c->to - c->from);
    return (bst_study_value){true, true, c->integer ? round(value) : value, NULL};
}

/* Number of values of a study axis. */
static int64_t own_levels(const bst_study_axis *axis) {
    return axis->values ? axis->value_count : axis->axis->count;
}

/* Value of a study axis at a level. */
static bst_study_value at_level(const bst_study_axis *axis, int64_t level) {
    if (axis->values) {
        return bst_study_listed(axis, level);
    }
    int64_t last = axis->axis->count - 1;
    return at_unit(axis, last > 0 ? (double)level / (double)last : 0.0);
}

/* Value at a point of the unit cube. `steps`: number of grid levels; 0: continuous. */
static bst_study_value at_place(const bst_study_axis *axis, double unit, int steps) {
    if (!axis->values) {
        return at_unit(axis, unit);
    }
    double n = axis->value_count;
    return bst_study_listed(axis,
                            (int64_t)fmin(steps ? round(unit * (n - 1.0)) : unit * n, n - 1.0));
}

/* Sets the axis values of a sweep for one level of its design. */
static void factor_values(const bst_study *study, const bst_study_factor *f, int64_t level,
                          bst_study_value *out) {
    for (int a = 0; a < f->axis_count; a++) {
        const bst_study_axis *axis = &study->axes[f->first_axis + a];
        bst_study_value *value = &out[f->first_axis + a];
        if (f->unit) {
            *value = at_place(axis, f->unit[level * f->axis_count + a], f->steps);
        } else if (f->design != BST_SWEEP_ONE_AT_A_TIME) {
            *value = at_level(axis, level);
        }
    }
    /* level 0 of one_at_a_time is the unchanged scenario */
    for (int a = 0; f->design == BST_SWEEP_ONE_AT_A_TIME && a < f->axis_count && level > 0; a++) {
        const bst_study_axis *axis = &study->axes[f->first_axis + a];
        if (level <= own_levels(axis)) {
            out[f->first_axis + a] = at_level(axis, level - 1);
        }
        level -= own_levels(axis);
    }
}

void bst_study_swept_values(const bst_study *study, const int64_t *levels, bst_study_value *out) {
    memset(out, 0, (size_t)study->swept_count * sizeof *out);
    for (int f = 0; f < study->factor_count; f++) {
        factor_values(study, &study->factors[f], levels[f], out);
    }
}

void bst_study_values(const bst_study *study, const bst_study_place *place, bst_study_value *out) {
    int64_t levels[BST_STUDY_AXES + 1];
    bst_study_levels(study, place->setting, levels);
    bst_study_swept_values(study, levels, out);
    int populations = study->axis_count - study->populations.count;
    for (int a = study->swept_count; a < populations; a++) {
        const bst_study_axis *axis = &study->axes[a];
        bst_rng_key key = bst_rng_make_key(study->config.seed, 0, axis->path, "dispersion");
        out[a] = bst_study_draw(axis, key, place->run_number, 0);
    }
    bst_study_population_numbers(study, place->run_number, out);
}
