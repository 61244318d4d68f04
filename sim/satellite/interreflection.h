/* Sunlight that reaches a facet by way of another one: one bounce of diffuse light. */
#ifndef BST_SATELLITE_INTERREFLECTION_H
#define BST_SATELLITE_INTERREFLECTION_H

#include "sim/satellite/flux.h"

/* More facets are an error: the exchange of each with each is computed. */
enum { BST_INTERREFLECTION_FACETS = 1000 };

/* Form factors of a pose, computed anew when its joints have moved; work memory of one thread. */
typedef struct bst_interreflection bst_interreflection;

/* Checks that a model has no more facets. BST_ERR_CONFIG. */
bst_status bst_interreflection_check(bst_ctx *ctx, const bst_satellite *satellite) BST_MUST_CHECK;

/* Allocates the exchange between the facets of a model.
 *
 * Given:     satellite  outlives it
 * Returned:  *out  NULL on error
 * Errors:    bst_interreflection_check; BST_ERR_MEMORY
 * Ownership: free *out with bst_interreflection_free */
bst_status bst_interreflection_create(bst_ctx *ctx, const bst_satellite *satellite,
                                      bst_interreflection **out) BST_MUST_CHECK;
/* Frees an exchange; NULL is allowed. */
void bst_interreflection_free(bst_interreflection *interreflection);

/* Form factor from a facet to another one: the part of the diffuse light of the first that reaches
 * the second, past the parts of the model between them.
 *
 * Given:     pose  joints as bst_satellite_pose_set left them
 * Returned:  0 to 1
 * Notes:     a mean over points of the first facet of Lambert's formula for the second one. The
 *            points are the closer the nearer the facets are; a point sees all of the other facet
 *            or nothing, as it sees its middle.
 * Reference: Lambert, Photometria (1760), also Howell, A Catalog of Radiation Heat Transfer
 *            Configuration Factors, B-1 */
double bst_interreflection_factor(const bst_satellite_pose *pose, int from, int to);

/* Adds the sunlight of two reflections to a flux.
 *
 * Given:     pose   as bst_satellite_flux_at had it; its views are changed
 *            light  sun, observer
 * Returned:  *flux  sun and error are changed
 * Notes:     all reflectance counts as diffuse: exact for Lambertian surfaces, and for others in
 *            the mean over observers */
void bst_interreflection_add(bst_interreflection *interreflection, bst_satellite_pose *pose,
                             const bst_satellite_light *light, bst_satellite_flux *flux);

#endif
