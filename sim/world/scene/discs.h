/* The discs of Earth, Moon and Sun in a camera's field, pixel by pixel. Inside of sim/world. */
#ifndef BST_WORLD_SCENE_DISCS_H
#define BST_WORLD_SCENE_DISCS_H

#include "boresight/camera.h"
#include "boresight/messages.h"
#include "sim/astro/bodies.h"

/* Stretches of the exposure in which an edge is taken to move evenly. */
enum { BST_DISC_PARTS = 8 };

/* What a camera is surrounded by in one exposure. */
typedef struct bst_scene_surroundings {
    bst_vec3 eye_m, eye_mps; /* observer at mid-exposure, GCRF */
    bst_bodies bodies;       /* at mid-exposure, as the rotation */
    bst_mat3 itrf_from_gcrf;
    bst_light light;                /* of the observer */
    bst_quat q[BST_DISC_PARTS + 1]; /* q_cam_from_gcrf at equidistant times, start to end */
    double exposure_s;
    double v_limit,
        faint_limit; /* stars fainter are not drawn: of the catalogue, statistical ones */
} bst_scene_surroundings;

enum { BST_BODY_EARTH, BST_BODY_MOON, BST_BODY_SUN, BST_BODY_COUNT };

/* One body as the camera sees it during the exposure. */
typedef struct bst_scene_body_disc {
    bool near;         /* may touch the sensor */
    bool present;      /* and is to be drawn */
    double radius_rad; /* of the Moon and the Sun */
    double radiance;   /* of full sunlight falling straight on it, or of the Sun itself; stars of
                          V = 0 per steradian */
    /* Earth only, as radiance: of full moonlight falling straight on it; of the night side */
    double moonlight, night;
    bst_vec3 moon;                       /* towards the Moon, Earth axes */
    double reach_px;                     /* beyond the edge, to where there is light of it */
    int parts;                           /* stretches used */
    bst_vec3 centre[BST_DISC_PARTS + 1]; /* towards it (unit), camera axes: Moon, Sun */
    bst_vec3 sun[BST_DISC_PARTS + 1];    /* towards the Sun: camera axes (Moon), Earth axes */
    bst_vec3 eye[BST_DISC_PARTS + 1];    /* Earth: observer, in coordinates in which it is a sphere
                                            of radius 1 */
    bst_mat3 frame[BST_DISC_PARTS + 1];  /* Earth: those coordinates from camera axes */
} bst_scene_body_disc;

typedef struct bst_discs {
    bst_scene_body_disc body[BST_BODY_COUNT];
    double scale_rad;  /* per px */
    double sigma_px;   /* by which the PSF and the pixel soften an edge */
    double limb_scale; /* Earth radii */
} bst_discs;

/* Works out the bodies of one exposure. Those that `config` leaves out, or that are too far beside
 * the sensor, are not present. Directions are apparent ones. */
void bst_discs_make(const bst_camera *camera, const bst_scene_surroundings *around, bst_discs *out);
/* True if Earth, Moon or Sun is in the field. */
bool bst_discs_any(const bst_discs *discs);

/* Whether the background block asks for any disc. */
static inline bool bst_discs_wanted(const bst_camera *camera) {
    const bst_background_config *c = &camera->background;
    return c->earth || c->moon || c->sun;
}

/* Share of a window's area that a body's disc covers at mid-exposure, 0 to 1, from a lattice of 33
 * x 33 places; of a smaller disc whose middle is in the window, its area over the window's.
 *
 * Given: body, one of BST_BODY_EARTH ..., whether or not its disc is to be drawn. */
double bst_discs_share(const bst_discs *discs, const bst_camera *camera, int body,
                       bst_window window);

/* Whether both day and night are among four places of the Earth's disc (unit, camera axes): its
 * terminator passes between them. false where the Earth is not drawn. */
bool bst_discs_terminator(const bst_discs *discs, const bst_vec3 directions[4]);

/* Distance of a direction (unit, camera axes) from the nearest edge of a disc at any time of the
 * exposure, px at the boresight's scale, less how far the disc's light reaches beyond its edge. */
double bst_discs_edge_px(const bst_discs *discs, bst_vec3 direction);

/* Mean light over the exposure that comes from a direction. */
typedef struct bst_disc_light {
    double sunlight; /* Sun, and its light from Moon and Earth, stars of V = 0 per steradian */
    double earth;    /* share of time and area that the Earth's disc fills */
} bst_disc_light;

/* Light of the discs of Earth, Moon and Sun in a direction; the Earth hides the others.
 *
 * Given:     direction  unit vector */
bst_disc_light bst_discs_light(const bst_discs *discs, bst_vec3 direction);

#endif
