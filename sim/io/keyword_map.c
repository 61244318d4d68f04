#include "sim/io/keyword_map.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cjson/cJSON.h>

#include "sim/astro/ccsds_time.h"

enum { FORMAT_VERSION = 1 };

#define NUMBER_TABLE(name, doc_)                                                                  \
    static const bst_config_desc name[] = {                                                       \
        BST_STRING(bst_keyword_number, keyword, "\"\"",                                           \
                   "Header keyword, or several as \"A|B\": the first that the frame has counts. " \
                   "In a cube also a column of its table, \"OBSPOS[2]\" an element of it; of "    \
                   "pictures a column of the side table."),                                       \
        BST_REAL(bst_keyword_number, factor, "", -1e12, 1e12, "1",                                \
                 "The keyword's value times this is " doc_ "."),                                  \
        BST_OPEN_REAL(bst_keyword_number, value, "", -1e15, 1e15,                                 \
                      "Used without the keyword; null: the keyword is required."),                \
        BST_CONFIG_END}

NUMBER_TABLE(number_table, "the number in the unit of this key");

static const char *const time_formats[] = {"utc", "mjd", "jd", "unix", NULL};
static const char *const scales[] = {"header", "utc", "tai", "tt", "tdb", "gps", NULL};
static const char *const moments[] = {"start", "middle", "end", NULL};
static const char *const attitudes[] = {"none", "wcs", "direction", "quaternion", NULL};

static const char *const rotations[] = {"gcrf_to_camera", "camera_to_gcrf", NULL};
static const char *const edges[] = {"top", "bottom", NULL};
static const char *const colours[] = {"refuse", "mean", "red", "green", "blue", NULL};

static const bst_config_desc time_table[] = {
    BST_STRING(bst_keyword_time, keyword, "\"DATE-OBS\"", "Header keyword of the time, as A|B."),
    BST_STRING(bst_keyword_time, clock_keyword, "\"\"",
               "Keyword of the time of day, where the keyword above has the date alone."),
    BST_ENUM(bst_keyword_time, format, time_formats, "\"utc\"",
             "utc: YYYY-MM-DDThh:mm:ss[.f]; mjd, jd: (modified) Julian date; unix: seconds of UTC "
             "from 1970-01-01, without leap seconds."),
    BST_ENUM(bst_keyword_time, scale, scales, "\"header\"",
             "Time scale of the dates; header: the one that the keyword TIMESYS names, UTC without "
             "it. A Z behind a date says UTC."),
    BST_ENUM(bst_keyword_time, moment, moments, "\"start\"", "Part of the exposure that it is."),
    BST_CONFIG_END};

static const bst_config_desc vector_table[] = {
    BST_OBJECT(bst_keyword_vector, x, number_table, "{}", "First component."),
    BST_OBJECT(bst_keyword_vector, y, number_table, "{}", "Second component."),
    BST_OBJECT(bst_keyword_vector, z, number_table, "{}", "Third component."), BST_CONFIG_END};

static const bst_config_desc quaternion_table[] = {
    BST_OBJECT(bst_keyword_quaternion, x, number_table, "{\"keyword\": \"QX\"}",
               "First component."),
    BST_OBJECT(bst_keyword_quaternion, y, number_table, "{\"keyword\": \"QY\"}",
               "Second component."),
    BST_OBJECT(bst_keyword_quaternion, z, number_table, "{\"keyword\": \"QZ\"}",
               "Third component."),
    BST_OBJECT(bst_keyword_quaternion, w, number_table, "{\"keyword\": \"QW\"}", "Scalar."),
    BST_ENUM(bst_keyword_quaternion, rotates, rotations, "\"gcrf_to_camera\"",
             "Axes from which to which it takes the coordinates of a vector."),
    BST_CONFIG_END};

static const bst_config_desc history_table[] = {
    BST_STRING(
        bst_keyword_history, time, "\"\"",
        "Keywords of the times, s after the start of the exposure, as DELT_###: # stands for "
        "a digit of the entry's index, from 0."),
    BST_STRING(bst_keyword_history, rate, "\"\"",
               "Keywords of the rates, one to three numbers each, in any unit."),
    BST_CONFIG_END};

