/* Keyword maps: which header keywords of a frame, or columns of a side table, give time, exposure,
 * gain and the like. A map is a JSON file (docs/reference/file_formats.md, "Keyword maps"). */
#ifndef BST_IO_KEYWORD_MAP_H
#define BST_IO_KEYWORD_MAP_H

#include "boresight/config.h"
#include "boresight/vec.h"
#include "sim/astro/time.h"
#include "sim/io/frame_source.h"

/* Room for the keywords of a value, "EXPTIME|EXPOSURE": the first one in the header counts. */
enum { BST_KEYWORD_TEXT = 80 };

/* A number of a frame: factor times the keyword's value, or `value` without the keyword. */
typedef struct bst_keyword_number {
    char keyword[BST_KEYWORD_TEXT]; /* "": none */
    double factor;
    double value; /* NAN: the keyword is required */
} bst_keyword_number;

enum { BST_KEYWORD_UTC, BST_KEYWORD_MJD, BST_KEYWORD_JD, BST_KEYWORD_UNIX };
/* Time scale of the header's keyword TIMESYS, UTC without it. */
enum { BST_KEYWORD_TIMESYS };
enum { BST_KEYWORD_START, BST_KEYWORD_MIDDLE, BST_KEYWORD_END };

typedef struct bst_keyword_time {
    char keyword[BST_KEYWORD_TEXT];
    char clock_keyword[BST_KEYWORD_TEXT]; /* time of day, where `keyword` has a date alone */
    int32_t format;                       /* BST_KEYWORD_UTC, _MJD, _JD, _UNIX */
    int32_t scale;                        /* BST_KEYWORD_TIMESYS, or 1 + bst_astro_time_system */
    int32_t moment;                       /* BST_KEYWORD_START, _MIDDLE, _END */
} bst_keyword_time;

typedef struct bst_keyword_vector {
    bst_keyword_number x, y, z;
} bst_keyword_vector;

/* Keywords of a history of rates of turn; # stands for a digit of its index, from 0. */
typedef struct bst_keyword_history {
    char time[BST_KEYWORD_TEXT]; /* s after the start of the exposure; "": no history */
    char rate[BST_KEYWORD_TEXT]; /* one to three numbers, any unit */
} bst_keyword_history;

/* A quaternion, scalar w, of unit length to a percent. */
typedef struct bst_keyword_quaternion {
    bst_keyword_number x, y, z, w;
    int32_t rotates; /* BST_KEYWORD_TO_CAMERA, _TO_GCRF */
} bst_keyword_quaternion;

enum { BST_KEYWORD_NO_ATTITUDE, BST_KEYWORD_WCS, BST_KEYWORD_DIRECTION, BST_KEYWORD_QUATERNION };
enum { BST_KEYWORD_TO_CAMERA, BST_KEYWORD_TO_GCRF };
enum { BST_KEYWORD_TOP, BST_KEYWORD_BOTTOM };

typedef struct bst_keyword_map {
    int64_t format;
    char name[64];
    bst_keyword_time time;
    bst_keyword_number plane_period_s, exposure_s, gain_e_per_dn, read_noise_e, offset_dn,
        full_well_e, pixel_scale_arcsec, exposure_id;
    bst_keyword_vector observer_position_gcrf_m, observer_velocity_gcrf_mps;
    bst_keyword_history rate_history;
    int32_t attitude; /* BST_KEYWORD_NO_ATTITUDE, _WCS, _DIRECTION, _QUATERNION */
    bst_keyword_number ra_deg, dec_deg, position_angle_deg;
    bst_keyword_quaternion quaternion;
    int32_t first_row; /* edge of the image: BST_KEYWORD_TOP, _BOTTOM */
    int32_t colour;    /* bst_image_colour */
    char file_column[BST_KEYWORD_TEXT], page_column[BST_KEYWORD_TEXT]; /* of side tables */
    char image_section[BST_KEYWORD_TEXT]; /* keyword; "": the whole image */
    char bias_section[BST_KEYWORD_TEXT];  /* keyword; "": no overscan is subtracted */
    double pedestal_dn, dn_per_unit;      /* count = pedestal_dn + dn_per_unit * value */
    double star_limit_v_mag;              /* faintest stars that a frame surely shows */
    char file[512];                       /* of the map; not in the table */
} bst_keyword_map;

