/* Columns of a VOTable: types, array sizes, numbers in binary rows. */
#ifndef BST_CATALOGUE_VOTABLE_FIELD_H
#define BST_CATALOGUE_VOTABLE_FIELD_H

#include <stdbool.h>
#include <stdint.h>

/* Kinds of numbers, by the size in a binary row. */
typedef enum bst_votable_type {
    BST_VOTABLE_BIT,
    BST_VOTABLE_BYTE,
    BST_VOTABLE_SHORT,
    BST_VOTABLE_INT,
    BST_VOTABLE_LONG,
    BST_VOTABLE_FLOAT,
    BST_VOTABLE_DOUBLE,
    BST_VOTABLE_OTHER
} bst_votable_type;

typedef struct bst_votable_field {
    bst_votable_type type;
    int quantity;   /* -1: none */
    int size;       /* bytes of an element; BST_VOTABLE_BIT: 0 */
    uint64_t fixed; /* elements of each item of an array, or all elements */
    bool variable;  /* the row states the number of items */
    bool has_null;
    char null[40];
} bst_votable_field;

/* Type of a column by its name in the file.
 *
 * Returned:  *size  bytes of an element; -1: there is no such type */
bst_votable_type bst_votable_datatype(const char *text, int *size);

/* Reads an array's size: numbers divided by "x", the last one may be "*" or a limit before it.
 *
 * Returned:  false: it is none, or has more than 2^40 elements */
bool bst_votable_read_size(const char *text, bst_votable_field *field);

/* Reads an integer as VOTable has it (1.4, section 6): decimal, or hexadecimal after "0x".
 *
 * Returned:  false: it is none, or beyond 64 bits */
bool bst_votable_read_integer(const char *text, int64_t *value);

/* Bytes of elements of an array. */
uint64_t bst_votable_bytes(const bst_votable_field *field, uint64_t elements);

/* Value of a number of big-endian bytes.
 *
 * Given:     bytes   [field->size]
 * Returned:  *whole  as an integer, 0: none */
double bst_votable_number(const bst_votable_field *field, const unsigned char *bytes,
                          int64_t *whole);

#endif
