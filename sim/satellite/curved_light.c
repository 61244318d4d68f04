#include "sim/satellite/curved_light.h"

#include "sim/satellite/gauss_legendre.h"

enum { BREAKS_MAX = 20 };

/* Borders of the panels of an integral. */
typedef struct breaks {
    double at[BREAKS_MAX];
    int count;
} breaks;

void bst_sort_few(double *x, int count) {
    for (int i = 1; i < count; i++) {
        double at = x[i];
        int k = i;
        for (; k > 0 && x[k - 1] > at; k--) {
            x[k] = x[k - 1];
        }
        x[k] = at;
    }
}

/* Adds a border within (low, high). */
static void add(breaks *b, double x, double low, double high) {
    if (x > low && x < high) {
        b->at[b->count++] = x;
    }
}

/* Panels for [low, high] with finer ones about the centre of a lobe. `fine`: for an error of 3e-5
 * of a lobe's light in place of 4e-4. */
static breaks panels(double low, double high, double centre, double lobe_rad, bool fine) {
    static const double coarse_steps[] = {1.5, 5.0, 18.0};
    static const double fine_steps[] = {0.8, 2.0, 4.5, 11.0, 30.0};
    const double *steps = fine ? fine_steps : coarse_steps;
    int count = fine ? 5 : 3;
    breaks b = {{low, high}, 2};
    if (lobe_rad < 1.0) {
        for (int i = 0; i < count; i++) {
            add(&b, centre - steps[i] * lobe_rad, low, high);
            add(&b, centre + steps[i] * lobe_rad, low, high);
        }
    } else {
        add(&b, 0.5 * (low + high), low, high);
    }
    bst_sort_few(b.at, b.count);
    return b;
}

static double sphere_light(const bst_curved *c, const bst_brdf *brdf, bst_vec3 sun,
                           bst_vec3 observer) {
    double phase = bst_vec3_angle(sun, observer), cosine = cos(phase), sum = 0.0;
    double lobe = bst_brdf_lobe_rad(brdf);
    if (brdf->model == BST_BRDF_LAMBERT) {
        return 2.0 / 3.0 * c->radius_m * c->radius_m * brdf->diffuse / BST_PI *
               (sin(phase) + (BST_PI - phase) * cosine);
    }
    /* longitude in the plane of both directions, from the observer; latitude from that plane */
    breaks longitude = panels(phase - 0.5 * BST_PI, 0.5 * BST_PI, 0.5 * phase, lobe, false);
    breaks latitude = panels(0.0, 0.5 * BST_PI, 0.0, lobe, false);
    for (int p = 0; p + 1 < longitude.count; p++) {
        double half = 0.5 * (longitude.at[p + 1] - longitude.at[p]);
        for (int i = 0; i < BST_GAUSS_POINTS; i++) {
            double l = longitude.at[p] + half * (1.0 + bst_gauss_place[i]);
            double in = cos(l - phase), out = cos(l), inner = 0.0;
            for (int q = 0; q + 1 < latitude.count; q++) {
                double step = 0.5 * (latitude.at[q + 1] - latitude.at[q]);
                for (int k = 0; k < BST_GAUSS_POINTS; k++) {
                    double cb = cos(latitude.at[q] + step * (1.0 + bst_gauss_place[k]));
                    inner += step * bst_gauss_weight[k] * cb * cb * cb *
                             bst_brdf_value(brdf, in * cb, out * cb, cosine);
                }
            }
            sum += half * bst_gauss_weight[i] * in * out * inner;
        }
    }
    return 2.0 * c->radius_m * c->radius_m * sum; /* both hemispheres of latitude */
}

/* Cosine of the angle to a normal as a function of azimuth: level + height cos(azimuth - peak). */
typedef struct wave {
    double level, height, peak;
} wave;

static wave wave_of(const bst_curved *c, bst_vec3 d, double radial, double axial) {
    double x = bst_vec3_dot(d, c->x), y = bst_vec3_dot(d, c->y);
    return (wave){axial * bst_vec3_dot(d, c->z), radial * hypot(x, y),
                  atan2(radial * y, radial * x)};
}

static double wave_at(wave w, double azimuth) {
    return w.level + fabs(w.height) * cos(azimuth - w.peak);
}

