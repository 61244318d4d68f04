#include "view/socket_frames.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/uio.h>

#include "sim/core/wall_clock.h"

/* Longest content of a control frame, bytes (RFC 6455, section 5.5). */
enum { CONTROL_MOST = 125 };
/* Time between two looks at whether the server ends, ms. */
enum { LOOK_MS = 200 };
/* Largest number of a file descriptor that is looked at: the server has some 200 connections. */
enum { DESCRIPTOR_MOST = 65535 };

/* ------------------------------------------------------------------ frames */

bst_view_frame_head bst_view_read_head(const unsigned char *data, size_t bytes) {
    bst_view_frame_head head = {.opcode = 0};
    if (bytes < 2) {
        return head;
    }
    const bool final = data[0] & 0x80, reserved = data[0] & 0x70, masked = data[1] & 0x80;
    const int opcode = data[0] & 0x0f;
    const bool control = opcode >= BST_VIEW_CLOSE && opcode <= BST_VIEW_PONG;
    const size_t extra = (data[1] & 0x7f) == 127 ? 8 : (data[1] & 0x7f) == 126 ? 2 : 0;
    uint64_t length = data[1] & 0x7f;
    head.opcode = opcode;
    if (reserved || !masked || (control && (!final || length > CONTROL_MOST))) {
        head.close = BST_VIEW_CLOSE_MALFORMED;
    } else if (!control && (opcode != BST_VIEW_TEXT || !final)) {
        head.close = BST_VIEW_CLOSE_UNSUPPORTED;
    }
    if (head.close != BST_VIEW_CLOSE_NOT || bytes < 2 + extra) {
        return head;
    }
    length = extra > 0 ? 0 : length;
    for (size_t i = 0; i < extra; i++) {
        length = length << 8 | data[2 + i];
    }
    if (length > BST_VIEW_CONTENT_BYTES) {
        head.close = BST_VIEW_CLOSE_TOO_BIG;
        return head;
    }
    if (bytes < 2 + extra + sizeof head.mask) {
        return head;
    }
    memcpy(head.mask, data + 2 + extra, sizeof head.mask);
    head.head_bytes = 2 + extra + sizeof head.mask;
    head.content_bytes = (size_t)length;
    head.complete = bytes - head.head_bytes >= head.content_bytes;
    return head;
}

void bst_view_unmask(const bst_view_frame_head *head, unsigned char *content) {
    for (size_t i = 0; i < head->content_bytes; i++) {
        content[i] ^= head->mask[i % sizeof head->mask];
    }
}

size_t bst_view_write_head(int opcode, size_t content_bytes, unsigned char out[10]) {
    const size_t extra = content_bytes > 0xffff ? 8 : content_bytes > CONTROL_MOST ? 2 : 0;
    out[0] = (unsigned char)(0x80 | opcode);
    out[1] = (unsigned char)(extra == 8 ? 127 : extra == 2 ? 126 : content_bytes);
    for (size_t i = 0; i < extra; i++) {
        out[2 + i] = (unsigned char)((uint64_t)content_bytes >> 8 * (extra - 1 - i));
    }
    return 2 + extra;
}

/* ------------------------------------------------------------------ the connection */

/* True if one end of a socket is a port of 127.0.0.1. */
static bool is_at(const struct sockaddr_in *end, int port) {
    return end->sin_family == AF_INET && end->sin_addr.s_addr == htonl(INADDR_LOOPBACK) &&
           ntohs(end->sin_port) == port;
}

int bst_view_find_socket(int peer_port, int own_port) {
    /* no list of them is opened: that needs a descriptor, and there may be none left */
    struct rlimit most = {.rlim_cur = DESCRIPTOR_MOST};
    (void)getrlimit(RLIMIT_NOFILE, &most);
    for (int fd = 0; fd <= DESCRIPTOR_MOST && (rlim_t)fd < most.rlim_cur; fd++) {
        struct sockaddr_in peer = {.sin_family = AF_UNSPEC}, own = peer;
        socklen_t peer_bytes = sizeof peer, own_bytes = sizeof own;
        if (getpeername(fd, (struct sockaddr *)&peer, &peer_bytes) == 0 &&
            getsockname(fd, (struct sockaddr *)&own, &own_bytes) == 0 && is_at(&peer, peer_port) &&
            is_at(&own, own_port)) {
            return fd;
        }
    }
    return -1;
}

