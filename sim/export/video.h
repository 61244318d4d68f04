/* Writes a video with ffmpeg as a child process. */
#ifndef BST_EXPORT_VIDEO_H
#define BST_EXPORT_VIDEO_H

#include <stdint.h>

#include "boresight/status.h"

typedef struct bst_video bst_video;

/* Begins an MP4 video of width x height pixels (rounded to even) at `path`, which appears with
 * bst_video_end. H.264, or MPEG-4 if ffmpeg has no libx264; 4:2:0; best quality within 1 MB per
 * second. BST_ERR_NOT_FOUND: no ffmpeg; the message names the package. Ignore SIGPIPE. */
bst_status bst_video_begin(bst_ctx *ctx, const char *path, int width, int height, double frame_rate,
                           bst_video **out) BST_MUST_CHECK;
/* Adds a frame of 3 * width * height bytes, blue first. BST_ERR_IO: ffmpeg has ended. */
bst_status bst_video_add(bst_ctx *ctx, bst_video *video, const uint8_t *bgr) BST_MUST_CHECK;
/* Completes the video and frees it, also after an error. BST_ERR_IO with ffmpeg's message. */
bst_status bst_video_end(bst_ctx *ctx, bst_video *video) BST_MUST_CHECK;
/* Abandons a video and removes its file. NULL is allowed. */
void bst_video_abandon(bst_video *video);

#endif
