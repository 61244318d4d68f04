#include "sim/studies/local_pool.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "sim/studies/shard_run.h"

enum { MOST_WORKERS = 1024 };

typedef struct pool_worker {
    pid_t pid;    /* 0: not started */
    int to, from; /* pipe ends of the pool */
    bool busy;
    bst_study_shard_job job;
} pool_worker;

typedef struct pool {
    bst_local_pool_options options;
    pool_worker *workers;
    int count;
    bool cancelled;
    struct pollfd *polled;
} pool;

/* ------------------------------------------------------------------ the worker's side */

typedef struct reporter {
    int fd;
    double reported_s; /* wall time of the last report */
} reporter;

/* Writes all bytes to a pipe between driver and worker; false: closed. */
static bool send_bytes(int fd, const void *data, size_t bytes) {
    const char *at = data;
    while (bytes > 0) {
        ssize_t n = write(fd, at, bytes);
        if (n < 0 && errno != EINTR) {
            return false;
        }
        if (n > 0) {
            at += n;
            bytes -= (size_t)n;
        }
    }
    return true;
}

/* Reports progress, limited in rate. A worker whose driver has gone stops. */
static void report(void *user, const bst_study_shard_news *news) {
    reporter *r = user;
    double now = bst_wall_seconds();
    if (now - r->reported_s >= 0.1) {
        r->reported_s = now;
        if (!send_bytes(r->fd, news, sizeof *news)) {
            raise(SIGTERM);
        }
    }
}

/* False at the end of the pipe, and when a signal requests a stop. */
static bool receive(int fd, void *data, size_t bytes) {
    char *at = data;
    while (bytes > 0) {
        ssize_t n = read(fd, at, bytes);
        if (n <= 0) {
            return false;
        }
        at += n;
        bytes -= (size_t)n;
    }
    return true;
}

/* Main loop of a worker process: receives shards and executes their simulation runs. */
static void work(const pool *p, int index, int in, int out) {
    const bst_local_pool_options *o = &p->options;
    bst_shard_worker worker = {
        .study = o->study,
        .kind = o->kind,
        .out = o->out,
        .place = {bst_local_settle(index, p->count, o->cores, o->unpinned),
                  o->device_count > 0 ? o->devices[index % o->device_count] : ""}};
    reporter to = {out, 0.0};
    bst_ctx ctx = {0};
    bst_study_shard_job job;
    while (!o->kind->stop_requested(o->kind->user) && receive(in, &job, sizeof job)) {
        bst_study_shard_news news;
        bst_status status = bst_shard_execute(&ctx, &worker, &job, report, &to, &news);
        (void)status; /* reported in the news */
        if (!send_bytes(out, &news, sizeof news)) {
            break;
        }
    }
    bst_shard_worker_close(&worker);
}

/* ------------------------------------------------------------------ the pool's side */

/* Closes the driver's ends of a worker's pipes. */
static void close_ends(pool_worker *w) {
    if (w->to >= 0) {
        close(w->to);
    }
    if (w->from >= 0) {
        close(w->from);
    }
    w->to = w->from = -1;
}

/* Starts a worker process connected by two pipes. */
static bst_status fork_worker(bst_ctx *ctx, pool *p, int index) {
    pool_worker *w = &p->workers[index];
    int to[2], from[2];
    if (pipe(to) != 0) {
        return bst_fail(ctx, BST_ERR_IO, "a worker cannot be started: %s", strerror(errno));
    }
    if (pipe(from) != 0) {
        int error = errno;
        close(to[0]);
        close(to[1]);
        return bst_fail(ctx, BST_ERR_IO, "a worker cannot be started: %s", strerror(error));
    }
    for (int i = 0; i < 2; i++) {
        fcntl(to[i], F_SETFD, FD_CLOEXEC);
        fcntl(from[i], F_SETFD, FD_CLOEXEC);
    }
    fflush(stdout);
    fflush(stderr);
    pid_t driver = getpid(), pid = fork();
    if (pid < 0) {
        int error = errno;
        close(to[0]);
        close(to[1]);
        close(from[0]);
        close(from[1]);
        return bst_fail(ctx, BST_ERR_IO, "a worker cannot be started: %s", strerror(error));
    }
    if (pid == 0) {
        /* Ctrl-C goes to the driver only */
        setpgid(0, 0);
        prctl(PR_SET_PDEATHSIG, SIGTERM);
        if (getppid() != driver) {
            _exit(0);
        }
        for (int i = 0; i < p->count; i++) {
            close_ends(&p->workers[i]);
        }
        close(to[1]);
        close(from[0]);
        if (p->options.lock_fd >= 0) {
            close(p->options.lock_fd);
        }
        work(p, index, to[0], from[1]);
        fflush(stdout);
        _exit(0);
    }
    close(to[0]);
    close(from[1]);
    *w = (pool_worker){.pid = pid, .to = to[1], .from = from[0]};
    return BST_OK;
}

/* Number of idle workers. */
static int64_t room(void *self) {
    const pool *p = self;
    int64_t n = 0;
    for (int i = 0; i < p->count; i++) {
        n += !p->workers[i].busy;
    }
    return p->cancelled ? 0 : n;
}

