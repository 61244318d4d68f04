/* `boresight study --dry-run`: prints number of runs, time and disk space, measured on two runs. */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/core/text.h"
#include "sim/io/run_store.h"
#include "sim/studies/local_pool.h"
#include "sim/studies/shard_run.h"
#include "sim/study_kinds/study_kinds.h"

enum { TRIED = 2, PATIENCE_MS = 60000 };
/* seconds of a trial run, from which the total time is extrapolated */
static const double TRIED_S = 1.0;

/* Results of the trial runs. */
typedef struct trial {
    int32_t count;
    double wall_s[TRIED];
    char error[256];
} trial;

static void try_runs(const bst_study *study, const bst_study_kind *kind, const char *out,
                     int workers, const char *device, int fd) {
    bst_shard_worker worker = {.study = study,
                               .kind = kind,
                               .out = out,
                               .place = {bst_local_settle(0, workers, 0, false), device},
                               .most_s = TRIED_S};
    trial t = {.count = 0};
    bst_ctx ctx = {0};
    while (t.count < TRIED && t.count < study->runs) {
        bst_study_result result;
        char error[BST_MESSAGE_BYTES];
        /* the last run is limited in time by the first */
        int64_t run = t.count == 0 ? 0 : study->runs - 1;
        if (bst_shard_run_one(&ctx, &worker, run, &result, error, &t.wall_s[t.count]) != BST_OK) {
            snprintf(t.error, sizeof t.error, "%.250s", ctx.message);
            break;
        }
        free(result.series);
        bool cut = result.left_s > 0.0;
        t.wall_s[t.count] += result.left_s;
        snprintf(t.error, sizeof t.error, "%.250s", error);
        t.count++;
        if (write(fd, &t, sizeof t) != (ssize_t)sizeof t || cut) {
            break;
        }
    }
    if (t.count == 0 && write(fd, &t, sizeof t) < 0) {
        t.count = 0; /* the parent has gone */
    }
    bst_shard_worker_close(&worker);
}

/* Removes a folder; returns the bytes of its files. */
static double take_away(const char *path) {
    double bytes = 0.0;
    DIR *dir = opendir(path);
    for (struct dirent *entry; dir && (entry = readdir(dir));) {
        char below[4096];
        struct stat info;
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) {
            continue;
        }
        snprintf(below, sizeof below, "%.3000s/%.900s", path, entry->d_name);
        if (lstat(below, &info) == 0 && S_ISDIR(info.st_mode)) {
            bytes += take_away(below);
        } else {
            bytes += (double)info.st_size;
            unlink(below);
        }
    }
    if (dir) {
        closedir(dir);
    }
    rmdir(path);
    return bytes;
}

/* Executes two trial runs in a process and folder of their own; *bytes: their output. */
static trial attempt(const bst_study *study, const bst_study_kind *kind, int workers,
                     const char *device, double *bytes) {
    trial t = {.count = 0}, news;
    char folder[256];
    int ends[2];
    const char *base = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.200s/boresight_study_XXXXXX", base && *base ? base : "/tmp");
    if (!mkdtemp(folder) || pipe(ends) != 0) {
        snprintf(t.error, sizeof t.error, "%s", strerror(errno));
        return t;
    }
    fflush(stdout);
    pid_t pid = fork();
    if (pid == 0) {
        close(ends[0]);
        try_runs(study, kind, folder, workers, device, ends[1]);
        _exit(0);
    }
    close(ends[1]);
    struct pollfd polled = {.fd = ends[0], .events = POLLIN};
    while (pid > 0 && poll(&polled, 1, PATIENCE_MS) > 0 &&
           read(ends[0], &news, sizeof news) == (ssize_t)sizeof news) {
        t = news;
    }
    if (pid > 0) {
        kill(pid, SIGKILL);
        waitpid(pid, NULL, 0);
    }
    close(ends[0]);
    *bytes = take_away(folder) / (t.count > 0 ? t.count : 1);
    return t;
}

static void print_time(double seconds) {
    if (seconds < 120.0) {
        printf("about %.0f s", seconds);
    } else if (seconds < 7200.0) {
        printf("about %.0f min", seconds / 60.0);
    } else {
        printf("about %.1f h", seconds / 3600.0);
    }
}

static void print_bytes(double bytes) {
    if (bytes < 1e10) {
        printf(bytes < 1e7 ? "%.1f MB" : "%.0f MB", 1e-6 * bytes);
    } else {
        printf("%.1f GB", 1e-9 * bytes);
    }
}

static void print_axes(const bst_study *study) {
    static const char *const designs[] = {"grid", "list", "latin hypercube", "one at a time",
                                          "morris"};
    for (int f = 0; f < study->factor_count; f++) {
        const bst_study_factor *factor = &study->factors[f];
        for (int a = 0; a < factor->axis_count; a++) {
            const bst_study_axis *axis = &study->axes[factor->first_axis + a];
            printf("  %-28s %6" PRId64 " levels, %s\n", axis->name, factor->levels,
                   designs[factor->design]);
        }
    }
    for (int a = study->swept_count; a < study->axis_count; a++) {
        printf("  %-28s %s\n", study->axes[a].name,
               study->axes[a].population ? "population, a number of objects" : "dispersed");
    }
}

void bst_study_print_plan(const bst_study *study, const bst_study_kind *kind, int workers,
                          const char *device, const char *out) {
    double bytes = 0.0, row_bytes = 60.0 * (kind->metric_count + study->axis_count + 8);
    printf(
        "%s, kind %s: %s, %s x %s, of %s\n", study->config.name, kind->name,
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, study->runs, "run", "runs"),
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, study->settings, "setting", "settings"),
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, study->config.replicates, "replicate",
                          "replicates"),
        bst_text_of_count((char[BST_COUNT_TEXT]){0}, study->base_count, "scenario", "scenarios"));
    print_axes(study);
    trial t = attempt(study, kind, workers, device, &bytes);
    if (*t.error) {
        printf("  a run that was tried failed: %s\n", t.error);
    }
    if (t.count == 0) {
        printf("  how long runs take is not known%s\n",
               *t.error ? "" : ": the first takes more than a minute");
    } else {
        double run_s = t.count > 1 ? t.wall_s[1] : t.wall_s[0];
        printf("  time: ");
        print_time(run_s * (double)study->runs / workers + fmax(t.wall_s[0] - run_s, 0.0));
        printf(" with %d worker%s (a run %.3g s, the first of a worker %.3g s)\n", workers,
               workers == 1 ? "" : "s", run_s, t.wall_s[0]);
    }
    double all = (bytes + row_bytes) * (double)study->runs;
    double room = (double)bst_run_free_bytes(out);
    printf("  disk: about ");
    print_bytes(all);
    if (room >= 0.0) {
        printf(" of ");
        print_bytes(room);
        printf(" that are free%s",
               all > room ? ": NOT ENOUGH; choose another folder with --out" : "");
    }
    printf("\n  results: %s\n", out);
}
