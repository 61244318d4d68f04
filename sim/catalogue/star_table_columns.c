/* Names by which the columns of a table of stars are found. */
#include <ctype.h>
#include <string.h>
#include <strings.h>

#include "sim/catalogue/star_table_internal.h"

const char bst_star_source_names[] = "source_id source id";
const char *const bst_star_quantity_names[BST_STAR_QUANTITIES] = {
    [BST_STAR_RA] = "ra ra_deg ra_icrs",
    [BST_STAR_DEC] = "dec dec_deg de_icrs",
    [BST_STAR_EPOCH] = "ref_epoch epoch epoch_year",
    [BST_STAR_PM_RA] = "pmra pm_ra pm_ra_cosdec pm_ra_cosdec_masyr",
    [BST_STAR_PM_DEC] = "pmdec pmde pm_dec pm_dec_masyr",
    [BST_STAR_G] = "phot_g_mean_mag gmag g_mag g",
    [BST_STAR_BP_RP] = "bp_rp bp-rp",
    [BST_STAR_BP] = "phot_bp_mean_mag bpmag bp_mag bp",
    [BST_STAR_RP] = "phot_rp_mean_mag rpmag rp_mag rp",
    [BST_STAR_V] = "v_mag vmag v",
    [BST_STAR_B_MINUS_V] = "b_minus_v b-v b_v",
    [BST_STAR_B] = "b_mag bmag b",
    [BST_STAR_ELECTRONS] = "electrons_per_s",
    [BST_STAR_PARALLAX] = "parallax plx parallax_mas",
    [BST_STAR_PERIOD] = "period_d period pf",
    [BST_STAR_AMPLITUDE] = "amplitude_mag amplitude peak_to_peak_g",
    [BST_STAR_MAXIMUM] = "maximum_jd",
    [BST_STAR_MAXIMUM_GAIA] = "epoch_g", /* less BST_STAR_GAIA_JD */
};

bool bst_star_name_is(const char *names, const char *name, size_t length) {
    for (const char *word = names; *word;) {
        size_t n = strcspn(word, " ");
        if (n == length && strncasecmp(word, name, n) == 0) {
            return true;
        }
        word += n + (word[n] == ' ');
    }
    return false;
}

/* Units of a quantity, without blanks, in small letters; "": not checked. */
static const char *units_of(bst_star_quantity q) {
    switch (q) {
        case BST_STAR_RA:
        case BST_STAR_DEC:
            return "deg degree degrees";
        case BST_STAR_EPOCH:
            return "yr year a jyear";
        case BST_STAR_PM_RA:
        case BST_STAR_PM_DEC:
            return "mas/yr mas/year mas.yr**-1 mas.yr-1 masyr-1 masyr**-1 mas/a";
        case BST_STAR_PARALLAX:
            return "mas";
        case BST_STAR_PERIOD:
        case BST_STAR_MAXIMUM:
        case BST_STAR_MAXIMUM_GAIA:
            return "d day days";
        case BST_STAR_AMPLITUDE:
            return "mag";
        default:
            return "";
    }
}

bst_status bst_star_unit_check(bst_ctx *ctx, const bst_star_table *t, bst_star_quantity q,
                               const char *unit, size_t length) {
    char plain[40];
    size_t n = 0;
    for (size_t i = 0; i < length && n + 1 < sizeof plain; i++) {
        if (!isspace((unsigned char)unit[i])) {
            plain[n++] = unit[i];
        }
    }
    const char *allowed = units_of(q);
    if (n == 0 || !*allowed || bst_star_name_is(allowed, plain, n)) {
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_FORMAT, "%s: column %s: unit \"%.*s\"; allowed: %s", t->path,
                    t->name[q], (int)length, unit, allowed);
}
