/* The Earth-orientation table that is part of the program; made by make_eop_table.py. */
#ifndef BST_ASTRO_EOP_TABLE_H
#define BST_ASTRO_EOP_TABLE_H

#include <stdint.h>

/* One day at 0h UTC, in the units of the last digit that the IERS prints. */
typedef struct bst_eop_table_row {
    int32_t xp_uas, yp_uas; /* pole, 1e-6 arcsec */
    int32_t ut1_minus_utc;  /* 1e-7 s */
} bst_eop_table_row;

extern const int bst_eop_table_first_mjd;
extern const int bst_eop_table_rows;
extern const bst_eop_table_row bst_eop_table[];

#endif
