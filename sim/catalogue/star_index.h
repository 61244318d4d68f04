/* File format of the star catalogue, for mapped files, the embedded catalogue and the importers.
 *
 * header | extension | patches | variables | points | cells | records | sources, in the byte order
 * of the machine that wrote it (checked). Extension, variables and points are in files of version 3
 * only, which have parallaxes or variable stars. The first sky cells are the 9,537 regions of the
 * Guide Star Catalog that Tycho-2 numbers its stars by (TYC1), so a star's identity names its cell.
 * Cells after them, in files of version 2 and 3, hold the stars of a user's table, numbered in the
 * order of their records; their sources are the table's own identities. Each cell stores the cap
 * that contains its stars, which are sorted brightest first. */
#ifndef BST_CATALOGUE_STAR_INDEX_H
#define BST_CATALOGUE_STAR_INDEX_H

#include <stdbool.h>
#include <stdint.h>

#include "boresight/status.h"
#include "boresight/vec.h"

#define BST_STAR_MAGIC "BSTSTARS"
#define BST_STAR_ENDIAN 0x01020304u
#define BST_STAR_VERSION 1u       /* stars of Tycho-2 only */
#define BST_STAR_TABLE_VERSION 2u /* also stars of a table */
#define BST_STAR_TIME_VERSION 3u  /* also parallaxes and variable stars */
#define BST_STAR_CELLS 9538u      /* one per TYC1, 1 to 9537; cell 0 is empty */
#define BST_STAR_CELLS_MAX (1u << 22)
#define BST_STAR_PATCHES_MAX 64u
#define BST_STAR_EPOCH_YEAR 2000.0 /* Julian year of the stored positions */

typedef struct bst_star_header {
    char magic[8];
    uint32_t endian;
    uint32_t version;
    uint64_t file_bytes;
    uint64_t checksum; /* bst_star_checksum of all bytes after this field */
    uint64_t star_count;
    uint32_t cell_count;
    uint32_t patch_count;
    double complete_to_v_mag; /* over the whole sky */
    char source[40];          /* zero-terminated */
} bst_star_header;

/* What files of version 3 have behind the header. */
typedef struct bst_star_extension {
    uint32_t variable_count;
    uint32_t point_count;
} bst_star_extension;

/* Variability of a star: V is that of its record, the brightest one, plus what follows. */
typedef struct bst_star_variable {
    uint32_t star;        /* index of its record */
    uint32_t first_point; /* of its light curve */
    uint32_t point_count; /* 0: a cosine */
    float amplitude_mag;  /* cosine: faintest less brightest V */
    float table_mag;      /* the table's V less the brightest */
    float spare;
    double period_d; /* 0: times of the curve are days, not phases; constant beyond its ends */
    double epoch_jd; /* of phase 0 or of the curve's time 0, barycentric Julian date (TDB) */
} bst_star_variable;

/* A point of a light curve; straight lines join the points. */
typedef struct bst_star_point {
    float time; /* phase from 0 to 1, or days */
    float mag;  /* V less the brightest */
} bst_star_point;

/* A cap of the sky in which the catalogue has fainter stars. */
typedef struct bst_star_patch {
    double ra_deg;
    double dec_deg;
    double radius_deg;
    double v_mag;
} bst_star_patch;

typedef struct bst_star_cell {
    float centre[3];     /* ICRS unit vector */
    float radius_rad;    /* all stars of the cell are within it, J2000 */
    float pm_max_radpyr; /* largest total proper motion in the cell */
    uint32_t first;      /* index of the cell's first record */
    uint32_t count;
} bst_star_cell;

/* One star in 20 bytes. Magnitudes and proper motions have the catalogue's digits. */
typedef struct bst_star_record {
    uint32_t ra;           /* ICRS, J2000, 2^32 to the turn (0.30 mas) */
    int32_t dec;           /* the same unit */
    uint32_t tyc_vt;       /* low 16 bits of the identity, then VT in mmag + BST_STAR_VT_OFFSET */
    uint32_t pm_ra_colour; /* pm_ra cos(dec), 0.1 mas/yr, 18 bits; BT-VT, mmag + offset, 14 bits */
    uint32_t pm_dec_flags; /* pm_dec, 0.1 mas/yr, 18 bits; parallax, 0.2 mas, 12 bits;
                              BST_STAR_VARIABLE and BST_STAR_NO_COLOUR */
} bst_star_record;

