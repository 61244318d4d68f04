#include "sim/optics/band.h"
#include "sim/world/world.h"

double bst_world_lambert_sphere_v_mag(double area_m2, double albedo, double phase_rad,
                                      double range_m, double sun_distance_m) {
    double phi = fabs(phase_rad);
    double phase = (BST_PI - phi) * cos(phi) + sin(phi);
    double au = sun_distance_m / BST_AU_M;
    double ratio =
        2.0 * albedo * area_m2 * phase / (3.0 * BST_PI * BST_PI * range_m * range_m * au * au);
    return phi < BST_PI && ratio > 0.0 ? BST_SUN_V_MAG - 2.5 * log10(ratio) : INFINITY;
}