const bst_config_desc bst_keyword_map_table[] = {
    {.key = "boresight_keyword_map",
     .type = BST_CONFIG_INT,
     .unit = "",
     .minimum = FORMAT_VERSION,
     .maximum = FORMAT_VERSION,
     .doc = "Version of the format.",
     .offset = offsetof(bst_keyword_map, format),
     .size = sizeof(int64_t)},
    BST_STRING(bst_keyword_map, name, "\"map\"", "Name, for messages and the scenario."),
    BST_OBJECT(bst_keyword_map, time, time_table, "{}", "Time of the exposure."),
    BST_OBJECT(
        bst_keyword_map, plane_period_s, number_table, "{\"value\": 0}",
        "From the start of a plane of a cube to that of the next, s, where the header has the "
        "time of the first plane alone; 0: the time is that of the frame."),
    BST_OBJECT(bst_keyword_map, exposure_s, number_table, "{\"keyword\": \"EXPTIME|EXPOSURE\"}",
               "Exposure time, s."),
    BST_OBJECT(bst_keyword_map, gain_e_per_dn, number_table, "{\"value\": 1}",
               "Electrons per count."),
    BST_OBJECT(bst_keyword_map, read_noise_e, number_table, "{\"value\": 0}", "Read noise, e-."),
    BST_OBJECT(bst_keyword_map, offset_dn, number_table, "{\"value\": 0}",
               "Value of a pixel without charge, in the unit of the file."),
    BST_OBJECT(bst_keyword_map, full_well_e, number_table, "{\"value\": 1e6}",
               "Charge at which a pixel is saturated, e-."),
    BST_OBJECT(bst_keyword_map, pixel_scale_arcsec, number_table, "{\"keyword\": \"PIXSCALE\"}",
               "Pixel scale, right to a few percent."),
    BST_OBJECT(bst_keyword_map, exposure_id, number_table, "{\"value\": -1}",
               "Number of the exposure; -1: frames are counted in their order."),
    BST_OBJECT(bst_keyword_map, observer_position_gcrf_m, vector_table, "{}",
               "Observer at mid-exposure, geocentric GCRF."),
    BST_OBJECT(bst_keyword_map, observer_velocity_gcrf_mps, vector_table, "{}",
               "Its velocity, for aberration."),
    BST_OBJECT(bst_keyword_map, rate_history, history_table, "{}",
               "History of the camera's rate of turn: gives the end of a streak that came first."),
    BST_ENUM(bst_keyword_map, attitude, attitudes, "\"none\"",
             "Attitude of frames whose stars give none. wcs: the header's TAN WCS; direction: "
             "ra_deg, dec_deg, position_angle_deg; quaternion: the key of that name."),
    BST_OBJECT(bst_keyword_map, ra_deg, number_table, "{\"keyword\": \"RA\"}",
               "Right ascension of the image's middle, deg or text hh:mm:ss."),
    BST_OBJECT(bst_keyword_map, dec_deg, number_table, "{\"keyword\": \"DEC\"}",
               "Its declination, deg or text dd:mm:ss."),
    BST_OBJECT(bst_keyword_map, position_angle_deg, number_table, "{\"keyword\": \"ROLL\"}",
               "Position angle of the camera's up, from north through east."),
    BST_OBJECT(bst_keyword_map, quaternion, quaternion_table, "{}",
               "Quaternion of the camera: x right, y down, z along the boresight."),
    BST_ENUM(
        bst_keyword_map, first_row, edges, "\"top\"",
        "Edge of the camera's image that the file's first row is: of a picture its top one, of "
        "a FITS file that of the first pixels."),
    BST_ENUM(
        bst_keyword_map, colour, colours, "\"refuse\"",
        "Value of a pixel of colour in PNG and TIFF files: the mean of red, green and blue, or "
        "one of them. Transparency is left out."),
    BST_STRING(bst_keyword_map, file_column, "\"" BST_FRAME_FILE_COLUMNS "\"",
               "Column of a side table with the files' paths, relative to the table's folder."),
    BST_STRING(bst_keyword_map, page_column, "\"" BST_FRAME_PAGE_COLUMNS "\"",
               "Column of a side table with the page of a TIFF file, from 1."),
    BST_STRING(bst_keyword_map, image_section, "\"\"",
               "Keyword of the part of the image that is used, as [x1:x2,y1:y2] from 1."),
    BST_STRING(bst_keyword_map, bias_section, "\"\"",
               "Keyword of the overscan, whose median is subtracted."),
    BST_REAL(bst_keyword_map, pedestal_dn, "DN", 0, 65535, "0",
             "Added to all pixels, so that those below 0 keep their noise in 16 bits."),
    BST_REAL(bst_keyword_map, dn_per_unit, "", 1e-9, 1e9, "1",
             "Counts per unit of the file, in 16 bits."),
    BST_REAL(bst_keyword_map, star_limit_v_mag, "mag", 1, 20, "12.5",
             "Faintest stars that the frames surely show, for the search of the attitude."),
    {.key = "camera",
     .type = BST_CONFIG_RAW,
     .doc = "Keys of a sensor's camera that headers do not give: aperture_m, psf_fwhm_px, ..."},
    BST_CONFIG_END};

static bst_status read_map(bst_ctx *ctx, const char *path, bst_json **json, bst_keyword_map *out) {
    BST_TRY(bst_json_load(ctx, path, json));
    bst_status status =
        bst_config_read(ctx, *json, bst_json_root(*json), "", bst_keyword_map_table, out);
    if (status == BST_OK && !*out->time.keyword) {
        status =
            bst_fail(ctx, BST_ERR_CONFIG, "%s: /time/keyword: is empty (allowed: a keyword)", path);
    }
    if (status == BST_OK && out->time.format == BST_KEYWORD_UNIX &&
        out->time.scale > 1 + BST_TIME_UTC) {
        status = bst_fail(ctx, BST_ERR_CONFIG,
                          "%s: /time/scale: is not for the format unix, which is in UTC (allowed: "
                          "header, utc)",
                          path);
    }
    snprintf(out->file, sizeof out->file, "%s", path);
    return status;
}

bst_status bst_keyword_map_load(bst_ctx *ctx, const char *path, bst_keyword_map *out) {
    assert(path && out);
    bst_json *json = NULL;
    bst_status status = read_map(ctx, path, &json, out);
    bst_json_free(json);
    return status;
}

bst_frame_source_options bst_keyword_map_source(const bst_keyword_map *map) {
    return (bst_frame_source_options){.columns = {map->file_column, map->page_column},
                                      .colour = (bst_image_colour)map->colour};
}

bst_status bst_keyword_map_camera(bst_ctx *ctx, const char *path, cJSON **out) {
    assert(path && out);
    bst_json *json = NULL;
    bst_keyword_map map;
    *out = NULL;
    bst_status status = read_map(ctx, path, &json, &map);
    if (status == BST_OK) {
        const cJSON *camera = cJSON_GetObjectItemCaseSensitive(bst_json_root(json), "camera");
        if (camera && !cJSON_IsObject(camera)) {
            status = bst_config_fail(ctx, path, "/camera", camera, "is no object", "{...}");
        } else {
            *out = camera ? cJSON_Duplicate(camera, true) : cJSON_CreateObject();
            status = *out ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for a keyword map");
        }
    }
    bst_json_free(json);
    return status;
}
