#include "view/large_stack.h"

#include <pthread.h>
#include <stddef.h>

#include "sim/core/parallel.h"

typedef struct call {
    void (*work)(void *user);
    void *user;
} call;

static void *run(void *user) {
    const call *c = user;
    c->work(c->user);
    return NULL;
}

bool bst_view_call_with_stack(void (*work)(void *user), void *user) {
    call c = {work, user};
    pthread_t thread;
    return bst_core_thread_start(&thread, run, &c) == 0 && pthread_join(thread, NULL) == 0;
}
