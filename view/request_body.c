#include "view/request_body.h"

#include <stdbool.h>
#include <stdlib.h>

#include "sim/core/wall_clock.h"
#include "view/request_guard.h"

/* Bodies longer than this have places of their own, bytes: texts of the editor go on beside files
 * that are dropped onto it. */
static const int64_t SMALL_BYTES = 256 << 10;
/* Bodies that are read at a time: small, large. */
static const int READING_MOST[2] = {8, 2};
/* Time that any body has, s, and the least rate after it, bytes/s. */
static const double FREE_S = 5.0;
static const double LEAST_RATE = 32768.0;
/* mg_read waits until all that it is asked for has come, as long as something comes: it is asked
 * for little, and for single bytes from a slow peer, so that the time can be looked at. */
enum { PIECE_BYTES = 256 };
static const double SLOW_PIECE_S = 0.02;

/* Takes a place. False: there is none. */
static bool begin_reading(bst_view_bodies *bodies, bool large) {
    pthread_mutex_lock(&bodies->lock);
    const bool room = bodies->reading[large] < READING_MOST[large];
    bodies->reading[large] += room;
    pthread_mutex_unlock(&bodies->lock);
    return room;
}

static void end_reading(bst_view_bodies *bodies, bool large) {
    pthread_mutex_lock(&bodies->lock);
    bodies->reading[large]--;
    pthread_mutex_unlock(&bodies->lock);
}

/* True once all has come. */
static bool read_all(struct mg_connection *peer, int64_t bytes, char *body) {
    const double begin = bst_wall_seconds();
    double before = begin;
    int64_t piece = 1;
    for (int64_t got = 0; got < bytes;) {
        const int n =
            mg_read(peer, body + got, (size_t)(piece < bytes - got ? piece : bytes - got));
        if (n <= 0) {
            return false;
        }
        got += n;
        const double now = bst_wall_seconds();
        if (now - begin > FREE_S + (double)got / LEAST_RATE) {
            return false;
        }
        piece = now - before > SLOW_PIECE_S ? 1 : 2 * piece < PIECE_BYTES ? 2 * piece : PIECE_BYTES;
        before = now;
    }
    return true;
}

int bst_view_read_body(bst_view_bodies *bodies, struct mg_connection *peer, int64_t bytes,
                       char **body) {
    const bool large = bytes > SMALL_BYTES;
    *body = NULL;
    if (bytes < 0) {
        return BST_HTTP_BAD_REQUEST;
    }
    if (!begin_reading(bodies, large)) {
        return BST_HTTP_BUSY;
    }
    char *text = malloc((size_t)bytes + 1);
    const bool whole = text && read_all(peer, bytes, text);
    end_reading(bodies, large);
    if (!whole) {
        const int status = text ? BST_HTTP_TIMEOUT : BST_HTTP_FAILED;
        free(text);
        return status;
    }
    text[bytes] = '\0';
    *body = text;
    return BST_HTTP_OK;
}
