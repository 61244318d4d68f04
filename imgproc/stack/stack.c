#include "imgproc/stack/stack.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imgproc/stack/stack_internal.h"
#include "sim/core/heapsort.h"
#include "sim/core/invariant.h"

const bst_config_desc bst_stack_config_table[] = {
    BST_INT(bst_stack_config, frames, "", 0, BST_STACK_MAX_FRAMES, "0",
            "Frames of a stack, a multiple of 4; 0: no stacks."),
    BST_REAL(bst_stack_config, rate_px_per_frame, "px/frame", 0.05, 16, "3",
             "Greatest rate against the stars that is searched, along each axis."),
    BST_REAL(bst_stack_config, false_alarms_per_frame, "", 1e-6, 1e4, "1",
             "Detections that noise alone may cause, on average: of a stack, times its frames."),
    BST_CONFIG_END,
};

static bst_status allocate(bst_ctx *ctx, bst_stack *s, int threads) {
    size_t pixels = (size_t)s->max_width * (size_t)s->max_height;
    size_t nodes =
        (size_t)(s->max_width / STACK_NODE_PX + 2) * (size_t)(s->max_height / STACK_NODE_PX + 2);
    s->maps = malloc(pixels * (size_t)s->config.frames);
    s->steady = calloc(pixels, sizeof *s->steady);
    s->rest = calloc(pixels, sizeof *s->rest);
    s->visited = calloc(pixels, 1);
    s->node_x = calloc(nodes, sizeof *s->node_x);
    s->node_y = calloc(nodes, sizeof *s->node_y);
    s->maxima = calloc(STACK_REST, sizeof *s->maxima);
    s->rest_paths = calloc(STACK_REST, sizeof *s->rest_paths);
    s->visit = calloc(STACK_VISITS, sizeof *s->visit);
    s->paths = calloc(BST_STACK_MAX_FOUND, sizeof *s->paths);
    if (!s->maps || !s->steady || !s->rest || !s->visited || !s->node_x || !s->node_y ||
        !s->maxima || !s->rest_paths || !s->visit || !s->paths) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for stacks of %lld frames of %d x %d",
                        (long long)s->config.frames, s->max_width, s->max_height);
    }
    BST_TRY(bst_parallel_create(ctx, threads, &s->pool));
    BST_TRY(bst_streak_map_create(ctx, s->max_width, s->max_height, false, &s->map));
    BST_TRY(stack_search_create(ctx, s));
    size_t order = (size_t)s->tiles_x * (size_t)s->tiles_y * STACK_TILE_FOUND;
    s->order = calloc(order > STACK_REST ? order : STACK_REST, sizeof *s->order);
    return s->order ? BST_OK : bst_fail(ctx, BST_ERR_MEMORY, "no memory for what stacks show");
}

bst_status bst_stack_create(bst_ctx *ctx, const bst_camera *camera, const bst_stack_config *config,
                            int threads, bst_stack **out) {
    assert(camera && config && out);
    *out = NULL;
    int64_t frames = config->frames;
    if (frames < 4 || frames > BST_STACK_MAX_FRAMES || frames % 4 != 0 ||
        !(config->rate_px_per_frame > 0.0) ||
        !(config->rate_px_per_frame * (double)(frames - 1) <= 256.0) ||
        !(config->false_alarms_per_frame > 0.0)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a stack of %lld frames at up to %g px per frame: it takes 4, 8, ... %d "
                        "frames, a rate above 0 at which paths are no longer than 256 px, and "
                        "false alarms above 0",
                        (long long)frames, config->rate_px_per_frame, BST_STACK_MAX_FRAMES);
    }
    bst_stack *s = calloc(1, sizeof *s);
    if (!s) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for a stack");
    }
    s->config = *config;
    s->camera = *camera;
    s->max_width = (int)camera->width_px;
    s->max_height = (int)camera->height_px;
    bst_status status = allocate(ctx, s, threads);
    if (status != BST_OK) {
        bst_stack_free(s);
        return status;
    }
    *out = s;
    return BST_OK;
}

void bst_stack_free(bst_stack *s) {
    if (!s) {
        return;
    }
    stack_search_free(s);
    bst_streak_map_free(&s->map);
    bst_parallel_free(s->pool);
    free(s->maps);
    free(s->steady);
    free(s->rest);
    free(s->visited);
    free(s->node_x);
    free(s->node_y);
    free(s->maxima);
    free(s->rest_paths);
    free(s->visit);
    free(s->paths);
    free(s->order);
    free(s);
}

/* Saves or restores frame i of the stack. Returns false if no frame can be like that. */
static bool archive_frame(bst_stack *s, bst_archive *archive, int i) {
    BST_ARCHIVE(archive, s->time_s[i]);
    BST_ARCHIVE(archive, s->q[i]);
    BST_ARCHIVE(archive, s->noise_e[i]);
    bst_archive_bytes(archive, stack_map(s, i), (size_t)s->width * (size_t)s->height);
    return isfinite(s->time_s[i]) && (i == 0 || s->time_s[i] > s->time_s[i - 1]) &&
           bst_is_unit_quat(s->q[i], BST_LINK_UNIT_TOLERANCE) && isfinite(s->noise_e[i]);
}

