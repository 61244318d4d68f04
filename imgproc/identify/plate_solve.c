#include "imgproc/identify/plate_solve.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* Shapes that are measured: FIRST_SHAPES of whole sources, and if none gives an attitude more, of
 * whole and cut ones. The best TRIES paths are tried. */
enum { FIRST_SHAPES = 3, SHAPES = 6, CUT_SHAPES = 4, TRIES = 4, PASSES = 4, JOINT_TRIES = 2 };
/* Candidates of a frame of points: most are solved by the first, and pieces of streaks are not. */
enum { POINT_CANDIDATES = 3000 };
/* Ends nearer to each other than this are one: the stars are points. */
static const double POINT_PX = 4.0;
/* Share of a streak in the frame from which on a star is used. */
static const double LEAST_INSIDE = 0.25;
/* Streaks are of one length within this: their middle moves by half of it. */
static const double SAME_PX = 4.0;
/* Least log-likelihood of a streak's ends over that of ends elsewhere: one wrong in 3000. */
static const double LEAST_MARGIN = 8.0;
/* The identified stars must vote against other ends. Where they do so by CLEAR_VOTES, the margin
 * may be LESS_MARGIN; by CERTAIN_VOTES, it does not matter. */
static const double CLEAR_VOTES = -1.0, LESS_MARGIN = 4.0, CERTAIN_VOTES = -3.0;
/* Stars above this SNR measure the path of a solved frame even if the catalogue lacks them. */
static const double BRIGHT_SNR = 10.0;
/* Logarithm of the chance of the best candidate below which the frame may be solved by a better
 * path. */
static const double NEARLY = -8.0;

/* A frame that is being solved. */
typedef struct attempt {
    bst_ctx *ctx;
    bst_lost_in_space *lost;
    const bst_plate_solve_options *options;
    bst_streak_finder *finder;
    bst_common_streak streak;
    int width, height;
    bool joint;     /* stars are fitted together: streaks that cross have better places then */
    int joint_left; /* paths that may still be tried so */
} attempt;

/* Solves the stars by the middles of their streaks.
 *
 * Given:     near  a solution with an earlier path; NULL: none */
static bst_status solve_middles(attempt *a, int candidates, const bst_lost_in_space_result *near,
                                bst_lost_in_space_result *out) {
    bst_lost_in_space_options options = BST_LOST_IN_SPACE_USUAL;
    options.scale_tolerance = a->options->scale_tolerance;
    options.max_candidates = candidates;
    const bst_lost_in_space_frame frame = {a->streak.items,
                                           a->streak.count,
                                           {0, 0, a->width, a->height},
                                           a->options->v_limit,
                                           a->options->light,
                                           bst_streak_finder_path(a->finder),
                                           near};
    return bst_lost_in_space_solve(a->ctx, a->lost, &options, &frame, out);
}

static double length_px(const bst_common_streak *s) {
    return hypot(s->ends[1].x_px - s->ends[0].x_px, s->ends[1].y_px - s->ends[0].y_px);
}

/* Whole light of a source of unit amplitude. The convolution is with a Gaussian of 1 px and unit
 * sum of squares, after which a point of light F has the height F / sqrt(4 pi). Along a streak the
 * amplitude is that of a sample, which its neighbours overlap. */
static double light_of_amplitude(const bst_star_path *path) {
    double light = 0.0;
    if (path->count == 1) {
        return sqrt(4.0 * BST_PI);
    }
    for (int k = -path->count; k <= path->count; k++) {
        double d = BST_STAR_PATH_STEP_PX * k;
        light += path->count * BST_STAR_PATH_STEP_PX * exp(-0.25 * d * d);
    }
    return light;
}

/* Fits the stars of the finder's path together, finds those that the fit leaves, and solves. */
static bst_status solve_together(attempt *a, int candidates, const bst_lost_in_space_result *near,
                                 bst_lost_in_space_result *out) {
    const bst_star_path *path = bst_streak_finder_path(a->finder);
    BST_TRY(bst_streak_finder_follow(a->ctx, a->finder, path, a->options->least_snr, LEAST_INSIDE,
                                     &a->streak));
    a->streak.ends_margin = fmin(path->margin[0], path->margin[1]);
    for (int i = 0; i < a->streak.count; i++) { /* in the unit of bst_streak_finder_search */
        a->streak.items[i].flux_e /= light_of_amplitude(path);
        a->streak.items[i].flux_sigma_e /= light_of_amplitude(path);
    }
    return solve_middles(a, candidates, near, out);
}