/* Table of a keyword map, for the reference pages and the schema. */
extern const bst_config_desc bst_keyword_map_table[];

/* Reads a keyword map.
 *
 * Given:     path  JSON file
 * Errors:    those of bst_json_load and bst_config_read */
bst_status bst_keyword_map_load(bst_ctx *ctx, const char *path,
                                bst_keyword_map *out) BST_MUST_CHECK;

/* The scenario keys of the camera that the map gives ("camera" of the file): aperture, band, PSF.
 *
 * Given:     path  of a map that bst_keyword_map_load took
 * Returned:  *out  JSON object, which the caller deletes; an empty one if the map has none
 * Errors:    as bst_keyword_map_load */
bst_status bst_keyword_map_camera(bst_ctx *ctx, const char *path,
                                  struct cJSON **out) BST_MUST_CHECK;

/* How the files of a map's frames are opened. It points into the map. */
bst_frame_source_options bst_keyword_map_source(const bst_keyword_map *map);

/* The first of several keywords "A|B" that the selected frame has, for messages; without any all of
 * them.
 *
 * Returned:  name, as text */
const char *bst_keyword_name(bst_frame_source *source, const char *keywords,
                             char text[BST_KEYWORD_TEXT]);

/* What the header says of a frame. */
typedef struct bst_keyword_values {
    bst_time start;
    double exposure_s, gain_e_per_dn, read_noise_e, offset_dn, full_well_e, pixel_scale_arcsec;
    int64_t exposure_id; /* -1: unknown */
    bool has_position, has_velocity;
    bst_vec3 position_gcrf_m, velocity_gcrf_mps; /* observer, geocentric */
} bst_keyword_values;

/* Reads the values of the selected frame of a file.
 *
 * Given:     frame  the selection, for messages
 * Errors:    BST_ERR_FORMAT with place, keyword or column and the map's key: a keyword is missing,
 * is no number, no time, or out of range */
bst_status bst_keyword_map_read(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                                const bst_frame_place *frame,
                                bst_keyword_values *out) BST_MUST_CHECK;

/* A part of an image, from a keyword "[x1:x2,y1:y2]" that counts pixels from 1.
 *
 * Given:     keyword  name; "": the whole image
 * Returned:  box      x0, y0, width, height; pixels from 0. Width 0: the keyword is empty
 * Errors:    BST_ERR_FORMAT with place and keyword: missing, of another form, or not within the
 *            image */
bst_status bst_keyword_section(bst_ctx *ctx, const char *keyword, bst_frame_source *source,
                               const bst_frame_place *frame, int box[4]) BST_MUST_CHECK;

/* Change of the rate of turn during the exposure by the header's history.
 *
 * Returned:  *trend  slope of the rate's length against time, times the exposure, over its mean;
 *                    NAN: no history, fewer than 4 entries within the exposure, or an entry is no
 *                    number, with a warning that says which
 *            *sigma  standard error by the scatter of the rates about the line
 */
void bst_keyword_rate_trend(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                            const bst_frame_place *frame, double exposure_s, double *trend,
                            double *sigma);

/* Attitude by the TAN WCS of a header: CRPIXn, CRVALn, and CDi_j, or CDELTn with PCi_j or CROTA2.
 *
 * Given:     flip_rows  the camera's first row is the last of the file
 * Returned:  *q_cam_from_gcrf  of catalogue places: aberration is not applied
 *            *scale_arcsec     pixel scale
 *            false: no or an incomplete WCS, or one that is mirrored for this order of rows */
bool bst_keyword_wcs(bst_frame_source *source, const bst_frame_place *frame, bool flip_rows,
                     bst_quat *q_cam_from_gcrf, double *scale_arcsec);

/* Attitude by what the map names: WCS, direction with position angle, or quaternion.
 *
 * Given:     flip_rows  as above, for the WCS. Direction and quaternion are of the camera: x right,
 *                       y down, z along the boresight, its first row at the top
 * Returned:  *has, *q_cam_from_gcrf  false: the map names none, or the frame has not all of it
 * Errors:    BST_ERR_FORMAT with place, keyword and key: no number, out of range, a quaternion that
 *            is no rotation */
bst_status bst_keyword_attitude(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                                const bst_frame_place *frame, bool flip_rows, bool *has,
                                bst_quat *q_cam_from_gcrf) BST_MUST_CHECK;

#endif
