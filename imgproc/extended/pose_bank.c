#include "imgproc/extended/pose_bank.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* Rounds of Gauss-Newton of hypotheses that are followed, and of new ones. */
enum { ROUNDS = 3, ROUNDS_NEW = 6 };
/* Attitudes tried in a frame, and those that become hypotheses; attitudes in the first frames. */
enum { TRIALS = 100, TRIALS_FIRST = 600, NEW = 2, NEW_FIRST = 6 };
/* What remains of a score in the next frame: that of some ten frames. */
static const double KEPT = 0.9;
/* Most cost of a frame that counts, and score that a new hypothesis has over the best one. */
static const double COST_MOST = 15.0, PENALTY = 20.0;
/* Uncertainty of the depth of a hypothesis that is placed on the outline. */
static const double FOLLOWED_DEPTH_SIGMA = 0.001;
/* Cost beyond which attitudes near the predicted one are tried, for hypotheses whose score is close
 * to the best, and their distance. */
static const double COST_USUAL = 4.0, CLOSE = 10.0, NEAR_RAD = 0.025;
/* Cost of the assumption that a part or a material is dark. */
static const double LACK_PENALTY = 3.0;
/* Uncertainty of a new hypothesis: distance of trials, and depth without and with others. */
static const double TURN_SIGMA_RAD = 0.2, DEPTH_SIGMA = 0.3, DEPTH_SIGMA_KNOWN = 0.03;
/* Hypotheses whose attitudes are closer are one. */
static const double SAME_RAD = 0.12;
/* Gap between frames after which all hypotheses end, s. */
static const double LONGEST_GAP_S = 60.0;
/* Frames that the best hypothesis must have followed. */
enum { FRAMES_LEAST = 3 };
/* Rates and changes of range that are none. */
static const double RATE_MOST_RADPS = 10.0, APPROACH_MOST = 10.0;
/* Index of the depth among the states. */
enum { DEPTH = 6 };
/* Share of an outline's directions in which the best hypothesis must agree with it. */
static const double INSIDE_LEAST = 0.6;
/* Cost that a frame should have: independent directions less unknowns. */
static const double DEGREES_OF_FREEDOM = 6.0;

/* A unit quaternion of a sequence that fills all rotations evenly. */
static bst_quat even_attitude(uint32_t index) {
    /* powers of the inverse of the root of x^4 = x + 1: additive recurrence in three dimensions */
    const double root = 1.2207440846057596;
    double u = fmod(0.5 + index / root, 1.0), v = fmod(0.5 + index / (root * root), 1.0);
    double w = fmod(0.5 + index / (root * root * root), 1.0);
    double a = sqrt(1.0 - u), b = sqrt(u);
    return (bst_quat){a * sin(2.0 * BST_PI * v), a * cos(2.0 * BST_PI * v),
                      b * sin(2.0 * BST_PI * w), b * cos(2.0 * BST_PI * w)};
}

/* Moves place and depth of a pose to those that fit an outline best. Returns the cost; infinite:
 * nothing is seen. */
static double fit_place(bst_target_model *model, const bst_target_sight *s, double depth_sigma,
                        bst_target_pose *pose) {
    bst_target_outline o;
    double sigma = bst_pose_filter_sigma_px(s), x = 0.0, y = 0.0, growth = 1.0;
    if (!bst_target_model_predict(model, s, pose, &o)) {
        return INFINITY;
    }
    for (int round = 0; round < 4; round++) {
        double a[6] = {0.0}, b[3] = {0.0}; /* xx, xy, yy, xg, yg, gg */
        for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
            double angle = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS, c = cos(angle), d = sin(angle);
            double h = o.support_px[k] - c * pose->x_px - d * pose->y_px;
            double r = s->support_px[k] - c * x - d * y - growth * h;
            double w =
                round == 0 ? 1.0 / (sigma * sigma) : bst_pose_filter_weight(r, sigma, 4.0 - round);
            r = s->support_px[k] - h;
            a[0] += w * c * c;
            a[1] += w * c * d;
            a[2] += w * d * d;
            a[3] += w * c * h;
            a[4] += w * d * h;
            a[5] += w * h * h;
            b[0] += w * c * r;
            b[1] += w * d * r;
            b[2] += w * h * r;
        }
        a[5] += 1.0 / (depth_sigma * depth_sigma);
        /* elimination of the place */
        double det = a[0] * a[2] - a[1] * a[1];
        double px = (a[2] * a[3] - a[1] * a[4]) / det, py = (a[0] * a[4] - a[1] * a[3]) / det;
        double left = a[5] - a[3] * px - a[4] * py;
        double change = (b[2] - b[0] * px - b[1] * py) / left;
        change = fmin(fmax(change, -0.6), 1.5);
        x = (a[2] * b[0] - a[1] * b[1]) / det - px * change;
        y = (a[0] * b[1] - a[1] * b[0]) / det - py * change;
        growth = 1.0 + change;
    }
    for (int k = 0; k < BST_TARGET_DIRECTIONS; k++) {
        double angle = 2.0 * BST_PI * k / BST_TARGET_DIRECTIONS, c = cos(angle), d = sin(angle);
        o.support_px[k] =
            c * x + d * y + growth * (o.support_px[k] - c * pose->x_px - d * pose->y_px);
    }
    pose->x_px = x;
    pose->y_px = y;
    pose->depth_m /= growth;
    double past = (growth - 1.0) / depth_sigma;
    return bst_pose_filter_cost(s, &o, 1.0, NULL) + past * past;
}

