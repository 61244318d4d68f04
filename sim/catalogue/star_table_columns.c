/* Names by which the columns of a table of stars are found. */
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