/* Solves the frame by a path: finds its stars and tries their middles. */
static bst_status solve_path(attempt *a, const bst_star_path *path, int candidates,
                             bst_lost_in_space_result *out) {
    BST_TRY(bst_streak_finder_search(a->ctx, a->finder, path, &a->streak));
    return solve_middles(a, candidates, NULL, out);
}

/* Chooses the stars that the catalogue has. */
static void choose_matched(const attempt *a, bool chosen[BST_PLATE_SOLVE_STARS]) {
    for (int i = 0; i < a->streak.count; i++) {
        chosen[i] = bst_lost_in_space_matched(a->lost, i);
    }
}

/* True if the ends of a solved frame's streaks are where its stars' light ends. All stars that
 * measured the path give the margin of its ends. Pieces of streaks may be among them, which would
 * keep a path that is too short, and light of others where a streak ends: those of the catalogue
 * have votes. */
static bool is_certain(const attempt *a) {
    bool chosen[BST_PLATE_SOLVE_STARS];
    choose_matched(a, chosen);
    const double votes = bst_streak_finder_votes(a->finder, chosen, &a->streak);
    const double margin = a->streak.ends_margin;
    if (!isfinite(votes)) { /* too short for other ends */
        return margin > LEAST_MARGIN;
    }
    return votes < CERTAIN_VOTES || (votes < CLEAR_VOTES && margin > LESS_MARGIN) ||
           (votes < 0.0 && margin > LEAST_MARGIN);
}

/* Moves the ends of a solved frame's streaks to where its identified stars vote for, and solves
 * again. */
static bst_status move_ends(attempt *a, bst_lost_in_space_result *out) {
    bool chosen[BST_PLATE_SOLVE_STARS];
    const bst_lost_in_space_result near = *out;
    choose_matched(a, chosen);
    BST_TRY(bst_streak_finder_move_ends(a->ctx, a->finder, chosen, &a->streak));
    return (a->joint ? solve_together : solve_middles)(a, BST_LOST_IN_SPACE_USUAL.max_candidates,
                                                       &near, out);
}

/* Measures the path on the identified stars and solves again.
 *
 * Given:     bright  also on bright stars that the catalogue lacks
 * Returned:  *certain  the frame is solved, and the streak has kept its length and has certain
 *                      ends */
static bst_status improve_once(attempt *a, bool bright, bst_lost_in_space_result *out,
                               bool *certain) {
    bool chosen[BST_PLATE_SOLVE_STARS];
    const double before = length_px(&a->streak);
    const bst_lost_in_space_result near = *out;
    for (int i = 0; i < a->streak.count; i++) {
        chosen[i] = bst_lost_in_space_matched(a->lost, i) ||
                    (bright && a->streak.items[i].snr > BRIGHT_SNR);
    }
    BST_TRY(bst_streak_finder_repeat(a->ctx, a->finder, chosen, &a->streak));
    BST_TRY((a->joint ? solve_together : solve_middles)(a, BST_LOST_IN_SPACE_USUAL.max_candidates,
                                                        &near, out));
    *certain = out->solved && fabs(length_px(&a->streak) - before) < SAME_PX && is_certain(a);
    return BST_OK;
}

/* Improves the path until its ends are certain; the frame is not solved if they never are.
 *
 * Given:     bright  from the beginning also on stars that the catalogue lacks */
static bst_status improve_by(attempt *a, bool bright, bst_lost_in_space_result *out) {
    bool certain = false;
    for (int pass = 0; pass < PASSES && out->solved && !certain; pass++) {
        if (pass > 0) {
            BST_TRY(move_ends(a, out));
        }
        if (out->solved) {
            BST_TRY(improve_once(a, bright || pass == PASSES - 1, out, &certain));
        }
    }
    out->solved = certain;
    return BST_OK;
}

/* Improves the path of a solved frame. If the ends of its streaks are never certain, they may lie
 * in the light of other stars, with the middle of the exposure in the wrong place: such a frame is
 * not solved. The identified stars measure the path first, then all bright ones. */
