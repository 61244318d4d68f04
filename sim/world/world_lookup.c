/* Lookup of objects by name and of state files by path. */
#include "sim/core/file.h"
#include "sim/world/world_build.h"

int bst_world_find_object(const bst_world *world, const char *name) {
    return world->object_names ? bst_name_index_find(world->object_names, name) : -1;
}

bst_world_path bst_world_path_join(const bst_world_builder *b, const char *path) {
    bst_world_path full;
    bst_file_resolve(b->base_dir, path, full.text, sizeof full.text);
    return full;
}
