#include "sim/catalogue/star_summary.h"

#include "sim/catalogue/star_import.h"

bst_status bst_stars_print_summary(bst_ctx *ctx, const bst_stars *stars, FILE *stream) {
    bst_stars_info i;
    bst_stars_get_info(stars, &i);
    fprintf(stream, "source    %s\n", i.source);
    fprintf(stream, "path      %s\n", i.embedded ? "(in the program)" : i.path);
    fprintf(stream, "stars     %lld\n", i.count);
    fprintf(stream, "complete  to V %.1f over the whole sky%s\n", i.complete_to_v_mag,
            i.complete_to_v_mag == BST_STAR_TYCHO2_COMPLETE_V ? " (98 % of the stars there)" : "");
    for (int p = 0; p < i.patches; p++) {
        bst_vec3 centre;
        double radius, v, ra, dec;
        bst_stars_patch(stars, p, &centre, &radius, &v);
        bst_vec3_to_radec(centre, &ra, &dec);
        fprintf(stream,
                "          all of Tycho-2 to V %.1f within %.1f deg of RA %.4f Dec %+.4f deg\n", v,
                radius / BST_DEG_RAD, ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    }
    fprintf(stream, "counts    V <=       stars\n");
    for (int v = 0, count = 0; v <= 15 && count < i.count; v++) {
        BST_TRY(bst_stars_query(ctx, stars, (bst_vec3){0.0, 0.0, 1.0}, BST_PI, (double)v,
                                BST_STAR_EPOCH_YEAR, NULL, 0, &count));
        fprintf(stream, "          %4d  %10d\n", v, count);
    }
    fprintf(
        stream,
        "licence   Tycho-2 (Hog et al. 2000): BSD-2-Clause, as Debian's package tycho2 states\n");
    return BST_OK;
}
