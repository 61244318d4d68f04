#include "view/browser.h"

#include <fcntl.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

void bst_view_open_browser(const char *url) {
    const char *display = getenv("DISPLAY"), *wayland = getenv("WAYLAND_DISPLAY");
    if (!(display && *display) && !(wayland && *wayland)) {
        return;
    }
    char program[] = "xdg-open", *words[] = {program, (char *)url, NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t own_group; /* Ctrl-C shall end the viewer, not the browser */
    pid_t child;
    if (posix_spawn_file_actions_init(&files) != 0) {
        return;
    }
    if (posix_spawnattr_init(&own_group) != 0) {
        posix_spawn_file_actions_destroy(&files);
        return;
    }
    posix_spawnattr_setflags(&own_group, POSIX_SPAWN_SETPGROUP);
    for (int fd = 0; fd < 3; fd++) {
        posix_spawn_file_actions_addopen(&files, fd, "/dev/null", fd ? O_WRONLY : O_RDONLY, 0);
    }
    /* the child stays until the viewer ends: xdg-open may be the browser itself */
    if (posix_spawnp(&child, program, &files, &own_group, words, environ) == 0) {
        waitpid(child, NULL, WNOHANG);
    }
    posix_spawnattr_destroy(&own_group);
    posix_spawn_file_actions_destroy(&files);
}