static bst_status improve(attempt *a, bst_lost_in_space_result *out) {
    const bst_star_path path = *bst_streak_finder_path(a->finder);
    const bst_lost_in_space_result first = *out;
    BST_TRY(improve_by(a, false, out));
    if (!out->solved) {
        BST_TRY(bst_streak_finder_search(a->ctx, a->finder, &path, &a->streak));
        BST_TRY((a->joint ? solve_together : solve_middles)(
            a, BST_LOST_IN_SPACE_USUAL.max_candidates, &first, out));
        BST_TRY(improve_by(a, true, out));
    }
    return BST_OK;
}

/* Measures the path on the brightest stars once more, if the frame is nearly solved. */
static bst_status try_again(attempt *a, int candidates, bst_lost_in_space_result *out) {
    for (int pass = 0; pass < PASSES && !out->solved && out->least_log_chance < NEARLY; pass++) {
        bool chosen[BST_PLATE_SOLVE_STARS];
        for (int i = 0; i < a->streak.count; i++) {
            chosen[i] = true;
        }
        BST_TRY(bst_streak_finder_repeat(a->ctx, a->finder, chosen, &a->streak));
        BST_TRY(solve_middles(a, candidates, NULL, out));
    }
    return BST_OK;
}

/* Lists the stars that the catalogue has. */
static void list_matched(const attempt *a, bst_plate_solve_result *out) {
    const double light = light_of_amplitude(&out->path);
    out->matched_count = 0;
    for (int i = 0; i < a->streak.count && out->attitude.solved; i++) {
        const bst_detection *d = &a->streak.items[i];
        if (bst_lost_in_space_matched(a->lost, i) && !(d->flags & BST_DETECTION_EDGE)) {
            out->matched[out->matched_count++] =
                (bst_plate_solve_star){d->x_px, d->y_px, light * d->flux_e};
        }
    }
}

/* A path that the frame suggests. */
typedef struct choice {
    bst_star_path path;
    double quality;
    bool tried;
} choice;

/* The best paths so far, the best first. */
typedef struct choices {
    choice items[TRIES];
    int count;
} choices;

/* Adds a path to those to try.
 *
 * Given:     first  before those of the same quality */
static void add_choice(choices *c, const bst_star_path *path, double quality, bool first) {
    int at = c->count < TRIES ? c->count++ : TRIES;
    for (; at > 0 &&
           (c->items[at - 1].quality < quality || (first && c->items[at - 1].quality <= quality));
         at--) {
        if (at < TRIES) {
            c->items[at] = c->items[at - 1];
        }
    }
    if (at < TRIES) {
        c->items[at] = (choice){*path, quality, false};
    }
}

/* Measures the paths of shapes from one on: at most so many of whole and of cut sources. Those that
 * have been measured cost little. */
static bst_status measure_shapes(attempt *a, int from, int most_whole, int most_cut, bool extend,
                                 choices *c) {
    const int shapes = bst_streak_finder_shapes(a->finder);
    int whole = 0, cut = 0;
    for (int i = from; i < shapes; i++) {
        bst_star_path path;
        double quality;
        bool is_cut = i >= 0 && bst_streak_finder_is_cut(a->finder, i);
        if (is_cut ? cut >= most_cut : whole >= most_whole) {
            continue;
        }
        BST_TRY(bst_streak_finder_measure(a->ctx, a->finder, i, extend, &path, &quality));
        if (quality > 0.0) {
            whole += !is_cut;
            cut += is_cut;
            add_choice(c, &path, quality, i == BST_STREAK_FINDER_POINT);
        }
    }
    return BST_OK;
}

/* Solves the frame by one path. */
static bst_status try_choice(attempt *a, choice *c, bst_plate_solve_result *out) {
    const int candidates =
        c->path.count == 1 ? POINT_CANDIDATES : BST_LOST_IN_SPACE_USUAL.max_candidates;
    c->tried = true;
    BST_TRY(solve_path(a, &c->path, candidates, &out->attitude));
    out->points = length_px(&a->streak) < POINT_PX;
    if (!out->points) {
        BST_TRY(try_again(a, candidates, &out->attitude));
    }
    if (!out->attitude.solved && !out->points && a->joint_left > 0 &&
        fmin(c->path.margin[0], c->path.margin[1]) > LEAST_MARGIN) {
        a->joint_left--;
        a->joint = true;
        BST_TRY(solve_together(a, candidates, NULL, &out->attitude));
    }
    if (out->attitude.solved && !out->points) {
        BST_TRY(improve(a, &out->attitude));
    }
    a->joint = false;
    out->stars = a->streak.count;
    out->ends_margin = a->streak.ends_margin;
    out->ends[0] = a->streak.ends[0];
    out->ends[1] = a->streak.ends[1];
    out->path = *bst_streak_finder_path(a->finder);
    list_matched(a, out);
    return BST_OK;
}

