#include "sim/core/memo.h"

#include <assert.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { KEPT = 16 };

typedef struct kept_call {
    const char *function; /* NULL: none */
    size_t argument_bytes, result_bytes;
    unsigned char arguments[BST_MEMO_ARGUMENTS], result[BST_MEMO_RESULT];
} kept_call;

struct bst_memo {
    pthread_mutex_t lock;
    kept_call calls[KEPT];
    int next; /* index that the next result takes */
};

bst_status bst_memo_create(bst_ctx *ctx, bst_memo **out) {
    assert(out);
    *out = calloc(1, sizeof **out);
    if (!*out) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for kept results");
    }
    pthread_mutex_init(&(*out)->lock, NULL);
    return BST_OK;
}

void bst_memo_free(bst_memo *memo) {
    if (memo) {
        pthread_mutex_destroy(&memo->lock);
        free(memo);
    }
}

static bool is_call(const kept_call *kept, const bst_memo_call *call) {
    return kept->function && strcmp(kept->function, call->function) == 0 &&
           kept->argument_bytes == call->argument_bytes &&
           kept->result_bytes == call->result_bytes &&
           memcmp(kept->arguments, call->arguments, call->argument_bytes) == 0;
}

bool bst_memo_find(bst_memo *memo, const bst_memo_call *call) {
    bool found = false;
    if (!memo) {
        return false;
    }
    pthread_mutex_lock(&memo->lock);
    for (int i = 0; i < KEPT && !found; i++) {
        found = is_call(&memo->calls[i], call);
        if (found) {
            memcpy(call->result, memo->calls[i].result, call->result_bytes);
        }
    }
    pthread_mutex_unlock(&memo->lock);
    return found;
}

void bst_memo_keep(bst_memo *memo, const bst_memo_call *call) {
    assert(call->argument_bytes <= BST_MEMO_ARGUMENTS && call->result_bytes <= BST_MEMO_RESULT);
    if (!memo) {
        return;
    }
    pthread_mutex_lock(&memo->lock);
    kept_call *kept = &memo->calls[memo->next];
    memo->next = (memo->next + 1) % KEPT;
    kept->function = call->function;
    kept->argument_bytes = call->argument_bytes;
    kept->result_bytes = call->result_bytes;
    memcpy(kept->arguments, call->arguments, call->argument_bytes);
    memcpy(kept->result, call->result, call->result_bytes);
    pthread_mutex_unlock(&memo->lock);
}
