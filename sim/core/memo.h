/* Memo: results of functions that depend on their arguments alone, for callers that ask again. It
 * belongs to what they share, so that two simulations of one model compute a result once. */
#ifndef BST_CORE_MEMO_H
#define BST_CORE_MEMO_H

#include <stdbool.h>
#include <stddef.h>

#include "boresight/status.h"

typedef struct bst_memo bst_memo;

/* Bytes of the arguments and of a result, at most. */
enum { BST_MEMO_ARGUMENTS = 128, BST_MEMO_RESULT = 32 };

/* Creates an empty memo, which keeps a fixed number of results: a new one replaces the oldest.
 *
 * Returned:  *out  NULL on error
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with bst_memo_free */
bst_status bst_memo_create(bst_ctx *ctx, bst_memo **out) BST_MUST_CHECK;
/* Frees a memo; NULL is allowed. */
void bst_memo_free(bst_memo *memo);

/* Arguments and result of a function. */
typedef struct bst_memo_call {
    const char *function; /* a string that is valid as long as the memo */
    const void *arguments;
    size_t argument_bytes; /* at most BST_MEMO_ARGUMENTS; compared byte by byte, also padding */
    void *result;
    size_t result_bytes; /* at most BST_MEMO_RESULT */
} bst_memo_call;

/* Looks for the result of a call. Any thread.
 *
 * Returned:  true: *call->result is filled; false: it is unchanged; false for no memo (NULL) */
bool bst_memo_find(bst_memo *memo, const bst_memo_call *call);
/* Keeps the result of a call. Any thread; NULL is allowed. */
void bst_memo_keep(bst_memo *memo, const bst_memo_call *call);

#endif
