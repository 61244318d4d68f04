/* Plug-ins that the program itself has registered by name. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "boresight/plugin.h"
#include "sim/engine/scenario/plugin.h"

enum { NAME_BYTES = 121, SHA256_BYTES = 65 };

typedef struct registered {
    char name[NAME_BYTES], sha256[SHA256_BYTES];
    const bst_module_desc *const *modules;
    const bst_stage_desc *const *stages;
} registered;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* protects the two below */
static registered *all;                                  /* [all_count], until the process ends */
static int all_count;

/* Index of a name; -1 if it is not registered. */
static int index_of(const char *name) {
    for (int i = 0; i < all_count; i++) {
        if (strcmp(all[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

bool bst_plugin_registered(const char *name, bst_plugin *out) {
    pthread_mutex_lock(&lock);
    int index = strchr(name, ':') ? index_of(name) : -1;
    if (index >= 0) {
        *out = (bst_plugin){.modules = all[index].modules, .stages = all[index].stages};
        memcpy(out->file, all[index].name, sizeof all[index].name);
        memcpy(out->sha256, all[index].sha256, sizeof all[index].sha256);
    }
    pthread_mutex_unlock(&lock);
    return index >= 0;
}

static bst_status check_name(bst_ctx *ctx, const char *name) {
    size_t length = strlen(name);
    bool good = length >= 1 && length < NAME_BYTES && strchr(name, ':') && !strchr(name, '/');
    for (size_t i = 0; i < length; i++) {
        good = good && name[i] > ' ' && name[i] <= '~';
    }
    return good ? BST_OK
                : bst_fail(ctx, BST_ERR_ARGUMENT,
                           "plug-in \"%.120s\": a name of the program's own plug-in has 1 to 120 "
                           "printable characters, a \":\" and no \"/\", as \"python:mine\"",
                           name);
}

static bst_status check_digest(bst_ctx *ctx, const char *name, const char *sha256) {
    return !sha256 || (strlen(sha256) == SHA256_BYTES - 1 &&
                       strspn(sha256, "0123456789abcdef") == SHA256_BYTES - 1)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT,
                          "plug-in \"%.120s\": its SHA-256 digest has 64 hexadecimal digits (found "
                          "\"%.80s\")",
                          name, sha256);
}

/* Stores an entry, in place of one of the same name. */
static bst_status store(bst_ctx *ctx, const registered *entry) {
    int index = index_of(entry->name);
    if (!entry->modules && !entry->stages) {
        if (index >= 0) {
            all[index] = all[--all_count];
        }
        return BST_OK;
    }
    if (index < 0) {
        registered *more = realloc(all, ((size_t)all_count + 1) * sizeof *all);
        if (!more) {
            return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for plug-in %s", entry->name);
        }
        all = more;
        index = all_count++;
    }
    all[index] = *entry;
    return BST_OK;
}

bst_status bst_plugin_register(bst_ctx *ctx, const char *name, const char *sha256,
                               const bst_module_desc *const *modules,
                               const bst_stage_desc *const *stages) {
    registered entry = {.modules = modules, .stages = stages};
    bst_plugin plugin = {.modules = modules, .stages = stages};
    BST_TRY(check_name(ctx, name));
    BST_TRY(check_digest(ctx, name, sha256));
    memcpy(entry.sha256, sha256 ? sha256 : "", sha256 ? SHA256_BYTES : 1);
    memcpy(entry.name, name, strlen(name) + 1);
    memcpy(plugin.file, name, strlen(name) + 1);
    BST_TRY(bst_plugin_check(ctx, &plugin));
    pthread_mutex_lock(&lock);
    bst_status status = store(ctx, &entry);
    pthread_mutex_unlock(&lock);
    return status;
}
