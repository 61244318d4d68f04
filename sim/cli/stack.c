#define _GNU_SOURCE /* pthread_setattr_default_np */
#include "sim/cli/stack.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>

#include "sim/cli/cli.h"
#include "sim/core/parallel.h"

typedef struct call {
    int (*command)(int argc, char **argv);
    int argc, code;
    char **argv;
} call;

static void *run(void *user) {
    call *c = user;
    c->code = c->command(c->argc, c->argv);
    return NULL;
}

/* Default stack size of threads; glibc takes it from the process's limit. */
static void set_default(void) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) == 0) {
        if (pthread_attr_setstacksize(&attributes, BST_THREAD_STACK_BYTES) == 0) {
            (void)pthread_setattr_default_np(&attributes);
        }
        pthread_attr_destroy(&attributes);
    }
}

int bst_cli_run_with_stack(int (*command)(int argc, char **argv), int argc, char **argv) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
        limit.rlim_cur >= BST_THREAD_STACK_BYTES) {
        return command(argc, argv);
    }
    set_default();
    call c = {.command = command, .argc = argc, .argv = argv, .code = BST_EXIT_FAILED};
    pthread_t thread;
    int error = bst_core_thread_start(&thread, run, &c);
    if (error) {
        fprintf(stderr, "boresight: no thread with a stack of %d bytes: %s; raise ulimit -s\n",
                BST_THREAD_STACK_BYTES, strerror(error));
        return BST_EXIT_FAILED;
    }
    pthread_join(thread, NULL);
    return c.code;
}