/* Waits until a connection is ready; true if it is. */
static bool wait_ready(const bst_view_peer *peer, short events, double until) {
    for (;;) {
        const double left_ms = 1e3 * (until - bst_wall_seconds());
        struct pollfd look = {.fd = peer->fd, .events = events};
        if (left_ms <= 0.0 || __atomic_load_n(peer->stopped, __ATOMIC_RELAXED)) {
            return false;
        }
        const int n = poll(&look, 1, left_ms < LOOK_MS ? 1 + (int)left_ms : LOOK_MS);
        if (n > 0) {
            return true;
        }
        if (n < 0 && errno != EINTR) {
            return false;
        }
    }
}

bool bst_view_send_frame(bst_view_peer *peer, int opcode, const void *content, size_t bytes) {
    unsigned char head[10];
    const size_t head_bytes = bst_view_write_head(opcode, bytes, head), all = head_bytes + bytes;
    const double begin = bst_wall_seconds();
    for (size_t sent = 0; sent < all;) {
        const size_t of_head = sent < head_bytes ? head_bytes - sent : 0;
        const size_t from = sent > head_bytes ? sent - head_bytes : 0;
        struct iovec parts[2] = {{head + head_bytes - of_head, of_head},
                                 {(char *)content + from, bytes - from}};
        const struct msghdr message = {.msg_iov = parts, .msg_iovlen = 2};
        const ssize_t n = sendmsg(peer->fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
        sent += n > 0 ? (size_t)n : 0;
        if (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR) {
            return false;
        }
        const double until = begin + peer->send_s + (double)sent / peer->least_rate;
        if (sent < all && !wait_ready(peer, POLLOUT, until)) {
            return false;
        }
    }
    return true;
}

/* Says why the connection ends. */
static void send_close(bst_view_peer *peer, bst_view_close_code code) {
    const unsigned char content[2] = {(unsigned char)(code >> 8), (unsigned char)code};
    peer->send_s = 0.0; /* at once or not at all */
    (void)bst_view_send_frame(peer, BST_VIEW_CLOSE, content, sizeof content);
}

/* Receives more of a frame. False: the connection has ended, or its time is over. */
static bool receive(bst_view_peer *peer) {
    const double wait_s = peer->bytes > 0 ? peer->frame_s
                          : peer->spoken  ? peer->idle_s
                                          : peer->first_s;
    if (peer->bytes == 0) {
        peer->begun = bst_wall_seconds();
    }
    if (!wait_ready(peer, POLLIN, peer->begun + wait_s)) {
        return false;
    }
    const ssize_t n =
        recv(peer->fd, peer->held + peer->bytes, sizeof peer->held - peer->bytes, MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
        return false;
    }
    if (peer->bytes == 0 && n > 0) { /* the time of a frame begins with its first byte */
        peer->begun = bst_wall_seconds();
    }
    peer->bytes += n > 0 ? (size_t)n : 0;
    return true;
}

/* Drops the first bytes that are held: those after them belong to another frame. */
static void drop(bst_view_peer *peer, size_t bytes) {
    peer->bytes -= bytes;
    memmove(peer->held, peer->held + bytes, peer->bytes);
    peer->begun = bst_wall_seconds();
    peer->spoken = true;
}

bool bst_view_next_text(bst_view_peer *peer, const char **text, size_t *bytes) {
    for (;;) {
        const bst_view_frame_head head = bst_view_read_head(peer->held, peer->bytes);
        unsigned char *content = peer->held + head.head_bytes;
        if (head.close != BST_VIEW_CLOSE_NOT) {
            send_close(peer, head.close);
            return false;
        }
        if (!head.complete) {
            if (!receive(peer)) {
                return false;
            }
            continue;
        }
        bst_view_unmask(&head, content);
        if (head.opcode == BST_VIEW_CLOSE) {
            send_close(peer, BST_VIEW_CLOSE_NORMAL);
            return false;
        }
        memcpy(peer->content, content, head.content_bytes);
        drop(peer, head.head_bytes + head.content_bytes);
        if (head.opcode == BST_VIEW_TEXT) {
            *text = peer->content;
            *bytes = head.content_bytes;
            return true;
        }
        if (head.opcode == BST_VIEW_PING &&
            !bst_view_send_frame(peer, BST_VIEW_PONG, peer->content, head.content_bytes)) {
            return false;
        }
    }
}
