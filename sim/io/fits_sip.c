#include <math.h>
#include <stdio.h>

#include "sim/io/fits_internal.h"

#define DIGITS (-15)

static void put_polynomial(fitsfile *file, const char *name, const double *c, int lowest, int order,
                           int *code) {
    char key[48];
    snprintf(key, sizeof key, "%s_ORDER", name);
    fits_write_key_lng(file, key, order, "order of the polynomial", code);
    for (int n = lowest; n <= order; n++) {
        for (int q = 0; q <= n; q++) {
            snprintf(key, sizeof key, "%s_%d_%d", name, n - q, q);
            fits_write_key_dbl(file, key, c[bst_sip_term(n - q, q)], DIGITS, "", code);
        }
    }
}

void bst_fits_put_sip(fitsfile *file, const bst_sip *sip, int *code) {
    put_polynomial(file, "A", sip->a, 2, sip->order, code);
    put_polynomial(file, "B", sip->b, 2, sip->order, code);
    put_polynomial(file, "AP", sip->ap, 0, sip->inverse_order, code);
    put_polynomial(file, "BP", sip->bp, 0, sip->inverse_order, code);
}

void bst_fits_put_lens(fitsfile *file, const bst_camera *c, int *code) {
    if (!c->geometry.general) {
        return;
    }
    fits_write_key_dbl(file, "ROTATION", c->rotation_deg, DIGITS,
                       "[deg] focal plane about the boresight, +x to +y", code);
    if (!bst_camera_distorted(c)) {
        return;
    }
    const bst_camera_distortion *d = &c->distortion;
    const double values[] = {d->k1, d->k2, d->k3, d->p1, d->p2};
    static const char *const keys[] = {"DISTK1", "DISTK2", "DISTK3", "DISTP1", "DISTP2"};
    for (int i = 0; i < 5; i++) {
        fits_write_key_dbl(file, keys[i], values[i], DIGITS,
                           i < 3 ? "radial distortion (Brown 1971, as OpenCV)"
                                 : "tangential distortion (Brown 1971, as OpenCV)",
                           code);
    }
}

enum { COLUMNS = 6 };
static const char *const columns[COLUMNS] = {"A_ORDER", "AP_ORDER", "A", "B", "AP", "BP"};

void bst_fits_sip_columns(fitsfile *file, int *code) {
    int last;
    fits_get_num_cols(file, &last, code);
    for (int i = 0; i < COLUMNS; i++) {
        char name[16], form[8];
        snprintf(name, sizeof name, "%s", columns[i]);
        snprintf(form, sizeof form, "%d%c", i < 2 ? 1 : BST_SIP_TERMS, i < 2 ? 'J' : 'D');
        fits_insert_col(file, last + 1 + i, name, form, code);
    }
    fits_update_key_str(file, "CTYPE1", "RA---TAN-SIP", "projection of the WCS in each row", code);
    fits_update_key_str(file, "CTYPE2", "DEC--TAN-SIP", "projection of the WCS in each row", code);
    fits_write_comment(file, "A, B, AP, BP: SIP terms u^p v^q in the order (0,0) (1,0) (0,1) (2,0)",
                       code);
    fits_write_comment(file, "(1,1) (0,2) ..., of the orders A_ORDER (A and B) and AP_ORDER.",
                       code);
}

void bst_fits_sip_row(fitsfile *file, long long row, const bst_sip *sip, int *code) {
    int first, orders[2] = {sip->order, sip->inverse_order};
    char name[] = "A_ORDER";
    fits_get_colnum(file, CASEINSEN, name, &first, code);
    for (int i = 0; i < 2; i++) {
        fits_write_col(file, TINT, first + i, row, 1, 1, &orders[i], code);
    }
    bst_sip copy = *sip;
    double *const arrays[4] = {copy.a, copy.b, copy.ap, copy.bp};
    for (int i = 0; i < 4; i++) {
        fits_write_col(file, TDOUBLE, first + 2 + i, row, 1, BST_SIP_TERMS, arrays[i], code);
    }
}
