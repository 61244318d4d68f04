#include "tests/astro/spherical_harmonic.h"

#include <GeographicLib/SphericalHarmonic.hpp>
#include <vector>

double test_spherical_harmonic(double gm, double radius, int degree, int order,
                               const double (*cs)[2], const double position[3],
                               double gradient[3]) {
    std::vector<double> c, s;
    for (int m = 0; m <= degree; m++) { /* its columns run along m */
        for (int n = m; n <= degree; n++) {
            c.push_back(cs[n * (n + 1) / 2 + m][0]);
            if (m > 0) {
                s.push_back(cs[n * (n + 1) / 2 + m][1]);
            }
        }
    }
    const double scale = gm / radius;
    GeographicLib::SphericalHarmonic sum(c, s, degree, degree, order, radius);
    double x, y, z, u = sum(position[0], position[1], position[2], x, y, z);
    gradient[0] = x * scale;
    gradient[1] = y * scale;
    gradient[2] = z * scale;
    return u * scale;
}
