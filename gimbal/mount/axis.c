#include "gimbal/mount/axis.h"

#include <assert.h>
#include <math.h>

#include "boresight/vec.h"
#include "sim/core/invariant.h"

#define SHAPED_SHARE 0.95    /* share of the axis limits for the shaped reference */
#define BRAKE_SHARE 0.8      /* share of the shaped acceleration for the braking curve */
#define SHAPER_GAIN_MAX 40.0 /* 1/s: settles in about 0.15 s */
#define SHAPER_GAIN_STEP 0.2 /* largest gain * dt */

static double clamp(double x, double limit) {
    return x > limit ? limit : x < -limit ? -limit : x;
}

void bst_axis_init(bst_axis *axis, const bst_axis_spec *spec) {
    assert(axis && spec && bst_is_positive(spec->dt_s));
    *axis = (bst_axis){.spec = *spec};
    double h = spec->dt_s, wn = spec->natural_frequency_radps;
    axis->shaper_gain_per_s = fmin(SHAPER_GAIN_MAX, SHAPER_GAIN_STEP / h);
    /* x'' + 2 s x' + wn^2 x = 0 with s = d wn: c = cos(wd h), g = sin(wd h) / wd; cosh and sinh
     * above critical damping, by series near it */
    double s = spec->damping * wn;
    double wd2 = wn * wn - s * s;
    double x = wd2 * h * h, c, g;
    if (fabs(x) < 1e-6) {
        c = 1.0 - x / 2.0;
        g = h * (1.0 - x / 6.0);
    } else if (x > 0.0) {
        c = cos(sqrt(x));
        g = h * sin(sqrt(x)) / sqrt(x);
    } else {
        c = cosh(sqrt(-x));
        g = h * sinh(sqrt(-x)) / sqrt(-x);
    }
    double decay = exp(-s * h);
    axis->phi[0][0] = decay * (c + s * g);
    axis->phi[0][1] = decay * g;
    axis->phi[1][0] = -wn * wn * decay * g;
    axis->phi[1][1] = decay * (c - s * g);
    axis->gamma[0] = (1.0 - axis->phi[0][0]) / (wn * wn);
    axis->gamma[1] = axis->phi[0][1];
}

void bst_axis_archive(bst_axis *axis, bst_archive *archive) {
    BST_ARCHIVE(archive, axis->reference_rad);
    BST_ARCHIVE(archive, axis->reference_radps);
    BST_ARCHIVE(archive, axis->angle_rad);
    BST_ARCHIVE(archive, axis->rate_radps);
    bst_archive_bool(archive, &axis->limited);
}

double bst_axis_shape(bst_axis *axis, double target_rad, double target_radps) {
    double h = axis->spec.dt_s;
    double accel_limit = SHAPED_SHARE * axis->spec.accel_limit_radps2;
    double rate_limit = SHAPED_SHARE * axis->spec.rate_limit_radps;
    /* relative to the target at the step's start */
    double d = axis->reference_rad - (target_rad - target_radps * h);
    double brake = BRAKE_SHARE * accel_limit;
    double k = axis->shaper_gain_per_s;
    double linear = brake / (k * k);
    double approach =
        fabs(d) <= linear ? k * fabs(d) : sqrt(2.0 * brake * (fabs(d) - 0.5 * linear));
    double wanted = target_radps - copysign(approach, d);
    double rate = clamp(wanted, rate_limit);
    double accel = clamp((rate - axis->reference_radps) / h, accel_limit);
    if (rate != wanted || fabs(accel) >= accel_limit) {
        axis->limited = true;
    }
    return accel;
}

void bst_axis_step(bst_axis *axis, double target_rad, double target_radps, double noise_rad) {
    assert(axis && isfinite(target_rad) && isfinite(target_radps) && isfinite(noise_rad));
    const bst_axis_spec *spec = &axis->spec;
    double h = spec->dt_s, wn = spec->natural_frequency_radps;
    axis->limited = false;
    double accel = bst_axis_shape(axis, target_rad, target_radps);
    double e = axis->angle_rad - axis->reference_rad;
    double e_rate = axis->rate_radps - axis->reference_radps;
    axis->reference_rad += axis->reference_radps * h + 0.5 * accel * h * h;
    axis->reference_radps += accel * h;

    double drive = -accel - wn * wn * noise_rad;
    double e_next = axis->phi[0][0] * e + axis->phi[0][1] * e_rate + axis->gamma[0] * drive;
    double e_rate_next = axis->phi[1][0] * e + axis->phi[1][1] * e_rate + axis->gamma[1] * drive;
    double angle = axis->reference_rad + e_next;
    double rate = axis->reference_radps + e_rate_next;

    double allowed = clamp(rate, spec->rate_limit_radps);
    double change = clamp(allowed - axis->rate_radps, spec->accel_limit_radps2 * h);
    allowed = axis->rate_radps + change;
    if (allowed != rate) {
        /* a difference in the last digit is rounding, not a limit */
        if (fabs(allowed - rate) > 1e-12 * spec->rate_limit_radps) {
            angle = axis->angle_rad + 0.5 * (axis->rate_radps + allowed) * h;
            axis->limited = true;
        }
        rate = allowed;
    }
    axis->angle_rad = angle;
    axis->rate_radps = rate;
}

void bst_axis_unwind(bst_axis *axis, double turns) {
    double turn = 2.0 * BST_PI * turns;
    axis->angle_rad += turn;
    axis->reference_rad += turn;
}
