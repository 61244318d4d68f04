/* Benchmarks of resolved satellites: frames of 2048 x 2048 pixels with a mesh that is not convex,
 * 64 px across with 2,000 triangles at rest, or 600 px across with 50,000 triangles that turns by
 * 4 % of a revolution in the exposure. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "scenegen/renderer.h"
#include "sim/bench/bench.h"
#include "sim/bench/bench_scenes.h"
#include "sim/device/device.h"
#include "sim/world/scene/source_body.h"

enum { SIDE = 2048, WARM_UP = 1 };

/* Light of a surface at normal incidence, electrons per pixel. */
static const double PER_PX_E = 1e4;
static const double TOLERANCE_SIGMA = 0.1, FINE_SIGMA = 0.01;
static const double RANGE_M = 1000.0, EXPOSURE_S = 0.1;

typedef struct mesh_size {
    const char *name;
    int around, up; /* triangles: 2 around (up - 1) */
    double across_px, turn_rad;
    int frames, together; /* a multiple of together; frames of which the times are averaged */
} mesh_size;

static const mesh_size sizes[] = {{"resolved_small", 40, 26, 64.0, 0.0, 40, 4},
                                  {"resolved_large", 200, 126, 600.0, 0.04 * 2.0 * BST_PI, 2, 1}};

/* Writes a sphere with bumps, of some 1 m, as an OBJ file. */
static bst_status write_mesh(bst_ctx *ctx, const mesh_size *s, const char *path, FILE *file) {
    for (int k = 1; k < s->up; k++) {
        for (int i = 0; i < s->around; i++) {
            double a = 2.0 * BST_PI * i / s->around, b = BST_PI * (k / (double)s->up - 0.5);
            double r = 1.0 + 0.12 * cos(5.0 * a) * cos(b) + 0.08 * sin(7.0 * b);
            fprintf(file, "v %.9f %.9f %.9f\n", r * cos(b) * cos(a), r * cos(b) * sin(a),
                    r * sin(b));
        }
    }
    int first = (s->up - 1) * s->around; /* the two ends */
    fprintf(file, "v 0 0 %.9f\nv 0 0 %.9f\n", -(1.0 - 0.08 * sin(3.5 * BST_PI)),
            1.0 + 0.08 * sin(3.5 * BST_PI));
    for (int i = 0; i < s->around; i++) {
        int n = (i + 1) % s->around, last = first - s->around;
        fprintf(file, "f %d %d %d\nf %d %d %d\n", n + 1, i + 1, first + 1, last + i + 1,
                last + n + 1, first + 2);
        for (int k = 0; k + 2 < s->up; k++) {
            int low = k * s->around + 1, high = low + s->around;
            fprintf(file, "f %d %d %d\nf %d %d %d\n", low + i, low + n, high + n, low + i, high + n,
                    high + i);
        }
    }
    return fflush(file) == 0 ? BST_OK : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written", path);
}

static bst_status make_model(bst_ctx *ctx, const mesh_size *s, bst_satellite **out) {
    char folder[] = "/tmp/boresight_bench_XXXXXX", path[sizeof folder + 16];
    if (!mkdtemp(folder)) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made", folder);
    }
    snprintf(path, sizeof path, "%s/mesh.obj", folder);
    FILE *file = fopen(path, "w");
    bst_status status = file ? write_mesh(ctx, s, path, file)
                             : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written", path);
    if (file) {
        fclose(file);
    }
    if (status == BST_OK) {
        status = bst_satellite_load(ctx, path, out);
    }
    unlink(path);
    rmdir(folder);
    return status;
}

/* One scene: the camera, the body and the exposure. */
typedef struct scene {
    bst_camera camera;
    bst_scene_source_body body;
    bst_scene_source source;
    double time_s[2];
    bst_quat q[2];
    bst_los_track track;
} scene;

static void make_scene(const mesh_size *size, bst_satellite *satellite, scene *s) {
    *s = (scene){.camera = {.width_px = SIDE,
                            .height_px = SIDE,
                            .pixel_scale_arcsec = 2.0 * satellite->radius_m / RANGE_M /
                                                  size->across_px / BST_ARCSEC_RAD,
                            .psf_fwhm_px = 2.0,
                            .read_noise_e = 8.0,
                            .full_well_e = 65000.0,
                            .gain_e_per_dn = 1.0,
                            .offset_dn = 100.0,
                            .bits = 16}};
    double a = bst_camera_scale_rad(&s->camera);
    s->time_s[1] = EXPOSURE_S;
    s->q[0] = s->q[1] = BST_QUAT_IDENTITY;
    s->track = (bst_los_track){2, s->time_s, s->q};
    s->body.satellite = satellite;
    s->body.object_m[0] = s->body.object_m[1] = (bst_vec3){7e6, 0, 0};
    s->body.sun_m =
        bst_vec3_axpy(s->body.object_m[0], BST_AU_M, bst_vec3_unit((bst_vec3){0.7, -0.4, -0.6}));
    for (int m = 0; m < satellite->material_count; m++) {
        const bst_brdf *brdf = &satellite->materials[m].brdf;
        s->body.gain[m].sun = BST_PI * PER_PX_E / EXPOSURE_S / (a * a) / fmax(brdf->diffuse, 1e-3);
    }
    s->source = (bst_scene_source){
        .kind = BST_SOURCE_OBJECT,
        .apparent_mid = {0.0, 0.0, 1.0},
        .range_m = RANGE_M,
        .body = &s->body,
        .body_u = {0.0, 1.0},
        .electrons_per_s = 0.3 * PER_PX_E / EXPOSURE_S * size->across_px * size->across_px};
}

