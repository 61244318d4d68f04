#include "sim/world/scene/zodiacal.h"

enum { LONGITUDES = 19, LATITUDES = 11 };

static const double longitude_deg[LONGITUDES] = {0,  5,  10, 15,  20,  25,  30,  35,  40, 45,
                                                 60, 75, 90, 105, 120, 135, 150, 165, 180};
static const double latitude_deg[LATITUDES] = {0, 5, 10, 15, 20, 25, 30, 45, 60, 75, 90};

/* surface brightness in S10; 0: no value in the table */
static const short table[LONGITUDES][LATITUDES] = {
    {0, 0, 0, 2450, 1260, 770, 500, 215, 117, 78, 60},
    {0, 0, 0, 2300, 1200, 740, 490, 212, 117, 78, 60},
    {0, 0, 3700, 1930, 1070, 675, 460, 206, 116, 78, 60},
    {9000, 5300, 2690, 1450, 870, 590, 410, 196, 114, 78, 60},
    {5000, 3500, 1880, 1100, 710, 495, 355, 185, 110, 77, 60},
    {3000, 2210, 1350, 860, 585, 425, 320, 174, 106, 76, 60},
    {1940, 1460, 955, 660, 480, 365, 285, 162, 102, 74, 60},
    {1290, 990, 710, 530, 400, 310, 250, 151, 98, 73, 60},
    {925, 735, 545, 415, 325, 264, 220, 140, 94, 72, 60},
    {710, 570, 435, 345, 278, 228, 195, 130, 91, 70, 60},
    {395, 345, 275, 228, 190, 163, 143, 105, 81, 67, 60},
    {264, 248, 210, 177, 153, 134, 118, 91, 73, 64, 60},
    {202, 196, 176, 151, 130, 115, 103, 81, 67, 62, 60},
    {166, 164, 154, 133, 117, 104, 93, 75, 64, 60, 60},
    {147, 145, 138, 120, 108, 98, 88, 70, 60, 58, 60},
    {140, 139, 130, 115, 105, 95, 86, 70, 60, 57, 60},
    {140, 139, 129, 116, 107, 99, 91, 75, 62, 56, 60},
    {153, 150, 140, 129, 118, 110, 102, 81, 64, 56, 60},
    {180, 166, 152, 139, 127, 116, 105, 82, 65, 56, 60},
};

#define INNER_DEG 15.0 /* half width of the square around the Sun without table values */
#define INNER_SLOPE 2.3
#define SOLAR_LIMB_DEG 0.27

/* Segment of a table axis that contains a value, and the fraction in it. */
static int segment(const double *nodes, int count, double v, double *share) {
    int i = 0;
    while (i + 2 < count && v > nodes[i + 1]) {
        i++;
    }
    *share = (v - nodes[i]) / (nodes[i + 1] - nodes[i]);
    return i;
}

/* Zodiacal light by logarithmic interpolation in the table; longitude from the Sun. */
static double from_table(double longitude, double latitude) {
    double s, t;
    int i = segment(longitude_deg, LONGITUDES, longitude, &s);
    int j = segment(latitude_deg, LATITUDES, latitude, &t);
    /* a corner without a value has zero weight: the point is on the far side of the cell */
    const double weight[4] = {(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t};
    const short value[4] = {table[i][j], table[i + 1][j], table[i][j + 1], table[i + 1][j + 1]};
    double sum = 0.0;
    for (int k = 0; k < 4; k++) {
        sum += value[k] > 0 ? weight[k] * log((double)value[k]) : 0.0;
    }
    return exp(sum);
}

double bst_zodiacal_s10(double longitude_rad, double latitude_rad) {
    double longitude = fabs(remainder(longitude_rad, 2.0 * BST_PI)) / BST_DEG_RAD;
    double latitude = fmin(fabs(latitude_rad) / BST_DEG_RAD, 90.0);
    double side = fmax(longitude, latitude);
    if (side >= INNER_DEG) {
        return from_table(longitude, latitude);
    }
    /* follow the line from the Sun to the border of the square; at the Sun, along the ecliptic */
    double distance = hypot(longitude, latitude);
    double grow = distance > 0.0 ? INNER_DEG / side : 1.0;
    double at_longitude = distance > 0.0 ? fmin(longitude * grow, INNER_DEG) : INNER_DEG;
    double at_latitude = distance > 0.0 ? fmin(latitude * grow, INNER_DEG) : 0.0;
    double border = hypot(at_longitude, at_latitude);
    return from_table(at_longitude, at_latitude) *
           pow(border / fmax(distance, SOLAR_LIMB_DEG), INNER_SLOPE);
}

double bst_zodiacal_towards(bst_vec3 icrs, bst_vec3 sun) {
    const double obliquity = 84381.406 * BST_ARCSEC_RAD;
    const double c = cos(obliquity), s = sin(obliquity);
    double longitude = atan2(c * icrs.y + s * icrs.z, icrs.x);
    double latitude = asin(fmin(fmax(c * icrs.z - s * icrs.y, -1.0), 1.0));
    return bst_zodiacal_s10(longitude - atan2(c * sun.y + s * sun.z, sun.x), latitude);
}
