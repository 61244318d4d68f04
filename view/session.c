#include "view/session.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "sim/cli/stop_signals.h"
#include "sim/core/folder.h"
#include "view/browser.h"
#include "view/read_ahead.h"
#include "view/server.h"
#include "view/study_view.h"

/* Prints the address and opens a browser there. */
static void announce(const bst_view_session *r, const char *url) {
    printf("%s\nCtrl-C ends it.\n", url);
    fflush(stdout);
    if (!r->no_browser) {
        bst_view_open_browser(url);
    }
}

static void wait_for_stop(void) {
    while (!bst_stop_requested()) {
        nanosleep(&(struct timespec){.tv_nsec = 200000000}, NULL);
    }
}

/* Opens the folder of a run or a study. */
static bst_status open_folder(bst_ctx *ctx, bst_view_subject *subject, const char *folder) {
    int64_t number;
    return bst_view_is_study(folder) ? bst_view_subject_set_study(ctx, subject, folder)
                                     : bst_view_subject_open(ctx, subject, folder, &number);
}

/* Serves recorded runs until a signal asks for the end. */
static bst_status serve_run(bst_ctx *ctx, const bst_view_session *r, bst_view_subject *subject,
                            const char *folder) {
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES];
    const char *const folders[] = {folder, r->other};
    for (int i = 0; i < 2; i++) {
        if (folders[i]) {
            BST_TRY(open_folder(ctx, subject, folders[i]));
        }
    }
    bst_view_run *run;
    bst_ctx ignored = {0};
    bst_view_ahead *ahead = bst_view_subject_run(&ignored, subject, 0, &run) == BST_OK
                                ? bst_view_ahead_start(run)
                                : NULL;
    bst_status status = bst_view_server_start(ctx, subject, NULL, (int)r->port, url, &server);
    if (status == BST_OK) {
        announce(r, url);
        wait_for_stop();
    }
    bst_view_ahead_stop(ahead);
    if (status == BST_OK) {
        bst_view_server_stop(server);
    }
    return status;
}

/* A folder in runs/ that does not exist yet. Its .partial folder is made, empty, so that no other
 * process chooses it; the run takes its place. */
static bst_status choose_folder(bst_ctx *ctx, const bst_scenario *scenario, char out[160],
                                char partial[200]) {
    struct stat found;
    BST_TRY(bst_folder_make(ctx, "runs"));
    for (int number = 1;; number++) {
        if (number == 1) {
            snprintf(out, 160, "runs/%s-live", scenario->name);
        } else {
            snprintf(out, 160, "runs/%s-live-%d", scenario->name, number);
        }
        snprintf(partial, 200, "%.160s.partial", out);
        if (mkdir(partial, 0777) == 0) {
            if (stat(out, &found) != 0) {
                return BST_OK;
            }
            rmdir(partial);
        } else if (errno != EEXIST) {
            return bst_fail(ctx, BST_ERR_IO, "%s: cannot be created: %s", partial, strerror(errno));
        }
    }
}

/* A page whose address is not printed yet. */
typedef struct waiting_page {
    const bst_view_session *session;
    char url[BST_VIEW_URL_BYTES];
} waiting_page;

static void announce_page(void *user) {
    const waiting_page *page = user;
    announce(page->session, page->url);
}

/* Runs a scenario into a folder, steered from the page. */
static bst_status go_live_in(bst_ctx *ctx, const bst_view_session *r, bst_run_parts *parts,
                             bst_view_subject *subject, const char *out) {
    bst_view_live *live;
    bst_view_server *server;
    waiting_page page = {.session = r};
    BST_TRY(bst_view_live_create(ctx, parts, subject, out, &live));
    bst_status status = bst_view_server_start(ctx, subject, live, (int)r->port, page.url, &server);
    if (status == BST_OK) {
        status = bst_view_live_go(ctx, live, r->overwrite, announce_page, &page);
        bst_view_server_stop(server);
    }
    bst_view_live_free(live);
    return status;
}

/* Runs a scenario that is read, steered from the page. */
static bst_status go_live(bst_ctx *ctx, const bst_view_session *r, bst_run_parts *parts,
                          bst_view_subject *subject) {
    char out[160], partial[200];
    if (r->out) {
        return go_live_in(ctx, r, parts, subject, r->out);
    }
    BST_TRY(choose_folder(ctx, bst_run_parts_scenario(parts), out, partial));
    bst_status status = go_live_in(ctx, r, parts, subject, out);
    if (status != BST_OK) {
        rmdir(partial); /* if no run has filled it */
    }
    return status;
}

static bst_status serve_live(bst_ctx *ctx, const bst_view_session *r, bst_view_subject *subject,
                             const char *scenario) {
    const bst_simulation_options options = {
        .device = r->device, .threads = (int)r->threads, .parallel = true};
    bst_run_parts *parts;
    BST_TRY(bst_run_parts_open(ctx, scenario, &r->load, &options, r->check, &parts));
    bst_status status = go_live(ctx, r, parts, subject);
    bst_run_parts_free(parts);
    return status;
}

bst_status bst_view_serve(bst_ctx *ctx, const bst_view_session *r, const char *path) {
    bst_view_subject *subject;
    struct stat found;
    BST_TRY(bst_view_subject_create(ctx, &subject));
    bst_stop_catch_signals();
    const bool scenario = path && stat(path, &found) == 0 && S_ISREG(found.st_mode);
    bst_status status =
        scenario ? serve_live(ctx, r, subject, path) : serve_run(ctx, r, subject, path);
    bst_view_subject_free(subject);
    return status;
}
