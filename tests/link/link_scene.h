/* A link with one part, and peers that are not as they should be. */
#ifndef BST_TESTS_LINK_LINK_SCENE_H
#define BST_TESTS_LINK_LINK_SCENE_H

#include "tests/test_support.h"

#include <pthread.h>

#include "sim/link/link.h"

enum { SCENE_WIDTH = 64, SCENE_HEIGHT = 48, SCENE_PIXELS = SCENE_WIDTH * SCENE_HEIGHT };

typedef struct link_scene {
    char folder[BST_TEST_PATH], address[128];
    bst_ctx ctx;
    bst_link *link;
    int part;
    uint16_t pixels[SCENE_PIXELS];
    /* of the latest exchange */
    struct {
        bst_detections head;
        bst_detection items[4];
    } detections;
    bool given, answered;
    int dropped;
    int64_t frames; /* so far */
    pthread_t peer;
    bool has_peer;
} link_scene;

/* `tcp`: over a port of the loopback, else a socket in a folder of its own. Times out after
 * timeout_s. */
void scene_open(link_scene *scene, bool tcp, double timeout_s, bst_link_silence on_timeout,
                bool shared_memory);
void scene_close(link_scene *scene);
/* Starts a peer in a thread of its own; scene_join waits for its end. */
void scene_start(link_scene *scene, void *(*play)(void *scene));
void scene_join(link_scene *scene);
/* One step: a frame out, detections in. */
bst_status scene_step(link_scene *scene);
int64_t scene_count(const link_scene *scene, const char *counter);

/* A peer that writes its bytes itself. */
typedef struct raw_peer {
    void *context, *socket;
    int64_t sequence;
    bst_link_header step; /* of the latest `step` that came */
} raw_peer;

void raw_open(raw_peer *raw, const char *address, const char *serves);
void raw_close(raw_peer *raw);
/* Reads until a message of the type has come; false after timeout_s, or when the run has ended.
 * *error (may be NULL): its content, where the type is `error`. */
bool raw_await(raw_peer *raw, bst_link_type type, double timeout_s, bst_link_error *error);
/* The header and the payload of an answer to the latest step, ready to be spoilt. */
typedef struct raw_message {
    bst_link_header header;
    char text[BST_LINK_HEADER_BYTES];
    size_t text_bytes;
    uint8_t payload[2048];
    size_t payload_bytes;
} raw_message;
void raw_make(const raw_peer *raw, raw_message *m, bst_link_type type, const void *payload);
/* Writes the header anew, with the payload's right length and checksum. */
void raw_seal(raw_message *m);
void raw_send(raw_peer *raw, const raw_message *m);
/* The right answer to the latest step: detections with one item, and done. */
void raw_answer(raw_peer *raw);
/* Detections with `count` <= 4 items for a test's own use. */
void raw_detections(void *detections, int count);

#endif
