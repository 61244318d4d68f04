/* Messages of a WebSocket client, read from its connection with bounds of size and time. The HTTP
 * library takes up to 2 GB into memory before it hands a frame over, and waits for the rest of a
 * frame as long as the client sends something; so its connection is read here after the handshake.
 *
 * Reference: RFC 6455 (2011), sections 5.2 to 5.5 and 7.4 */
#ifndef BST_VIEW_SOCKET_FRAMES_H
#define BST_VIEW_SOCKET_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Longest content of a frame that is taken, and of the head before it, bytes. */
enum { BST_VIEW_CONTENT_BYTES = 8192, BST_VIEW_HEAD_BYTES = 14 };

typedef enum bst_view_opcode {
    BST_VIEW_TEXT = 1,
    BST_VIEW_BINARY = 2,
    BST_VIEW_CLOSE = 8,
    BST_VIEW_PING = 9,
    BST_VIEW_PONG = 10,
} bst_view_opcode;

/* Why a connection is closed (RFC 6455, section 7.4.1); 0: it is not. */
typedef enum bst_view_close_code {
    BST_VIEW_CLOSE_NOT = 0,
    BST_VIEW_CLOSE_NORMAL = 1000,
    BST_VIEW_CLOSE_MALFORMED = 1002,
    BST_VIEW_CLOSE_UNSUPPORTED = 1003,
    BST_VIEW_CLOSE_TOO_BIG = 1009,
} bst_view_close_code;

/* A frame at the beginning of what a client has sent. */
typedef struct bst_view_frame_head {
    int opcode;
    size_t head_bytes, content_bytes;
    unsigned char mask[4];
    bool complete;             /* its content is there, too */
    bst_view_close_code close; /* not 0: the client must not send this */
} bst_view_frame_head;

/* Reads the head of the frame at the beginning of `bytes` bytes. A frame that is too long, not
 * masked, in fragments, or neither text nor control is refused as soon as its head says so.
 *
 * Returned:  head_bytes 0 and close 0: the head is not complete */
bst_view_frame_head bst_view_read_head(const unsigned char *data, size_t bytes);
/* Takes the mask off the content of a frame, in place. */
void bst_view_unmask(const bst_view_frame_head *head, unsigned char *content);
/* Writes the head of a frame that is sent.
 *
 * Returned:  bytes of the head */
size_t bst_view_write_head(int opcode, size_t content_bytes, unsigned char out[10]);

/* The socket of a connection that this process has accepted, by the peer's address.
 *
 * Given:     peer_port, own_port  TCP ports of 127.0.0.1
 * Returned:  its file descriptor, which stays that of the library; -1: none */
int bst_view_find_socket(int peer_port, int own_port);

/* A client's connection. */
typedef struct bst_view_peer {
    int fd;
    const bool *stopped; /* atomic: the server ends */
    double first_s;      /* longest wait for the first frame, s */
    double idle_s;       /* longest wait for a further frame, s */
    double frame_s;      /* longest time from the first byte of a frame to its last, s */
    double send_s;       /* longest time to send, s, */
    double least_rate;   /* and for each byte more, bytes/s */
    unsigned char held[BST_VIEW_HEAD_BYTES + BST_VIEW_CONTENT_BYTES];
    char content[BST_VIEW_CONTENT_BYTES]; /* of the last frame */
    size_t bytes;                         /* that are held */
    double begun;                         /* wall time of the first of them */
    bool spoken;                          /* a frame has come */
} bst_view_peer;

/* Waits for the next text of a client; answers pings meanwhile.
 *
 * Returned:  *text   it, [*bytes], until the next call
 *            false: the connection has ended; a close frame is sent if the peer takes it */
bool bst_view_next_text(bst_view_peer *peer, const char **text, size_t *bytes);
/* Sends a frame. False: the peer is gone, takes nothing, or takes it too slowly. */
bool bst_view_send_frame(bst_view_peer *peer, int opcode, const void *content, size_t bytes);

#endif
