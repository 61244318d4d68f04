/* Attitude of a frame by its keywords: WCS, direction, quaternion. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/io/keyword_values_internal.h"
#include "sim/io/tangent.h"

/* Lengths of quaternions that are taken as rotations. */
static const double LEAST_LENGTH = 0.99, MOST_LENGTH = 1.01;

/* Reads a number that a header must have. */
static bool header_number(bst_frame_source *source, const char *keyword, double *out) {
    char text[BST_FITS_SOURCE_TEXT];
    return bst_frame_source_text(source, keyword, text) && bst_keyword_number_of(text, out);
}

/* The matrix of a WCS, deg per pixel (Calabretta and Greisen 2002, section 6). */
static bool header_matrix(bst_frame_source *source, double cd[2][2]) {
    if (header_number(source, "CD1_1", &cd[0][0]) && header_number(source, "CD1_2", &cd[0][1]) &&
        header_number(source, "CD2_1", &cd[1][0]) && header_number(source, "CD2_2", &cd[1][1])) {
        return true;
    }
    double dx, dy, angle = 0.0;
    if (!header_number(source, "CDELT1", &dx) || !header_number(source, "CDELT2", &dy)) {
        return false;
    }
    double pc[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    bool any = header_number(source, "PC1_1", &pc[0][0]);
    any = header_number(source, "PC1_2", &pc[0][1]) || any;
    any = header_number(source, "PC2_1", &pc[1][0]) || any;
    any = header_number(source, "PC2_2", &pc[1][1]) || any;
    if (any) { /* those that are missing are of the unit matrix */
        cd[0][0] = dx * pc[0][0];
        cd[0][1] = dx * pc[0][1];
        cd[1][0] = dy * pc[1][0];
        cd[1][1] = dy * pc[1][1];
        return true;
    }
    (void)header_number(source, "CROTA2", &angle);
    double c = cos(angle * BST_DEG_RAD), s = sin(angle * BST_DEG_RAD);
    cd[0][0] = dx * c;
    cd[0][1] = -dy * s;
    cd[1][0] = dx * s;
    cd[1][1] = dy * c;
    return true;
}

bool bst_keyword_wcs(bst_frame_source *source, const bst_frame_place *frame, bool flip_rows,
                     bst_quat *q_cam_from_gcrf, double *scale_arcsec) {
    double cd[2][2], pix[2], val[2];
    if (!header_matrix(source, cd) || !header_number(source, "CRPIX1", &pix[0]) ||
        !header_number(source, "CRPIX2", &pix[1]) || !header_number(source, "CRVAL1", &val[0]) ||
        !header_number(source, "CRVAL2", &val[1])) {
        return false;
    }
    double det = cd[0][0] * cd[1][1] - cd[0][1] * cd[1][0];
    double up = flip_rows ? -1.0 : 1.0;
    /* with z along the boresight, x right and y down are right-handed: the determinant is positive
     */
    if (!(up * det > 0.0) || !isfinite(det) || fabs(val[1]) > 90.0) {
        return false;
    }
    const bst_io_sky_plane plane = bst_io_sky_plane_at(val[0] * BST_DEG_RAD, val[1] * BST_DEG_RAD);
    bst_vec3 at[2];
    for (int k = 0; k < 2; k++) { /* the middle of the frame, and a pixel to the right of it */
        double x = 0.5 * (frame->width + 1) + k - pix[0], y = 0.5 * (frame->height + 1) - pix[1];
        at[k] = bst_io_sky_from_plane(&plane, (cd[0][0] * x + cd[0][1] * y) * BST_DEG_RAD,
                                      (cd[1][0] * x + cd[1][1] * y) * BST_DEG_RAD);
    }
    bst_vec3 z = at[0], right = bst_vec3_axpy(at[1], -bst_vec3_dot(at[1], z), z);
    if (!(bst_vec3_norm(right) > 0.0)) {
        return false;
    }
    bst_vec3 x = bst_vec3_unit(right), y = bst_vec3_cross(z, x);
    const bst_mat3 m = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    *q_cam_from_gcrf = bst_quat_from_mat3(&m);
    *scale_arcsec = sqrt(fabs(det)) * 3600.0;
    return true;
}

/* Reads an angle as [sign]a:b:c, with colons or blanks. */
static bool sexagesimal(const char *text, double *out) {
    double part[3];
    const char *at = text + strspn(text, " ");
    bool negative = *at == '-';
    at += *at == '-' || *at == '+';
    for (int i = 0; i < 3; i++) {
        char *end;
        bool good = *at >= '0' && *at <= '9';
        part[i] = good ? strtod(at, &end) : -1.0;
        if (!good || !(part[i] >= 0.0) || (i > 0 && part[i] >= 60.0) ||
            (i < 2 && *end != ':' && *end != ' ')) {
            return false;
        }
        at = i < 2 ? end + 1 : end;
    }
    *out = (negative ? -1.0 : 1.0) * (part[0] + part[1] / 60.0 + part[2] / 3600.0);
    return *at == '\0' && isfinite(*out);
}

/* True if the map and the frame give a number. */
static bool has(const bst_keyword_reading *r, const bst_keyword_number *n) {
    char text[BST_FITS_SOURCE_TEXT];
    return (*n->keyword && bst_keyword_find(r, n->keyword, text)) || !isnan(n->value);
}

/* Reads an angle, deg; one of three parts has `unit` degrees. */
static bst_status read_angle(const bst_keyword_reading *r, const bst_keyword_number *n,
                             const bst_keyword_range *allowed, double unit, double *out) {
    char text[BST_FITS_SOURCE_TEXT];
    if (*n->keyword && bst_keyword_find(r, n->keyword, text) && sexagesimal(text, out)) {
        *out *= unit;
        if (*out >= allowed->least && *out <= allowed->most) {
            return BST_OK;
        }
        return bst_keyword_wrong(r, n->keyword, allowed->key, "is out of range");
    }
    return bst_keyword_read_number(r, n, allowed, out);
}

/* The camera's axes: z to the direction, up at the position angle, x = y cross z. */
static bst_status read_direction(const bst_keyword_reading *r, bool *found, bst_quat *q) {
    const bst_keyword_map *map = r->map;
    double ra, dec, angle;
    *found = has(r, &map->ra_deg) && has(r, &map->dec_deg) && has(r, &map->position_angle_deg);
    if (!*found) {
        return BST_OK;
    }
    const bst_keyword_range ras = {"ra_deg", -360.0, 360.0}, decs = {"dec_deg", -90.0, 90.0};
    const bst_keyword_range angles = {"position_angle_deg", -360.0, 360.0};
    BST_TRY(read_angle(r, &map->ra_deg, &ras, 15.0, &ra));
    BST_TRY(read_angle(r, &map->dec_deg, &decs, 1.0, &dec));
    BST_TRY(read_angle(r, &map->position_angle_deg, &angles, 1.0, &angle));
    ra *= BST_DEG_RAD;
    dec *= BST_DEG_RAD;
    angle *= BST_DEG_RAD;
    bst_vec3 east = {-sin(ra), cos(ra), 0.0};
    bst_vec3 north = {-sin(dec) * cos(ra), -sin(dec) * sin(ra), cos(dec)};
    bst_vec3 z = {cos(dec) * cos(ra), cos(dec) * sin(ra), sin(dec)};
    bst_vec3 up = bst_vec3_axpy(bst_vec3_scale(north, cos(angle)), sin(angle), east);
    bst_vec3 y = bst_vec3_scale(up, -1.0), x = bst_vec3_cross(y, z);
    const bst_mat3 m = {{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}};
    *q = bst_quat_from_mat3(&m);
    return BST_OK;
}

static bst_status read_quaternion(const bst_keyword_reading *r, bool *found, bst_quat *q) {
    const bst_keyword_quaternion *k = &r->map->quaternion;
    const bst_keyword_range allowed = {"quaternion", -1.01, 1.01};
    *found = has(r, &k->x) && has(r, &k->y) && has(r, &k->z) && has(r, &k->w);
    if (!*found) {
        return BST_OK;
    }
    BST_TRY(bst_keyword_read_number(r, &k->x, &allowed, &q->x));
    BST_TRY(bst_keyword_read_number(r, &k->y, &allowed, &q->y));
    BST_TRY(bst_keyword_read_number(r, &k->z, &allowed, &q->z));
    BST_TRY(bst_keyword_read_number(r, &k->w, &allowed, &q->w));
    double length = sqrt(q->x * q->x + q->y * q->y + q->z * q->z + q->w * q->w);
    if (!(length >= LEAST_LENGTH && length <= MOST_LENGTH)) {
        char what[120];
        snprintf(what, sizeof what, "is a quaternion of length %.6g (allowed: 1 to a percent)",
                 length);
        return bst_keyword_wrong(r, k->w.keyword, "quaternion", what);
    }
    *q = bst_quat_unit(*q);
    *q = k->rotates == BST_KEYWORD_TO_GCRF ? bst_quat_conj(*q) : *q;
    return BST_OK;
}

bst_status bst_keyword_attitude(bst_ctx *ctx, const bst_keyword_map *map, bst_frame_source *source,
                                const bst_frame_place *frame, bool flip_rows, bool *found,
                                bst_quat *q_cam_from_gcrf) {
    assert(map && source && frame && found && q_cam_from_gcrf);
    const bst_keyword_reading r = {ctx, map, source, frame};
    double scale;
    *found = false;
    switch (map->attitude) {
        case BST_KEYWORD_WCS:
            *found = bst_keyword_wcs(source, frame, flip_rows, q_cam_from_gcrf, &scale);
            return BST_OK;
        case BST_KEYWORD_DIRECTION:
            return read_direction(&r, found, q_cam_from_gcrf);
        case BST_KEYWORD_QUATERNION:
            return read_quaternion(&r, found, q_cam_from_gcrf);
        default:
            return BST_OK;
    }
}
