#include "sim/io/run_files.h"

#include <fnmatch.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sim/core/draft.h"

/* With several sensors, FITS files are named WHAT_OBSERVER_SENSOR.fits
 * (sim/engine/recorder/recorder.c). */
static const char *const run_names[] = {"run.sqlite",
                                        "run.sqlite-wal",
                                        "run.sqlite-shm",
                                        "run.sqlite-journal",
                                        "manifest.json",
                                        "scenario.json",
                                        "link.packets",
                                        "quicklook.png",
                                        "pointing.png",
                                        "wall_clock.csv",
                                        "lock",
                                        "state",
                                        "frames.fits",
                                        "frames.fits.rows",
                                        "stars.fits",
                                        "targets.fits",
                                        "background.fits",
                                        "segmentation.fits",
                                        "saturation.fits",
                                        "parts.fits",
                                        "frames_*_*.fits",
                                        "frames_*_*.fits.rows",
                                        "stars_*_*.fits",
                                        "targets_*_*.fits",
                                        "background_*_*.fits",
                                        "segmentation_*_*.fits",
                                        "saturation_*_*.fits",
                                        "parts_*_*.fits",
                                        NULL};

static const char *const study_names[] = {
    "study.sqlite", "study.sqlite-*", "study.json",  "plugins.json",
    "lock",         "card.json",      "train.txt",   "val.txt",
    "test.txt",     "*.csv",          "shards",      "runs",
    "slurm",        "ImageFiles",     "Annotations", NULL};

/* Matches a file name against patterns; drafts of these files match too. */
static bool matches(const char *const *patterns, const char *name) {
    char base[256];
    int n = snprintf(base, sizeof base, "%s", name);
    if (n < 0 || (size_t)n >= sizeof base) {
        return false;
    }
    if (bst_draft_is_name(base)) {
        *(strrchr(base, '.') - strlen(".tmp")) = '\0';
    }
    for (; *patterns; patterns++) {
        if (fnmatch(*patterns, base, 0) == 0) {
            return true;
        }
    }
    return false;
}

size_t bst_run_folder_length(const char *path) {
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') {
        length--;
    }
    return length;
}

bool bst_run_owns(const char *name) {
    return matches(run_names, name);
}

bool bst_io_study_owns(const char *name) {
    return matches(study_names, name);
}

static bool has(const char *folder, const char *name) {
    char path[4200];
    struct stat info;
    int n = snprintf(path, sizeof path, "%s/%s", folder, name);
    return n > 0 && (size_t)n < sizeof path && lstat(path, &info) == 0;
}

bool bst_io_folder_is_run(const char *folder) {
    return has(folder, "run.sqlite") ||
           (has(folder, "manifest.json") && has(folder, "scenario.json"));
}

bool bst_io_folder_is_study(const char *folder) {
    return has(folder, "study.sqlite") || has(folder, "shards");
}
