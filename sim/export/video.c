#include "sim/export/video.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/core/subprocess.h"

/* Limits a video to 1 MB per second of duration, for more than a second plus a frame: by the buffer
 * model of H.264 (ITU-T H.264, annex C) any interval of T seconds has at most rate T + buffer
 * bits. */
#define MOST_BITS_PER_S 6e6
#define BUFFER_BITS 2e6

struct bst_video {
    char path[4096], draft[4160], words[4160];
    size_t bytes; /* per frame */
    bool refused; /* ffmpeg rejected a frame: the file is incomplete */
    bst_subprocess child;
};

/* Checks whether ffmpeg can encode H.264. */
static bst_status has_x264(bst_ctx *ctx, bool *out) {
    const char *const argv[] = {"ffmpeg", "-hide_banner", "-encoders", NULL};
    bst_subprocess child;
    char line[512];
    bst_status status = bst_subprocess_start(ctx, argv, NULL, true, NULL, &child);
    if (status != BST_OK) {
        return bst_fail(ctx, status,
                        "mp4 needs the program ffmpeg, which cannot be run; install it (Debian: "
                        "apt-get install ffmpeg) or export png");
    }
    *out = false;
    while (fgets(line, sizeof line, child.output)) {
        *out = *out || strstr(line, " libx264 ");
    }
    bst_subprocess_wait(&child);
    return BST_OK;
}

/* Creates the drafts of the video, which ffmpeg overwrites (-y), and of its messages. */
static bst_status make_drafts(bst_ctx *ctx, bst_video *v) {
    int fd;
    BST_TRY(bst_draft_make(ctx, v->path, v->draft, sizeof v->draft, &fd));
    close(fd);
    bst_status status = bst_draft_make(ctx, v->path, v->words, sizeof v->words, &fd);
    if (status == BST_OK) {
        close(fd);
    } else {
        unlink(v->draft);
    }
    return status;
}

bst_status bst_video_begin(bst_ctx *ctx, const char *path, int width, int height, double frame_rate,
                           bst_video **out) {
    *out = NULL;
    bool x264 = false;
    BST_TRY(has_x264(ctx, &x264));
    bst_video *v = calloc(1, sizeof *v);
    if (!v) {
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory for a film");
    }
    if (strlen(path) + 3 > sizeof v->path) {
        free(v);
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: the path is too long", path);
    }
    /* a path must not look like an option or a protocol */
    const char *here = path[0] == '/' ? "" : "./";
    snprintf(v->path, sizeof v->path, "%s%s", here, path);
    bst_status status = make_drafts(ctx, v);
    if (status != BST_OK) {
        free(v);
        return status;
    }
    v->bytes = 3 * (size_t)width * (size_t)height;
    char size[32], rate[32], output[4200], most[32], buffer[32];
    snprintf(size, sizeof size, "%dx%d", width, height);
    snprintf(rate, sizeof rate, "%.6g", frame_rate);
    snprintf(output, sizeof output, "file:%s", v->draft);
    snprintf(most, sizeof most, "%.0f", MOST_BITS_PER_S);
    snprintf(buffer, sizeof buffer, "%.0f", BUFFER_BITS * fmax(1.0, 1.0 / frame_rate));
    const char *const argv[] = {
        "ffmpeg", "-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-f", "rawvideo",
        "-pixel_format", "bgr24", "-video_size", size, "-framerate", rate, "-i", "pipe:0", "-an",
        "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-c:v",
        x264 ? "libx264" : "mpeg4", x264 ? "-crf" : "-b:v", x264 ? "20" : most,
        /* keeps the colours of the marks, at the expense of the grey noise */
        x264 ? "-x264-params" : "-qmin", x264 ? "chroma-qp-offset=-12" : "2", "-maxrate", most,
        "-bufsize", buffer, "-movflags", "+faststart", "-f", "mp4", output, NULL};
    status = bst_subprocess_start_fed(ctx, argv, v->words, &v->child);
    if (status != BST_OK) {
        unlink(v->draft);
        unlink(v->words);
        free(v);
        return status;
    }
    *out = v;
    return BST_OK;
}

bst_status bst_video_add(bst_ctx *ctx, bst_video *video, const uint8_t *bgr) {
    if (fwrite(bgr, 1, video->bytes, video->child.input) != video->bytes) {
        video->refused = true;
        return bst_fail(ctx, BST_ERR_IO, "%s: ffmpeg does not take frames any more: %s",
                        video->path, strerror(errno));
    }
    return BST_OK;
}

/* Reads the first line of ffmpeg's messages. */
static void read_words(const bst_video *video, char *text, size_t bytes) {
    FILE *file = fopen(video->words, "re");
    snprintf(text, bytes, "no reason given");
    if (file) {
        char line[400];
        if (fgets(line, sizeof line, file)) {
            line[strcspn(line, "\r\n")] = '\0';
            snprintf(text, bytes, "%s", line);
        }
        fclose(file);
    }
}

bst_status bst_video_end(bst_ctx *ctx, bst_video *video) {
    bst_status status = BST_OK;
    char words[400];
    int code = bst_subprocess_wait(&video->child);
    if (code != 0 || video->refused) {
        read_words(video, words, sizeof words);
        status = bst_fail(ctx, BST_ERR_IO, "%s: ffmpeg failed (exit code %d): %s", video->path,
                          code, words);
    } else if (rename(video->draft, video->path) != 0) {
        status =
            bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", video->path, strerror(errno));
    }
    if (status != BST_OK) {
        unlink(video->draft);
    }
    unlink(video->words);
    free(video);
    return status;
}

void bst_video_abandon(bst_video *video) {
    if (video) {
        bst_subprocess_wait(&video->child);
        unlink(video->draft);
        unlink(video->words);
        free(video);
    }
}