static bst_status try_choices(attempt *a, choices *c, bst_plate_solve_result *out) {
    for (int i = 0; i < c->count && !out->attitude.solved; i++) {
        if (!c->items[i].tried) {
            BST_TRY(try_choice(a, &c->items[i], out));
        }
    }
    return BST_OK;
}

/* True if the best path needs no comparison with those of more shapes: a streak that fits better
 * than a point and has certain ends, or a point if the first shape is one, too.
 *
 * Given:     against_points  it fits better than points, which are not among the choices */
static bool is_clear(const choices *c, bool against_points) {
    const bst_star_path *best = &c->items[0].path;
    if (c->count < (against_points ? 1 : 2)) {
        return false;
    }
    return best->count > 1 ? fmin(best->margin[0], best->margin[1]) > LEAST_MARGIN
                           : c->items[1].path.count == 1;
}

/* Measures the first shape, and points if they may fit better.
 *
 * Returned:  *no_points  they were not measured */
static bst_status measure_first(attempt *a, choices *c, bool *no_points) {
    BST_TRY(measure_shapes(a, 0, 1, 0, false, c));
    *no_points = c->count > 0 && bst_streak_finder_points_fit_worse(a->finder, c->items[0].quality);
    return *no_points ? BST_OK : measure_shapes(a, BST_STREAK_FINDER_POINT, 1, 0, false, c);
}

static bst_status try_shapes(attempt *a, bst_plate_solve_result *out) {
    choices *c = calloc(1, sizeof *c);
    if (!c) {
        return bst_fail(a->ctx, BST_ERR_MEMORY, "no memory for the streaks of a frame");
    }
    bool no_points;
    bst_status status = measure_first(a, c, &no_points);
    if (status == BST_OK && is_clear(c, no_points)) {
        status = try_choice(a, &c->items[0], out);
    }
    if (status == BST_OK && !out->attitude.solved && no_points) {
        status = measure_shapes(a, BST_STREAK_FINDER_POINT, 1, 0, false, c);
    }
    if (status == BST_OK && !out->attitude.solved) {
        status = measure_shapes(a, 1, FIRST_SHAPES - 1, 0, false, c);
        status = status == BST_OK ? try_choices(a, c, out) : status;
    }
    if (status == BST_OK && !out->attitude.solved) {
        status = measure_shapes(a, 0, SHAPES, CUT_SHAPES, false, c);
        status = status == BST_OK ? try_choices(a, c, out) : status;
    }
    if (status == BST_OK && !out->attitude.solved) {
        c->count = 0; /* pieces may fit better than what they are pieces of */
        a->joint_left = JOINT_TRIES;
        status = measure_shapes(a, 0, SHAPES, CUT_SHAPES, true, c);
        status = status == BST_OK ? try_choices(a, c, out) : status;
    }
    free(c);
    return status;
}

bst_status bst_plate_solve(bst_ctx *ctx, bst_lost_in_space *lost,
                           const bst_plate_solve_options *options, const float *pixels, int width,
                           int height, bst_plate_solve_result *out) {
    assert(lost && options && pixels && out && options->light);
    *out = (bst_plate_solve_result){.points = false};
    attempt a = {.ctx = ctx,
                 .lost = lost,
                 .options = options,
                 .width = width,
                 .height = height,
                 .joint_left = JOINT_TRIES};
    const bst_common_streak_options streak = {.max_sources = BST_PLATE_SOLVE_STARS,
                                              .least_snr = options->least_snr,
                                              .tangent_per_px = options->tangent_per_px};
    BST_TRY(bst_streak_finder_create(ctx, pixels, width, height, &streak, &a.finder));
    bst_status status = try_shapes(&a, out);
    bst_streak_finder_free(a.finder);
    return status;
}
