/* Limits the bytes that TCP peers have sent and the link has not read. ZeroMQ limits each message
 * part, but not the number of parts; it buffers them until the last one arrives. */
#include <errno.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "sim/core/wall_clock.h"
#include "sim/link/link_internal.h"

/* seconds between checks of the connections */
static const double LOOK_S = 0.005;

static link_flow *find(bst_link *link, int fd) {
    for (int i = 0; i < link->flow_count; i++) {
        if (link->flows[i].fd == fd) {
            return &link->flows[i];
        }
    }
    return NULL;
}

/* Closes a TCP connection without lingering: the peer gets a reset at once and does not wait. */
static void cut(int fd) {
    const struct linger none = {.l_onoff = 1, .l_linger = 0};
    (void)setsockopt(fd, SOL_SOCKET, SO_LINGER, &none, sizeof none);
    (void)shutdown(fd, SHUT_RDWR);
}

bool bst_link_flow_watched(const bst_link *link) {
    return link->flow_count > 0;
}

void bst_link_flow_open(bst_link *link, int fd) {
    /* with CURVE peers are authenticated, and the length on the wire differs */
    if (strncmp(link->address, "tcp://", 6) != 0 || link->asker || fd < 0) {
        return;
    }
    link_flow *flow = find(link, fd);
    if (!flow && link->flow_count == LINK_FLOWS) {
        cut(fd);
        return;
    }
    flow = flow ? flow : &link->flows[link->flow_count++];
    *flow = (link_flow){.fd = fd};
}

void bst_link_flow_close(bst_link *link, int fd) {
    link_flow *flow = find(link, fd);
    if (flow) {
        *flow = link->flows[--link->flow_count];
    }
}

void bst_link_flow_take(bst_link *link, zmq_msg_t *part) {
    link_flow *flow = link->flow_count > 0 ? find(link, zmq_msg_get(part, ZMQ_SRCFD)) : NULL;
    if (flow) {
        size_t bytes = zmq_msg_size(part);
        flow->taken += (int64_t)bytes + (bytes < 256 ? 2 : 9); /* ZMTP 3.1: flags and length */
    }
}

/* Bytes received on a connection and not yet read by the link; -1: the connection is closed. */
static int64_t waiting(const bst_link *link, const link_flow *flow) {
    struct tcp_info info = {0};
    struct sockaddr_storage own = {0};
    socklen_t bytes = sizeof info, own_bytes = sizeof own;
    long port = strtol(strrchr(link->address, ':') + 1, NULL, 10);
    if (getsockopt(flow->fd, IPPROTO_TCP, TCP_INFO, &info, &bytes) != 0 ||
        getsockname(flow->fd, (struct sockaddr *)&own, &own_bytes) != 0) {
        return -1;
    }
    in_port_t found = own.ss_family == AF_INET6
                          ? ((const struct sockaddr_in6 *)(const void *)&own)->sin6_port
                          : ((const struct sockaddr_in *)(const void *)&own)->sin_port;
    return ntohs(found) == port ? (int64_t)info.tcpi_bytes_received - flow->taken : -1;
}

void bst_link_flow_check(bst_link *link, bst_ctx *ctx) {
    double now = bst_wall_seconds();
    if (link->flow_count == 0 || now - link->flow_looked < LOOK_S) {
        return;
    }
    link->flow_looked = now;
    int64_t all = 0, most = 0;
    int worst = -1;
    for (int i = 0; i < link->flow_count; i++) {
        int64_t bytes = waiting(link, &link->flows[i]);
        if (bytes < 0) {
            link->flows[i--] = link->flows[--link->flow_count];
            continue;
        }
        all += bytes;
        if (bytes > most) {
            most = bytes;
            worst = i;
        }
    }
    if (worst >= 0 && (most > LINK_WAITING_BYTES || all > LINK_WAITING_ALL)) {
        bst_link_event(link, ctx, LINK_OVERSIZED,
                       "a peer with %lld MiB that are not taken is disconnected (allowed: %d of a "
                       "peer, %d of all)",
                       (long long)(most >> 20), LINK_WAITING_BYTES >> 20, LINK_WAITING_ALL >> 20);
        cut(link->flows[worst].fd);
        bst_link_flow_close(link, link->flows[worst].fd);
    }
}
