#include <signal.h>
#include <stddef.h>

#include "sim/app/app.h"
#include "view/attach.h"
#include "view/page_export.h"

int main(int argc, char **argv) {
    static const bst_app_command more[] = {
        {"view", bst_cmd_view, "look at a run in the browser"},
        {"bench", bst_cmd_bench, "measure speed and error"},
        {"version", bst_cmd_version, "versions of the program, its libraries and the machine"},
        {NULL, NULL, NULL},
    };
    static const bst_app_viewer viewer = {bst_view_attach, bst_view_attached_steering,
                                          bst_view_detach, bst_view_page_export};
    bst_app_page = &viewer;
    signal(SIGXFSZ, SIG_IGN); /* a write beyond a limit on file sizes then returns an error */
    return bst_app_run(argc, argv, more);
}
