#include <stdlib.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/analysis/loop/loop_model.h"
#include "sim/io/plot.h"

static const double two_pi = 2.0 * BST_PI;

enum { CURVE_POINTS = 600, STEP_POINTS = 400, STEP_LENGTH = 4096 };

/* Plot frequencies: from a thousandth of the crossover to half the sampling rate. */
static double curve_hz(const bst_loop *loop, double crossover_hz, int i) {
    double high = 0.5 / loop->dt_s, low = crossover_hz > 0.0 ? 1e-2 * crossover_hz : 1e-4 * high;
    return low * pow(0.9999 * high / low, (double)i / (CURVE_POINTS - 1));
}

static void put_frequency_data(FILE *o, const char *name, const bst_loop *loop,
                               const bst_loop_margins *m) {
    fprintf(o, "$%s << BST_END\n", name);
    double phase = 0.0;
    for (int i = 0; i < CURVE_POINTS; i++) {
        double hz = curve_hz(loop, m->crossover_hz, i);
        double complex l = loop->open(loop->user, two_pi * hz), s = 1.0 / (1.0 + l);
        double now = carg(l) / BST_DEG_RAD;
        if (i == 0) {
            phase = now > 90.0 ? now - 360.0 : now;
        } else {
            phase += now - phase - 360.0 * round((now - phase) / 360.0);
        }
        fprintf(o, "%.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", hz, 20.0 * log10(cabs(l)), phase,
                creal(l), cimag(l), 20.0 * log10(cabs(l * s)), 20.0 * log10(cabs(s)));
    }
    fputs("BST_END\n", o);
}

static void put_step_data(FILE *o, const char *name, const bst_loop *loop,
                          const bst_loop_margins *m) {
    double out[STEP_POINTS];
    /* at most 200 samples per period of the crossover */
    double every = m->crossover_hz > 0.0 ? 1.0 / (m->crossover_hz * loop->dt_s) : 1.0;
    bst_loop slow = *loop;
    if (every > 100.0) {
        slow.dt_s = loop->dt_s * floor(every / 50.0);
    }
    if (!m->stable) {
        fprintf(o, "$%s << BST_END\n0 nan\nBST_END\n", name);
        return;
    }
    bst_loop_step_response(&slow, STEP_LENGTH, NAN, out, STEP_POINTS);
    fprintf(o, "$%s << BST_END\n", name);
    double until = m->crossover_hz > 0.0 ? 6.0 / m->crossover_hz : STEP_POINTS * slow.dt_s;
    for (int n = 0; n < STEP_POINTS && (n < 12 || n * slow.dt_s <= until); n++) {
        fprintf(o, "%.9g %.9g\n", n * slow.dt_s, out[n]);
    }
    fputs("BST_END\n", o);
}

/* Writes the transfer from disturbance to pointing error, also above half the frame rate, and the
 * jitter density. */
static void put_rejection_data(FILE *o, const bst_loop_axis *axis, double period_s) {
    fputs("$rejection << BST_END\n", o);
    for (int i = 0; i < CURVE_POINTS; i++) {
        double hz = 1e-3 / period_s * pow(1e4, (double)i / (CURVE_POINTS - 1));
        double r = cabs(bst_tracking_rejection(axis->tracking, two_pi * hz, 0.0));
        double n =
            hz < 0.5 / period_s ? cabs(bst_tracking_noise(axis->tracking, two_pi * hz, 0.0)) : NAN;
        fprintf(o, "%.9g %.9g %.9g\n", hz, 20.0 * log10(r), 20.0 * log10(n));
    }
    fputs("BST_END\n", o);
}

