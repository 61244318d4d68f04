/* New objects of a run: orbits of candidates that tracks confirm, each with a filter of its own. */
#ifndef BST_RUN_RUN_NEW_OBJECTS_H
#define BST_RUN_RUN_NEW_OBJECTS_H

#include "boresight/archive.h"
#include "sim/run/run_custody_tables.h"
#include "sim/world/world.h"
#include "tracker/orbit/custody.h"

typedef struct bst_run_new_object {
    bst_custody_orbit orbit;
    bst_custody_filter filter;
    double noise_m_per_day;  /* of its process noise, for its unknown drag */
    bst_custody_score score; /* updates: with the tracks of its candidate */
    /* by the truth: object that all tracks of its candidate belong to, -1: different ones, none */
    int64_t true_object;
} bst_run_new_object;

typedef struct bst_run_new_objects {
    int count, room;
    bst_run_new_object *items;
} bst_run_new_objects;

/* Score of the new objects at the end of a run. */
typedef struct bst_run_new_figures {
    int64_t wrong;         /* of tracks of different objects or none, or of a known object */
    double sigma_median_m; /* of the position; NAN: none */
    double nees_mean;      /* of their osculating elements, 6 degrees of freedom; NAN: none */
} bst_run_new_figures;

/* Appends an object, and gives it its process noise; beyond 65,536 objects it is left out. Errors:
 * BST_ERR_MEMORY */
bst_status bst_run_new_objects_add(bst_ctx *ctx, bst_run_new_objects *objects,
                                   const bst_run_new_object *object) BST_MUST_CHECK;
/* Frees the objects; none are left. */
void bst_run_new_objects_clear(bst_run_new_objects *objects);

/* Adds an object's process noise until `time_s`. */
void bst_run_new_object_advance(bst_run_new_object *object, double time_s);

/* Whether two orbits with filters are those of one object at `time_s`: the squared difference of
 * their elements by the sum of both covariances is that of errors up to three times as large as
 * stated, and the standard deviation of the difference of places is at most 5 km, as otherwise
 * neighbours would be one. */
bool bst_run_new_object_is(const bst_custody_orbit *orbit, const bst_custody_filter *filter,
                           const bst_custody_orbit *other, const bst_custody_filter *other_filter,
                           double time_s);

/* Filter of a catalogued object that starts anew on the orbit of another one, which is within some
 * kilometres of it: differences of osculating elements at `time_s` are taken for those of mean
 * ones (to a thousandth). False: no state. */
bool bst_run_new_object_carry(const bst_custody_orbit *from, const bst_custody_filter *filter,
                              const bst_custody_orbit *to, double time_s, bst_custody_filter *out);

/* Scores the new objects against the truth at the end, and writes their rows to the table custody
 * (NULL: no rows). catalogue: orbit of each object of the world, a_m 0: it has none there. Errors:
 * BST_ERR_MEMORY, those of bst_io_table_append */
bst_status bst_run_new_objects_finish(bst_ctx *ctx, bst_run_new_objects *objects,
                                      const bst_world *world, const bst_custody_orbit *catalogue,
                                      bst_io_table *table, double end_s,
                                      bst_run_new_figures *out) BST_MUST_CHECK;

/* Saves or restores the objects. Errors: BST_ERR_MEMORY; BST_ERR_FORMAT: their number, orbit or
 * times are impossible, or an object of the truth that the world lacks */
bst_status bst_run_new_objects_archive(bst_run_new_objects *objects, int world_objects,
                                       bst_archive *archive) BST_MUST_CHECK;

#endif
