#include "sim/run/run_custody_tables.h"

#include <stdlib.h>

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
    REAL("chi2", "", "of the nearest candidate, 4 degrees of freedom; NULL: none"),
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

static int compare(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double bst_custody_quantile(double *values, int count, double share) {
    qsort(values, (size_t)count, sizeof *values, compare);
    return count > 0 ? values[(int)(share * (count - 1))] : NAN;
}
