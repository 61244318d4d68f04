#define _GNU_SOURCE /* SOCK_CLOEXEC */
#include "sim/link/ipc_socket.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

enum { BACKLOG = 100 };

static int new_socket(void) {
    return socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

/* Opens and locks the folder of the socket, so that only one program replaces a dead socket. -1
 * with errno. */
static int lock_folder(const char *path) {
    char folder[108];
    const char *slash = strrchr(path, '/');
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path) : 1, slash ? path : ".");
    int fd = open(*folder ? folder : "/", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    while (fd >= 0 && flock(fd, LOCK_EX) != 0 && errno == EINTR) {
    }
    return fd;
}

/* Frees the address: removes a dead socket of this user. */
static bst_status remove_dead_socket(bst_ctx *ctx, const struct sockaddr_un *address) {
    struct stat info;
    if (lstat(address->sun_path, &info) != 0) {
        return errno == ENOENT ? BST_OK
                               : bst_fail(ctx, BST_ERR_IO, "link: ipc://%s: %s", address->sun_path,
                                          strerror(errno));
    }
    if (!S_ISSOCK(info.st_mode)) {
        return bst_fail(ctx, BST_ERR_IO,
                        "link: ipc://%s: a file that is no socket is there, and is left alone; "
                        "choose another path, or remove it",
                        address->sun_path);
    }
    if (info.st_uid != geteuid()) {
        return bst_fail(ctx, BST_ERR_IO,
                        "link: ipc://%s: the socket there is another user's; choose a path in a "
                        "folder of your own",
                        address->sun_path);
    }
    int fd = new_socket();
    if (fd < 0) {
        return bst_fail(ctx, BST_ERR_IO, "link: no socket: %s", strerror(errno));
    }
    bool dead = connect(fd, (const struct sockaddr *)address, sizeof *address) != 0 &&
                errno == ECONNREFUSED;
    close(fd);
    if (!dead) {
        return bst_fail(ctx, BST_ERR_IO,
                        "link: ipc://%s: another program listens there; choose another path",
                        address->sun_path);
    }
    return unlink(address->sun_path) == 0
               ? BST_OK
               : bst_fail(ctx, BST_ERR_IO, "link: ipc://%s: the dead socket cannot be removed: %s",
                          address->sun_path, strerror(errno));
}

static bst_status listen_at(bst_ctx *ctx, const struct sockaddr_un *address, bst_ipc_socket *out) {
    struct stat info;
    /* the mode before binding becomes the mode of the file */
    if (fchmod(out->fd, 0600) == 0 &&
        bind(out->fd, (const struct sockaddr *)address, sizeof *address) == 0 &&
        lstat(address->sun_path, &info) == 0 && listen(out->fd, BACKLOG) == 0) {
        out->device = info.st_dev;
        out->inode = info.st_ino;
        out->made = info.st_mtim;
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_IO, "link: ipc://%s: cannot be made: %s", address->sun_path,
                    strerror(errno));
}

bst_status bst_ipc_socket_open(bst_ctx *ctx, const char *path, bst_ipc_socket *out) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    *out = (bst_ipc_socket){.fd = -1};
    if (strlen(path) >= sizeof address.sun_path) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "link: ipc://%.200s: the path is too long (allowed: 107 bytes)", path);
    }
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    snprintf(out->path, sizeof out->path, "%s", path);
    int lock = lock_folder(path);
    if (lock < 0) {
        return bst_fail(ctx, BST_ERR_IO, "link: ipc://%s: its folder cannot be opened: %s", path,
                        strerror(errno));
    }
    bst_status status = remove_dead_socket(ctx, &address);
    if (status == BST_OK && (out->fd = new_socket()) < 0) {
        status = bst_fail(ctx, BST_ERR_IO, "link: no socket: %s", strerror(errno));
    }
    if (status == BST_OK) {
        status = listen_at(ctx, &address, out);
    }
    if (status != BST_OK && out->fd >= 0) {
        close(out->fd);
        out->fd = -1;
    }
    close(lock);
    return status;
}

void bst_ipc_socket_remove(const bst_ipc_socket *s) {
    struct stat info;
    if (*s->path && lstat(s->path, &info) == 0 && info.st_dev == s->device &&
        info.st_ino == s->inode && info.st_mtim.tv_sec == s->made.tv_sec &&
        info.st_mtim.tv_nsec == s->made.tv_nsec) {
        unlink(s->path);
    }
}
