/* Light of a tile from the Fourier path's image, instead of the nodes' stamps. The image starts at
 * the window's first pixel; its row stride is p.light_pitch floats. */
static void load_tile(local float *sum, bst_kernel_frame_params p, int left, int top,
                      global const float *image) {
    int rows = min(TILE_H, p.window_height - top), columns = min(TILE_W, p.window_width - left);
    int first = max(0, -left); /* the tile may start before the window */
    image += p.light_first + (size_t)top * p.light_pitch + left;
    for (int y = 0; y < rows; y++) {
        /* rounding leaves the darkest pixels slightly negative; rows are padded for the last vector */
        for (int x = 0; x < columns; x += 16) {
            if (left + x < 0) { /* the window starts inside the vector or after it */
                for (int i = x; i < x + 16; i++) {
                    sum[y * STRIDE + i] =
                        left + i < 0 ? 0.0f : fmax(image[(size_t)y * p.light_pitch + i], 0.0f);
                }
                continue;
            }
            *(local float16 *)(sum + y * STRIDE + x) =
                fmax(vload16(0, image + (size_t)y * p.light_pitch + x), 0.0f);
        }
    }
}