static void put_panels(FILE *o, bool tracked) {
    const char *loop = tracked ? "tracking" : "servo";
    fprintf(o,
            "set multiplot layout 2,2 margins 0.07,0.97,0.07,0.93 spacing 0.14,0.11\n"
            "set grid linecolor rgb '#d8dde4'\nset logscale x\nset key top right samplen 2\n"
            "set xlabel 'Hz'\nset ylabel 'open loop, dB'\nset y2label 'phase, deg'\n"
            "set y2tics 90\nset ytics nomirror\nset yrange [-60:60]\nset y2range [-540:0]\n"
            "plot $%s using 1:2 with lines linecolor rgb '#1f4e9c' linewidth 1.6 title 'gain', "
            "$%s using 1:3 axes x1y2 with lines linecolor rgb '#c0392b' linewidth 1.4 title "
            "'phase', 0 with lines linecolor rgb '#8a97a8' notitle, "
            "-180 axes x1y2 with lines linecolor rgb '#8a97a8' dashtype 2 notitle\n",
            loop, loop);
    fprintf(o,
            "unset title\nunset logscale x\nunset y2label\nunset y2tics\nset ytics mirror\n"
            "set xlabel 'Re L'\nset ylabel 'Im L'\nset xrange [-3:1.5]\nset yrange [-2.2:2.2]\n"
            "set key off\nset object 1 circle at -1,0 size 0.5 front fillstyle empty border "
            "linecolor rgb '#2a8c6e'\n"
            "plot $%s using 4:5 with lines linecolor rgb '#1f4e9c' linewidth 1.6, "
            "$%s using 4:(-$5) with lines linecolor rgb '#1f4e9c' dashtype 2, "
            "'+' using (-1):(0) with points pointtype 2 linecolor rgb '#c0392b'\n"
            "unset object 1\nset autoscale x\nset autoscale y\nset key bottom right\n"
            "set xlabel 's'\nset ylabel 'closed loop, step'\nset yrange [0:*]\n"
            "plot $%s_step using 1:2 with %s linecolor rgb '#1f4e9c' linewidth 1.6 title '%s', "
            "1 with lines linecolor rgb '#8a97a8' notitle\n",
            loop, loop, loop, tracked ? "steps" : "lines", loop);
    fputs(
        "set logscale x\nset xlabel 'Hz'\nset ylabel 'dB'\nset yrange [-60:20]\n"
        "set key bottom right\n",
        o);
    if (tracked) {
        fputs(
            "plot $rejection using 1:2 with lines linecolor rgb '#1f4e9c' linewidth 1.6 title "
            "'pointing error / disturbance', $rejection using 1:3 with lines linecolor rgb "
            "'#c0392b' linewidth 1.2 title 'pointing error / error of a frame', "
            "0 with lines linecolor rgb '#8a97a8' notitle\n",
            o);
    } else {
        fputs(
            "plot $servo using 1:7 with lines linecolor rgb '#1f4e9c' linewidth 1.6 title "
            "'sensitivity', $servo using 1:6 with lines linecolor rgb '#c0392b' linewidth 1.2 "
            "title 'closed loop', 0 with lines linecolor rgb '#8a97a8' notitle\n",
            o);
    }
    fputs("unset multiplot\n", o);
}

bst_status bst_loop_plot(bst_ctx *ctx, const char *path, const bst_loop_model *model) {
    const bst_loop_axis *axis = &model->axis[0];
    bst_plot plot;
    BST_TRY(bst_plot_begin(ctx, &plot, path, 1100, 850));
    FILE *o = plot.script;
    const bst_loop *loop = axis->tracked ? &axis->loop : &axis->servo.loop;
    const bst_loop_margins *m = axis->tracked ? &axis->margins : &axis->servo.margins;
    put_frequency_data(o, axis->tracked ? "tracking" : "servo", loop, m);
    put_step_data(o, axis->tracked ? "tracking_step" : "servo_step", loop, m);
    if (axis->tracked) {
        put_rejection_data(o, axis, model->timing.period_s);
    }
    fprintf(o,
            "set title \"%s/%s, %s axis: %s%s, gain margin %.3g dB, phase margin %.3g deg, "
            "delay margin %.3g s, peak %.3g\" noenhanced offset 34,0\n",
            model->observer_name, model->sensor_name, axis->name,
            axis->tracked ? "tracking loop, " : "servo", axis->tracked ? model->compensator : "",
            m->gain_margin_db, m->phase_margin_deg, m->delay_margin_s, m->sensitivity_peak);
    put_panels(o, axis->tracked);
    return bst_plot_end(ctx, &plot, NULL);
}