bst_status bst_stack_archive(bst_stack *s, bst_archive *archive) {
    assert(s && archive);
    BST_ARCHIVE(archive, s->threshold);
    BST_ARCHIVE(archive, s->followed);
    int count = bst_archive_count(archive, s->count, (int)s->config.frames - 1);
    s->count = count;
    if (count == 0) {
        return BST_OK;
    }
    s->width = (int)bst_archive_integer(archive, s->width, 1, s->max_width);
    s->height = (int)bst_archive_integer(archive, s->height, 1, s->max_height);
    BST_ARCHIVE(archive, s->origin_x_px);
    BST_ARCHIVE(archive, s->origin_y_px);
    BST_ARCHIVE(archive, s->binning);
    BST_ARCHIVE(archive, s->sigma_px);
    bst_archive_bytes(archive, s->steady, (size_t)s->width * (size_t)s->height * sizeof *s->steady);
    bool valid = true;
    for (int i = 0; i < count; i++) {
        valid = archive_frame(s, archive, i) && valid;
    }
    if (!valid) {
        s->count = 0;
        return bst_fail(bst_archive_ctx(archive), BST_ERR_FORMAT,
                        "the saved state has stacked frames with attitudes, times or noise that "
                        "are not those of frames");
    }
    return BST_OK;
}

/* True if a frame has the size, position and binning of the stack and is later than its last frame.
 */
static bool continues_stack(const bst_stack *s, const bst_stack_frame *f) {
    return s->count > 0 && s->count < s->config.frames && f->width == s->width &&
           f->height == s->height && f->origin_x_px == s->origin_x_px &&
           f->origin_y_px == s->origin_y_px && f->binning == s->binning &&
           f->sigma_px == s->sigma_px && f->time_s > s->time_s[s->count - 1];
}

int bst_stack_add(bst_stack *s, const bst_stack_frame *f) {
    assert(s && f && s->count >= 0 && s->count <= BST_STACK_MAX_FRAMES);
    assert(bst_is_unit_quat(f->q_cam_from_gcrf, BST_LINK_UNIT_TOLERANCE));
    if (!continues_stack(s, f)) {
        s->count = 0;
        s->width = f->width;
        s->height = f->height;
        s->origin_x_px = f->origin_x_px;
        s->origin_y_px = f->origin_y_px;
        s->binning = f->binning;
        s->sigma_px = f->sigma_px;
        memset(s->steady, 0, (size_t)f->width * (size_t)f->height * sizeof *s->steady);
    }
    int n = s->count;
    s->time_s[n] = f->time_s;
    s->q[n] = f->q_cam_from_gcrf;
    s->noise_e[n] = (double)f->background->median_noise;
    stack_align(s, f, n);
    return ++s->count;
}

double bst_stack_threshold(double false_alarms, const double side_px[2], double rate_px_per_frame,
                           double roughness, double time_variance) {
    double root = sqrt(roughness), of_rate = 2.0 * rate_px_per_frame * root * sqrt(time_variance);
    const double side[4] = {side_px[0] * root, side_px[1] * root, of_rate, of_rate};
    double e[5] = {1.0};
    for (int i = 0; i < 4; i++) {
        for (int d = 4; d > 0; d--) {
            e[d] += e[d - 1] * side[i];
        }
    }
    double lo = 2.5, hi = 12.0;
    for (int i = 0; i < 50; i++) {
        double u = 0.5 * (lo + hi), hermite[4] = {1.0, u, u * u - 1.0, u * (u * u - 3.0)};
        double sum = 0.5 * erfc(u / sqrt(2.0));
        for (int d = 1; d <= 4; d++) {
            sum += e[d] * pow(2.0 * BST_PI, -0.5 * (d + 1)) * hermite[d - 1] * exp(-0.5 * u * u);
        }
        *(sum > false_alarms ? &lo : &hi) = u;
    }
    return 0.5 * (lo + hi);
}

/* Frame times relative to their mean, in frame intervals, and their variance. */
static void set_times(bst_stack *s) {
    double mean = 0.0, square = 0.0;
    for (int i = 0; i < s->count; i++) {
        mean += (s->time_s[i] - s->time_s[0]) / s->count;
    }
    s->interval_s = (s->time_s[s->count - 1] - s->time_s[0]) / (s->count - 1);
    for (int i = 0; i < s->count; i++) {
        s->tau[i] = (s->time_s[i] - s->time_s[0] - mean) / s->interval_s;
        square += s->tau[i] * s->tau[i] / s->count;
    }
    s->time_variance = square;
}

static bool stronger(const void *context, int a, int b) {
    const stack_path *p = (const stack_path *)context + a, *q = (const stack_path *)context + b;
    return p->snr != q->snr ? p->snr > q->snr : a < b;
}