/* Adds the zeros of a wave, in [from, from + 2 pi). */
static void add_zeros(breaks *b, wave w, double from) {
    double k = -w.level / fabs(w.height);
    if (fabs(k) < 1.0) {
        for (int side = -1; side <= 1; side += 2) {
            double x = w.peak + side * acos(k);
            x -= 2.0 * BST_PI * floor((x - from) / (2.0 * BST_PI));
            add(b, x, from, from + 2.0 * BST_PI);
        }
    }
}

/* A wave as level + x cos(azimuth) + y sin(azimuth). */
typedef struct plain_wave {
    double level, x, y;
} plain_wave;

static plain_wave plain_wave_of(const bst_curved *c, bst_vec3 d, double radial, double axial) {
    return (plain_wave){axial * bst_vec3_dot(d, c->z), radial * bst_vec3_dot(d, c->x),
                        radial * bst_vec3_dot(d, c->y)};
}

/* Adds the zeros of a wave, in [0, 2 pi). Returned: false if it is nowhere above 0. */
static bool add_plain_zeros(breaks *b, plain_wave w) {
    double height = hypot(w.x, w.y);
    if (fabs(w.level) < height) {
        add_zeros(b, (wave){w.level, height, atan2(w.y, w.x)}, 0.0);
    }
    return w.level + height > 0.0;
}

/* Integral of the product of two waves from azimuth 0 to one with that cosine and sine. */
static double product_to(plain_wave a, plain_wave b, double azimuth, double c, double s) {
    return (a.level * b.level + 0.5 * (a.x * b.x + a.y * b.y)) * azimuth +
           a.level * (b.x * s + b.y * (1.0 - c)) + b.level * (a.x * s + a.y * (1.0 - c)) +
           0.5 * ((a.x * b.x - a.y * b.y) * s * c + (a.x * b.y + a.y * b.x) * s * s);
}

/* By Lambert's law: the integral over the azimuths that are lit and in sight is elementary. */
static double lambert_cone_light(const bst_curved *c, double diffuse, double radial, double axial,
                                 bst_vec3 sun, bst_vec3 observer) {
    plain_wave in = plain_wave_of(c, sun, radial, axial);
    plain_wave out = plain_wave_of(c, observer, radial, axial);
    breaks b = {{0.0, 2.0 * BST_PI}, 2};
    if (!add_plain_zeros(&b, in) || !add_plain_zeros(&b, out)) {
        return 0.0;
    }
    bst_sort_few(b.at, b.count);
    double sum = 0.0;
    for (int p = 0; p + 1 < b.count; p++) {
        double from = b.at[p], to = b.at[p + 1], middle = 0.5 * (from + to);
        double cm = cos(middle), sm = sin(middle);
        if (in.level + in.x * cm + in.y * sm > 0.0 && out.level + out.x * cm + out.y * sm > 0.0) {
            sum += product_to(in, out, to, cos(to), sin(to)) -
                   product_to(in, out, from, cos(from), sin(from));
        }
    }
    return diffuse / BST_PI * sum;
}

/* What the light of a cylinder or cone depends on. */
typedef struct cone_waves {
    double radial, axial; /* of the normal */
    wave in, out;         /* cosines of incidence and reflection */
    double peak;          /* azimuth of the half vector */
    breaks borders;       /* of panels, over a turn */
} cone_waves;

static cone_waves waves_of(const bst_curved *c, const bst_brdf *brdf, bst_vec3 sun,
                           bst_vec3 observer) {
    double rise = c->top_radius_m - c->radius_m, slant = hypot(rise, c->length_m);
    cone_waves w = {.radial = c->side * c->length_m / slant, .axial = -c->side * rise / slant};
    w.in = wave_of(c, sun, w.radial, w.axial);
    w.out = wave_of(c, observer, w.radial, w.axial);
    wave half = wave_of(c, bst_vec3_add(sun, observer), w.radial, w.axial);
    double from = half.peak - BST_PI;
    w.peak = half.peak;
    w.borders = panels(from, from + 2.0 * BST_PI, half.peak, bst_brdf_lobe_rad(brdf), true);
    add_zeros(&w.borders, w.in, from);
    add_zeros(&w.borders, w.out, from);
    bst_sort_few(w.borders.at, w.borders.count);
    return w;
}