/* Sends a shard to an idle worker; forks the worker at first use. */
static bst_status start_one(bst_ctx *ctx, pool *p, const bst_study_shard_job *job) {
    for (int i = 0; i < p->count; i++) {
        pool_worker *w = &p->workers[i];
        if (w->busy) {
            continue;
        }
        if (!w->pid) {
            BST_TRY(fork_worker(ctx, p, i));
        }
        w->busy = true;
        w->job = *job;
        /* the next poll notices a worker that has died */
        if (!send_bytes(w->to, job, sizeof *job) && errno != EPIPE) {
            return bst_fail(ctx, BST_ERR_IO, "a shard cannot be sent to a worker: %s",
                            strerror(errno));
        }
        return BST_OK;
    }
    return bst_fail(ctx, BST_ERR_STATE, "all workers are busy");
}

/* Executor interface: sends shards to the workers. */
static bst_status start(bst_ctx *ctx, void *self, const bst_study_shard_job *jobs, int64_t count) {
    for (int64_t i = 0; i < count; i++) {
        BST_TRY(start_one(ctx, self, &jobs[i]));
    }
    return BST_OK;
}

/* Handles a worker whose pipe has ended; true if it had a job. */
static bool reap_worker(pool_worker *w, bst_study_shard_news *news) {
    int ended = 0;
    bool busy = w->busy;
    close_ends(w);
    while (waitpid(w->pid, &ended, 0) < 0 && errno == EINTR) {
    }
    *news = (bst_study_shard_news){.id = w->job.id, .kind = BST_SHARD_LOST};
    if (WIFSIGNALED(ended)) {
        snprintf(news->text, sizeof news->text, "killed by signal %d (%s)", WTERMSIG(ended),
                 strsignal(WTERMSIG(ended)));
    } else {
        snprintf(news->text, sizeof news->text, "ended with code %d", WEXITSTATUS(ended));
    }
    *w = (pool_worker){.to = -1, .from = -1};
    return busy;
}

/* Executor interface: waits for messages of the workers. */
static bst_status poll_workers(bst_ctx *ctx, void *self, int timeout_ms, bst_study_shard_news *news,
                               int capacity, int *count) {
    pool *p = self;
    *count = 0;
    for (int i = 0; i < p->count; i++) {
        p->polled[i] =
            (struct pollfd){.fd = p->workers[i].pid ? p->workers[i].from : -1, .events = POLLIN};
    }
    int n = poll(p->polled, (nfds_t)p->count, timeout_ms);
    if (n < 0 && errno != EINTR) {
        return bst_fail(ctx, BST_ERR_IO, "waiting for workers: %s", strerror(errno));
    }
    for (int i = 0; n > 0 && i < p->count && *count < capacity; i++) {
        pool_worker *w = &p->workers[i];
        if (!p->polled[i].revents) {
            continue;
        }
        if (receive(w->from, &news[*count], sizeof *news)) {
            w->busy = w->busy && news[*count].kind == BST_SHARD_AT_WORK;
            (*count)++;
        } else {
            *count += reap_worker(w, &news[*count]);
        }
    }
    return BST_OK;
}

/* Executor interface: stops all workers with SIGTERM, or SIGKILL if `now`. */
static void cancel(void *self, bool now) {
    pool *p = self;
    p->cancelled = true;
    for (int i = 0; i < p->count; i++) {
        if (p->workers[i].pid) {
            kill(p->workers[i].pid, now ? SIGKILL : SIGTERM);
        }
    }
}

/* Executor interface: ends all workers, after 10 s by SIGKILL, and frees the pool. */
static void close_pool(void *self) {
    pool *p = self;
    const struct timespec pause = {0, 5000000};
    if (!p) {
        return;
    }
    for (int i = 0; i < p->count; i++) {
        if (p->workers[i].busy) {
            kill(p->workers[i].pid, SIGTERM);
        }
        close_ends(&p->workers[i]);
    }
    for (int i = 0; i < p->count; i++) {
        pid_t pid = p->workers[i].pid;
        double until = bst_wall_seconds() + 10.0;
        while (pid && waitpid(pid, NULL, WNOHANG) == 0) {
            if (bst_wall_seconds() > until) {
                kill(pid, SIGKILL);
            }
            nanosleep(&pause, NULL);
        }
    }
    free(p->workers);
    free(p->polled);
    free(p);
}

int bst_local_workers(int asked, int devices) {
    int count = asked > 0 ? asked : devices > 0 ? devices : bst_local_cores();
    return count < MOST_WORKERS ? count : MOST_WORKERS;
}

bst_status bst_local_pool_open(bst_ctx *ctx, const bst_local_pool_options *options,
                               bst_executor *out) {
    int count = bst_local_workers(options->workers, options->device_count);
    pool *p = calloc(1, sizeof *p);
    if (p) {
        *p = (pool){.options = *options,
                    .count = count,
                    .workers = calloc((size_t)count, sizeof *p->workers),
                    .polled = calloc((size_t)count, sizeof *p->polled)};
    }
    if (!p || !p->workers || !p->polled) {
        if (p) {
            free(p->workers);
            free(p->polled);
        }
        free(p);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for %d workers", count);
    }
    for (int i = 0; i < count; i++) {
        p->workers[i].to = p->workers[i].from = -1;
    }
    *out = (bst_executor){.self = p,
                          .name = "local pool",
                          .room = room,
                          .start = start,
                          .poll = poll_workers,
                          .cancel = cancel,
                          .close = close_pool};
    return BST_OK;
}
