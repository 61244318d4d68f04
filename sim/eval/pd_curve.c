#include "sim/eval/pd_curve.h"

#include <math.h>
#include <stdbool.h>

#include "boresight/vec.h"
#include "sim/eval/detection_theory.h"

enum { TERMS = 3 };

static const double LEAST = 0.02, MOST = 0.98; /* range of counted fractions that the fit uses */

double bst_pd_without_chance(double raw, double chance) {
    return chance < 1.0 ? fmin(fmax((raw - chance) / (1.0 - chance), 0.0), 1.0) : 0.0;
}

/* Probit regression of detection counts in u = snr - centre. */
typedef struct fit {
    const bst_pd_point *points;
    int count, terms, used;
    double chance, centre;
    double theta[TERMS], covariance[TERMS][TERMS];
} fit;

/* Detection probability at a point, corrected for chance matches. */
static double share(const bst_pd_point *p, double chance) {
    return bst_pd_without_chance((double)p->detected / (double)p->trials, chance);
}

static bool is_informative(const fit *f, const bst_pd_point *p) {
    if (p->trials <= 0) {
        return false;
    }
    double pd = share(p, f->chance);
    return pd > LEAST && pd < MOST;
}

/* Basis of the fitted curve: polynomial of second degree in SNR. */
static void basis(const fit *f, double snr, double out[TERMS]) {
    out[0] = 1.0;
    out[1] = snr - f->centre;
    out[2] = out[1] * out[1];
}

static double value(const fit *f, const double theta[TERMS], double snr) {
    double b[TERMS], sum = 0.0;
    basis(f, snr, b);
    for (int k = 0; k < f->terms; k++) {
        sum += theta[k] * b[k];
    }
    return sum;
}

/* Solves a x = b for the terms of the fit and inverts a. False: singular. */
static bool solve(int n, double a[TERMS][TERMS], const double b[TERMS], double x[TERMS],
                  double inverse[TERMS][TERMS]) {
    double work[TERMS][2 * TERMS] = {{0.0}};
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            work[i][j] = a[i][j];
        }
        work[i][n + i] = 1.0;
    }
    for (int c = 0; c < n; c++) {
        int best = c;
        for (int r = c + 1; r < n; r++) {
            best = fabs(work[r][c]) > fabs(work[best][c]) ? r : best;
        }
        if (!(fabs(work[best][c]) > 1e-12 * fabs(a[c][c])) || work[best][c] == 0.0) {
            return false;
        }
        for (int j = 0; j < 2 * n; j++) {
            double swap = work[c][j];
            work[c][j] = work[best][j];
            work[best][j] = swap;
        }
        for (int r = 0; r < n; r++) {
            double factor = r == c ? 0.0 : work[r][c] / work[c][c];
            for (int j = 0; j < 2 * n; j++) {
                work[r][j] -= factor * work[c][j];
            }
        }
    }
    for (int i = 0; i < n; i++) {
        x[i] = 0.0;
        for (int j = 0; j < n; j++) {
            inverse[i][j] = work[i][n + j] / work[i][i];
            x[i] += inverse[i][j] * b[j];
        }
    }
    return true;
}

static double log_likelihood(const fit *f, const double theta[TERMS]) {
    double sum = 0.0;
    for (int i = 0; i < f->count; i++) {
        const bst_pd_point *p = &f->points[i];
        if (is_informative(f, p)) {
            double eta = value(f, theta, p->snr);
            double hit = f->chance + (1.0 - f->chance) * bst_eval_normal_tail(-eta);
            double miss = (1.0 - f->chance) * bst_eval_normal_tail(eta);
            sum += (double)p->detected * log(fmax(hit, 1e-300)) +
                   (double)(p->trials - p->detected) * log(fmax(miss, 1e-300));
        }
    }
    return sum;
}

