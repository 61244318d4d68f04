#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/subprocess.h"
#include "sim/core/wall_clock.h"
#include "sim/studies/shell_word.h"
#include "sim/studies/slurm_internal.h"

enum { MOST_WORDS = 96 };

bst_status bst_slurm_path(bst_ctx *ctx, const bst_slurm *s, char out[BST_SLURM_PATH_BYTES],
                          const char *file) {
    int length = snprintf(out, BST_SLURM_PATH_BYTES, "%s/%s", s->folder, file);
    return length < BST_SLURM_PATH_BYTES
               ? BST_OK
               : bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path of the study is too long",
                          s->folder);
}

void bst_slurm_read_tail(const char *path, char *out, size_t out_bytes) {
    out[0] = '\0';
    FILE *file = fopen(path, "r");
    if (!file) {
        return;
    }
    if (fseek(file, 0, SEEK_END) == 0) {
        long size = ftell(file);
        long room = (long)out_bytes - 1;
        if (size >= 0 && fseek(file, size > room ? size - room : 0, SEEK_SET) == 0) {
            out[fread(out, 1, out_bytes - 1, file)] = '\0';
        }
    }
    fclose(file);
    size_t length = strlen(out);
    while (length > 0 && (out[length - 1] == '\n' || out[length - 1] == ' ')) {
        out[--length] = '\0';
    }
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)out[i] < 32) {
            out[i] = ' ';
        }
    }
}

/* ---------------------------------------------------------------- Slurm's programs */

bst_status bst_slurm_run(bst_ctx *ctx, const bst_slurm *s, const char *const argv[],
                         void (*take)(void *user, const char *line), void *user, int *code,
                         char said[BST_SHARD_TEXT_BYTES]) {
    char errors[BST_SLURM_PATH_BYTES], file[BST_SLURM_TOKEN_BYTES + 16];
    snprintf(file, sizeof file, "%s-errors", s->token);
    BST_TRY(bst_slurm_path(ctx, s, errors, file));
    bst_subprocess child;
    BST_TRY(bst_subprocess_start(ctx, argv, NULL, true, errors, &child));
    char line[512];
    while (fgets(line, sizeof line, child.output)) {
        if (take) {
            take(user, line);
        }
    }
    *code = bst_subprocess_wait(&child);
    bst_slurm_read_tail(errors, said, BST_SHARD_TEXT_BYTES);
    unlink(errors);
    return BST_OK;
}

/* Checks whether a message means that the controller does not answer, not that the request is
 * wrong. */
static bool is_silence(const char *said) {
    static const char *const signs[] = {
        "contact slurm controller", "Unable to contact", "timed out",
        "onnection refused",        "try again later",   "temporarily"};
    for (size_t i = 0; i < sizeof signs / sizeof *signs; i++) {
        if (strstr(said, signs[i])) {
            return true;
        }
    }
    return false;
}

void bst_slurm_take_array(void *user, const char *line) {
    *(int64_t *)user = strtoll(line, NULL, 10); /* output "JOB" or "JOB;CLUSTER" */
}

static bst_status write_table(bst_ctx *ctx, const bst_slurm *s, const char *path) {
    FILE *file = fopen(path, "w");
    bool good = file != NULL;
    for (int64_t i = 0; i < s->count; i++) {
        const bst_slurm_task *t = &s->tasks[i];
        if (good && t->array == 0 && t->batch == s->batches) {
            good = fprintf(file, "%lld %lld:%lld\n", (long long)t->job.id, (long long)t->job.first,
                           (long long)t->job.count) > 0;
        }
    }
    good = file && fclose(file) == 0 && good;
    return good ? BST_OK
                : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
}

/* Writes the script of a batch: a task finds its shard in the table, runs it, and writes its exit
 * code. The script receives the signals that end the shard, and survives them. */
