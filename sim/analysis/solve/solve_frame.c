#include "sim/analysis/solve/solve_frame.h"

#include <math.h>
#include <stdlib.h>

#include "imgproc/identify/plate_solve.h"
#include "sim/astro/time.h"
#include "sim/io/fits_image.h"

#define Q bst_solve_request
const bst_option bst_solve_options[] = {
    {.name = "scale",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, scale_arcsec),
     .argument = "ARCSEC",
     .doc = "pixel scale at the middle of the frame",
     .required = true,
     .minimum = 0.01,
     .maximum = 600},
    {.name = "utc",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, utc),
     .argument = "UTC",
     .doc = "time of the exposure, as 2022-06-16T22:10:00Z, for aberration and proper motion",
     .required = true},
    {.name = "velocity-x",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, speed_kmps[0]),
     .argument = "KM/S",
     .doc = "observer's velocity about the Earth, GCRF (default 0: up to 5 arcsec of aberration)",
     .minimum = -100,
     .maximum = 100},
    {.name = "velocity-y",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, speed_kmps[1]),
     .argument = "KM/S",
     .doc = "the same, y",
     .minimum = -100,
     .maximum = 100},
    {.name = "velocity-z",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, speed_kmps[2]),
     .argument = "KM/S",
     .doc = "the same, z",
     .minimum = -100,
     .maximum = 100},
    {.name = "scale-tolerance",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, scale_tolerance),
     .argument = "SHARE",
     .doc = "largest relative error of the scale (default 0.05)",
     .minimum = 0,
     .maximum = 0.1},
    {.name = "v-limit",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, v_limit),
     .argument = "V",
     .doc = "faintest stars that the frame surely shows (default 12.5)",
     .minimum = 1,
     .maximum = 20},
    {.name = "least-snr",
     .kind = BST_OPTION_REAL,
     .offset = offsetof(Q, least_snr),
     .argument = "SNR",
     .doc = "faintest detections that are used (default 12)",
     .minimum = 5,
     .maximum = 1000},
    {.name = "catalogue",
     .kind = BST_OPTION_TEXT,
     .offset = offsetof(Q, catalogue),
     .argument = "NAME",
     .doc = "a catalogue's path, embedded, or default"},
    {.name = "help", .kind = BST_OPTION_FLAG, .offset = offsetof(Q, help), .doc = "this text"},
    {.name = NULL},
};
#undef Q

/* A frame that is being solved. */
typedef struct solving {
    const bst_solve_request *request;
    bst_camera camera;
    bst_light light;
    double julian_year;
    bst_stars *stars;
    bst_star_patterns *patterns;
    bst_lost_in_space *solver;
    bst_plate_solve_result result;
} solving;

static void close_all(solving *s) {
    bst_lost_in_space_free(s->solver);
    bst_star_patterns_free(s->patterns);
    bst_stars_close(s->stars);
}

static bst_status open_all(bst_ctx *ctx, solving *s, int width, int height) {
    const bst_solve_request *q = s->request;
    bst_time time;
    bst_bodies bodies;
    BST_TRY(bst_time_from_utc(ctx, q->utc, &time));
    s->julian_year = bst_time_julian_year(time);
    bst_bodies_at(time, &bodies);
    s->light = bst_light_at(&bodies, (bst_vec3){0, 0, 0},
                            bst_vec3_scale(bst_vec3_from_array(q->speed_kmps), 1e3));
    s->camera =
        (bst_camera){.width_px = width, .height_px = height, .pixel_scale_arcsec = q->scale_arcsec};
    BST_TRY(bst_camera_prepare(ctx, &s->camera));
    BST_TRY(bst_stars_open(ctx, q->catalogue, &s->stars));
    double side = 0.5 * (width < height ? width : height) * bst_camera_scale_rad(&s->camera);
    const bst_star_patterns_options options = {2.0 * atan(side), q->v_limit, s->julian_year};
    BST_TRY(bst_star_patterns_create(ctx, s->stars, &options, &s->patterns));
    return bst_lost_in_space_create(ctx, &s->camera, s->stars, s->patterns, s->julian_year,
                                    BST_PLATE_SOLVE_STARS, &s->solver);
}

