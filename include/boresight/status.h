/* Status codes and the per-run context that carries error messages, log and warnings. */
#ifndef BORESIGHT_STATUS_H
#define BORESIGHT_STATUS_H

#include <stdarg.h>
#include <stddef.h>

#pragma GCC visibility push(default)

#ifdef __cplusplus
extern "C" {
#endif

/* What a function that can fail returns. BST_OK is 0; the message is in the context. */
typedef enum bst_status {
    BST_OK = 0,
    BST_ERR_ARGUMENT,    /* a caller passed a value outside its documented range */
    BST_ERR_MEMORY,      /* an allocation failed */
    BST_ERR_IO,          /* the operating system refused a file operation */
    BST_ERR_FORMAT,      /* a file's content is not what its format allows */
    BST_ERR_CONFIG,      /* a scenario is wrong */
    BST_ERR_RANGE,       /* a date or value outside the range of the data */
    BST_ERR_NOT_FOUND,   /* a name, file or number that does not exist */
    BST_ERR_DEVICE,      /* OpenCL failed */
    BST_ERR_NUMERIC,     /* an iteration did not converge or a matrix is not positive definite */
    BST_ERR_STATE,       /* a call in the wrong order */
    BST_ERR_INTERRUPTED, /* the user requested a stop */
    BST_STATUS_COUNT
} bst_status;

#if defined(__GNUC__)
#define BST_MUST_CHECK __attribute__((warn_unused_result))
#define BST_PRINTF(fmt_index, first) __attribute__((format(printf, fmt_index, first)))
#else
#define BST_MUST_CHECK
#define BST_PRINTF(fmt_index, first)
#endif

typedef enum bst_log_level {
    BST_LOG_ERROR,
    BST_LOG_WARNING,
    BST_LOG_INFO,
    BST_LOG_DEBUG
} bst_log_level;

/* Receives log lines (no newline at the end). Called from the thread that logs. */
typedef void (*bst_log_fn)(void *user, bst_log_level level, const char *message);

#define BST_MESSAGE_BYTES 1024

/* Per-run context. Zero-initialise ({0}) or call bst_ctx_init; owns nothing.
 * A context belongs to one run and is written by one thread at a time. */
typedef struct bst_ctx {
    char message[BST_MESSAGE_BYTES]; /* reason of the last failure; "": none */
    bst_log_fn log;                  /* NULL: log lines are dropped */
    void *log_user;
    bst_log_level log_level; /* lines above this level are dropped */
    unsigned warnings;       /* number of BST_LOG_WARNING lines so far */
} bst_ctx;

/* Initialises a context.
 *
 * Given:     log       receives the log lines; NULL: they are dropped
 *            log_user  first argument of log
 *            level     lines above this level are dropped */
void bst_ctx_init(bst_ctx *ctx, bst_log_fn log, void *log_user, bst_log_level level);

/* Stores an error message and returns a status: return bst_fail(ctx, BST_ERR_IO, "...", ...);
 *
 * Given:     ctx     NULL: the message is dropped
 *            status  returned unchanged
 *            format  printf-style; arguments may point to ctx->message
 * Notes:     control characters become '?'; newlines are kept if the format itself contains some.
 *            The message is cut at BST_MESSAGE_BYTES - 1 bytes. */
bst_status bst_fail(bst_ctx *ctx, bst_status status, const char *format, ...) BST_PRINTF(3, 4);

/* Puts "prefix: " before the stored message and returns a status, for callers that know more.
 *
 * Given:     ctx     NULL: nothing is stored
 *            status  returned unchanged
 *            format  printf-style text of the prefix */
bst_status bst_fail_prefix(bst_ctx *ctx, bst_status status, const char *format, ...)
    BST_PRINTF(3, 4);

/* Sends a line to the log of a context.
 *
 * Given:     ctx     NULL: the line is dropped
 *            level   lines above ctx->log_level are dropped; warnings are counted in any case
 *            format  printf-style */
void bst_log(bst_ctx *ctx, bst_log_level level, const char *format, ...) BST_PRINTF(3, 4);

/* Short English name of a status ("bad format"); never NULL. */
const char *bst_status_name(bst_status status);

/* Returns from the calling function when expr is not BST_OK. */
#define BST_TRY(expr)                        \
    do {                                     \
        bst_status bst_try_status_ = (expr); \
        if (bst_try_status_ != BST_OK) {     \
            return bst_try_status_;          \
        }                                    \
    } while (0)

#ifdef __cplusplus
}
#endif

#pragma GCC visibility pop

#endif
