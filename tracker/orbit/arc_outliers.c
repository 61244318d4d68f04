#include "tracker/orbit/arc_outliers.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* chi-square of a direction, 2 degrees of freedom: beyond it are 4e-6 of good ones */
static const double OUTLIER = 25.0;

int bst_arc_outlier(const double *chi2, int count) {
    double sorted[BST_CUSTODY_DIRECTIONS];
    int worst = 0;
    for (int i = 0; i < count; i++) {
        int k = i;
        for (; k > 0 && sorted[k - 1] > chi2[i]; k--) {
            sorted[k] = sorted[k - 1];
        }
        sorted[k] = chi2[i];
        worst = chi2[i] > chi2[worst] ? i : worst;
    }
    return chi2[worst] > fmax(OUTLIER, 10.0 * sorted[count / 2]) ? worst : -1;
}

void bst_arc_drop(bst_od_observation *directions, int count, int index) {
    if (index + 1 < count) {
        directions[index + 1].shared_change += directions[index].shared_change;
    }
    memmove(&directions[index], &directions[index + 1],
            (size_t)(count - index - 1) * sizeof *directions);
}