/* Selects the paths of all tiles that are no duplicates, strongest first; the light of a selected
 * path is removed for the others. They are appended to the `kept` ones. Returns the total. */
static int select_paths(bst_stack *s, int kept) {
    int columns = (s->width + STACK_TILE - 1) / STACK_TILE;
    int rows = (s->height + STACK_TILE - 1) / STACK_TILE, count = 0;
    s->followed = 0;
    for (int tile = 0; tile < columns * rows; tile++) {
        s->followed += s->tile_followed[tile];
        for (int i = 0; i < s->tile_count[tile]; i++) {
            assert(s->tile_count[tile] <= STACK_TILE_FOUND);
            s->order[count++] = tile * STACK_TILE_FOUND + i;
        }
    }
    bst_heapsort_indices(s->order, count, stronger, s->tile_paths);
    for (int i = 0; i < count && kept < BST_STACK_MAX_FOUND; i++) {
        stack_path p = s->tile_paths[s->order[i]];
        p.snr = stack_sum(s, &p, STACK_CLAMP, &p.frames);
        if (p.snr > s->threshold && stack_holds(s, &p)) {
            s->paths[kept++] = p;
            stack_clean_path(s, &p);
        }
    }
    return kept;
}

/* Position in the last frame of a position in the first frame's pixels; false if out of view. */
static bool first_to_last_frame(const bst_stack *s, double x, double y, double out[2]) {
    bst_quat turn = bst_quat_mul(s->q[s->count - 1], bst_quat_conj(s->q[0]));
    bst_vec3 seen = bst_camera_unproject(&s->camera, s->origin_x_px + s->binning * x,
                                         s->origin_y_px + s->binning * y);
    return bst_camera_project(&s->camera, bst_quat_rotate(turn, seen), &out[0], &out[1]);
}

/* Flux, e-, of a point whose filter output in one frame is 1. Kernels have unit norm, so their sum
 * is 1 / sqrt(sum share^2) along an axis. */
static double electrons_per_snr(const bst_stack *s) {
    double noise = 0.0, total = 0.0;
    for (int i = 0; i < s->count; i++) {
        noise += s->noise_e[i] / s->count;
    }
    for (int i = 0; i <= 2 * s->map.radius; i++) {
        total += (double)s->map.kernel[i];
    }
    return noise * total * total;
}

/* Converts a path of the stack to a detection in the last frame. */
static bool report(const bst_stack *s, const stack_path *p, bool at_rest, bst_stack_found *out) {
    double end = s->tau[s->count - 1], now[2], before[2];
    double x = p->x + p->vx * end, y = p->y + p->vy * end;
    if (!first_to_last_frame(s, x, y, now) ||
        !first_to_last_frame(s, x - p->vx, y - p->vy, before)) {
        return false;
    }
    /* a maximum over four coordinates biases the squared output by that much */
    double signal2 = p->snr * p->snr - 4.0;
    double place = s->binning * s->binning / (signal2 * s->roughness);
    double electrons = electrons_per_snr(s), root = sqrt((double)p->frames);
    *out = (bst_stack_found){.x_px = now[0],
                             .y_px = now[1],
                             .rate_x_pxps = (now[0] - before[0]) / s->interval_s,
                             .rate_y_pxps = (now[1] - before[1]) / s->interval_s,
                             .rate_sigma_pxps = sqrt(place / s->time_variance) / s->interval_s,
                             .snr = p->snr,
                             .flux_e = electrons * p->snr / root,
                             .flux_sigma_e = electrons / root,
                             .at_rest = at_rest,
                             .frames = p->frames};
    out->cov_xx = out->cov_yy = place * (1.0 + end * end / s->time_variance);
    return true;
}

const bst_stack_found *bst_stack_search(bst_stack *s, int *count) {
    *count = 0;
    if (s->count < s->config.frames) {
        return s->found;
    }
    set_times(s);
    const double side[2] = {s->width - 1.0, s->height - 1.0};
    s->threshold =
        bst_stack_threshold(s->config.false_alarms_per_frame * (double)s->config.frames, side,
                            s->config.rate_px_per_frame, s->roughness, s->time_variance);
    stack_clean_charge(s);
    int rest = stack_clean_rest(s);
    stack_search_tiles(s);
    int count_all = select_paths(s, rest), kept = 0;
    for (int pass = 0; pass < 2; pass++) { /* moving objects first */
        for (int i = 0; i < count_all; i++) {
            const stack_path *p = &s->paths[i];
            bool at_rest = i < rest || stack_at_rest(s, p);
            if (at_rest == (pass == 1)) {
                kept += report(s, p, at_rest, &s->found[kept]);
            }
        }
    }
    s->count = 0;
    *count = kept;
    return s->found;
}

double bst_stack_threshold_snr(const bst_stack *s) {
    return s->threshold;
}

int64_t bst_stack_followed(const bst_stack *s) {
    return s->followed;
}
