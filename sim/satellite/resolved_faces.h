/* Facets of a pose in the image: coverage, light and shadows. Internal to sim/satellite. */
#ifndef BST_SATELLITE_RESOLVED_FACES_H
#define BST_SATELLITE_RESOLVED_FACES_H

#include "sim/satellite/area_sums.h"
#include "sim/satellite/curved_patches.h"
#include "sim/satellite/facet_layers.h"
#include "sim/satellite/polygon_coverage.h"
#include "sim/satellite/sun_disc.h"
#include "sim/satellite/visible_surface.h"

/* A cell that a facet with shadows covers. */
typedef struct bst_resolved_lit_cell {
    double area;  /* that the facet covers */
    double light; /* of lit polygons that cover all of that */
} bst_resolved_lit_cell;

/* Lights that cast shadows: the Sun, and the centroid of the earthlight. */
enum { BST_RESOLVED_LIGHTS = 2 };

/* Differences of depth over the satellite's radius that are none. */
#define BST_RESOLVED_SAME 2e-6

/* Plane of a facet, body frame: normal . place = offset_m. */
typedef struct bst_resolved_plane {
    bst_vec3 normal;
    double offset_m;
} bst_resolved_plane;

/* Poses of which the edges are added together: the cells that an edge meets in one of them are
 * still in fast memory for the next one. */
enum { BST_RESOLVED_KEPT = 4 };

/* A pose of which the edges are not yet added. */
typedef struct bst_resolved_kept {
    bst_point2 *at; /* by vertex of the net: place in the image */
    double *even;   /* by facet, and 0 for one more: light per cell of whole facets */
} bst_resolved_kept;

/* Work memory of light by exact areas (resolved_areas.c): zero-initialise. */
typedef struct bst_resolved_areas {
    bst_facet_net net;
    bool borrowed; /* the net's arrays are those of another image of the same model */
    bst_facet_layers eye, lit[BST_RESOLVED_LIGHTS];
    bst_area_sums sums;
    bst_resolved_plane *planes;        /* by facet, of the current pose */
    bst_vec3 *middles;                 /* likewise: means of the corners, body frame */
    bool placed;                       /* they are those of all poses: the model has no joints */
    double *even;                      /* by facet: light without shadows, per cell */
    double *from[BST_RESOLVED_LIGHTS]; /* by facet: of each light */
    uint8_t *wanted;                   /* by facet */
    bst_resolved_kept kept[BST_RESOLVED_KEPT];
    int kept_count;
    double faint; /* difference of light, over that light, of which an edge is faint */
    bst_resolved_second *second; /* of the image's cells */
    size_t second_capacity;
    bool made;
} bst_resolved_areas;

struct bst_resolved {
    const bst_satellite *satellite;
    bst_resolved_image image;
    size_t cell_capacity;
    bst_curved_places places;
    bst_visible_surface surface;
    bst_polygon_coverage whole, lit;  /* of the current facet */
    bst_polygon_coverage hidden;      /* of the hidden region of the pose */
    bst_resolved_lit_cell *lit_cells; /* in the box of the current facet */
    size_t lit_capacity;
    bst_point2 *outline, *hull; /* of a body, with room */
    bst_sun_disc disc;
    bst_resolved_areas areas;
};

/* One pose that is added. */
typedef struct bst_resolved_adding {
    bst_resolved *r;
    bst_satellite_pose *pose;
    const bst_resolved_view *view;
    const bst_resolved_light *light;
    bst_mat3 image_from_body;
    bst_vec3 eye_m; /* body frame */
    double per_m;   /* cells per metre at one metre */
    double scale;   /* of the current curved surface, see bst_curved_facet_scale */
    bool earth;
    bst_point2 hidden[BST_RESOLVED_HIDDEN_CORNERS]; /* of the view, in cells */
    int hidden_count;                               /* 0: nothing is hidden */
} bst_resolved_adding;

