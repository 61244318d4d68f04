/* Modules of type "external": parts that a peer of the link plays. */
#ifndef BST_LINK_EXTERNAL_H
#define BST_LINK_EXTERNAL_H

#include "boresight/module.h"
#include "sim/link/link.h"
#include "sim/link/wire.h"

extern const bst_module_desc bst_external_imgproc_module;
extern const bst_module_desc bst_external_tracker_module;
extern const bst_module_desc bst_external_control_module;

/* The message of a channel; BST_LINK_TYPES where the link has none. */
bst_link_type bst_external_type(const char *channel);
/* True if a role has a module of type "external". */
bool bst_external_role(const char *role);
/* True if `boresight serve` can play a role: imgproc, tracker or control. */
bool bst_external_serves(const char *role);

/* ---- for modules of this type ---- */

/* What the peer is told about the sensor: what is known on board. */
bst_link_part bst_external_describe(const bst_module_env *env, const char *role);
/* A frame as an input of a step: *payload and the input are filled; the pixels are mapped until
 * bst_frame_unmap(message->frame). */
bst_status bst_external_frame(bst_ctx *ctx, const bst_frame_message *message, int64_t tick,
                              bst_link_frame *payload, bst_link_input *input) BST_MUST_CHECK;
/* What the link has counted and noted, into the run. */
void bst_external_tell(bst_link *link, struct bst_step *step);

#endif
