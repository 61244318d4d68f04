#include "view/space_scene.h"

#include <stdlib.h>

#include "view/recorded_run_internal.h"
#include "view/space.h"

/* Latest time that is asked for, s: the longest duration of a scenario. */
static const double LATEST_S = 1e9;

/* World of a run; made at its first use. Call it with the lock held. */
static bst_status open_scene(bst_ctx *ctx, bst_view_run *run) {
    if (run->scene) {
        return BST_OK;
    }
    bst_run_scene *scene = calloc(1, sizeof *scene);
    if (!scene) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for the world of the run");
    }
    bst_status status = bst_run_scene_open(ctx, run->reader, scene);
    scene->run = NULL; /* is closed between calls while the run is in progress */
    if (status != BST_OK) {
        bst_run_scene_close(scene);
        free(scene);
        return status;
    }
    run->scene = scene;
    return BST_OK;
}

void bst_view_space_forget(bst_view_run *run) {
    pthread_mutex_lock(&run->lock);
    if (run->scene) {
        bst_run_scene_close(run->scene);
        free(run->scene);
        run->scene = NULL;
    }
    pthread_mutex_unlock(&run->lock);
}

bst_status bst_view_with_scene(bst_ctx *ctx, bst_view_exchange *x,
                               bst_status (*answer)(bst_ctx *, bst_view_run *,
                                                    bst_view_exchange *)) {
    bst_view_run *run;
    BST_TRY(bst_view_subject_run(ctx, x->subject, x->run, &run));
    bst_status status = bst_view_lock(ctx, run);
    status = status == BST_OK ? open_scene(ctx, run) : status;
    status = status == BST_OK ? answer(ctx, run, x) : status;
    bst_view_unlock(run);
    return status;
}

bst_status bst_view_space_check_time(bst_ctx *ctx, double from_s) {
    return from_s >= 0.0 && from_s <= LATEST_S
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT, "from: %g s is before or long after the run",
                          from_s);
}
