/* The discs of Earth, Moon and Sun in a camera's field, per pixel. Internal to sim/world. */
#ifndef BST_WORLD_SCENE_DISCS_H
#define BST_WORLD_SCENE_DISCS_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* time intervals of the exposure in which an edge moves uniformly */
enum { BST_DISC_PARTS = 8 };

/* Observer, bodies and camera attitudes during one exposure. */
typedef struct bst_scene_surroundings {
    bst_vec3 eye_m, eye_mps; /* observer at mid-exposure, GCRF */
    bst_bodies bodies;       /* at mid-exposure, with the rotation */
    bst_mat3 itrf_from_gcrf;
    bst_light light;                /* of the observer */
    bst_quat q[BST_DISC_PARTS + 1]; /* q_cam_from_gcrf at equidistant times, start to end */
    double exposure_s;
    double v_limit, faint_limit; /* magnitude limits of rendered stars: catalogue, statistical */
} bst_scene_surroundings;

enum { BST_BODY_EARTH, BST_BODY_MOON, BST_BODY_SUN, BST_BODY_COUNT };

/* The disc of one body in the camera during the exposure. */
typedef struct bst_scene_body_disc {
    bool near;         /* may reach the sensor */
    bool present;      /* and is rendered */
    double radius_rad; /* angular radius of Moon and Sun */
    double radiance;   /* of a surface in full normal sunlight, or of the Sun; stars of V = 0 per
                          steradian */
    /* Earth only, as radiance: surface in full normal moonlight; night side */
    double moonlight, night;
    bst_vec3 moon;                       /* direction of the Moon, ITRF */
    double reach_px;                     /* distance beyond the edge up to which there is light */
    int parts;                           /* time intervals used */
    bst_vec3 centre[BST_DISC_PARTS + 1]; /* unit, camera axes: direction of Moon or Sun */
    bst_vec3 sun[BST_DISC_PARTS + 1]; /* direction of the Sun: camera axes (Moon), ITRF (Earth) */
    bst_vec3 eye[BST_DISC_PARTS +
                 1]; /* Earth: observer in coordinates in which the Earth is a unit sphere */
    double distance[BST_DISC_PARTS + 1];   /* Earth: of the observer in those, from the centre */
    double half_angle[BST_DISC_PARTS + 1]; /* Earth: of the sphere, seen from the observer, rad */
    bst_mat3 frame[BST_DISC_PARTS +
                   1]; /* Earth: rotation and scaling from camera axes to those coordinates */
} bst_scene_body_disc;

typedef struct bst_discs {
    bst_scene_body_disc body[BST_BODY_COUNT];
    double scale_rad;  /* per px */
    double sigma_px;   /* blur of an edge by PSF and pixel */
    double limb_scale; /* scale height of the limb glow, Earth radii */
} bst_discs;

/* Computes the discs of one exposure. Bodies that `config` excludes or that are far outside the
 * field are not present. Directions are apparent. */
void bst_discs_make(const bst_camera *camera, const bst_scene_surroundings *around, bst_discs *out);
/* True if Earth, Moon or Sun is in the field. */
bool bst_discs_any(const bst_discs *discs);

/* True if the background block enables any disc. */
static inline bool bst_discs_wanted(const bst_camera *camera) {
    const bst_background_config *c = &camera->background;
    return c->earth || c->moon || c->sun;
}

/* Fraction of a window's area that a body's disc covers at mid-exposure, 0 to 1, from a grid of 33
 * x 33 points. A smaller disc with its centre in the window: its area over the window's.
 *
 * Given: body  one of BST_BODY_EARTH ..., rendered or not */
double bst_discs_share(const bst_discs *discs, const bst_camera *camera, int body,
                       bst_window window);

/* Distance (px at the boresight's scale) of a direction (unit, camera axes) from the nearest edge
 * of a disc during the exposure, minus the reach of the disc's light. */
double bst_discs_edge_px(const bst_discs *discs, bst_vec3 direction);

/* True only if no direction up to radius_rad from an axis (unit, camera axes) is within `px` of an
 * edge by bst_discs_edge_px, and the Sun lights the Earth in all of them or in none. */
bool bst_discs_none_begins(const bst_discs *discs, bst_vec3 axis, double radius_rad, double px);

/* Distance of a direction from the nearest blurred edge at the limits and middles of the time
 * intervals, px. Between them an edge moves uniformly: its light can be interpolated. */
double bst_discs_sharp_edge_px(const bst_discs *discs, bst_vec3 direction);

/* Mean light from one direction over the exposure. */
typedef struct bst_disc_light {
    double sunlight; /* from the Sun and, reflected, from Moon and Earth; stars of V = 0 per
                        steradian */
    double earth;    /* fraction of time and area that the Earth's disc fills */
    /* bits 3 i to 3 i + 2: whether the place that is seen in time interval i is lit, on the Earth
     * by Sun and Moon, and on the Moon. They change at terminators and edges. */
    unsigned sides;
} bst_disc_light;

/* Light of the discs of Earth, Moon and Sun in a direction; the Earth occults the others.
 *
 * Given:     direction  unit vector */
bst_disc_light bst_discs_light(const bst_discs *discs, bst_vec3 direction);

#endif
