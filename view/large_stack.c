#include "view/large_stack.h"

#include <pthread.h>
#include <stddef.h>

static const size_t STACK_BYTES = (size_t)8 << 20;

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
    pthread_attr_t attributes;
    pthread_t thread;
    if (pthread_attr_init(&attributes) != 0) {
        return false;
    }
    const bool begun = pthread_attr_setstacksize(&attributes, STACK_BYTES) == 0 &&
                       pthread_create(&thread, &attributes, run, &c) == 0;
    pthread_attr_destroy(&attributes);
    return begun && pthread_join(thread, NULL) == 0;
}
