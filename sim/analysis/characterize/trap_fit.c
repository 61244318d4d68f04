#include "sim/analysis/characterize/trap_fit.h"

#include <math.h>
#include <string.h>

#include "sim/analysis/characterize/simplex_search.h"
#include "sim/analysis/characterize/trap_correction.h"

/* Pixels before the hot one, in which traps reach their state in the background; starts of the
 * search; reference charge of the result. */
enum { BEFORE = 40, MOST_TURNS = 2000, PARAMETERS = 5 };
static const double REFERENCE_E = 10000.0;
/* Uncertainty of a trail, share of the charge, and relative: from the scatter of groups of hot
 * pixels of tests/e2e/test_characterize.py. */
static const double LEAST_SIGMA = 5e-4, RELATIVE_SIGMA = 0.03;

/* What the cost function needs. */
typedef struct fit {
    const bst_trap_fit_input *input;
    double profile[BST_TRAIL_PIXELS]; /* trail less the other side */
    double charge_e[BST_TRAIL_CLASSES], sums[BST_TRAIL_CLASSES], median_e;
} fit;

/* Trail of a hot pixel: shares of its charge, both over the background. */
static void model_trail(const bst_detector_traps_config *t, const bst_trap_fit_input *input,
                        double charge_e, double *trail) {
    enum { PIXELS = BEFORE + 1 + BST_TRAIL_PIXELS };
    float line[PIXELS];
    for (int i = 0; i < PIXELS; i++) {
        line[i] = (float)(input->background_e + (i == BEFORE ? charge_e : 0.0));
    }
    bst_trap_pass_line(t, input->transfers - BEFORE, PIXELS, 1, line);
    const float *hot = line + BEFORE; /* over the level before it */
    for (int k = 1; k <= BST_TRAIL_PIXELS; k++) {
        trail[k - 1] = ((double)hot[k] - input->background_e) / (double)(hot[0] - hot[-1]);
    }
}

/* Traps of the parameters: logarithms of densities and times, logit of the exponent. */
static bst_detector_traps_config of_parameters(const double *x) {
    return (bst_detector_traps_config){.traps_per_px = {exp(x[0]), exp(x[1]), 0.0},
                                       .release_px = {0.05 + exp(x[2]), 0.05 + exp(x[3]), 1.0},
                                       .fill_exponent = 1.0 / (1.0 + exp(-x[4])),
                                       .reference_e = REFERENCE_E};
}

/* Squares of the differences of profile and sums, with weights (callback: cost), or without. */
static double misfit(const fit *f, const bst_detector_traps_config *t, bool weighted) {
    double trail[BST_TRAIL_PIXELS], total = 0.0;
    model_trail(t, f->input, f->median_e, trail);
    for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
        double d = trail[k] - f->profile[k];
        double sigma = weighted ? LEAST_SIGMA + RELATIVE_SIGMA * fabs(f->profile[k]) : 1.0;
        total += d * d / (sigma * sigma);
    }
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        double sum = 0.0;
        model_trail(t, f->input, f->charge_e[c], trail);
        for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
            sum += trail[k];
        }
        double d = sum - f->sums[c];
        double sigma = weighted ? 2.0 * (LEAST_SIGMA + RELATIVE_SIGMA * fabs(f->sums[c])) : 1.0;
        total += d * d / (sigma * sigma);
    }
    return total;
}

static double cost_of(const void *user, const double *x) {
    const bst_detector_traps_config t = of_parameters(x);
    /* times that five pixels cannot tell */
    double far = fmax(t.release_px[0] - 20.0, 0.0) + fmax(t.release_px[1] - 20.0, 0.0);
    return misfit(user, &t, true) + far * far;
}

double bst_trap_fit(const bst_charge_trail *trail, bool parallel, const bst_trap_fit_input *input,
                    bst_detector_traps_config *out) {
    fit f = {.input = input};
    int side = (parallel ? 0 : 2) + ((parallel ? trail->parallel_up : trail->serial_right) ? 0 : 1);
    int other = side ^ 1;
    for (int k = 0; k < BST_TRAIL_PIXELS; k++) {
        f.profile[k] = trail->profile[side][k] - trail->profile[other][k];
    }
    for (int c = 0; c < BST_TRAIL_CLASSES; c++) {
        f.charge_e[c] = trail->class_charge[c] * input->gain_e_per_dn;
        f.sums[c] = (parallel ? trail->class_parallel : trail->class_serial)[c];
    }
    f.median_e = sqrt(f.charge_e[1] * f.charge_e[2]); /* between the two middle classes */
    /* a fast species of the whole trail, and a slow one of a tenth of it */
    double sum = fmax(f.sums[1], 1e-4) * f.median_e;
    double met = sum * pow(REFERENCE_E / f.median_e, 0.5) / input->transfers;
    double best = INFINITY;
    const double slow[2] = {2.0, 6.0};
    for (int i = 0; i < 2; i++) {
        double x[PARAMETERS] = {log(2.0 * met), log(0.2 * met), log(0.5), log(slow[i]), 0.0};
        const double step[PARAMETERS] = {0.5, 0.5, 0.3, 0.3, 0.5};
        double cost = bst_simplex_search(cost_of, &f, PARAMETERS, x, step, MOST_TURNS);
        if (cost < best) {
            best = cost;
            *out = of_parameters(x);
        }
    }
    return sqrt(misfit(&f, out, false) / (BST_TRAIL_PIXELS + BST_TRAIL_CLASSES));
}
