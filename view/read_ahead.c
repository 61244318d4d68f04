#include "view/read_ahead.h"

#include <stdlib.h>
#include <time.h>

#include "view/recorded_run_internal.h"

/* The panels whose lines need the truth are read by one thread: its table is the longest. The other
 * thread reads the description and the other panels. */
enum { READERS = 2, TRUTH_PANELS = 3 };
/* Time between two attempts to interrupt a query, s. */
static const long INTERRUPT_NS = 5000000;

typedef struct ahead_reader {
    bst_view_ahead *ahead;
    pthread_t thread;
    bool started;
    int first, end;    /* panels */
    bst_view_run *own; /* of the thread; NULL: not open. With the lock of `ahead` */
    bool done;         /* with the lock of `ahead` */
} ahead_reader;

struct bst_view_ahead {
    bst_view_run *run;
    pthread_mutex_t lock;
    bool stopping; /* atomic */
    ahead_reader readers[READERS];
};

static void set_own(ahead_reader *reader, bst_view_run *own) {
    pthread_mutex_lock(&reader->ahead->lock);
    reader->own = own;
    pthread_mutex_unlock(&reader->ahead->lock);
}

/* Reads the panels of a thread with its own connection, and gives their lines to the run. What
 * cannot be read is read again at its request, which gets the message. */
static void read_panels(ahead_reader *reader) {
    bst_view_run *run = reader->ahead->run, *own;
    bst_ctx ignored = {0};
    bool opened = bst_view_run_open(&ignored, run->path, &own) == BST_OK;
    if (opened && own->running) { /* since it was opened for the page: its reader closes often */
        bst_view_run_close(own);
        opened = false;
    }
    set_own(reader, opened ? own : NULL);
    if (opened) {
        bst_view_take_looks(own, run, 0);
    }
    for (int panel = reader->first; panel < reader->end; panel++) {
        if (opened && !__atomic_load_n(&reader->ahead->stopping, __ATOMIC_RELAXED) &&
            bst_view_read_panel(&ignored, own, 0, panel) == BST_OK) {
            bst_view_take_lines(run, own, 0, panel);
        }
        bst_view_end_wait(run, panel);
    }
    set_own(reader, NULL);
    bst_view_run_close(opened ? own : NULL);
}

static void *read_ahead(void *user) {
    ahead_reader *reader = user;
    bst_ctx ignored = {0};
    cJSON *described;
    if (reader->end == BST_VIEW_PANELS && /* lists the exposures, and which panels there are */
        bst_view_run_describe(&ignored, reader->ahead->run, &described) == BST_OK) {
        cJSON_Delete(described);
    }
    read_panels(reader);
    pthread_mutex_lock(&reader->ahead->lock);
    reader->done = true;
    pthread_mutex_unlock(&reader->ahead->lock);
    return NULL;
}

bst_view_ahead *bst_view_ahead_start(bst_view_run *run) {
    static const int edges[READERS + 1] = {0, TRUTH_PANELS, BST_VIEW_PANELS};
    pthread_mutex_lock(&run->lock);
    const bool fits = !run->running && run->sensors > 0;
    pthread_mutex_unlock(&run->lock);
    bst_view_ahead *ahead = fits ? calloc(1, sizeof *ahead) : NULL;
    if (!ahead || pthread_mutex_init(&ahead->lock, NULL) != 0) {
        free(ahead);
        return NULL;
    }
    ahead->run = run;
    for (int i = 0; i < READERS; i++) {
        ahead_reader *reader = &ahead->readers[i];
        *reader = (ahead_reader){.ahead = ahead, .first = edges[i], .end = edges[i + 1]};
        bst_view_begin_wait(run, reader->first, reader->end);
        reader->started = pthread_create(&reader->thread, NULL, read_ahead, reader) == 0;
        for (int panel = reader->first; !reader->started && panel < reader->end; panel++) {
            bst_view_end_wait(run, panel);
        }
    }
    return ahead;
}

/* Interrupts the query of a thread. True: the thread is done. */
static bool interrupt(ahead_reader *reader) {
    pthread_mutex_lock(&reader->ahead->lock);
    const bool done = !reader->started || reader->done;
    if (!done && reader->own) {
        bst_run_reader_interrupt(reader->own->reader);
    }
    pthread_mutex_unlock(&reader->ahead->lock);
    return done;
}

void bst_view_ahead_stop(bst_view_ahead *ahead) {
    if (!ahead) {
        return;
    }
    __atomic_store_n(&ahead->stopping, true, __ATOMIC_RELAXED);
    for (int i = 0; i < READERS; i++) {
        while (!interrupt(&ahead->readers[i])) { /* it may have been between two queries */
            nanosleep(&(struct timespec){.tv_nsec = INTERRUPT_NS}, NULL);
        }
        if (ahead->readers[i].started) {
            pthread_join(ahead->readers[i].thread, NULL);
        }
    }
    pthread_mutex_destroy(&ahead->lock);
    free(ahead);
}
