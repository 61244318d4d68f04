/* Saves a run at random ticks, restores each state in another process and runs it to the end: all
 * messages and pixels must equal those of the run without interruption.
 *
 *   restore_runs SCENARIO DURATION_S SAVES SEED [/pointer=value...]
 */
#include <inttypes.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/api/message_hash.h"

enum { MOST_OVERRIDES = 16, MOST_SAVES = 1000 };

/* The hashes of a run's messages, in order. */
typedef struct record {
    uint64_t *hashes;
    size_t count, room;
} record;

static bst_status on_message(void *user, const char *scope, const char *channel,
                             const void *payload, int64_t tick) {
    record *r = user;
    if (r->count == r->room) {
        r->room = r->room ? 2 * r->room : 4096;
        r->hashes = realloc(r->hashes, r->room * sizeof *r->hashes);
    }
    r->hashes[r->count++] = hash_message(0, scope, channel, payload, tick);
    return BST_OK;
}

static int fail(const bst_ctx *ctx, const char *what) {
    fprintf(stderr, "%s: %s\n", what, ctx->message);
    return 1;
}

/* Hash of the messages from the n-th on, and of the counters at the end. */
static uint64_t hash_from(const record *r, size_t first, const bst_sim *sim) {
    uint64_t hash = r->count > first
                        ? hash_bytes(1, r->hashes + first, (r->count - first) * sizeof *r->hashes)
                        : 1;
    int64_t count;
    const char *name;
    for (int i = 0; (name = bst_sim_counter(sim, i, &count)) != NULL; i++) {
        hash = hash_bytes(hash_bytes(hash, name, strlen(name)), &count, sizeof count);
    }
    return hash;
}

/* In the other process: restores a state and prints number and hash of the messages after it. */
static int go_on(const char *scenario, double duration_s, const char *file,
                 const bst_model_options *options) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    record r = {NULL, 0, 0};
    if (bst_model_load(&ctx, scenario, options, &model) != BST_OK ||
        bst_sim_create(&ctx, model, NULL, &sim) != BST_OK) {
        return fail(&ctx, "create");
    }
    bst_sim_observe(sim, &(bst_sim_observer){.user = &r, .message = on_message});
    if (bst_sim_restore_file(&ctx, sim, file, BST_STATE_ALL) != BST_OK ||
        bst_sim_run_until(&ctx, sim, duration_s) != BST_OK) {
        return fail(&ctx, file);
    }
    printf("%zu %016" PRIx64 "\n", r.count, hash_from(&r, 0, sim));
    bst_sim_free(sim);
    bst_model_free(model);
    free(r.hashes);
    return 0;
}

/* Runs this program again; returns what it printed. */
static int other_process(char **argv, const char *file, int overrides, char *out, size_t bytes) {
    int ends[2];
    char *args[MOST_OVERRIDES + 6] = {argv[0], "--continue", argv[1], argv[2], (char *)file};
    for (int i = 0; i < overrides; i++) {
        args[5 + i] = argv[5 + i];
    }
    if (pipe(ends) != 0) {
        return 1;
    }
    pid_t child = fork();
    if (child == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        execv("/proc/self/exe", args);
        _exit(127);
    }
    close(ends[1]);
    ssize_t n = read(ends[0], out, bytes - 1);
    out[n > 0 ? n : 0] = '\0';
    close(ends[0]);
    int status = 1;
    waitpid(child, &status, 0);
    return status;
}

static int compare_ticks(const void *a, const void *b) {
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static int run(char **argv, int overrides, const bst_model_options *options) {
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    const double duration_s = atof(argv[2]);
    int saves = atoi(argv[3]), different = 0;
    uint64_t random = strtoull(argv[4], NULL, 0);
    char folder[256];
    snprintf(folder, sizeof folder, "%s/restore_runs_XXXXXX",
             getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    int64_t ticks[MOST_SAVES];
    size_t at[MOST_SAVES];
    record r = {NULL, 0, 0};
    bst_model *model = NULL;
    bst_sim *sim = NULL;
    if (saves < 1 || saves > MOST_SAVES || !mkdtemp(folder) ||
        bst_model_load(&ctx, argv[1], options, &model) != BST_OK ||
        bst_sim_create(&ctx, model, NULL, &sim) != BST_OK) {
        return fail(&ctx, "create");
    }
    const double rate = (double)bst_model_tick_rate_hz(model);
    for (int i = 0; i < saves; i++) {
        random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        ticks[i] = 1 + (int64_t)((double)(random >> 11) * 0x1p-53 * (duration_s * rate - 2.0));
    }
    qsort(ticks, (size_t)saves, sizeof *ticks, compare_ticks);
    bst_sim_observe(sim, &(bst_sim_observer){.user = &r, .message = on_message});
    char file[320];
    for (int i = 0; i < saves; i++) {
        snprintf(file, sizeof file, "%s/%d.state", folder, i);
        if (bst_sim_run_until(&ctx, sim, (double)ticks[i] / rate) != BST_OK ||
            bst_sim_save_file(&ctx, sim, file) != BST_OK) {
            return fail(&ctx, "save");
        }
        at[i] = r.count;
    }
    if (bst_sim_run_until(&ctx, sim, duration_s) != BST_OK) {
        return fail(&ctx, "run");
    }
    for (int i = 0; i < saves; i++) {
        char printed[100], expected[100];
        snprintf(file, sizeof file, "%s/%d.state", folder, i);
        snprintf(expected, sizeof expected, "%zu %016" PRIx64 "\n", r.count - at[i],
                 hash_from(&r, at[i], sim));
        int status = other_process(argv, file, overrides, printed, sizeof printed);
        if (status != 0 || strcmp(printed, expected) != 0) {
            fprintf(stderr, "%s: restored at tick %" PRId64 " (%.4f s): %s, expected %s", argv[1],
                    ticks[i], (double)ticks[i] / rate, status ? "failed" : printed, expected);
            different++;
        }
        unlink(file);
    }
    rmdir(folder);
    printf("%s: %d of %d states went on with the same bytes (%zu messages)\n", argv[1],
           saves - different, saves, r.count);
    bst_sim_free(sim);
    bst_model_free(model);
    free(r.hashes);
    return different > 0;
}

int main(int argc, char **argv) {
    bool second = argc > 1 && strcmp(argv[1], "--continue") == 0;
    if (argc < 5 || argc - 5 > MOST_OVERRIDES) {
        fprintf(stderr, "usage: restore_runs SCENARIO DURATION_S SAVES SEED [/pointer=value...]\n");
        return 2;
    }
    /* both forms have five words before the overrides */
    const bst_model_options options = {.assignments = (const char *const *)argv + 5,
                                       .assignment_count = argc - 5};
    return second ? go_on(argv[2], atof(argv[3]), argv[4], &options)
                  : run(argv, argc - 5, &options);
}
