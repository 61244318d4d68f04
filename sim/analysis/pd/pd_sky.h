/* Stars and sky of the scenario as background for `boresight pd`. */
#ifndef BST_ANALYSIS_PD_PD_SKY_H
#define BST_ANALYSIS_PD_PD_SKY_H

#include "sim/eval/target_match.h"
#include "sim/world/scene/field.h"

struct bst_pd_scene;

/* Stars that a detector may find in a frame: SNR of at least BST_PD_STAR_SNR, sorted into cells. */
#define BST_PD_STAR_SNR 1.0
typedef struct bst_pd_stars {
    bst_eval_match_target *places; /* [count], sorted by cell */
    int *first;                    /* [columns * rows + 1], index of the first star of each cell */
    int count, room, columns, rows;
    double cell_px;
} bst_pd_stars;

typedef struct bst_pd_sky bst_pd_sky;

/* Opens the sky of the scenario's sensor at the epoch, in the direction of its cue. */
bst_status bst_pd_sky_open(bst_ctx *ctx, const struct bst_pd_scene *scene,
                           bst_pd_sky **out) BST_MUST_CHECK;
/* Frees a sky; NULL is allowed. */
void bst_pd_sky_close(bst_pd_sky *sky);
/* Camera attitude towards that direction, rotated about the boresight by `roll_rad`. */
bst_quat bst_pd_sky_attitude(const bst_pd_sky *sky, double roll_rad);
/* Computes stars and background along `track`; `sky` holds them until the next call. */
bst_status bst_pd_sky_look(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                           const bst_scene_source **stars, int *count) BST_MUST_CHECK;
/* Appends the positions of detectable stars to `out`. */
bst_status bst_pd_sky_stars(bst_ctx *ctx, bst_pd_sky *sky, const bst_los_track *track,
                            const bst_scene_source *stars, int count,
                            bst_pd_stars *out) BST_MUST_CHECK;
/* Frees the memory of a list of stars and clears the struct, which belongs to the caller. */
void bst_pd_stars_free(bst_pd_stars *stars);

/* Expected electrons of sky in a pixel at the latest time of the sky.
 *
 * Given:     x_px, y_px  full-sensor pixel coordinates */
double bst_pd_sky_e(const bst_pd_sky *sky, double x_px, double y_px);
/* Map of the sky at its latest time; NULL if the sky is uniform. It belongs to the sky. */
const struct bst_skylight_map *bst_pd_sky_map(const bst_pd_sky *sky);

/* True if a detection may be a star: within reach_px of one (of a streak as targets are matched),
 * or a streak with a star on it; twice that at an edge. */
bool bst_pd_is_star(const bst_pd_stars *stars, double reach_px, const bst_detection *detection);

#endif
