/* Building a world from its configuration; internal to sim/world. */
#ifndef BST_WORLD_WORLD_BUILD_H
#define BST_WORLD_WORLD_BUILD_H

#include "sim/world/world_internal.h"

typedef struct bst_world_builder {
    bst_ctx *ctx;
    const char *scenario; /* file, for messages */
    const char *base_dir; /* base folder of relative paths */
    bst_world *world;     /* under construction; epoch and Earth orientation are set */
    bst_sky_clock *clock;
    const bst_config_list *constellations; /* bst_constellation_config */
    /* of the object whose orbit is built: its surface, NULL: none, and the starts of the phases of
     * its attitude */
    const bst_force_surface *surface;
    const double *phase_s;
    int phase_count;
} bst_world_builder;

/* A file path, joined to the scenario's folder if relative. */
typedef struct bst_world_path {
    char text[1100];
} bst_world_path;

/* Path of a scenario's file; relative paths start at the scenario's folder. */
bst_world_path bst_world_path_join(const bst_world_builder *b, const char *path);

/* Creates an orbit of any source. `path`: its JSON pointer ("/observers/0/orbit"). `name`
 * (borrowed) and `burns` belong to the object. A relative orbit may refer to objects created
 * before. *norad: catalogue number, 0: none. After an error free the orbit with
 * bst_world_orbit_free. */
bst_status bst_world_orbit_build(const bst_world_builder *b, const bst_orbit_config *config,
                                 const bst_config_list *burns, const char *path, const char *name,
                                 bst_world_orbit *orbit, int *norad) BST_MUST_CHECK;

/* Creates an SGP4 orbit from an element set. */
bst_status bst_world_orbit_build_sgp4(const bst_world_builder *b, const bst_elements *set,
                                      const char *name, bst_world_orbit *orbit) BST_MUST_CHECK;

/* Creates an orbit from a file of states (OEM or per frame); called by bst_world_orbit_build. */
bst_status bst_world_orbit_build_file(const bst_world_builder *b, const bst_orbit_config *config,
                                      const char *path, bst_world_orbit *orbit) BST_MUST_CHECK;

/* Reads the frame-updates files of all sensors. */
bst_status bst_world_load_updates(const bst_world_builder *b,
                                  const bst_config_list *observers) BST_MUST_CHECK;
/* Frees the frame updates of a world. */
void bst_world_updates_free(bst_world *world);
/* States of an object from a frame_updates_file, at the frame times of the first sensor that uses
 * the file. */
bst_status bst_world_updates_injected(const bst_world_builder *b, const char *path,
                                      bst_state_table **out) BST_MUST_CHECK;
/* Attitudes of an object from a frame_updates_file: at start and end of its frames.
 *
 * Given:     world   bst_world under construction, with its frame updates
 *            path    the file; it must be that of a sensor
 *            object  its name in the file; "": the only one with attitudes
 * Returned:  *rows   [*count] times after the epoch; the caller frees it
 * Errors:    BST_ERR_CONFIG with the file, BST_ERR_MEMORY */
bst_status bst_world_updates_attitudes(bst_ctx *ctx, const void *world, const char *path,
                                       const char *object, bst_attitude_row **rows,
                                       int *count) BST_MUST_CHECK;

/* Closes the files of orbits of a world. */
void bst_world_files_free(bst_world *world);
/* Creates the gravity field of a numerical orbit, before the orbit itself. */
bst_status bst_world_orbit_make_gravity(const bst_world_builder *b, const bst_force_config *f,
                                        const char *path, bst_gravity **out) BST_MUST_CHECK;
/* Creates a numerical orbit whose gravity field exists; called by bst_world_orbit_build, same
 * arguments. `other`: initial state if an orbit of another source provides it. */
bst_status bst_world_orbit_build_numerical(const bst_world_builder *b,
                                           const bst_orbit_config *config,
                                           const bst_config_list *burns,
                                           const bst_world_state *other, const char *path,
                                           bst_world_orbit *orbit) BST_MUST_CHECK;

/* Frees the content of an orbit (SGP4, trajectories, gravity field, burns); the caller owns the
 * struct. */
void bst_world_orbit_free(bst_world_orbit *orbit);

/* Fills world->objects: listed objects first, then those of the catalogues. */
bst_status bst_world_build_objects(const bst_world_builder *b,
                                   const bst_world_config *config) BST_MUST_CHECK;

#endif
