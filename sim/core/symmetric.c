#include "sim/core/symmetric.h"

#include <assert.h>
#include <math.h>

#include "sim/core/cholesky.h"

#define LEAST_PIVOT 1e-13

enum { MOST = BST_SYMMETRIC_MOST };

bool bst_symmetric_invert(int n, const double *a, double *out) {
    assert(a && out);
    assert(n >= 1 && n <= MOST);
    double scale[MOST], l[MOST][MOST], m[MOST][MOST]; /* lower triangles: L and its inverse */
    for (int i = 0; i < n; i++) {
        double diagonal = a[i * n + i];
        if (!(diagonal > 0.0) || !isfinite(diagonal)) {
            return false;
        }
        scale[i] = 1.0 / sqrt(diagonal);
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            l[i][j] = a[i * n + j] * scale[i] * scale[j];
        }
    }
    if (!bst_cholesky_factor(l[0], MOST, n, LEAST_PIVOT)) {
        return false;
    }
    for (int j = 0; j < n; j++) {
        m[j][j] = 1.0 / l[j][j];
        for (int i = j + 1; i < n; i++) {
            double v = 0.0;
            for (int k = j; k < i; k++) {
                v -= l[i][k] * m[k][j];
            }
            m[i][j] = v / l[i][i];
        }
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double v = 0.0;
            for (int k = i; k < n; k++) {
                v += m[k][i] * m[k][j];
            }
            out[i * n + j] = out[j * n + i] = v * scale[i] * scale[j];
        }
    }
    return true;
}
