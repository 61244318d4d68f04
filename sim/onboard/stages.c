#include "boresight/stages.h"

const char *const bst_stage_kinds[] = {BST_STAGE_DETECTOR, BST_STAGE_COMPENSATOR, BST_STAGE_FRAME,
                                       NULL};