/* Fisher scoring from initial estimates; a step that decreases the likelihood is halved. */
static bool fit_curve(fit *f) {
    double score[TERMS], fisher[TERMS][TERMS], step[TERMS];
    for (int round = 0; round < 40; round++) {
        for (int k = 0; k < TERMS; k++) {
            score[k] = 0.0;
            for (int m = 0; m < TERMS; m++) {
                fisher[k][m] = 0.0;
            }
        }
        for (int i = 0; i < f->count; i++) {
            const bst_pd_point *p = &f->points[i];
            if (!is_informative(f, p)) {
                continue;
            }
            double b[TERMS], eta = value(f, f->theta, p->snr), n = (double)p->trials;
            if (round == 0) { /* initial values: linear regression of the counted fractions */
                eta = -bst_eval_normal_tail_inverse(share(p, f->chance));
            }
            double hit = f->chance + (1.0 - f->chance) * bst_eval_normal_tail(-eta);
            double slope = (1.0 - f->chance) * exp(-0.5 * eta * eta) / sqrt(2.0 * BST_PI);
            double weight = n * slope * slope / fmax(hit * (1.0 - hit), 1e-12);
            double off = round == 0 ? eta : ((double)p->detected / n - hit) / fmax(slope, 1e-12);
            basis(f, p->snr, b);
            for (int k = 0; k < f->terms; k++) {
                score[k] += weight * off * b[k];
                for (int m = 0; m < f->terms; m++) {
                    fisher[k][m] += weight * b[k] * b[m];
                }
            }
        }
        if (!solve(f->terms, fisher, score, step, f->covariance)) {
            return false;
        }
        double before = round == 0 ? -INFINITY : log_likelihood(f, f->theta), largest = 0.0;
        double factor = 1.0, next[TERMS] = {0.0};
        for (int halving = 0; halving < 20; halving++, factor *= 0.5) {
            for (int k = 0; k < f->terms; k++) {
                next[k] = f->theta[k] + factor * step[k];
            }
            if (!(log_likelihood(f, next) < before)) {
                break;
            }
        }
        for (int k = 0; k < f->terms; k++) {
            largest = fmax(largest, fabs(next[k] - f->theta[k]));
            f->theta[k] = next[k];
        }
        if (round > 0 && largest < 1e-10) {
            break;
        }
    }
    return true;
}

/* SNR in [low, high] at which the increasing fit equals `want`; NAN: none. */
static double crossing(const fit *f, double want, double low, double high) {
    double below = value(f, f->theta, low) - want, above = value(f, f->theta, high) - want;
    if (!(below <= 0.0 && above >= 0.0)) {
        return NAN;
    }
    for (int i = 0; i < 200 && high - low > 1e-12 * high; i++) {
        double middle = 0.5 * (low + high);
        *(value(f, f->theta, middle) < want ? &low : &high) = middle;
    }
    return 0.5 * (low + high);
}

bst_pd_needed bst_pd_snr_at(const bst_pd_point *points, int count, double chance, double pd) {
    const bst_pd_needed none = {NAN, NAN};
    fit f = {.points = points, .count = count, .chance = chance};
    double low = INFINITY, high = -INFINITY, least = INFINITY, most = -INFINITY;
    for (int i = 0; i < count; i++) {
        if (is_informative(&f, &points[i])) {
            f.used++;
            f.centre += points[i].snr;
            low = fmin(low, points[i].snr);
            high = fmax(high, points[i].snr);
        }
        if (points[i].trials > 0) {
            least = fmin(least, share(&points[i], chance));
            most = fmax(most, share(&points[i], chance));
        }
    }
    if (f.used < 2 || !(low < high) || least > pd || most < pd) {
        return none;
    }
    f.centre /= f.used;
    f.terms = f.used < 4 ? 2 : 3;
    if (!fit_curve(&f)) {
        return none;
    }
    /* allow half a step beyond the informative points */
    double reach = 0.5 * (high - low) / (f.used - 1);
    double want = -bst_eval_normal_tail_inverse(pd),
           at = crossing(&f, want, low - reach, high + reach);
    if (isnan(at)) {
        return none;
    }
    double b[TERMS], variance = 0.0, slope = f.theta[1];
    basis(&f, at, b);
    slope += f.terms > 2 ? 2.0 * f.theta[2] * b[1] : 0.0;
    for (int k = 0; k < f.terms; k++) {
        for (int m = 0; m < f.terms; m++) {
            variance += b[k] * b[m] * f.covariance[k][m];
        }
    }
    return (bst_pd_needed){at, sqrt(variance) / fabs(slope)};
}

double bst_pd_loss_db(double snr, double pfa, double pd) {
    if (!(pfa > 0.0 && pfa < pd && pd < 1.0)) {
        return NAN;
    }
    return 20.0 * log10(snr / bst_eval_ideal_snr(pfa, pd));
}