#define BST_STAR_VT_OFFSET 3000
#define BST_STAR_COLOUR_OFFSET 4000
#define BST_STAR_PM_LIMIT 131071 /* 0.1 mas/yr */
#define BST_STAR_NO_COLOUR 1u    /* BT-VT is assumed, not measured */
#define BST_STAR_VARIABLE 2u     /* one of the file's variables */
#define BST_STAR_PARALLAX_BITS 0x3FFCu
#define BST_STAR_PARALLAX_UNIT_MAS 0.2
#define BST_STAR_PARALLAX_MAX_MAS 819.0 /* what the bits hold; the largest known is 768.5 */
#define BST_STAR_PERIOD_MIN_D 1e-9      /* 86 us: a Julian date in a double has 40 us */
#define BST_STAR_PERIOD_MAX_D 1e7

_Static_assert(sizeof(bst_star_header) == 96, "file layout");
_Static_assert(sizeof(bst_star_patch) == 32, "file layout");
_Static_assert(sizeof(bst_star_cell) == 28, "file layout");
_Static_assert(sizeof(bst_star_record) == 20, "file layout");
_Static_assert(sizeof(bst_star_extension) == 8, "file layout");
_Static_assert(sizeof(bst_star_variable) == 40, "file layout");
_Static_assert(sizeof(bst_star_point) == 8, "file layout");

/* A star's catalogue values before packing. */
typedef struct bst_star_values {
    double ra_rad, dec_rad; /* ICRS, J2000 */
    int pm_ra_cosdec;       /* 0.1 mas/yr */
    int pm_dec;             /* 0.1 mas/yr */
    int vt_mmag;
    int colour_mmag; /* BT-VT */
    int has_colour;  /* 0: colour_mmag is assumed */
    uint32_t id;     /* bst_star_id_make */
} bst_star_values;

/* Pointers into the bytes of a catalogue; owns nothing. */
typedef struct bst_star_view {
    const bst_star_header *header;
    const bst_star_patch *patches;
    const bst_star_cell *cells; /* header->cell_count */
    const bst_star_record *records;
    const unsigned char *sources; /* int64_t for each star of a table, not aligned; NULL: none */
    uint32_t tycho2_count;        /* stars of Tycho-2; those of a table follow */
    const bst_star_variable *variables; /* [variable_count], by ascending star */
    const bst_star_point *points;
    uint32_t variable_count;
    bool has_parallax; /* version 3: some stars may have one */
} bst_star_view;

/* Brings position and proper motion to another epoch, on a straight line.
 *
 * Given:     years  from the epoch of *values to the wanted one */
void bst_star_move_epoch(bst_star_values *values, double years);

/* Packs one star into a record. BST_ERR_RANGE: a value exceeds its field (VT -3 to 62 mag, BT-VT -4
 * to 12 mag, proper motion up to 13.1 arcsec/yr per axis). */
bst_status bst_star_pack(bst_ctx *ctx, const bst_star_values *values,
                         bst_star_record *out) BST_MUST_CHECK;

/* V magnitude of a record in 1e-5 mag, exact: V = VT - 0.090 (BT - VT) (Tycho-2 ReadMe, note 7). */
static inline int32_t bst_star_record_v(const bst_star_record *r) {
    return (int32_t)(r->tyc_vt >> 16) * 100 - 100 * BST_STAR_VT_OFFSET -
           9 * ((int32_t)(r->pm_ra_colour & 0x3FFFu) - BST_STAR_COLOUR_OFFSET);
}

/* Direction of a star (ICRS unit vector) `years` Julian years after J2000: (u + t mu) / |u + t mu|,
 * uniform straight motion without radial velocity. */
bst_vec3 bst_star_record_direction(const bst_star_record *r, double years);

/* Sets a record's parallax, rounded to BST_STAR_PARALLAX_UNIT_MAS.
 *
 * Given:     parallax_mas  up to BST_STAR_PARALLAX_MAX_MAS; a measured one below 0 becomes 0 */
void bst_star_record_set_parallax(bst_star_record *record, double parallax_mas);

/* Parallax of a record, mas; 0: none is known. */
static inline double bst_star_record_parallax_mas(const bst_star_record *r) {
    return (double)((r->pm_dec_flags & BST_STAR_PARALLAX_BITS) >> 2) * BST_STAR_PARALLAX_UNIT_MAS;
}

/* Checksum of a catalogue file: four interleaved multiply-xor lanes of 64-bit words. It detects any
 * change within one 8-byte word. */
uint64_t bst_star_checksum(const void *data, size_t bytes);

/* Checks a catalogue of `bytes` bytes (aligned to 8) and points *out into it. `label`: name for
 * messages; `sum`: compare the checksum, which reads all of it. BST_ERR_FORMAT: foreign, other
 * version or byte order, truncated or damaged; the message states how to recreate it. */
bst_status bst_star_view_init(bst_ctx *ctx, const char *label, const void *data, uint64_t bytes,
                              bool sum, bst_star_view *out) BST_MUST_CHECK;

struct bst_stars;
/* Cells and records of a catalogue, borrowed. */
const bst_star_view *bst_stars_records(const struct bst_stars *stars);

#endif
