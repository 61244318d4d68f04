#include "sim/astro/geodesy.h"

#include <GeographicLib/Geocentric.hpp>
#include <cmath>
#include <exception>

namespace {

constexpr double degree_rad = 3.14159265358979323846 / 180.0;

bst_status fail_exception(bst_ctx *ctx, const char *what) noexcept {
    return bst_fail(ctx, BST_ERR_NUMERIC, "GeographicLib failed: %s", what);
}

}  // namespace

bst_status bst_astro_geodetic_to_itrf(bst_ctx *ctx, double latitude_rad, double longitude_rad,
                                      double height_m, double itrf_m[3]) noexcept {
    if (!std::isfinite(latitude_rad) || !std::isfinite(longitude_rad) || !std::isfinite(height_m)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "geodetic position (%g, %g, %g) is not finite",
                        latitude_rad, longitude_rad, height_m);
    }
    double latitude_deg = latitude_rad / degree_rad;
    if (std::fabs(latitude_deg) > 90.0) {
        /* half of pi, rounded, may come out one unit above 90 */
        if (std::fabs(latitude_deg) > 90.0 + 1e-12) {
            return bst_fail(ctx, BST_ERR_ARGUMENT, "latitude of %.9g degrees is not in -90..90",
                            latitude_deg);
        }
        latitude_deg = std::copysign(90.0, latitude_deg);
    }
    try {
        GeographicLib::Geocentric::WGS84().Forward(latitude_deg, longitude_rad / degree_rad,
                                                   height_m, itrf_m[0], itrf_m[1], itrf_m[2]);
        return BST_OK;
    } catch (const std::exception &e) {
        return fail_exception(ctx, e.what());
    } catch (...) {
        return fail_exception(ctx, "unknown exception");
    }
}

bst_status bst_astro_itrf_to_geodetic(bst_ctx *ctx, const double itrf_m[3], double *latitude_rad,
                                      double *longitude_rad, double *height_m) noexcept {
    if (!std::isfinite(itrf_m[0]) || !std::isfinite(itrf_m[1]) || !std::isfinite(itrf_m[2])) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "ITRF position (%g, %g, %g) is not finite",
                        itrf_m[0], itrf_m[1], itrf_m[2]);
    }
    try {
        double latitude_deg, longitude_deg;
        GeographicLib::Geocentric::WGS84().Reverse(itrf_m[0], itrf_m[1], itrf_m[2], latitude_deg,
                                                   longitude_deg, *height_m);
        *latitude_rad = latitude_deg * degree_rad;
        *longitude_rad = longitude_deg * degree_rad;
        return BST_OK;
    } catch (const std::exception &e) {
        return fail_exception(ctx, e.what());
    } catch (...) {
        return fail_exception(ctx, "unknown exception");
    }
}