/* Angle between two attitudes, rad. */
static double angle_between(bst_quat a, bst_quat b) {
    double w = fabs(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w);
    return 2.0 * acos(fmin(w, 1.0));
}

/* Adds a hypothesis, or replaces the worst or one like it, if it is better. */
static void add(bst_pose_bank *bank, const bst_pose_filter *f) {
    int at = bank->count;
    for (int i = 0; i < bank->count; i++) {
        const bst_pose_filter *other = &bank->filter[i];
        if (angle_between(other->pose.q_body_from_gcrf, f->pose.q_body_from_gcrf) < SAME_RAD) {
            at = i;
            break;
        }
        if (bank->count == BST_POSE_BANK &&
            (at == bank->count || other->score > bank->filter[at].score)) {
            at = i;
        }
    }
    if (at == bank->count) {
        bank->filter[bank->count++] = *f;
    } else if (f->score < bank->filter[at].score) {
        bank->filter[at] = *f;
    }
}

/* Places a pose on the outline, with the assumption on grazing surfaces that fits it best. Returns
 * the cost. */
static double choose_dimming(bst_target_model *model, const bst_target_sight *s,
                             bst_target_pose *pose) {
    bst_target_pose best = *pose;
    double least = INFINITY;
    for (unsigned dimming = 0; dimming < BST_TARGET_DIMMINGS; dimming++) {
        bst_target_pose trial = *pose;
        trial.x_px = trial.y_px = 0.0;
        trial.dimming = dimming;
        double cost = fit_place(model, s, FOLLOWED_DEPTH_SIGMA, &trial);
        if (cost < least) {
            least = cost;
            best = trial;
        }
    }
    best.depth_m = pose->depth_m;
    *pose = best;
    return least;
}

/* Fits a hypothesis again from another pose, and takes the result if it costs less. */
static void fit_again(bst_pose_filter *f, const bst_pose_filter *predicted,
                      const bst_target_pose *start, double penalty, bst_target_model *model,
                      const bst_target_sight *s) {
    bst_pose_filter again = *predicted;
    if (bst_pose_filter_update(&again, model, s, start, ROUNDS) && again.cost + penalty < f->cost) {
        *f = again;
        f->cost += penalty;
    }
}

/* Adds the differences of the places of several trials, by their costs, to the covariance. */
static void add_spread(bst_pose_filter *f, const bst_target_pose *trial, const double *cost,
                       int count, int best) {
    double sum = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    for (int i = 0; i < count; i++) {
        double w = exp(-0.5 * (cost[i] - cost[best]));
        double dx = trial[i].x_px - trial[best].x_px, dy = trial[i].y_px - trial[best].y_px;
        sum += w;
        xx += w * dx * dx;
        xy += w * dx * dy;
        yy += w * dy * dy;
    }
    f->centre_xx += xx / sum;
    f->centre_xy += xy / sum;
    f->centre_yy += yy / sum;
}

