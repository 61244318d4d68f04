#include "sim/catalogue/star_summary.h"

#include <inttypes.h>
#include <math.h>

#include "sim/catalogue/star_import.h"
#include "sim/catalogue/star_index.h"
#include "sim/catalogue/star_list.h"

/* Stars with a parallax. */
static long long count_parallaxes(const bst_stars *stars) {
    const bst_star_view *view = bst_stars_records(stars);
    long long count = 0;
    for (uint64_t i = 0; i < view->header->star_count; i++) {
        count += (view->records[i].pm_dec_flags & BST_STAR_PARALLAX_BITS) != 0;
    }
    return count;
}

bst_status bst_stars_print_summary(bst_ctx *ctx, const bst_stars *stars, FILE *stream) {
    bst_stars_info i;
    bst_stars_get_info(stars, &i);
    fprintf(stream, "source    %s\n", i.source);
    fprintf(stream, "path      %s\n", i.embedded ? "(in the program)" : i.path);
    fprintf(stream, "stars     %lld\n", i.count);
    if (i.table_count > 0) {
        fprintf(stream, "          %lld of them from a table\n", i.table_count);
    }
    if (i.has_parallax) {
        fprintf(stream, "          %lld of them with a parallax, %lld variable\n",
                count_parallaxes(stars), i.variable_count);
    }
    if (i.complete_to_v_mag > BST_STAR_BRIGHTER_THAN_ALL) {
        fprintf(stream, "complete  to V %.1f over the whole sky%s\n", i.complete_to_v_mag,
                i.complete_to_v_mag == BST_STAR_TYCHO2_COMPLETE_V && i.table_count == 0
                    ? " (98 % of the stars there)"
                    : "");
    } else {
        fputs("complete  nothing is stated for the whole sky\n", stream);
    }
    for (int p = 0; p < i.patches; p++) {
        bst_vec3 centre;
        double radius, v, ra, dec;
        bst_stars_patch(stars, p, &centre, &radius, &v);
        bst_vec3_to_radec(centre, &ra, &dec);
        fprintf(stream, "          %s to V %.1f within %.1f deg of RA %.4f Dec %+.4f deg\n",
                i.table_count > 0 ? "all stars" : "all of Tycho-2", v, radius / BST_DEG_RAD,
                ra / BST_DEG_RAD, dec / BST_DEG_RAD);
    }
    fprintf(stream, "counts    V <=       stars\n");
    for (int v = 0, count = 0; v <= 21 && count < i.count; v++) {
        BST_TRY(bst_stars_query(ctx, stars, (bst_vec3){0.0, 0.0, 1.0}, BST_PI, (double)v,
                                BST_STAR_EPOCH_YEAR, NULL, 0, &count));
        fprintf(stream, "          %4d  %10d\n", v, count);
    }
    if (i.table_count > 0) {
        fprintf(stream, "licence   of the table's stars: your table's\n");
    }
    if (i.count > i.table_count) {
        fputs(
            "licence   Tycho-2 (Hog et al. 2000): BSD-2-Clause, as Debian's package tycho2 "
            "states\n",
            stream);
    }
    return BST_OK;
}

bst_status bst_stars_print_star(bst_ctx *ctx, const bst_stars *stars, uint32_t id, FILE *stream) {
    bst_star star;
    BST_TRY(bst_stars_find(ctx, stars, id, BST_STAR_EPOCH_YEAR, &star));
    double ra, dec;
    bst_vec3_to_radec(star.icrs, &ra, &dec);
    if (id < BST_STAR_TABLE_ID) {
        unsigned tyc1, tyc2, tyc3;
        bst_star_id_split(id, &tyc1, &tyc2, &tyc3);
        fprintf(stream, "identity  %" PRIu32 ", TYC %u-%u-%u\n", id, tyc1, tyc2, tyc3);
    } else {
        fprintf(stream, "identity  %" PRIu32 "\n", id);
    }
    int64_t source = bst_stars_source(stars, id);
    if (source != 0) {
        fprintf(stream, "source    %" PRId64 "\n", source);
    }
    fprintf(stream, "place     RA %.7f Dec %+.7f deg, ICRS, J2000\n", ra / BST_DEG_RAD,
            dec / BST_DEG_RAD);
    fprintf(stream, "V         %.3f\n", (double)star.v_mag);
    if (isfinite(star.b_minus_v)) {
        fprintf(stream, "B-V       %.3f\n", (double)star.b_minus_v);
    }
    bst_star_change change;
    bst_stars_change(stars, id, &change);
    if (change.parallax_mas > 0.0) {
        fprintf(stream, "parallax  %.1f mas\n", change.parallax_mas);
    }
    if (change.varies) {
        fprintf(stream, "varies    V %.3f to %.3f", change.brightest_v_mag, change.faintest_v_mag);
        fprintf(stream, change.period_d > 0.0 ? ", period %.7g d, " : ", no period, ",
                change.period_d);
        fprintf(stream, "%s at JD %.4f\n", change.points > 0 ? "light curve's zero" : "brightest",
                change.epoch_jd);
    }
    return BST_OK;
}