static double length_px(const bst_plate_solve_result *r) {
    return hypot(r->ends[1].x_px - r->ends[0].x_px, r->ends[1].y_px - r->ends[0].y_px);
}

static bst_status solve(bst_ctx *ctx, solving *s, const float *pixels, int width, int height) {
    const bst_plate_solve_options options = {.scale_tolerance = s->request->scale_tolerance,
                                             .v_limit = s->request->v_limit,
                                             .least_snr = s->request->least_snr,
                                             .tangent_per_px = bst_camera_scale_rad(&s->camera),
                                             .light = &s->light};
    return bst_plate_solve(ctx, s->solver, &options, pixels, width, height, &s->result);
}

/* Prints where the middle of the frame looks while the stars are at an end of their streaks. */
static void print_end(const solving *s, int end, FILE *out) {
    const bst_common_streak_point *to = &s->result.ends[end];
    double x = bst_camera_centre_x(&s->camera) - to->x_px;
    double y = bst_camera_centre_y(&s->camera) - to->y_px, ra, dec;
    bst_vec3 v = bst_camera_unproject(&s->camera, x, y);
    v = (bst_vec3){v.x * s->result.attitude.scale, v.y * s->result.attitude.scale, v.z};
    bst_quat back = bst_quat_conj(s->result.attitude.q_cam_from_gcrf);
    bst_vec3 boresight = bst_vec3_unit(bst_quat_rotate(back, v));
    bst_vec3 column = bst_quat_rotate(back, (bst_vec3){0.0, -1.0, 0.0});
    bst_vec3_to_radec(boresight, &ra, &dec);
    bst_vec3 east = bst_vec3_unit(bst_vec3_cross((bst_vec3){0, 0, 1}, boresight));
    bst_vec3 north = bst_vec3_cross(boresight, east);
    double angle = atan2(bst_vec3_dot(column, east), bst_vec3_dot(column, north));
    fprintf(out, "%-10s RA %.5f deg, Dec %.5f deg, rows point to position angle %.3f deg\n",
            s->result.points ? "middle"
            : end == 0       ? "left end"
                             : "right end",
            ra / BST_DEG_RAD, dec / BST_DEG_RAD, angle / BST_DEG_RAD);
}

static void print(const solving *s, FILE *out) {
    const bst_lost_in_space_result *r = &s->result.attitude;
    if (!r->solved) {
        fprintf(out, "no attitude: %d stars found, %d quads and %d patterns tried\n",
                s->result.stars, r->quads, r->candidates);
        return;
    }
    bool points = s->result.points;
    fprintf(out, "stars      %d of %d of the catalogue matched, rms %.2f px, chance 1e%.0f\n",
            r->matched, r->predicted, r->rms_px, r->log_chance / log(10.0));
    fprintf(out, "scale      %.5f arcsec/px\n", r->scale * s->camera.pixel_scale_arcsec);
    if (!points) {
        fprintf(out, "streaks    %.1f px from end to end; which end came first is not known\n",
                length_px(&s->result));
    }
    for (int end = 0; end < (points ? 1 : 2); end++) {
        print_end(s, end, out);
    }
}

bst_status bst_solve_frame(bst_ctx *ctx, const bst_solve_request *request, const char *path,
                           FILE *out, bool *solved) {
    int width, height;
    float *pixels;
    solving s = {.request = request};
    *solved = false;
    BST_TRY(bst_fits_read_image(ctx, path, &width, &height, &pixels));
    bst_status status = open_all(ctx, &s, width, height);
    if (status == BST_OK) {
        status = solve(ctx, &s, pixels, width, height);
    }
    if (status == BST_OK) {
        *solved = s.result.attitude.solved;
        print(&s, out);
    }
    free(pixels);
    close_all(&s);
    return status;
}
