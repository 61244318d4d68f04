#include "sim/run/run_custody_tables.h"

#include <math.h>
#include <stdlib.h>

#include "sim/core/compare.h"

#define INT(name, unit, doc) \
    { name, BST_COLUMN_INT, unit, doc }
#define REAL(name, unit, doc) \
    { name, BST_COLUMN_REAL, unit, doc }

static const bst_io_column track_columns[] = {
    INT("sensor", "", "row of the table sensors"),
    INT("track_id", "", "of the sensor's tracker"),
    REAL("time_s", "s", "middle of the last exposure with a detection, since the epoch"),
    INT("hits", "", "detections of the track"),
    INT("candidates", "", "objects whose predicted direction and rate agree"),
    INT("object", "", "object that the track updated: id in truth; NULL: none, or a new one"),
    INT("new_object", "", "new object that the track updated: 1, 2, ...; NULL: none"),
    INT("true_object", "", "object that the track belongs to; NULL: none"),
    REAL("chi2", "",
         "of the nearest candidate, 4 degrees of freedom, 2 if its middle found it; NULL: none"),
    REAL("nees", "", "error of the updated elements squared, by their covariance, 6 degrees"),
};

static const bst_io_column object_columns[] = {
    INT("object", "", "index in the scenario: id in truth; NULL: new object"),
    {"name", BST_COLUMN_TEXT, "", "name of the object; new 1, new 2, ..."},
    INT("norad", "", "catalogue number, 0: none"),
    INT("updates", "", "tracks that updated its orbit"),
    INT("cross_tags", "", "of these, tracks of another object, or of none"),
    REAL("last_s", "s", "last update; NULL: none"),
    REAL("age_s", "s", "time from the last update to the end"),
    REAL("sigma_m", "m", "standard deviation of the position at the end"),
    REAL("error_m", "m", "error of the position at the end"),
    REAL("nees", "", "error of the elements squared, by their covariance, 6 degrees of freedom"),
    REAL("chi2_mean", "",
         "mean chi-square of the tracks that updated it themselves, 4 degrees of freedom; NULL: "
         "none"),
    INT("true_object", "", "id in truth; NULL: new object of different ones, or of none"),
};

bst_status bst_run_custody_tables_create(bst_ctx *ctx, bst_run *store, bst_io_table **tracks,
                                         bst_io_table **objects) {
    BST_TRY(bst_io_table_create(ctx, store, "custody_tracks",
                                "Tracks that were correlated with the catalogue, as they ended.",
                                track_columns, sizeof track_columns / sizeof *track_columns,
                                tracks));
    return bst_io_table_create(ctx, store, "custody", "Orbits of the catalogue at the end.",
                               object_columns, sizeof object_columns / sizeof *object_columns,
                               objects);
}

void bst_custody_score_add(bst_custody_score *s, bool crossed, double chi2, double time_s) {
    s->updates++;
    s->cross_tags += crossed;
    s->chi2_sum += chi2;
    s->chi2_count++;
    s->last_s = fmax(s->last_s, time_s); /* fmax ignores NAN */
}

bst_status bst_run_custody_add_object(bst_ctx *ctx, bst_io_table *table, const bst_custody_row *r,
                                      const bst_custody_score *s, double end_s) {
    const bst_io_value row[] = {
        bst_io_known_int_value(r->object, r->object >= 0),
        bst_io_text_value(r->name),
        bst_io_int_value(r->norad),
        bst_io_int_value(s->updates),
        bst_io_int_value(s->cross_tags),
        bst_io_real_value(s->last_s),
        bst_io_real_value(end_s - s->last_s),
        bst_io_real_value(r->sigma_m),
        bst_io_real_value(r->error_m),
        bst_io_real_value(r->nees),
        bst_io_real_value(s->chi2_count > 0 ? s->chi2_sum / (double)s->chi2_count : NAN),
        bst_io_known_int_value(r->true_object, r->true_object >= 0)};
    return bst_io_table_append(ctx, table, row);
}

double bst_custody_quantile(double *values, int count, double share) {
    qsort(values, (size_t)count, sizeof *values, bst_compare_doubles);
    return count > 0 ? values[(int)(share * (count - 1))] : NAN;
}
