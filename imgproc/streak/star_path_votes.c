/* Votes of identified stars on the ends of their path. */
#include <assert.h>
#include <math.h>
#include <string.h>

#include "imgproc/streak/star_path_internal.h"

/* Most samples by which an end is moved, as a share of the path's. */
static const double MOVED_SHARE = 0.5;
/* Continuations of the path: so many on either side of the smoothest, each FAN_SLOPE px further out
 * for each px beyond the end. */
enum { FAN = 2 };
static const double FAN_SLOPE = 0.06;
/* Least samples of a path with ends. */
enum { LEAST_SAMPLES = 5 };
/* Probability that a star has another one's light along its continuation. */
static const double CROSSED = 0.2;

/* Parabola through the samples of the path, in t from -1 to 1 along it, by least squares. */
static void fit_parabola(const bst_star_path *p, double c[2][3]) {
    double s2 = 0.0, s4 = 0.0, g[2][3] = {{0}};
    const double half = 0.5 * (p->count - 1);
    for (int k = 0; k < p->count; k++) {
        double t = (k - half) / half;
        s2 += t * t;
        s4 += t * t * t * t;
        for (int i = 0; i < 2; i++) {
            g[i][0] += p->place[k][i];
            g[i][1] += t * p->place[k][i];
            g[i][2] += t * t * p->place[k][i];
        }
    }
    const double n = p->count, det = n * s4 - s2 * s2;
    for (int i = 0; i < 2; i++) {
        c[i][0] = (s4 * g[i][0] - s2 * g[i][2]) / det;
        c[i][1] = g[i][1] / s2;
        c[i][2] = (n * g[i][2] - s2 * g[i][0]) / det;
    }
}

/* Place of a sample beyond an end on one of the continuations.
 *
 * Given:     c       of the parabola
 *            end     0 or 1
 *            beyond  samples beyond the last, negative: inside
 *            fan     number of the continuation */
static void continued_place(const bst_star_path *p, const double c[2][3], int end, int beyond,
                            int fan, double place[2]) {
    const double half = 0.5 * (p->count - 1), sign = end ? 1.0 : -1.0;
    const int last = end ? p->count - 1 : 0;
    if (beyond <= 0) {
        place[0] = p->place[last + (end ? beyond : -beyond)][0];
        place[1] = p->place[last + (end ? beyond : -beyond)][1];
        return;
    }
    double t = sign * (1.0 + beyond / half), tangent[2];
    for (int i = 0; i < 2; i++) {
        place[i] = c[i][0] + t * (c[i][1] + t * c[i][2]);
        tangent[i] = c[i][1] + 2.0 * t * c[i][2];
    }
    double length = fmax(hypot(tangent[0], tangent[1]), 1e-9);
    double across = fan * FAN_SLOPE * beyond * BST_STAR_PATH_STEP_PX;
    place[0] -= across * tangent[1] / length;
    place[1] += across * tangent[0] / length;
}

/* Log-likelihood of a star for another end over this one, if other stars' light may cause it. */
static double vote(double evidence) {
    double e = fmax(fmin(evidence, 50.0), -50.0);
    return log(((1.0 - CROSSED) * exp(e) + CROSSED) / ((1.0 - CROSSED) + CROSSED * exp(e)));
}

/* A path, its parabola and the stars that vote. */
typedef struct electorate {
    const bst_star_path *path;
    const bst_star_path_image *image;
    const bst_star_path_star *stars;
    int count;
    double c[2][3];
} electorate;

static electorate make_electorate(const bst_star_path *path, const bst_star_path_image *image,
                                  const bst_star_path_star *stars, int count) {
    electorate e = {path, image, stars, count, {{0}}};
    e.count = count < BST_STAR_PATH_VOTERS ? count : BST_STAR_PATH_VOTERS;
    fit_parabola(path, e.c);
    return e;
}

