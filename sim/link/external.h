/* Modules of type "external": a peer program on the link replaces imgproc, tracker or control. */
#ifndef BST_LINK_EXTERNAL_H
#define BST_LINK_EXTERNAL_H

#include "boresight/module.h"
#include "sim/link/link.h"
#include "sim/link/wire.h"

extern const bst_module_desc bst_external_imgproc_module;
extern const bst_module_desc bst_external_tracker_module;
extern const bst_module_desc bst_external_control_module;

/* Link message type of a channel; BST_LINK_TYPES: none. */
bst_link_type bst_external_type(const char *channel);
/* True if a role has a module of type "external". */
bool bst_external_role(const char *role);
/* True if `boresight serve` can play a role: imgproc, tracker or control. */
bool bst_external_serves(const char *role);

/* ---- for modules of this type ---- */

/* Description of the sensor for the peer: onboard knowledge. */
bst_link_part bst_external_describe(const bst_module_env *env, const char *role);
/* Fills a frame as an input of a step: *payload and the input. The pixels stay mapped until
 * bst_frame_unmap(message->frame). */
bst_status bst_external_frame(bst_ctx *ctx, const bst_frame_message *message, int64_t tick,
                              bst_link_frame *payload, bst_link_input *input) BST_MUST_CHECK;
/* Passes counters and notes of the link to the run. */
void bst_external_tell(bst_link *link, struct bst_step *step);

#endif
