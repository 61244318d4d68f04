#include "boresight/status.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

void bst_ctx_init(bst_ctx *ctx, bst_log_fn log, void *log_user, bst_log_level level) {
    memset(ctx, 0, sizeof *ctx);
    ctx->log = log;
    ctx->log_user = log_user;
    ctx->log_level = level;
}

/* Replaces control characters in messages, which may quote untrusted input: none reaches a terminal
 * or starts a new line. Newlines of `format` itself are kept. */
static void hide_controls(char *text, const char *format) {
    bool lines = strchr(format, '\n') != NULL;
    for (; *text; text++) {
        if (((unsigned char)*text < 0x20 && !(lines && *text == '\n')) || *text == 0x7f) {
            *text = '?';
        }
    }
}

bst_status bst_fail(bst_ctx *ctx, bst_status status, const char *format, ...) {
    if (ctx) {
        /* formatted into a copy: arguments may quote the previous message */
        char text[BST_MESSAGE_BYTES];
        va_list args;
        va_start(args, format);
        vsnprintf(text, sizeof text, format, args);
        va_end(args);
        hide_controls(text, format);
        memcpy(ctx->message, text, sizeof text);
    }
    return status;
}

bst_status bst_fail_prefix(bst_ctx *ctx, bst_status status, const char *format, ...) {
    if (ctx) {
        char prefix[BST_MESSAGE_BYTES];
        char text[2 * BST_MESSAGE_BYTES + 2];
        va_list args;
        va_start(args, format);
        vsnprintf(prefix, sizeof prefix, format, args);
        va_end(args);
        hide_controls(prefix, format);
        snprintf(text, sizeof text, "%s: %s", prefix, ctx->message);
        text[BST_MESSAGE_BYTES - 1] = '\0';
        memcpy(ctx->message, text, BST_MESSAGE_BYTES);
    }
    return status;
}

void bst_log(bst_ctx *ctx, bst_log_level level, const char *format, ...) {
    if (!ctx) {
        return;
    }
    if (level == BST_LOG_WARNING) {
        ctx->warnings++;
    }
    if (!ctx->log || level > ctx->log_level) {
        return;
    }
    char text[BST_MESSAGE_BYTES];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    hide_controls(text, format);
    ctx->log(ctx->log_user, level, text);
}

const char *bst_status_name(bst_status status) {
    static const char *const names[BST_STATUS_COUNT] = {
        "ok",           "bad argument",      "out of memory",    "file error",
        "bad format",   "bad scenario",      "outside the data", "not found",
        "device error", "numerical failure", "wrong state",      "interrupted",
    };
    return (unsigned)status < BST_STATUS_COUNT ? names[status] : "unknown status";
}
