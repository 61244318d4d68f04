/* Set-up of a worker before it opens a device: cores, threads, kernel cache. */
#define _GNU_SOURCE /* sched_setaffinity */
#include <fcntl.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

#include "sim/core/folder.h"
#include "sim/device/kernel_cache.h"
#include "sim/studies/local_pool.h"

enum { CACHES = 4096 };

int bst_local_cores(void) {
    cpu_set_t set;
    return sched_getaffinity(0, sizeof set, &set) == 0 && CPU_COUNT(&set) > 0 ? CPU_COUNT(&set) : 1;
}

/* Binds to the index-th of `workers` parts of the cores: equal parts, or `wanted` cores each; one
 * core if there are too few. */
static int bind_to_cores(int index, int workers, int wanted, bool unpinned) {
    cpu_set_t all, own;
    if (sched_getaffinity(0, sizeof all, &all) != 0) {
        return 1;
    }
    int cores = CPU_COUNT(&all), each = cores / workers > 1 ? cores / workers : 1;
    each = wanted > 0 && wanted < cores ? wanted : wanted > 0 ? cores : each;
    int from = index * each % cores, n = 0, taken = 0;
    CPU_ZERO(&own);
    for (size_t c = 0; c < CPU_SETSIZE; c++) {
        if (CPU_ISSET(c, &all)) {
            if (n >= from && taken < each) {
                CPU_SET(c, &own);
                taken++;
            }
            n++;
        }
    }
    if (!unpinned && taken > 0 && sched_setaffinity(0, sizeof own, &own) != 0) {
        return each; /* slower, not wrong */
    }
    return each;
}

/* Number of cores that Slurm grants a task, which need not be bound to them; 0: no Slurm task. */
static int granted_cores(void) {
    const char *text = getenv("SLURM_CPUS_PER_TASK");
    char *end = NULL;
    long n = text ? strtol(text, &end, 10) : 0;
    return text && end != text && *end == '\0' && n > 0 && n < 65536 ? (int)n : 0;
}

static bool cache_root(char *out, size_t bytes) {
    const char *own = getenv("POCL_CACHE_DIR"), *xdg = getenv("XDG_CACHE_HOME"),
               *home = getenv("HOME");
    int n = own && *own     ? snprintf(out, bytes, "%s", own)
            : xdg && *xdg   ? snprintf(out, bytes, "%s/boresight", xdg)
            : home && *home ? snprintf(out, bytes, "%s/.cache/boresight", home)
                            : snprintf(out, bytes, "/tmp/boresight-%ld", (long)getuid());
    return n > 0 && (size_t)n < bytes;
}

/* Takes the first kernel cache that no running process uses, with the kernels of the user's cache,
 * and locks it until exit. Without one PoCL's default is used. */
static void take_cache(void) {
    char root[2048], path[2200], lock[2300];
    if (!cache_root(root, sizeof root)) {
        return;
    }
    for (int i = 0; i < CACHES; i++) {
        snprintf(path, sizeof path, "%s/worker-%d", root, i);
        snprintf(lock, sizeof lock, "%s/lock", path);
        bst_ctx quiet = {0};
        /* PoCL loads code from this folder */
        if (bst_folder_make_private(&quiet, path) != BST_OK) {
            return;
        }
        int fd = open(lock, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
        if (fd < 0) {
            return;
        }
        if (flock(fd, LOCK_EX | LOCK_NB) == 0) {
            bst_kernel_cache_take(path);
            return;
        }
        close(fd);
    }
}

int bst_local_settle(int index, int workers, int wanted, bool unpinned) {
    char text[16];
    int cores = bind_to_cores(index, workers, wanted, unpinned), granted = granted_cores();
    cores = granted > 0 && granted < cores ? granted : cores;
    unsetenv("POCL_AFFINITY");
    snprintf(text, sizeof text, "%d", cores);
    setenv("POCL_MAX_PTHREAD_COUNT", text, 1);
    take_cache();
    return cores;
}