/* Fits a hypothesis again without a part or a material. */
static void search_lacks(bst_pose_filter *f, const bst_pose_filter *predicted,
                         bst_target_model *model, const bst_target_sight *s) {
    bst_target_pose trial[BST_TARGET_LACKS];
    double cost[BST_TARGET_LACKS];
    int count = bst_target_model_lacks(model), best = 0;
    for (int i = 0; i < count; i++) {
        trial[i] = predicted->pose;
        trial[i].without = i + 1;
        cost[i] = choose_dimming(model, s, &trial[i]);
        best = cost[i] < cost[best] ? i : best;
    }
    fit_again(f, predicted, &trial[best], LACK_PENALTY, model, s);
    if (f->pose.without > 0) {
        add_spread(f, trial, cost, count, best);
    }
}

/* Fits a hypothesis again from attitudes near the predicted one: where surfaces appear or vanish
 * the cost has steps. Then without a part or a material. */
static void search_near(bst_pose_filter *f, const bst_pose_filter *predicted,
                        bst_target_model *model, const bst_target_sight *s) {
    bst_target_pose best = predicted->pose, trial = best;
    double least = INFINITY;
    for (int i = 0; i < 12; i++) {
        double angle = NEAR_RAD * (i < 6 ? 1.0 : 2.0) * (i % 2 == 0 ? 1.0 : -1.0);
        int axis = i / 2 % 3;
        bst_vec3 turn = {axis == 0 ? angle : 0.0, axis == 1 ? angle : 0.0, axis == 2 ? angle : 0.0};
        trial = predicted->pose;
        trial.q_body_from_gcrf = bst_quat_turn_frame(trial.q_body_from_gcrf, turn);
        double cost = choose_dimming(model, s, &trial);
        if (cost < least) {
            least = cost;
            best = trial;
        }
    }
    fit_again(f, predicted, &best, 0.0, model, s);
    search_lacks(f, predicted, model, s);
}

/* Follows all hypotheses to the frame. */
static void follow(bst_pose_bank *bank, bst_target_model *model, const bst_target_sight *s,
                   double seconds) {
    bst_pose_filter old[BST_POSE_BANK];
    int count = bank->count;
    memcpy(old, bank->filter, sizeof old);
    bank->count = 0;
    for (int i = 0; i < count; i++) {
        bst_pose_filter *predicted = &old[i];
        bst_pose_filter_predict(predicted, seconds);
        predicted->pose.without = 0;
        bst_target_pose start = predicted->pose;
        (void)choose_dimming(model, s, &start);
        bst_pose_filter f = *predicted;
        if (!bst_pose_filter_update(&f, model, s, &start, ROUNDS)) {
            continue;
        }
        if (f.cost > COST_USUAL && f.score < old[0].score + CLOSE) {
            search_near(&f, predicted, model, s);
        }
        f.score = KEPT * f.score + fmin(f.cost, COST_MOST);
        add(bank, &f);
    }
}

/* Tries attitudes, and makes hypotheses of the best. */
static void try_new(bst_pose_bank *bank, bst_target_model *model, const bst_target_sight *s,
                    double depth_m) {
    bool known = bank->count > 0 && bank->filter[0].frames >= FRAMES_LEAST;
    int trials = known ? TRIALS : TRIALS_FIRST, wanted = known ? NEW : NEW_FIRST;
    double depth_sigma = known ? DEPTH_SIGMA_KNOWN : DEPTH_SIGMA;
    double score = fmax(bank->score, 0.0);
    bst_target_pose best[NEW_FIRST];
    double least[NEW_FIRST];
    int count = 0;
    for (int i = 0; i < trials; i++) {
        bst_target_pose pose = {.q_body_from_gcrf = even_attitude(bank->trial++),
                                .depth_m = known ? bank->filter[0].pose.depth_m : depth_m};
        double cost = fit_place(model, s, depth_sigma, &pose);
        int at = count;
        while (at > 0 && least[at - 1] > cost) {
            at--;
        }
        if (at == wanted || !isfinite(cost)) {
            continue;
        }
        count += count < wanted;
        for (int k = count - 1; k > at; k--) {
            least[k] = least[k - 1];
            best[k] = best[k - 1];
        }
        least[at] = cost;
        best[at] = pose;
    }
    for (int i = 0; i < count; i++) {
        bst_pose_filter f;
        bst_pose_filter_start(&f, &best[i], TURN_SIGMA_RAD, depth_sigma);
        if (bst_pose_filter_update(&f, model, s, &best[i], ROUNDS_NEW)) {
            f.score = score + PENALTY + fmin(f.cost, COST_MOST);
            add(bank, &f);
        }
    }
}