/* What stars vote for at one end. */
typedef struct ballot {
    double votes;
    int at, fan; /* samples by which that end is further out, and the continuation */
} ballot;

/* Greatest sum of votes for an end further out (step 1) or further in (step -1). */
static ballot most_votes(const electorate *e, int end, int step, int fan) {
    double evidence[BST_STAR_PATH_VOTERS] = {0};
    ballot best = {-HUGE_VAL, 0, fan};
    const int most = (int)(MOVED_SHARE * e->path->count);
    for (int k = 1; k <= most; k++) {
        double place[2], sum = 0.0;
        continued_place(e->path, e->c, end, step > 0 ? k : 1 - k, fan, place);
        for (int i = 0; i < e->count; i++) {
            evidence[i] += step * bst_star_path_evidence(e->path, e->image, &e->stars[i], place);
            sum += vote(evidence[i]);
        }
        if (k > BST_STAR_PATH_SAME_END && sum > best.votes) {
            best.votes = sum;
            best.at = step * k;
        }
    }
    return best;
}

static ballot vote_on(const electorate *e, int end) {
    ballot best = most_votes(e, end, -1, 0);
    for (int fan = -FAN; fan <= FAN; fan++) {
        ballot b = most_votes(e, end, 1, fan);
        best = b.votes > best.votes ? b : best;
    }
    return best;
}

void bst_star_path_vote(const bst_star_path *path, const bst_star_path_image *image,
                        const bst_star_path_star *stars, int count, double votes[2]) {
    assert(path && image && stars && count >= 0 && votes);
    votes[0] = votes[1] = -HUGE_VAL;
    if (path->count < LEAST_SAMPLES) {
        return;
    }
    const electorate e = make_electorate(path, image, stars, count);
    for (int end = 0; end < 2; end++) {
        votes[end] = vote_on(&e, end).votes;
    }
}

/* Moves the origin of a path to its middle, and its ends to its first and last sample. */
static void recentre(bst_star_path *p) {
    double sum = 0.0;
    for (int i = 0; i < 2; i++) {
        double middle = 0.5 * (p->place[(p->count - 1) / 2][i] + p->place[p->count / 2][i]);
        for (int k = 0; k < p->count; k++) {
            p->place[k][i] -= middle;
        }
        p->ends[0][i] = p->place[0][i];
        p->ends[1][i] = p->place[p->count - 1][i];
    }
    for (int k = 0; k < p->count; k++) {
        sum += p->light[k];
    }
    for (int k = 0; k < p->count; k++) {
        p->light[k] *= p->count / sum;
    }
    p->margin[0] = p->margin[1] = 0.0;
}

bool bst_star_path_move_ends(bst_star_path *path, const bst_star_path_image *image,
                             const bst_star_path_star *stars, int count) {
    assert(path && image && stars && count >= 0);
    if (path->count < LEAST_SAMPLES) {
        return false;
    }
    const electorate e = make_electorate(path, image, stars, count);
    const ballot b[2] = {vote_on(&e, 0), vote_on(&e, 1)};
    const int first = b[0].votes > 0.0 ? -b[0].at : 0;
    const int last = path->count - 1 + (b[1].votes > 0.0 ? b[1].at : 0), samples = last - first + 1;
    if (samples > BST_STAR_PATH_ROOM || samples < LEAST_SAMPLES ||
        (first == 0 && last == path->count - 1)) {
        return false;
    }
    const bst_star_path old = *path;
    path->count = samples;
    for (int k = first; k <= last; k++) {
        const int end = k < 0 ? 0 : 1, beyond = k < 0 ? -k : k - old.count + 1;
        double *to = path->place[k - first];
        if (beyond > 0) {
            continued_place(&old, e.c, end, beyond, b[end].fan, to);
        } else {
            memcpy(to, old.place[k], sizeof old.place[k]);
        }
        path->light[k - first] = beyond > 0 ? 1.0 : old.light[k];
    }
    recentre(path);
    return true;
}
