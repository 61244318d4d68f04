/* A satellite's model at one instant: joints turned, and what is lit and visible of each facet. */
#ifndef BST_SATELLITE_POSE_H
#define BST_SATELLITE_POSE_H

#include "sim/satellite/model.h"
#include "sim/satellite/polygon_clip.h"
#include "sim/satellite/polygon_covers.h"

/* What joints follow, in the body frame; unit vectors. */
typedef struct bst_satellite_aim {
    bst_vec3 sun, earth, target;
    double seconds; /* after the epoch, for joints that spin */
} bst_satellite_aim;

/* Parallel projection of the model along one direction. */
typedef struct bst_pose_view {
    bst_vec3 x, y, z; /* right-handed; z: unit, from the satellite to the light or the observer */
    bst_point2 *flat; /* by vertex: x and y */
    double *depth_m;  /* by vertex: z */
    bool *within_rim; /* by vertex of a shell: see bst_pose_is_within_rim */
    double (*bounds)[6]; /* by occluder: lowest and highest x, y, z */
    bst_point2 *outline; /* silhouettes of occluders, counter-clockwise, from 2 * first_vertex */
    uint64_t *hiders;    /* by occluder: set of those that may hide some of it; for few occluders */
    int *outline_count;  /* corners of the silhouette; -1: not yet made */
    bst_half_planes *sides;       /* of silhouettes, see bst_pose_sides; for few occluders */
    int *side_blocks;             /* blocks of them; -1: not yet made */
    int *cell_first, *cell_items; /* occluders by cell of a grid, for models with many */
    int cells, cell_item_count, cell_item_capacity;
    double origin[2], step[2]; /* of the grid */
} bst_pose_view;

/* Bodies of a model, at most, for which separating planes are kept; plane faces tried of each. */
enum { BST_SEPARATION_BODIES = 64, BST_SEPARATION_FACES = 6 };

/* Whether and how two bodies are separate (separation.h). */
typedef struct bst_pose_pair {
    int stamp; /* pose in which it was found; 0: not yet */
    bool separate;
    bst_vec3 axis;
} bst_pose_pair;

/* A curved surface: its light without shadows, m^2/sr, what share of it is free, and the error of
 * that. */
typedef struct bst_pose_curved {
    double light, share, error;
} bst_pose_curved;

/* A pose: work memory of one thread for one model. */
typedef struct bst_satellite_pose {
    const bst_satellite *satellite;
    const double *burn_s; /* [burn_count] starts of burns after the epoch, for joints that follow
                             them; borrowed; set by the owner of the pose; at first none */
    int burn_count;
    struct bst_interreflection *interreflection; /* borrowed; NULL: light is reflected
                                                    once */
    bst_vec3 *vertices;                          /* body frame */
    bst_vec3 *normals;                           /* of facets, body frame */
    bst_mat3 *rotation;                          /* by joint: body frame from joint frame */
    bst_vec3 *origin;                            /* by joint, body frame */
    bst_pose_view views[2];                      /* see bst_pose_look */
    int *next;                      /* work memory of outlines: by vertex of the largest occluder */
    bst_point2 *flat;               /* likewise */
    bool *facing;                   /* likewise: by facet */
    bst_point2 *front, *front_hull; /* work memory of bst_pose_front */
    int *seen;                      /* by occluder: facet for which it was last found in the grid */
    int seen_stamp;
    int (*hiders)[2];                   /* work memory of bst_line_shadow */
    bst_pose_curved *curved;            /* likewise of bst_satellite_flux_at, by curved surface */
    int stamp;                          /* counts the poses, from 1 */
    bst_pose_pair *pairs;               /* [occluders][occluders]; NULL: too many */
    int (*faces)[BST_SEPARATION_FACES]; /* by occluder: plane facets; -1: no more */
    bst_polygon_clip clip;
    bst_polygon_covers covers;
    bst_point2 *plane;      /* by corner of a facet: see plane_corner */
    int (*plane_corner)[2]; /* by facet: corners that are (1, 0) and (0, 1); corner 0 is (0, 0) */
    bst_half_planes *sides; /* work memory: of one polygon */
} bst_satellite_pose;

/* Allocates a pose of a model, with all joints at their offsets.
 *
 * Given:     satellite  outlives the pose
 * Returned:  *out  the pose; NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_satellite_pose_free */
bst_status bst_satellite_pose_create(bst_ctx *ctx, const bst_satellite *satellite,
                                     bst_satellite_pose **out) BST_MUST_CHECK;
/* Frees a pose; NULL is allowed. */
void bst_satellite_pose_free(bst_satellite_pose *pose);

/* Turns the joints only: `rotation` and `origin`. */
void bst_satellite_pose_turn(bst_satellite_pose *pose, const bst_satellite_aim *aim);

/* Turns the joints and places all vertices. */
void bst_satellite_pose_set(bst_satellite_pose *pose, const bst_satellite_aim *aim);

/* Prepares a view for bst_pose_unshadowed.
 *
 * Given:     view       0 or 1
 *            direction  unit, body frame: from the satellite to the light or the observer */
void bst_pose_look(bst_satellite_pose *pose, int view, bst_vec3 direction);

/* Silhouette of a convex body in a view that bst_pose_look prepared.
 *
 * Returned:  number of corners, below 3: none
 *            *points  counter-clockwise, along the view's x and y; they belong to the pose */
int bst_pose_outline(bst_satellite_pose *pose, int view, int occluder, const bst_point2 **points);

/* Return value of bst_pose_front: nothing of the body is behind the plane. */
enum { BST_POSE_ALL_IN_FRONT = -1 };

/* Silhouette, along the view's x and y, of what of a convex body is in front of a plane.
 *
 * Given:     point, normal  of the plane, toward the view
 * Returned:  number of corners; 0: none is; BST_POSE_ALL_IN_FRONT: see bst_pose_outline
 *            *hull  counter-clockwise; valid until the next call */
int bst_pose_front(bst_satellite_pose *pose, const bst_pose_view *view, int occluder,
                   bst_vec3 point, bst_vec3 normal, const bst_point2 **hull);

/* Area of a facet that the bodies of the model hide from none of the directions of the first
 * `views` views, m^2. The facet faces all of these directions.
 *
 * Returned:  pose->clip holds the convex pieces of that area in the coordinates of
 *            bst_pose_facet_axes, if *whole is false
 *            *whole  nothing hides any of it
 * Notes:     exact for plane facets: the silhouette of each convex body is projected onto the
 *            facet's plane and subtracted. */
double bst_pose_unshadowed(bst_satellite_pose *pose, int facet, int views, bool *whole);

/* The same area without its pieces, in a part of the time; exactly that of the facet if nothing
 * hides any of it. */
double bst_pose_unshadowed_area(bst_satellite_pose *pose, int facet, int views);

/* Axes of a facet's plane: a point of it is *origin + x *e1 + y *e2, body frame. */
void bst_pose_facet_axes(const bst_satellite_pose *pose, int facet, bst_vec3 *origin, bst_vec3 *e1,
                         bst_vec3 *e2);

#endif
