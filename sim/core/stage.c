#include "boresight/stage.h"

#include <assert.h>

bst_status bst_stage_archive(bst_archive *archive, const char *plugin,
                             bst_status (*function)(void *self, bst_archive *archive), void *self) {
    assert(archive && plugin);
    bst_ctx *ctx = bst_archive_ctx(archive);
    if (!function) {
        return bst_fail(ctx, BST_ERR_STATE,
                        "plug-in %s: its state cannot be saved, because its stage has no function "
                        "archive (boresight/stages.h); add one, or leave the plug-in out",
                        plugin);
    }
    bst_status status = function(self, archive);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "plug-in %s", plugin);
}
