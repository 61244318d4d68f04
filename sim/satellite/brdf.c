#include "sim/satellite/brdf.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"

/* x^n for n >= 0, fast for small whole n. */
static double power(double x, double n) {
    return x > 0.0 ? pow(x, n) : n == 0.0 ? 1.0 : 0.0;
}

static double fifth(double x) {
    double x2 = x * x;
    return x2 * x2 * x;
}

/* Fresnel reflectance by Schlick's approximation; cosine: of the angle to the half vector. */
static double fresnel(double normal_incidence, double cosine) {
    return normal_incidence + (1.0 - normal_incidence) * fifth(1.0 - cosine);
}

/* Cosines of the half vector. */
typedef struct half {
    double normal; /* between half vector and surface normal */
    double light;  /* between half vector and the light, or the observer */
} half;

static half half_of(double cos_in, double cos_out, double cos_between) {
    double sum = sqrt(fmax(2.0 + 2.0 * cos_between, 1e-30)); /* length of the sum of both */
    return (half){fmin((cos_in + cos_out) / sum, 1.0), fmin(0.5 * sum, 1.0)};
}

static double phong(const bst_brdf *f, double in, double out, double between) {
    double mirror = 2.0 * in * out - between; /* cosine between reflected ray and observer */
    double lobe = f->specular * (f->exponent + 2.0) / (2.0 * BST_PI) * power(mirror, f->exponent);
    return f->diffuse / BST_PI + lobe;
}

static double ashikhmin_shirley(const bst_brdf *f, double in, double out, double between) {
    half h = half_of(in, out, between);
    double lobe = (f->exponent + 1.0) / (8.0 * BST_PI) * power(h.normal, f->exponent) /
                  (h.light * fmax(in, out)) * fresnel(f->specular, h.light);
    return lobe + 28.0 * f->diffuse / (23.0 * BST_PI) * (1.0 - f->specular) *
                      (1.0 - fifth(1.0 - 0.5 * in)) * (1.0 - fifth(1.0 - 0.5 * out));
}

static double cook_torrance(const bst_brdf *f, double in, double out, double between) {
    half h = half_of(in, out, between);
    double a2 = f->roughness * f->roughness, n2 = h.normal * h.normal;
    double width = n2 * a2 + (1.0 - n2);
    /* masking over 4 cos cos, height correlated */
    double mask =
        0.5 / (in * sqrt(out * out * (1.0 - a2) + a2) + out * sqrt(in * in * (1.0 - a2) + a2));
    double lobe = a2 / (BST_PI * width * width) * mask * fresnel(f->specular, h.light);
    /* what enters the coating and leaves it again */
    return lobe + f->diffuse / BST_PI * (1.0 - fresnel(f->specular, in)) *
                      (1.0 - fresnel(f->specular, out));
}

static double maxwell_beard(const bst_brdf *f, double in, double out, double between) {
    half h = half_of(in, out, between);
    double n2 = h.normal * h.normal, tangent2 = (1.0 - n2) / n2, s2 = f->roughness * f->roughness;
    /* slopes: s^2 / (pi cos^4 (s^2 + tan^2)^2) integrates to 1 over projected solid angle */
    double spread = s2 + tangent2;
    double slopes = s2 / (BST_PI * n2 * n2 * spread * spread);
    double mask = fmin(1.0, 2.0 * h.normal * fmin(in, out) / h.light); /* Torrance and Sparrow */
    double tilt = acos(h.normal), bistatic = acos(h.light);
    double ratio = f->omega_rad > 0.0 ? tilt / f->omega_rad : 0.0;
    double shadow =
        f->tau_rad > 0.0 ? (1.0 + ratio * exp(-2.0 * bistatic / f->tau_rad)) / (1.0 + ratio) : 1.0;
    double lobe = fresnel(f->specular, h.light) * slopes * mask * shadow / (4.0 * in * out);
    return lobe + f->diffuse / BST_PI + 2.0 * f->volume / (BST_PI * (in + out));
}

/* log10 of the BRDF is a series in D, the distance of the direction cosines from the specular
 * direction. */
static double binomial(const bst_brdf *f, double in, double out, double between) {
    double sum = in + out, d2 = fmax(2.0 + 2.0 * between - sum * sum, 0.0);
    double series = f->b[0] + f->b[1] * sqrt(d2);
    for (int j = 0; j < f->terms; j++) {
        series += 0.5 * f->c[j] * log10(1.0 + pow(f->base, f->first_power + j) * d2);
    }
    return pow(10.0, fmin(series, 12.0));
}