static bst_status write_script(bst_ctx *ctx, const bst_slurm *s, const char *path,
                               const char *table) {
    FILE *file = fopen(path, "w");
    if (file) {
        fputs(
            "#!/bin/sh\n# One task: the shard in line SLURM_ARRAY_TASK_ID + 1 of the table.\n"
            "trap : INT TERM\ncd ",
            file);
        bst_put_shell_word(file, s->folder);
        fputs(" || exit 1\nset -- $(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" ", file);
        bst_put_shell_word(file, table);
        fputs(")\nended=", file);
        bst_put_shell_word(file, s->token);
        fputs("-ended-$1 runs=$2\n", file);
        if (s->site.setup[0]) {
            fputs(". ", file);
            bst_put_shell_word(file, s->site.setup);
            fputc('\n', file);
        }
        for (char **word = s->program; *word; word++) {
            bst_put_shell_word(file, *word);
            fputc(' ', file);
        }
        fputs(
            "\"$runs\"\ncode=$?\n"
            "echo \"$code ${SLURMD_NODENAME:-}\" >\"$ended.$$\" && mv \"$ended.$$\" \"$ended\"\n"
            "exit $code\n",
            file);
    }
    bool good = file && !ferror(file);
    good = file && fclose(file) == 0 && good;
    return good ? BST_OK
                : bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", path, strerror(errno));
}

static void add_option(const char *argv[MOST_WORDS], int *words, char *text, size_t text_bytes,
                       const char *option, const char *value) {
    if (value[0] && *words < MOST_WORDS - 2) {
        snprintf(text, text_bytes, "%s=%s", option, value);
        argv[(*words)++] = text;
    }
}

static void add_number(const char *argv[MOST_WORDS], int *words, char *text, size_t text_bytes,
                       const char *option, int64_t value) {
    char digits[24];
    snprintf(digits, sizeof digits, "%lld", (long long)value);
    add_option(argv, words, text, text_bytes, option, value > 0 ? digits : "");
}

/* Submits `count` tasks as batch `s->batches`; *array 0: the controller does not answer. */
static bst_status submit_batch(bst_ctx *ctx, bst_slurm *s, int64_t count, int64_t *array) {
    char file[BST_SLURM_TOKEN_BYTES + 32], script[BST_SLURM_PATH_BYTES],
        table[BST_SLURM_PATH_BYTES], log[BST_SLURM_PATH_BYTES];
    snprintf(file, sizeof file, "%s-batch-%d.sh", s->token, s->batches);
    BST_TRY(bst_slurm_path(ctx, s, script, file));
    snprintf(file, sizeof file, "%s-batch-%d.txt", s->token, s->batches);
    BST_TRY(bst_slurm_path(ctx, s, table, file));
    snprintf(file, sizeof file, "%s-batch-%d-%%a.log", s->token, s->batches);
    BST_TRY(bst_slurm_path(ctx, s, log, file));
    BST_TRY(write_table(ctx, s, table));
    BST_TRY(write_script(ctx, s, script, table));

    const char *argv[MOST_WORDS] = {"sbatch", "--parsable", "--requeue", "--open-mode=append"};
    int words = 4;
    char name[64], range[128], output[BST_SLURM_PATH_BYTES + 16], account[128], partition[128],
        qos[128], gres[128], time[64], memory[64], cpus[64], options[sizeof s->site.options];
    add_option(argv, &words, name, sizeof name, "--job-name", s->name);
    snprintf(file, sizeof file, "0-%lld", (long long)(count - 1));
    add_option(argv, &words, range, sizeof range, "--array", file);
    add_option(argv, &words, output, sizeof output, "--output", log);
    add_option(argv, &words, account, sizeof account, "--account", s->site.account);
    add_option(argv, &words, partition, sizeof partition, "--partition", s->site.partition);
    add_option(argv, &words, qos, sizeof qos, "--qos", s->site.qos);
    add_option(argv, &words, gres, sizeof gres, "--gres", s->site.gres);
    add_number(argv, &words, time, sizeof time, "--time", s->site.time_min);
    add_number(argv, &words, memory, sizeof memory, "--mem", s->site.memory_mib);
    add_number(argv, &words, cpus, sizeof cpus, "--cpus-per-task", s->site.cpus_per_task);
    memcpy(options, s->site.options, sizeof options);
    char *rest = NULL;
    for (char *word = strtok_r(options, " \t", &rest); word && words < MOST_WORDS - 2;
         word = strtok_r(NULL, " \t", &rest)) {
        argv[words++] = word;
    }
    argv[words] = script;

    int code;
    char said[BST_SHARD_TEXT_BYTES];
    *array = 0;
    BST_TRY(bst_slurm_run(ctx, s, argv, bst_slurm_take_array, array, &code, said));
    if (code == 0 && *array > 0) {
        return BST_OK;
    }
    *array = 0;
    return is_silence(said) ? BST_OK
                            : bst_fail(ctx, BST_ERR_IO, "sbatch refuses the job array: %s", said);
}

bst_status bst_slurm_submit(bst_ctx *ctx, bst_slurm *s) {
    for (;;) {
        int64_t count = 0;
        for (int64_t i = 0; i < s->count && count < s->site.array_size; i++) {
            bst_slurm_task *t = &s->tasks[i];
            if (t->array == 0) {
                t->index = count++;
                t->batch = s->batches;
            }
        }
        if (count == 0) {
            return BST_OK;
        }
        int64_t array;
        BST_TRY(submit_batch(ctx, s, count, &array));
        for (int64_t i = 0; i < s->count; i++) {
            bst_slurm_task *t = &s->tasks[i];
            if (t->array == 0) {
                if (array > 0 && t->batch == s->batches) {
                    t->array = array;
                    t->gone = t->held = false;
                }
                if (array == 0) {
                    t->batch = -1;
                }
            }
        }
        if (array == 0) {
            return BST_OK;
        }
        s->silent_s = bst_wall_seconds();
        s->batches++;
    }
}
