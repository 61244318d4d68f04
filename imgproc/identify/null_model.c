#include "imgproc/identify/null_model.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

double bst_null_model_log_tail(int predicted, int matched, double chance) {
    assert(predicted >= 0 && chance >= 0.0 && chance <= 1.0);
    if (matched <= 0 || chance >= 1.0) {
        return 0.0;
    }
    if (matched > predicted || chance <= 0.0) {
        return -INFINITY;
    }
    double odds = chance / (1.0 - chance);
    double first = lgamma(predicted + 1.0) - lgamma(matched + 1.0) -
                   lgamma(predicted - matched + 1.0) + matched * log(chance) +
                   (predicted - matched) * log1p(-chance);
    double term = 1.0, sum = 0.0; /* relative to the first term */
    for (int k = matched; k <= predicted; k++) {
        sum += term;
        term *= odds * (predicted - k) / (k + 1.0);
    }
    return fmin(first + log(sum), 0.0);
}

double bst_null_model_chance(double tolerances_px2, double area_px2) {
    assert(tolerances_px2 >= 0.0 && area_px2 > 0.0);
    return -expm1(-tolerances_px2 / area_px2);
}
