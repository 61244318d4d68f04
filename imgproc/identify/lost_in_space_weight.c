/* Likelihood ratio of a match of stars and detections. */
#include <math.h>

#include "imgproc/identify/lost_in_space_internal.h"
#include "imgproc/identify/null_model.h"

/* Share of right candidates, of matched places and of brightnesses that may be as by chance. */
static const double UNUSUAL = 0.2;
/* Magnitudes of detections differ by so much from those of their stars: colours, neighbours. */
static const double MAG_SIGMA = 0.4;
/* Least stars of the quad that give the zero point of magnitudes. */
enum { LEAST_ZERO_STARS = 3 };
/* Least chance that a place holds a detection: frames are not as clean as the null model. */
static const double LEAST_CHANCE = 1e-5;

/* True for a source of the quad. */
static bool is_of(const int quad[4], int i) {
    return i == quad[0] || i == quad[1] || i == quad[2] || i == quad[3];
}

double bst_lost_in_space_log_quad(double chi_squared) {
    /* of four degrees of freedom; by chance its square is evenly spread */
    const double usual =
        0.125 * BST_LOST_MOST_CHI_SQUARED * BST_LOST_MOST_CHI_SQUARED * exp(-0.5 * chi_squared);
    return log((1.0 - UNUSUAL) * usual + UNUSUAL);
}

/* Zero point of the detections' magnitudes by the quad's stars, or by all without a quad; NAN:
 * unknown. */
static double zero_point(const bst_lost_in_space *s, const int quad[4], int sources) {
    double sum = 0.0;
    int count = 0;
    for (int i = 0; i < sources; i++) {
        if (s->star_of[i] >= 0 && (quad[0] < 0 || is_of(quad, i))) {
            sum += s->v_mag[s->star_of[i]] - s->sources[i].mag;
            count++;
        }
    }
    return count >= LEAST_ZERO_STARS ? sum / count : NAN;
}

/* Probability that a star that is detected is a certain one of the detections beside the quad's,
 * by its brightness.
 *
 * Given:     zero_mag  NAN: all are equally probable */
static double share_of_detection(const bst_lost_in_space *s, const int quad[4], int sources,
                                 double zero_mag, int i) {
    double sum = 0.0, own = 0.0;
    int others = 0;
    for (int j = 0; j < sources; j++) {
        if (!is_of(quad, j)) {
            double d = (s->v_mag[s->star_of[i]] - s->sources[j].mag - zero_mag) / MAG_SIGMA;
            double fits = isnan(zero_mag) ? 1.0 : exp(-0.5 * d * d);
            sum += fits;
            own = j == i ? fits : own;
            others++;
        }
    }
    return (sum > 0.0 ? (1.0 - UNUSUAL) * own / sum : 0.0) + UNUSUAL / others;
}

/* Likelihood of the brightnesses of the quad's stars over its mean over all their permutations,
 * which are equally probable by chance; the zero point is the same for all. */
static double brightness_of_quad(const bst_lost_in_space *s, const int quad[4], int sources) {
    double v[4], sum = 0.0;
    for (int i = 0; i < 4; i++) {
        if (quad[i] < 0 || quad[i] >= sources || s->star_of[quad[i]] < 0) {
            return 1.0;
        }
        v[i] = s->v_mag[s->star_of[quad[i]]] / MAG_SIGMA;
    }
    for (int k = 0; k < 256; k++) {
        const int of[4] = {k & 3, k >> 2 & 3, k >> 4 & 3, k >> 6};
        if ((1 << of[0] | 1 << of[1] | 1 << of[2] | 1 << of[3]) == 15) {
            double more = 0.0;
            for (int i = 0; i < 4; i++) {
                more += (v[of[i]] - v[i]) * s->sources[quad[i]].mag / MAG_SIGMA;
            }
            sum += exp(fmin(more, 100.0));
        }
    }
    return (1.0 - UNUSUAL) * 24.0 / sum + UNUSUAL;
}

/* Density of a star's place in the ellipse of its detection, over that of even spread: a normal one
 * that is cut off at BST_LOST_LAST_SIGMAS. */
static double density_of(double distance2) {
    const double k = 0.5 * BST_LOST_LAST_SIGMAS * BST_LOST_LAST_SIGMAS;
    return (1.0 - UNUSUAL) * k * exp(-k * distance2) / (1.0 - exp(-k)) + UNUSUAL;
}

double bst_lost_in_space_log_ratio(const bst_lost_in_space_attempt *a, const int quad[4],
                                   int predicted, int sources, bst_lost_in_space_result *out) {
    bst_lost_in_space *s = a->s;
    const double zero_mag = zero_point(s, quad, sources);
    double area_px2 = 0.0, sum = log(brightness_of_quad(s, quad, sources));
    out->predicted = out->matched = 0;
    for (int i = 0; i < sources; i++) {
        area_px2 += is_of(quad, i) ? 0.0 : s->area_px2[i];
    }
    const double chance = fmax(bst_null_model_chance(area_px2, a->area_px2), LEAST_CHANCE);
    for (int k = 0; k < predicted; k++) {
        out->predicted += s->found_share[k] >= BST_LOST_SURELY_FOUND;
        sum += s->found_share[k] > chance ? log((1.0 - s->found_share[k]) / (1.0 - chance)) : 0.0;
    }
    for (int i = 0; i < sources; i++) {
        if (s->star_of[i] < 0) {
            continue;
        }
        const double share = s->found_share[s->star_of[i]];
        out->matched += share >= BST_LOST_SURELY_FOUND;
        if (share > chance) {
            sum -= log((1.0 - share) / (1.0 - chance));
            if (!is_of(quad, i)) {
                double own = fmax(s->area_px2[i] / a->area_px2, LEAST_CHANCE);
                sum += log(share * density_of(s->nearest2[i]) / own *
                           share_of_detection(s, quad, sources, zero_mag, i));
            }
        }
    }
    return sum;
}