/* Brings the hypothesis with the least score to the front. */
static void lead(bst_pose_bank *bank) {
    int best = 0;
    for (int i = 1; i < bank->count; i++) {
        best = bank->filter[i].score < bank->filter[best].score ? i : best;
    }
    bst_pose_filter first = bank->filter[best];
    bank->filter[best] = bank->filter[0];
    bank->filter[0] = first;
}

/* Mean and covariance of the hypotheses. */
static void mix(const bst_pose_bank *bank, bst_pose_estimate *out) {
    double sum = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
    double depth = 0.0, depth2 = 0.0;
    for (int i = 0; i < bank->count; i++) {
        const bst_pose_filter *f = &bank->filter[i];
        double w = exp(-0.5 * (f->score - bank->filter[0].score));
        double ratio = log(f->pose.depth_m / bank->filter[0].pose.depth_m);
        sum += w;
        depth += w * ratio;
        depth2 += w * (f->covariance[DEPTH * BST_POSE_STATES + DEPTH] + ratio * ratio);
        x += w * f->pose.x_px;
        y += w * f->pose.y_px;
        double excess = fmax(f->cost / DEGREES_OF_FREEDOM, 1.0);
        xx += w * (excess * f->centre_xx + f->pose.x_px * f->pose.x_px);
        xy += w * (excess * f->centre_xy + f->pose.x_px * f->pose.y_px);
        yy += w * (excess * f->centre_yy + f->pose.y_px * f->pose.y_px);
    }
    out->depth_m = bank->filter[0].pose.depth_m * exp(depth / sum);
    out->depth_sigma_share = sqrt(depth2 / sum - depth * depth / (sum * sum));
    out->x_px = x / sum;
    out->y_px = y / sum;
    out->cov_xx = xx / sum - out->x_px * out->x_px;
    out->cov_xy = xy / sum - out->x_px * out->y_px;
    out->cov_yy = yy / sum - out->y_px * out->y_px;
}

double bst_pose_bank_hidden_px(const bst_pose_bank *bank, bst_target_model *model,
                               const bst_target_sight *s) {
    assert(bank && model && s);
    if (bank->count == 0 || bank->filter[0].frames < FRAMES_LEAST) {
        return 0.0;
    }
    bst_target_pose pose = bank->filter[0].pose;
    bst_target_outline o;
    double size = 0.0;
    pose.without = BST_TARGET_WHOLE;
    if (!bst_target_model_predict(model, s, &pose, &o)) {
        return 0.0;
    }
    for (int k = 0; k < BST_TARGET_DIRECTIONS / 2; k++) {
        size = fmax(size, o.support_px[k] + o.support_px[k + BST_TARGET_DIRECTIONS / 2]);
    }
    return fmin(fmax(size - s->size_px, 0.0), s->size_px);
}

void bst_pose_bank_check(bst_pose_bank *bank) {
    assert(bank && bank->count >= 0 && bank->count <= BST_POSE_BANK);
    int count = 0;
    for (int i = 0; i < bank->count; i++) {
        const bst_pose_filter *f = &bank->filter[i];
        bst_quat q = f->pose.q_body_from_gcrf;
        bool unit = fabs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) < 1e-6;
        if (unit && isfinite(f->score) && bst_vec3_norm(f->rate_radps) < RATE_MOST_RADPS &&
            fabs(f->approach) < APPROACH_MOST) {
            bank->filter[count++] = *f;
        }
    }
    bank->count = count;
}

bool bst_pose_bank_step(bst_pose_bank *bank, bst_target_model *model, const bst_target_sight *s,
                        double middle_s, double depth_m, bst_pose_estimate *out) {
    assert(bank && model && s && out && depth_m > 0.0);
    double seconds = middle_s - bank->middle_s;
    if (!(seconds >= 0.0 && seconds < LONGEST_GAP_S)) {
        bank->count = 0;
    }
    bank->middle_s = middle_s;
    bank->score = bank->count > 0 ? KEPT * bank->filter[0].score : 0.0;
    follow(bank, model, s, seconds);
    if (bank->count > 0) {
        lead(bank);
    }
    try_new(bank, model, s, depth_m);
    if (bank->count == 0) {
        return false;
    }
    lead(bank);
    const bst_pose_filter *first = &bank->filter[0];
    mix(bank, out);
    return first->frames >= FRAMES_LEAST && first->inside >= INSIDE_LEAST;
}