/* Turns the body for a frame. */
static void set_frame(const mesh_size *size, scene *s, int frame) {
    s->body.times = 5;
    for (int k = 0; k < s->body.times; k++) {
        double turn = 0.3 * frame + size->turn_rad * k / (s->body.times - 1);
        bst_quat q = bst_quat_from_rotvec((bst_vec3){0.1, 0.7 + turn, 0.0});
        s->body.q_body_from_gcrf[k] =
            bst_quat_mul(bst_quat_from_rotvec((bst_vec3){0.5, 0.0, 0.2}), q);
    }
}

static bst_render_request request_of(scene *s, int frame) {
    return (bst_render_request){.window = {0, 0, SIDE, SIDE},
                                .track = &s->track,
                                .sources = &s->source,
                                .count = 1,
                                .background_e = 10.0,
                                .key = bst_rng_make_key(1, 0, "bench", "noise"),
                                .exposure_id = frame};
}

/* Times frames as in other benchmarks: the next one is planned while one is rendered, and
 * size->together are averaged. */
static bst_status time_frames(bst_ctx *ctx, bst_renderer *r, const mesh_size *size, scene *s,
                              bst_bench_result *out) {
    bst_bench_clock clock = {.count = 0};
    bst_frame *before = NULL;
    bst_status status = BST_OK;
    for (int n = 0; n <= WARM_UP + size->frames && status == BST_OK; n++) {
        bst_frame *frame = NULL;
        set_frame(size, s, n);
        bst_render_request q = request_of(s, n);
        status = bst_renderer_render(ctx, r, &q, &frame);
        if (before && status == BST_OK) {
            status = bst_bench_map_and_release(ctx, before);
        } else if (before) {
            bst_frame_release(before);
        }
        before = frame;
        int mapped = n - WARM_UP; /* after the warm-up */
        if (mapped > 0 && mapped % size->together == 0) {
            bst_bench_stop(&clock, size->together);
        }
        if (mapped >= 0 && mapped % size->together == 0) {
            bst_bench_start(&clock);
        }
    }
    if (before) {
        bst_frame_release(before);
    }
    if (status == BST_OK) {
        bst_bench_summarise(&clock, out);
    }
    return status;
}

/* Difference from a rendering with a tenth of the tolerance, which has more poses and nodes, in
 * sigma of a pixel. */
static bst_status find_error(bst_ctx *ctx, bst_device *device, bst_renderer *r,
                             const mesh_size *size, scene *s, bst_bench_result *out) {
    size_t pixels = (size_t)SIDE * SIDE;
    float *image = malloc(2 * pixels * sizeof *image);
    bst_renderer_options options = bst_renderer_default_options();
    options.tolerance_sigma = FINE_SIGMA;
    bst_renderer *fine = NULL;
    bst_status status =
        image ? bst_renderer_create(ctx, device, &s->camera, &options, &fine)
              : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the images of %s", size->name);
    set_frame(size, s, 1);
    bst_render_request q = request_of(s, 1);
    if (status == BST_OK) {
        status = bst_renderer_render_noise_free(ctx, r, &q, image);
    }
    if (status == BST_OK) {
        bst_render_stats stats;
        bst_renderer_get_stats(r, &stats);
        out->predicted_error_sigma = stats.predicted_sigma;
        status = bst_renderer_render_noise_free(ctx, fine, &q, image + pixels);
    }
    double read2 = s->camera.read_noise_e * s->camera.read_noise_e, worst = 0.0, sum = 0.0;
    for (size_t i = 0; i < pixels && status == BST_OK; i++) {
        double right = (double)image[pixels + i], error = (double)image[i] - right;
        error /= sqrt(right + read2);
        worst = fmax(worst, fabs(error));
        sum += error * error;
    }
    if (status == BST_OK) {
        out->error_sigma_max = worst;
        out->error_sigma_rms = sqrt(sum / (double)pixels);
        out->error_sources = 1;
    }
    bst_renderer_free(fine);
    free(image);
    return status;
}

bst_status bst_bench_resolved(bst_ctx *ctx, const bst_bench *self, const bst_bench_options *options,
                              bst_bench_result *out) {
    const mesh_size *size = strcmp(self->name, sizes[0].name) == 0 ? &sizes[0] : &sizes[1];
    bst_device *device = NULL;
    bst_satellite *satellite = NULL;
    bst_renderer *r = NULL;
    scene *s = malloc(sizeof *s);
    bst_renderer_options choice = bst_renderer_default_options();
    choice.tolerance_sigma = TOLERANCE_SIGMA;
    bst_status status =
        s ? bst_device_open(ctx, options->device ? options->device : "", options->threads, &device)
          : bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %s", size->name);
    if (status == BST_OK) {
        status = make_model(ctx, size, &satellite);
    }
    if (status == BST_OK) {
        make_scene(size, satellite, s);
        status = bst_renderer_create(ctx, device, &s->camera, &choice, &r);
    }
    if (status == BST_OK) {
        status = time_frames(ctx, r, size, s, out);
    }
    if (status == BST_OK) {
        status = find_error(ctx, device, r, size, s, out);
    }
    bst_renderer_free(r);
    bst_satellite_free(satellite);
    bst_device_close(device);
    free(s);
    return status;
}
