#include "tracker/symmetric3.h"

#include <math.h>

bool bst_symmetric3_invert(const double a[3][3], double out[3][3]) {
    double scale[3], l[3][3] = {{0}}, inverse[3][3] = {{0}};
    for (int i = 0; i < 3; i++) {
        if (!(a[i][i] > 0.0) || !isfinite(a[i][i])) {
            return false;
        }
        scale[i] = 1.0 / sqrt(a[i][i]);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j <= i; j++) {
            double v = a[i][j] * scale[i] * scale[j];
            for (int k = 0; k < j; k++) {
                v -= l[i][k] * l[j][k];
            }
            if (i == j) {
                if (!(v > 1e-13)) {
                    return false;
                }
                l[i][i] = sqrt(v);
            } else {
                l[i][j] = v / l[j][j];
            }
        }
    }
    for (int j = 0; j < 3; j++) {
        for (int i = j; i < 3; i++) {
            double v = i == j ? 1.0 : 0.0;
            for (int k = j; k < i; k++) {
                v -= l[i][k] * inverse[k][j];
            }
            inverse[i][j] = v / l[i][i];
        }
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double v = 0.0;
            for (int k = 0; k < 3; k++) {
                v += inverse[k][i] * inverse[k][j];
            }
            out[i][j] = v * scale[i] * scale[j];
        }
    }
    return true;
}