/* A facet in the image. */
typedef struct bst_resolved_face {
    bst_point2 corner[BST_COVERAGE_CORNERS_MAX];
    int count, part, body;
    bst_vec3 plane;            /* nearness at (x, y, 1) in cells: the scalar product */
    int low[2], width, height; /* box in cells */
    /* change of the light per cell from the middle, per cell, and its limits; all 0: none */
    double slope[2], middle[2], least, most;
} bst_resolved_face;

/* Light per cell: where Sun and Earth light the facet, and everywhere. */
typedef struct bst_resolved_shading {
    double sun, earth, uniform;
    double sun_change[2]; /* across a part of a curved surface, around and up */
} bst_resolved_shading;

/* A point of the image plane, in cells. *depth_m: along the boresight. */
bst_point2 bst_resolved_project(const bst_resolved_adding *a, bst_vec3 p, double *depth_m);

/* Sets corners and depths of a facet in the image. False: it shows its back.
 *
 * Given:     corner  [count] body frame
 *            normal  unit, body frame */
bool bst_resolved_make_face(const bst_resolved_adding *a, const bst_vec3 *corner, int count,
                            bst_vec3 normal, bst_resolved_face *out);

/* Light per cell of a surface element of a material, at a point with a normal, body frame. */
bst_resolved_shading bst_resolved_shade(const bst_resolved_adding *a, int material, bst_vec3 point,
                                        bst_vec3 normal);

/* Keeps the most light of surfaces for bst_resolved_image.
 *
 * Given:     round  the surface is curved or has a round border */
void bst_resolved_note_light(const bst_resolved_adding *a, const bst_resolved_shading *light,
                             bool round);

/* Direction of the point of the Sun's disc that casts the shadows. */
bst_vec3 bst_resolved_shadow_sun(const bst_resolved_light *light);

/* A line at which a shadow ends on a facet, body frame. */
typedef struct bst_resolved_border {
    bst_vec3 normal;  /* of the facet, unit */
    bst_vec3 at[2];   /* its ends; the same: of any direction */
    bst_vec3 side[2]; /* along the sides of the facet that it ends at; 0: none */
    double light;     /* sunlight per cell */
    double change[2]; /* of the light across these sides, per cell */
    double gap_m;     /* along the light, from the facet to what casts the shadow, at most */
} bst_resolved_border;

/* Keeps the width of a penumbra for bst_resolved_image. */
void bst_resolved_note_shadow(const bst_resolved_adding *a, const bst_resolved_border *border);

/* The same for a plane or curved facet, or a part of it, of which the Sun reaches the pieces in
 * pose->clip, by the outlines of the bodies at which these end.
 *
 * Given:     place, normal  of the plane, body frame
 *            flat  the pieces are along the x and y of the view from the Sun; false: along the
 *                  facet's axes */
void bst_resolved_note_shadows_on(const bst_resolved_adding *a, int facet, bst_vec3 place,
                                  bst_vec3 normal, double light, bool flat);

/* Fraction of a facet that a light reaches; the pieces are in pose->clip if it is between 0 and 1.
 *
 * Given:     view  0: Sun; 1: earthlight */
double bst_resolved_lit_fraction(const bst_resolved_adding *a, int facet, int view);

/* Marks the cells of the surface that the convex bodies of the model reach. BST_ERR_MEMORY. */
bst_status bst_resolved_reach(bst_ctx *ctx, const bst_resolved_adding *a) BST_MUST_CHECK;

/* Covers the grid by a facet: fills r->whole and the facet's box. BST_ERR_MEMORY. */
bst_status bst_resolved_cover_face(bst_ctx *ctx, const bst_resolved_adding *a,
                                   bst_resolved_face *f) BST_MUST_CHECK;
/* Starts the light of the facet's box with none. BST_ERR_MEMORY. */
bst_status bst_resolved_clear_lit(bst_ctx *ctx, bst_resolved *r,
                                  const bst_resolved_face *f) BST_MUST_CHECK;