static double table(const bst_brdf *f, double in, double out, double between) {
    double sum = in + out;
    double d = sqrt(fmax(2.0 + 2.0 * between - sum * sum, 0.0));
    double v = in * out - between, s = sqrt(fmax(d * d + 4.0 * v, 0.0));
    double a = 0.5 * (s - d), b = fmin(0.5 * (s + d), 1.0);
    /* the pair of directions in the plane with the same D and V, in both orders */
    double forth = bst_brdf_table_value(f->table, fabs(a), a < 0.0 ? -b : b);
    double back = bst_brdf_table_value(f->table, b, a);
    return 0.5 * (forth + back);
}

double bst_brdf_value(const bst_brdf *brdf, double cos_in, double cos_out, double cos_between) {
    switch (brdf->model) {
        case BST_BRDF_PHONG:
            return phong(brdf, cos_in, cos_out, cos_between);
        case BST_BRDF_ASHIKHMIN_SHIRLEY:
            return ashikhmin_shirley(brdf, cos_in, cos_out, cos_between);
        case BST_BRDF_COOK_TORRANCE:
            return cook_torrance(brdf, cos_in, cos_out, cos_between);
        case BST_BRDF_BINOMIAL:
            return binomial(brdf, cos_in, cos_out, cos_between);
        case BST_BRDF_MAXWELL_BEARD:
            return maxwell_beard(brdf, cos_in, cos_out, cos_between);
        case BST_BRDF_TABLE:
            return table(brdf, cos_in, cos_out, cos_between);
        default:
            return brdf->diffuse / BST_PI;
    }
}

double bst_brdf_lobe_rad(const bst_brdf *brdf) {
    switch (brdf->model) {
        case BST_BRDF_PHONG: /* half the angle from the mirror direction */
            return brdf->specular > 0.0
                       ? fmin(0.5 * sqrt(2.0 / (brdf->exponent + 1e-9)), 0.5 * BST_PI)
                       : 0.5 * BST_PI;
        case BST_BRDF_ASHIKHMIN_SHIRLEY:
            return fmin(sqrt(2.0 / (brdf->exponent + 1e-9)), 0.5 * BST_PI);
        case BST_BRDF_COOK_TORRANCE:
        case BST_BRDF_MAXWELL_BEARD:
            return atan(brdf->roughness);
        case BST_BRDF_BINOMIAL:
        case BST_BRDF_TABLE:
            return 0.05; /* measured lobes; tables have steps of a degree */
        default:
            return 0.5 * BST_PI;
    }
}

/* Reflectance by `polar` times `around` directions. */
static double integrate(const bst_brdf *brdf, double cos_in, int polar, int around) {
    /* polar coordinates about the mirror direction, so that narrow lobes are resolved: the polar
     * angle is mapped by a power, steps grow from the lobe's centre */
    double sin_in = sqrt(1.0 - cos_in * cos_in), sum = 0.0;
    for (int i = 0; i < polar; i++) {
        double t = (i + 0.5) / polar, p = BST_PI * t * t * t;
        double weight = BST_PI * 3.0 * t * t / polar * sin(p) * 2.0 * BST_PI / around;
        for (int k = 0; k < around; k++) {
            double a = 2.0 * BST_PI * (k + 0.5) / around;
            /* mirror direction (-sin_in, 0, cos_in), perpendicular (cos_in, 0, sin_in), (0, 1, 0)
             */
            double x = -cos(p) * sin_in + sin(p) * cos(a) * cos_in;
            double z = cos(p) * cos_in + sin(p) * cos(a) * sin_in;
            if (z > 0.0) {
                sum += weight * z * bst_brdf_value(brdf, cos_in, z, x * sin_in + z * cos_in);
            }
        }
    }
    return sum;
}

double bst_brdf_reflectance(const bst_brdf *brdf, double cos_in) {
    return integrate(brdf, cos_in, 400, 72);
}

bst_status bst_brdf_check(bst_ctx *ctx, const bst_brdf *brdf) {
    static const double angles_deg[] = {0, 30, 50, 65, 75, 85};
    if (brdf->model == BST_BRDF_TABLE) {
        assert(brdf->table);
        return BST_OK; /* as measured */
    }
    for (int i = 0; i < 6; i++) {
        double cosine = cos(angles_deg[i] * BST_DEG_RAD);
        /* a coarse sum, within 3 %, is enough for most; scenarios have hundreds of materials */
        double share = integrate(brdf, cosine, 100, 24);
        share = share > 0.95 ? bst_brdf_reflectance(brdf, cosine) : share;
        if (!(share <= 1.003)) { /* accuracy of the integral */
            return bst_fail(ctx, BST_ERR_CONFIG,
                            "the surface reflects %.4g times the light that it receives at %g "
                            "degrees incidence (allowed: at most 1); reduce diffuse or specular",
                            share, angles_deg[i]);
        }
    }
    return BST_OK;
}
