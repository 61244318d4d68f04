#include "sim/link/curve_keys.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include "sim/core/file.h"

enum { MOST_BYTES = 4096, KEY_BYTES = 32 };

static const char *const names[] = {"simulation_public", "simulation_secret", "peer_public",
                                    "peer_secret"};
enum { NAMES = sizeof names / sizeof *names };

static char *key_of(bst_curve_keys *keys, int i) {
    char *const all[NAMES] = {keys->simulation_public, keys->simulation_secret, keys->peer_public,
                              keys->peer_secret};
    return all[i];
}

static bst_status no_curve(bst_ctx *ctx) {
    return bst_fail(ctx, BST_ERR_STATE,
                    "link: this ZeroMQ is built without CURVE; use ipc://PATH in a folder of your "
                    "own, without keys");
}

bst_status bst_curve_keys_make(bst_ctx *ctx, const char *path) {
    bst_curve_keys keys;
    if (zmq_curve_keypair(keys.simulation_public, keys.simulation_secret) != 0 ||
        zmq_curve_keypair(keys.peer_public, keys.peer_secret) != 0) {
        return no_curve(ctx);
    }
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    FILE *file = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (!file) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", path, strerror(errno));
    }
    fputs("# Keys of Boresight's link: their holder may play parts of a run.\n", file);
    for (int i = 0; i < NAMES; i++) {
        fprintf(file, "%s %s\n", names[i], key_of(&keys, i));
    }
    bool good = fflush(file) == 0 && fsync(fd) == 0;
    int error = errno;
    if ((fclose(file) != 0 || !good)) {
        unlink(path);
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(error));
    }
    return BST_OK;
}

/* Reads one line of a key file: a comment, an empty line, or a key. */
static bst_status read_line(bst_ctx *ctx, const char *path, int number, const char *line,
                            bst_curve_keys *out) {
    uint8_t bytes[KEY_BYTES];
    if (!*line || *line == '#') {
        return BST_OK;
    }
    for (int i = 0; i < NAMES; i++) {
        size_t length = strlen(names[i]);
        if (strncmp(line, names[i], length) == 0 && line[length] == ' ' &&
            strlen(line + length + 1) == BST_CURVE_TEXT - 1 &&
            zmq_z85_decode(bytes, line + length + 1)) {
            memcpy(key_of(out, i), line + length + 1, BST_CURVE_TEXT);
            return BST_OK;
        }
    }
    return bst_fail(
        ctx, BST_ERR_FORMAT,
        "%s:%d: is no line of a file of keys (allowed: a name and 40 characters of Z85; "
        "make a file with boresight link-keys --out FILE)",
        path, number);
}

bst_status bst_curve_keys_read(bst_ctx *ctx, const char *path, bst_curve_keys *out) {
    char text[MOST_BYTES + 1] = "";
    int fd;
    uint64_t bytes;
    struct stat info;
    memset(out, 0, sizeof *out);
    BST_TRY(bst_file_open(ctx, path, MOST_BYTES, "a file of boresight link-keys", &fd, &bytes));
    bool known = fstat(fd, &info) == 0;
    ssize_t got = read(fd, text, MOST_BYTES);
    close(fd);
    if (!known || got < 0) {
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read: %s", path, strerror(errno));
    }
    if ((info.st_mode & 077) || (info.st_uid != geteuid() && info.st_uid != 0)) {
        return bst_fail(
            ctx, BST_ERR_ARGUMENT,
            "%s: others than this user can read or change it (found mode %04o; allowed: "
            "0600, and your own): chmod 600, and make new keys if they may be known",
            path, (unsigned)(info.st_mode & 07777));
    }
    int number = 0;
    for (char *line = text, *next; line && *line; line = next) {
        next = strchr(line, '\n');
        if (next) {
            *next++ = '\0';
        }
        BST_TRY(read_line(ctx, path, ++number, line, out));
    }
    for (int i = 0; i < NAMES; i++) {
        if (!*key_of(out, i)) {
            return bst_fail(ctx, BST_ERR_FORMAT, "%s: has no line %s", path, names[i]);
        }
    }
    return BST_OK;
}

static bool set_text(void *socket, int option, const char *text) {
    return zmq_setsockopt(socket, option, text, strlen(text)) == 0;
}

bst_status bst_curve_secure(bst_ctx *ctx, void *socket, const bst_curve_keys *keys,
                            bool simulation) {
    int server = 1;
    bool good = simulation
                    ? zmq_setsockopt(socket, ZMQ_CURVE_SERVER, &server, sizeof server) == 0 &&
                          set_text(socket, ZMQ_CURVE_SECRETKEY, keys->simulation_secret) &&
                          set_text(socket, ZMQ_ZAP_DOMAIN, "boresight")
                    : set_text(socket, ZMQ_CURVE_SERVERKEY, keys->simulation_public) &&
                          set_text(socket, ZMQ_CURVE_PUBLICKEY, keys->peer_public) &&
                          set_text(socket, ZMQ_CURVE_SECRETKEY, keys->peer_secret);
    return good ? BST_OK : no_curve(ctx);
}

void *bst_curve_asker(void *context) {
    void *asker = zmq_socket(context, ZMQ_REP);
    int linger_ms = 0;
    if (asker && (zmq_setsockopt(asker, ZMQ_LINGER, &linger_ms, sizeof linger_ms) != 0 ||
                  zmq_bind(asker, "inproc://zeromq.zap.01") != 0)) {
        int error = errno;
        zmq_close(asker);
        errno = error;
        return NULL;
    }
    return asker;
}

bool bst_curve_answer(void *asker, const bst_curve_keys *keys) {
    /* version, request, domain, address, identity, mechanism, key */
    enum { PARTS = 7 };
    uint8_t parts[PARTS][256], own[KEY_BYTES];
    int bytes[PARTS] = {0}, count = 0, more = 1;
    while (more) {
        uint8_t spare[256];
        size_t size = sizeof more;
        int n = zmq_recv(asker, count < PARTS ? parts[count] : spare, 256, ZMQ_DONTWAIT);
        if (n < 0 || zmq_getsockopt(asker, ZMQ_RCVMORE, &more, &size) != 0) {
            return false;
        }
        if (count < PARTS) {
            bytes[count] = n < 256 ? n : 256;
        }
        count++;
    }
    bool good = count == PARTS && bytes[5] == 5 && memcmp(parts[5], "CURVE", 5) == 0 &&
                bytes[6] == KEY_BYTES && zmq_z85_decode(own, keys->peer_public) &&
                memcmp(parts[6], own, KEY_BYTES) == 0;
    const char *const answers[] = {good ? "200" : "400", good ? "OK" : "not the peer's key", "",
                                   ""};
    (void)zmq_send(asker, "1.0", 3, ZMQ_SNDMORE);
    (void)zmq_send(asker, parts[1], (size_t)bytes[1], ZMQ_SNDMORE);
    for (int i = 0; i < 4; i++) {
        (void)zmq_send(asker, answers[i], strlen(answers[i]), i < 3 ? ZMQ_SNDMORE : 0);
    }
    return !good;
}
