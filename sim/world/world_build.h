/* Making a world from its configuration; shared by the files of sim/world only. */
#ifndef BST_WORLD_WORLD_BUILD_H
#define BST_WORLD_WORLD_BUILD_H

#include "sim/world/world_internal.h"

typedef struct bst_world_builder {
    bst_ctx *ctx;
    const char *scenario; /* file, for messages */
    const char *base_dir; /* folder that relative paths start from */
    bst_world *world;     /* being made; its epoch and Earth orientation are there */
    bst_sky_clock *clock;
    const bst_config_list *constellations; /* bst_constellation_config */
} bst_world_builder;

/* A path that may be relative to the scenario's folder. */
typedef struct bst_world_path {
    char text[1100];
} bst_world_path;

/* Path of a file of the scenario: relative paths start at the scenario's folder. */
bst_world_path bst_world_path_join(const bst_world_builder *b, const char *path);

/* Makes an orbit of any source. `path` is its place in the scenario ("/observers/0/orbit"), `name`
 * (borrowed by the orbit) and `burns` belong to the object; a relative orbit may refer to the
 * world's objects so far. *norad: catalogue number, 0 when there is none. On error the orbit holds
 * what was made of it, for bst_world_orbit_free. */
bst_status bst_world_orbit_build(const bst_world_builder *b, const bst_orbit_config *config,
                                 const bst_config_list *burns, const char *path, const char *name,
                                 bst_world_orbit *orbit, int *norad) BST_MUST_CHECK;

/* Makes an sgp4 orbit from an element set. */
bst_status bst_world_orbit_build_sgp4(const bst_world_builder *b, const bst_elements *set,
                                      const char *name, bst_world_orbit *orbit) BST_MUST_CHECK;

/* Makes an orbit of source oem or injected; called by bst_world_orbit_build. */
bst_status bst_world_orbit_build_file(const bst_world_builder *b, const bst_orbit_config *config,
                                      const char *path, bst_world_orbit *orbit) BST_MUST_CHECK;

/* Reads the files that drive sensors frame by frame. */
bst_status bst_world_load_updates(const bst_world_builder *b,
                                  const bst_config_list *observers) BST_MUST_CHECK;
/* Frees the files of updates that a world reads. */
void bst_world_updates_free(bst_world *world);
/* The objects of a frame_updates_file as injected states, at the times of the frames of the first
 * sensor that the file drives. */
bst_status bst_world_updates_injected(const bst_world_builder *b, const char *path,
                                      bst_state_table **out) BST_MUST_CHECK;

/* Closes the files that orbits came from. */
void bst_world_files_free(bst_world *world);
/* Makes the gravity of a numerical orbit, the first step to it. */
bst_status bst_world_orbit_make_gravity(const bst_world_builder *b, const bst_force_config *f,
                                        const char *path, bst_gravity **out) BST_MUST_CHECK;
/* Makes a numerical orbit whose gravity is there; called by bst_world_orbit_build, arguments as
 * there. `other`: the state that it begins with where that comes from an orbit of another source.
 */
bst_status bst_world_orbit_build_numerical(const bst_world_builder *b,
                                           const bst_orbit_config *config,
                                           const bst_config_list *burns,
                                           const bst_world_state *other, const char *path,
                                           bst_world_orbit *orbit) BST_MUST_CHECK;

/* Frees what an orbit holds (SGP4, trajectories, gravity field, burns); the struct itself stays. */
void bst_world_orbit_free(bst_world_orbit *orbit);

/* Fills world->objects from the list of objects and then from the catalogues. */
bst_status bst_world_build_objects(const bst_world_builder *b,
                                   const bst_world_config *config) BST_MUST_CHECK;

#endif
