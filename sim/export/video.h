/* A film, made by the program ffmpeg as a child process. */
#ifndef BST_EXPORT_VIDEO_H
#define BST_EXPORT_VIDEO_H

#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_video bst_video;

/* Begins an MP4 file of width x height pixels (H.264, or MPEG-4 where ffmpeg lacks libx264; 4:2:0,
 * sides made even; at most 1 MB per second of film, at a quality that this allows) at `path`, which
 * appears when bst_video_end succeeds. BST_ERR_NOT_FOUND when there is no ffmpeg: the message says
 * what to install. Ignore SIGPIPE. */
bst_status bst_video_begin(bst_ctx *ctx, const char *path, int width, int height, double frame_rate,
                           bst_video **out) BST_MUST_CHECK;
/* Adds a frame of 3 * width * height bytes, blue first. BST_ERR_IO when ffmpeg ended. */
bst_status bst_video_add(bst_ctx *ctx, bst_video *video, const uint8_t *bgr) BST_MUST_CHECK;
/* Completes the file; frees `video` in every case. BST_ERR_IO with ffmpeg's own words. */
bst_status bst_video_end(bst_ctx *ctx, bst_video *video) BST_MUST_CHECK;
/* Gives it up: no file is left. NULL is allowed. */
void bst_video_abandon(bst_video *video);

#endif
