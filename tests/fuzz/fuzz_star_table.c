/* Tables of stars, text or FITS, from any bytes. A row that is accepted makes a star. */
#include <math.h>
#include <stdlib.h>

#include "sim/catalogue/star_index.h"
#include "sim/catalogue/star_table.h"
#include "tests/fuzz/input_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static void check_row(const bst_star_table_row *row) {
    if (!(row->ra_deg >= 0.0 && row->ra_deg <= 360.0 && fabs(row->dec_deg) <= 90.0 &&
          fabs(row->v_mag) <= 40.0 && row->epoch_year >= 1800.0 &&
          fabs(row->pm_ra_cosdec_masyr) <= 13e3 && fabs(row->pm_dec_masyr) <= 13e3 &&
          row->parallax_mas >= 0.0 && row->parallax_mas <= 819.0 && row->period_d >= 0.0 &&
          row->period_d <= 1e7 && row->amplitude_mag >= 0.0 && row->amplitude_mag <= 20.0 &&
          row->maximum_jd >= 2e6 && row->maximum_jd <= 3e6 &&
          (isnan(row->b_minus_v) || fabs(row->b_minus_v) <= 6.0))) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes) {
    const char *path = fuzz_write_file("stars.csv", data, bytes);
    const bst_star_table_options options = {2016.0, 25.0};
    bst_ctx ctx;
    bst_star_table *table = NULL;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_status status = bst_star_table_open(&ctx, path, &options, &table);
    FUZZ_CHECK_REASON(ctx, status);
    bool end = status != BST_OK;
    /* a FITS header can state any number of rows; they are read in blocks */
    for (int rows = 0; !end && rows < 20000; rows++) {
        bst_star_table_row row;
        status = bst_star_table_next(&ctx, table, &row, &end);
        FUZZ_CHECK_REASON(ctx, status);
        if (status != BST_OK) {
            break;
        }
        if (!end) {
            check_row(&row);
        }
    }
    bst_star_table_close(table);
    return 0;
}
