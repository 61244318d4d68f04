#include "sim/astro/atmosphere.h"

#include "sim/astro/bodies.h"

typedef struct layer {
    double height_km, density_kgpm3;
    double curvature; /* second derivative of the spline of ln density, 1/km^2 */
} layer;

/* clang-format off */
static const layer layers[] = {
    {0.0, 1.225, 0.000000000000e+00},
    {25.0, 0.03899, -2.069519779211e-03},
    {30.0, 0.01774, 1.313027242637e-03},
    {40.0, 0.003972, 1.800531453352e-03},
    {50.0, 0.001057, 1.847878428176e-03},
    {60.0, 0.0003206, -1.341687550054e-03},
    {70.0, 8.77e-05, -2.677723934110e-03},
    {80.0, 1.905e-05, -1.782364133991e-03},
    {90.0, 3.396e-06, -2.049661649016e-03},
    {100.0, 5.297e-07, 1.966576384624e-03},
    {110.0, 9.661e-08, 3.568207262099e-03},
    {120.0, 2.438e-08, 3.243159859664e-03},
    {130.0, 8.484e-09, 2.739435946783e-03},
    {140.0, 3.845e-09, 1.649455569557e-03},
    {150.0, 2.07e-09, 9.937480588582e-04},
    {180.0, 5.464e-10, 3.050027134469e-04},
    {200.0, 2.789e-10, 2.164199201596e-04},
    {250.0, 7.248e-11, 7.290890095620e-05},
    {300.0, 2.418e-11, 9.136323525712e-05},
    {350.0, 9.518e-12, -4.129692823983e-05},
    {400.0, 3.725e-12, 5.996018559098e-05},
    {450.0, 1.585e-12, 2.181257152164e-06},
    {500.0, 6.967e-13, 9.309170345092e-06},
    {600.0, 1.454e-13, 1.724379935702e-05},
    {700.0, 3.614e-14, 2.658246642762e-05},
    {800.0, 1.17e-14, 3.499243687748e-05},
    {900.0, 5.245e-15, 2.874649210541e-05},
    {1000.0, 3.019e-15, 0.000000000000e+00},
};
/* clang-format on */

enum { LAYERS = sizeof layers / sizeof layers[0] };

double bst_astro_height_m(bst_vec3 p) {
    const double squash = (1.0 - BST_EARTH_FLATTENING) * (1.0 - BST_EARTH_FLATTENING);
    double across2 = p.x * p.x + p.y * p.y, r2 = across2 + p.z * p.z;
    if (!(r2 > 0.0)) {
        return -BST_EARTH_RADIUS_M;
    }
    /* distance at which the radius intersects the ellipsoid */
    double surface2 = BST_EARTH_RADIUS_M * BST_EARTH_RADIUS_M * r2 / (across2 + p.z * p.z / squash);
    return sqrt(r2) - sqrt(surface2);
}

double bst_atmosphere_density_kgpm3(double height_m) {
    double km = 1e-3 * height_m;
    int i = 0;
    while (i < LAYERS - 2 && km >= layers[i + 1].height_km) {
        i++;
    }
    const layer *low = &layers[i], *high = low + 1;
    double width = high->height_km - low->height_km;
    double y0 = log(low->density_kgpm3), y1 = log(high->density_kgpm3);
    double slope = (y1 - y0) / width, b = (km - low->height_km) / width, a = 1.0 - b;
    double y;
    if (b > 1.0) { /* above all layers: constant slope; the spline's curvature ends at 0 */
        y = y1 + (km - high->height_km) * (slope + width / 6.0 * low->curvature);
    } else if (b < 0.0) {
        y = y0 + (km - low->height_km) * (slope - width / 6.0 * high->curvature);
    } else {
        y = a * y0 + b * y1 +
            ((a * a * a - a) * low->curvature + (b * b * b - b) * high->curvature) * width * width /
                6.0;
    }
    return exp(y);
}
