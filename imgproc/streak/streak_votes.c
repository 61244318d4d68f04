/* Chosen stars of a frame, and their votes on the ends of the common streak. */
#include <assert.h>
#include <math.h>

#include "imgproc/streak/common_streak_internal.h"

/* Samples on either side that overlap: those of the widest PSF six times over. */
enum { OVERLAP = 12 };

typedef bst_streak_finder finder;

/* Value of a sample inside a streak of unit amplitude: the convolved samples overlap. */
static double overlap(const finder *f) {
    double sum = 0.0, step = BST_STAR_PATH_STEP_PX / f->psf_sigma_px;
    for (int k = -OVERLAP; k <= OVERLAP; k++) {
        sum += exp(-0.25 * k * k * step * step);
    }
    return sum;
}

int bst_streak_finder_choose(const finder *f, const bst_common_streak *found, const bool *chosen,
                             bst_star_path_star *stars, int most) {
    const double light = overlap(f);
    int count = 0;
    for (int i = 0; i < found->count && count < most; i++) {
        if (!chosen || chosen[i]) {
            stars[count++] = (bst_star_path_star){found->items[i].x_px, found->items[i].y_px,
                                                  found->items[i].flux_e / f->sigma * light};
        }
    }
    return count;
}

double bst_streak_finder_votes(finder *f, const bool *chosen, const bst_common_streak *found) {
    assert(f && chosen && found);
    const bst_star_path_image image = {f->smooth, f->width, f->height};
    bst_star_path_star stars[BST_STAR_PATH_VOTERS];
    double votes[2];
    int count = bst_streak_finder_choose(f, found, chosen, stars, BST_STAR_PATH_VOTERS);
    bst_star_path_vote(&f->path, &image, stars, count, votes);
    return fmax(votes[0], votes[1]);
}

bst_status bst_streak_finder_move_ends(bst_ctx *ctx, finder *f, const bool *chosen,
                                       bst_common_streak *out) {
    assert(f && chosen && out);
    const bst_star_path_image image = {f->smooth, f->width, f->height};
    bst_star_path_star stars[BST_STAR_PATH_VOTERS];
    int count = bst_streak_finder_choose(f, out, chosen, stars, BST_STAR_PATH_VOTERS);
    return bst_star_path_move_ends(&f->path, &image, stars, count)
               ? bst_streak_finder_find_all(ctx, f, out)
               : BST_OK;
}
