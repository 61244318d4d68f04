/* Columns of a table of stars, and the two kinds of files that have them. Names of columns are in
 * star_table_columns.c. */
#ifndef BST_CATALOGUE_STAR_TABLE_INTERNAL_H
#define BST_CATALOGUE_STAR_TABLE_INTERNAL_H

#include <fitsio.h>
#include <stdio.h>

#include "sim/catalogue/star_table.h"
#include "sim/core/subprocess.h"
#include "sim/core/text_reader.h"

typedef enum bst_star_quantity {
    BST_STAR_RA,
    BST_STAR_DEC,
    BST_STAR_EPOCH,
    BST_STAR_PM_RA,
    BST_STAR_PM_DEC,
    BST_STAR_G,
    BST_STAR_BP_RP,
    BST_STAR_BP,
    BST_STAR_RP,
    BST_STAR_V,
    BST_STAR_B_MINUS_V,
    BST_STAR_B,
    BST_STAR_ELECTRONS,
    BST_STAR_PARALLAX,
    BST_STAR_PERIOD,
    BST_STAR_AMPLITUDE,
    BST_STAR_MAXIMUM,
    BST_STAR_MAXIMUM_GAIA,
    BST_STAR_QUANTITIES
} bst_star_quantity;

/* Names of the column of identities, and of each quantity, divided by blanks, in small letters. */
extern const char bst_star_source_names[];
extern const char *const bst_star_quantity_names[BST_STAR_QUANTITIES];

/* Checks the unit of a column of the table.
 *
 * Given:     unit  [length] "": not stated, taken as the right one
 * Errors:    BST_ERR_FORMAT with file, column, unit and those allowed */
bst_status bst_star_unit_check(bst_ctx *ctx, const bst_star_table *table,
                               bst_star_quantity quantity, const char *unit,
                               size_t length) BST_MUST_CHECK;

/* True if `names` holds the word `name` of `length` bytes, in any case. */
bool bst_star_name_is(const char *names, const char *name, size_t length);

enum { BST_STAR_TABLE_COLUMNS = 1024, BST_STAR_TABLE_LINE = 1 << 16 };

/* Unit of a column, from the head of an ECSV file. */
typedef struct bst_star_column_unit {
    char name[72], unit[40];
} bst_star_column_unit;

typedef struct bst_star_votable bst_star_votable;

struct bst_star_table {
    bst_star_table_options options;
    char path[512];
    int source_column;                  /* from 0; -1: none */
    int column[BST_STAR_QUANTITIES];    /* the same */
    char name[BST_STAR_QUANTITIES][72]; /* of the column, for messages */
    int64_t rows, skipped;
    /* text */
    FILE *text; /* NULL: FITS, VOTable */
    bst_subprocess unzip;
    bool unzips;
    char *line, *scratch;
    int line_number, fields; /* fields: columns of the line of names */
    bool ecsv, blanks;       /* blanks divide the columns */
    bst_star_column_unit *units;
    int unit_count;
    struct bst_star_votable *votable; /* NULL: another kind */
    /* FITS */
    fitsfile *fits;
    int64_t fits_rows;
    double *block[BST_STAR_QUANTITIES]; /* values of the rows from block_first on */
    int64_t *block_source;
    int64_t block_first, block_count;
};

/* Opens a text file, unpacked by gzip if `gzip`, and finds its columns. BST_ERR_FORMAT, BST_ERR_IO,
 * BST_ERR_MEMORY. */
bst_status bst_star_text_open(bst_ctx *ctx, bst_star_table *table, bool gzip) BST_MUST_CHECK;

/* Reads the next row of a text file.
 *
 * Returned:  *source  the identity; 0: none, or no number
 *            value    the numbers; NAN: no column or no value
 *            *end     true: there is no row, nothing else is set
 * Errors:    BST_ERR_FORMAT with file, line, column and text */
bst_status bst_star_text_next(bst_ctx *ctx, bst_star_table *table, int64_t *source,
                              double value[BST_STAR_QUANTITIES], bool *end) BST_MUST_CHECK;

/* True if a field of text says that there is no value. */
bool bst_star_field_is_empty(bst_text_span field);
/* Reads a whole number; false: it is none, or beyond 63 bits. */
bool bst_star_source_read(bst_text_span field, int64_t *source);

/* Opens a VOTable, unpacked by gzip if `gzip`, and finds the columns of its first table.
 *
 * Errors:    BST_ERR_FORMAT with file, line and what is allowed: also for document types and links
 *            to other files, which are not followed; BST_ERR_IO, BST_ERR_MEMORY */
bst_status bst_star_votable_open(bst_ctx *ctx, bst_star_table *table, bool gzip) BST_MUST_CHECK;

/* Reads the next row of a VOTable, as bst_star_text_next. */
bst_status bst_star_votable_next(bst_ctx *ctx, bst_star_table *table, int64_t *source,
                                 double value[BST_STAR_QUANTITIES], bool *end) BST_MUST_CHECK;

/* Closes a VOTable; nothing if there is none. */
void bst_star_votable_close(bst_star_table *table);

/* Opens a FITS file and finds the columns of its first binary table. BST_ERR_FORMAT,
 * BST_ERR_MEMORY. */
bst_status bst_star_fits_open(bst_ctx *ctx, bst_star_table *table) BST_MUST_CHECK;

/* Reads the next row of a FITS table, as bst_star_text_next. */
bst_status bst_star_fits_next(bst_ctx *ctx, bst_star_table *table, int64_t *source,
                              double value[BST_STAR_QUANTITIES], bool *end) BST_MUST_CHECK;

#endif
