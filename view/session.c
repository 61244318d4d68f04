#include "view/session.h"

#include <stdio.h>
#include <sys/stat.h>
#include <time.h>

#include "sim/cli/stop_signals.h"
#include "view/browser.h"
#include "view/server.h"

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

/* Serves a recorded run until a signal asks for the end. */
static bst_status serve_run(bst_ctx *ctx, const bst_view_session *r, bst_view_subject *subject,
                            const char *folder) {
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES];
    int64_t number;
    if (folder) {
        BST_TRY(bst_view_subject_open(ctx, subject, folder, &number));
    }
    BST_TRY(bst_view_server_start(ctx, subject, NULL, (int)r->port, url, &server));
    announce(r, url);
    wait_for_stop();
    bst_view_server_stop(server);
    return BST_OK;
}

/* A folder in runs/ that does not exist yet. */
static void choose_folder(const bst_scenario *scenario, char *out, size_t bytes) {
    struct stat found;
    char partial[200];
    int number = 1;
    do {
        int length = snprintf(out, bytes, "runs/%s-live", scenario->name);
        if (number > 1 && length > 0 && (size_t)length < bytes) {
            snprintf(out + length, bytes - (size_t)length, "-%d", number);
        }
        snprintf(partial, sizeof partial, "%s.partial", out);
        number++;
    } while (stat(out, &found) == 0 || stat(partial, &found) == 0);
}

/* Runs a scenario that is read, steered from the page. */
static bst_status go_live(bst_ctx *ctx, const bst_view_session *r, bst_run_parts *parts,
                          bst_view_subject *subject) {
    bst_view_live *live;
    bst_view_server *server;
    char url[BST_VIEW_URL_BYTES], chosen[160];
    const char *out = r->out;
    if (!out) {
        choose_folder(bst_run_parts_scenario(parts), chosen, sizeof chosen);
        out = chosen;
    }
    BST_TRY(bst_view_live_create(ctx, parts, subject, out, &live));
    bst_status status = bst_view_server_start(ctx, subject, live, (int)r->port, url, &server);
    if (status == BST_OK) {
        announce(r, url);
        status = bst_view_live_go(ctx, live, r->overwrite);
        bst_view_server_stop(server);
    }
    bst_view_live_free(live);
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
