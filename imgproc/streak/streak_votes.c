/* Votes of chosen stars on the ends of the common streak. */
#include <assert.h>
#include <math.h>

#include "imgproc/streak/common_streak_internal.h"

typedef bst_streak_finder finder;

double bst_streak_finder_votes(finder *f, const bool *chosen, const bst_common_streak *found) {
    assert(f && chosen && found);
    const bst_star_path_image image = bst_streak_finder_image(f);
    bst_star_path_star stars[BST_STAR_PATH_VOTERS];
    double votes[2];
    int count = bst_streak_finder_choose(f, found, chosen, stars, BST_STAR_PATH_VOTERS);
    bst_star_path_vote(&f->path, &image, stars, count, votes);
    return fmax(votes[0], votes[1]);
}

bst_status bst_streak_finder_move_ends(bst_ctx *ctx, finder *f, const bool *chosen,
                                       bst_common_streak *out) {
    assert(f && chosen && out);
    const bst_star_path_image image = bst_streak_finder_image(f);
    bst_star_path_star stars[BST_STAR_PATH_VOTERS];
    int count = bst_streak_finder_choose(f, out, chosen, stars, BST_STAR_PATH_VOTERS);
    return bst_star_path_move_ends(&f->path, &image, stars, count)
               ? bst_streak_finder_find_all(ctx, f, out)
               : BST_OK;
}
