/* Error messages of FITS frame files. */
#include <errno.h>
#include <string.h>

#include "sim/io/fits_internal.h"

bst_status bst_fits_check(bst_ctx *ctx, const bst_fits *fits, int code, const char *what) {
    if (code == 0) {
        return BST_OK;
    }
    int error = errno;
    char reason[FLEN_STATUS];
    fits_get_errstatus(code, reason);
    fits_clear_errmsg();
    return bst_fail(ctx, BST_ERR_IO, "%s: %s: %s%s%s%s", fits->path, what, reason,
                    error ? " (" : "", error ? strerror(error) : "", error ? ")" : "");
}

bst_status bst_fits_fail_errno(bst_ctx *ctx, const bst_fits *fits, const char *what) {
    return bst_fail(ctx, BST_ERR_IO, "%s: %s: %s", fits->path, what, strerror(errno));
}