/* Adds the light of a polygon within the facet, corner[count] in cells: to its box where it covers
 * all that the facet has of a cell, else to the surface. BST_ERR_MEMORY. */
bst_status bst_resolved_add_lit(bst_ctx *ctx, bst_resolved *r, const bst_resolved_face *f,
                                const bst_point2 *corner, int count, double light) BST_MUST_CHECK;
/* Adds the fragments of a facet to the surface: a uniform light per cell and, with `pieces`, that
 * of its box. BST_ERR_MEMORY. */
bst_status bst_resolved_add_fragments(bst_ctx *ctx, const bst_resolved_adding *a,
                                      const bst_resolved_face *f, double uniform,
                                      bool pieces) BST_MUST_CHECK;

/* Most parts of an arc where they are squared; of a cylinder or cone four times as many. */
enum { BST_RESOLVED_PARTS_MAX = 64 };

/* Parts into which an arc is divided: at the limb, or elsewhere, at most `most`. */
int bst_resolved_parts(const bst_resolved_adding *a, double radius_m, double angle, bst_vec3 at,
                       bool limb, int most);

/* Adds a plane facet to the surface; f: work space, with part and body set. BST_ERR_MEMORY. */
bst_status bst_resolved_add_plane_facet(bst_ctx *ctx, bst_resolved_adding *a, int facet,
                                        bst_resolved_face *f) BST_MUST_CHECK;
/* Likewise a facet of a curved surface (resolved_curved.c). */
bst_status bst_resolved_add_curved_facet(bst_ctx *ctx, bst_resolved_adding *a, int facet,
                                         bst_resolved_face *f) BST_MUST_CHECK;

/* Sets the hidden region of a pose, in cells (resolved_hidden.c). */
void bst_resolved_set_hidden(bst_resolved_adding *a);
/* Prepares the cells of the surface at the border of the hidden region, after bst_resolved_reach.
 * BST_ERR_MEMORY. */
bst_status bst_resolved_reach_hidden(bst_ctx *ctx, const bst_resolved_adding *a) BST_MUST_CHECK;
/* Hides what of the surface is in the hidden region, after all facets. BST_ERR_MEMORY. */
bst_status bst_resolved_hide(bst_ctx *ctx, const bst_resolved_adding *a) BST_MUST_CHECK;
/* Cuts the hidden region from a facet of which others leave r->areas.eye.clip, or all of it
 * (`whole`). Returned: as bst_facet_layers_cut. */
bool bst_resolved_cut_hidden(const bst_resolved_adding *a, int facet, bool whole);

/* View from a light: a place in the body frame is at middle + per_m times its x and y. */
typedef struct bst_resolved_light_view {
    bst_vec3 x, y, z; /* unit; z: toward the light */
    double middle, per_m;
    int side;
} bst_resolved_light_view;

static inline bst_point2 bst_resolved_light_place(const bst_resolved_light_view *v, bst_vec3 p) {
    return (bst_point2){v->middle + v->per_m * bst_vec3_dot(p, v->x),
                        v->middle + v->per_m * bst_vec3_dot(p, v->y)};
}

/* Places the vertices in the views of r->areas.eye and, once it has begun, of r->areas.lit[0], and
 * finds the facets that face the observer and the Sun, with their light if nothing hides them:
 * r->areas.even and from; those with light are wanted (resolved_places.c). BST_ERR_MEMORY. */
bst_status bst_resolved_place_facets(bst_ctx *ctx, const bst_resolved_adding *a,
                                     const bst_resolved_light_view *sun) BST_MUST_CHECK;
/* Adds the light of a pose to the sums (resolved_areas.c). BST_ERR_MEMORY. */
bst_status bst_resolved_add_areas(bst_ctx *ctx, const bst_resolved_adding *a,
                                  double weight) BST_MUST_CHECK;
/* Frees the work memory of these sums. */
void bst_resolved_areas_free(bst_resolved_areas *areas);

#endif