/* Light of a cylinder or cone. */
static double cone_light(const bst_curved *c, const bst_brdf *brdf, bst_vec3 sun,
                         bst_vec3 observer) {
    double rise = c->top_radius_m - c->radius_m, slant = hypot(rise, c->length_m), sum = 0.0;
    double area = 0.5 * slant * (c->radius_m + c->top_radius_m); /* by azimuth */
    if (brdf->model == BST_BRDF_LAMBERT) {
        return area * lambert_cone_light(c, brdf->diffuse, c->side * c->length_m / slant,
                                         -c->side * rise / slant, sun, observer);
    }
    double cosine = bst_vec3_dot(sun, observer);
    cone_waves w = waves_of(c, brdf, sun, observer);
    wave in = w.in, out = w.out;
    breaks b = w.borders;
    for (int p = 0; p + 1 < b.count; p++) {
        double step = 0.5 * (b.at[p + 1] - b.at[p]), middle = b.at[p] + step;
        if (!(wave_at(in, middle) > 0.0 && wave_at(out, middle) > 0.0)) {
            continue;
        }
        /* by the sum of angles, with the points as pairs about the middle */
        double ci = fabs(in.height) * cos(middle - in.peak);
        double si = fabs(in.height) * sin(middle - in.peak);
        double co = fabs(out.height) * cos(middle - out.peak);
        double so = fabs(out.height) * sin(middle - out.peak);
        double cosine_at[BST_GAUSS_POINTS / 2], sine_at[BST_GAUSS_POINTS / 2];
        for (int i = 0; i < BST_GAUSS_POINTS / 2; i++) {
            cosine_at[i] = cos(step * bst_gauss_place[i]);
            sine_at[i] = sin(step * bst_gauss_place[i]);
        }
        for (int i = 0; i < BST_GAUSS_POINTS; i++) {
            int k = i < BST_GAUSS_POINTS / 2 ? i : BST_GAUSS_POINTS - 1 - i;
            double sine = i == k ? sine_at[k] : -sine_at[k];
            double mu_in = in.level + ci * cosine_at[k] - si * sine;
            double mu_out = out.level + co * cosine_at[k] - so * sine;
            if (mu_in > 0.0 && mu_out > 0.0) {
                sum += step * bst_gauss_weight[i] * mu_in * mu_out *
                       bst_brdf_value(brdf, fmin(mu_in, 1.0), fmin(mu_out, 1.0), cosine);
            }
        }
    }
    return area * sum;
}

int bst_curved_panels(const bst_curved *c, const bst_brdf *brdf, bst_vec3 sun, bst_vec3 observer,
                      double (*panel)[2]) {
    int count = 0;
    bool lobe = bst_brdf_lobe_rad(brdf) < 1.0; /* with a border in its middle */
    if (c->sphere) {
        double phase = bst_vec3_angle(sun, observer);
        breaks b =
            panels(phase - 0.5 * BST_PI, 0.5 * BST_PI, 0.5 * phase, bst_brdf_lobe_rad(brdf), true);
        if (lobe) {
            add(&b, 0.5 * phase, phase - 0.5 * BST_PI, 0.5 * BST_PI);
            bst_sort_few(b.at, b.count);
        }
        for (; count + 1 < b.count; count++) {
            panel[count][0] = b.at[count];
            panel[count][1] = b.at[count + 1];
        }
        return count;
    }
    cone_waves w = waves_of(c, brdf, sun, observer);
    if (lobe) {
        add(&w.borders, w.peak, -INFINITY, INFINITY);
        bst_sort_few(w.borders.at, w.borders.count);
    }
    for (int p = 0; p + 1 < w.borders.count; p++) {
        double from = w.borders.at[p], to = w.borders.at[p + 1], middle = 0.5 * (from + to);
        if (wave_at(w.in, middle) > 0.0 && wave_at(w.out, middle) > 0.0) {
            panel[count][0] = from;
            panel[count++][1] = to;
        }
    }
    return count;
}

double bst_curved_light(const bst_curved *curved, const bst_brdf *brdf, bst_vec3 sun,
                        bst_vec3 observer) {
    return curved->sphere ? sphere_light(curved, brdf, sun, observer)
                          : cone_light(curved, brdf, sun, observer);
}
