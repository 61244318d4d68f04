/* Varying part of the background, added to a tile's light. */

#ifdef ONE_LANE
/* Background of a pixel of the sensor: bilinear between the nodes of bst_skylight_map, which lie at
 * multiples of a power of two, so that the weights are exact. */
INLINE float background_of(bst_kernel_frame_params p, int x, int y, global const float *background) {
    int down = y - p.map_y0, right = x - p.map_x0;
    if (p.map_step > 32768) {
        return 0.0f; /* there is no background map */
    }
    if (p.map_step == 1) {
        int known = right >= 0 && right < p.map_columns && down >= 0 && down < p.map_rows;
        return known ? background[(size_t)down * p.map_columns + right] : 0.0f;
    }
    float share = 1.0f / (float)p.map_step;
    int j = min(down / p.map_step, p.map_rows - 2);
    int i = clamp(right / p.map_step, 0, p.map_columns - 2);
    float t = (float)(down - j * p.map_step) * share;
    float s = (float)(right - i * p.map_step) * share;
    global const float *above = background + j * p.map_columns + i, *below = above + p.map_columns;
    float v0 = above[0] + t * (below[0] - above[0]);
    float v1 = above[1] + t * (below[1] - above[1]);
    return v0 + s * (v1 - v0);
}
#else
/* Bilinear interpolation between the nodes of bst_skylight_map. Nodes lie at multiples of a power
 * of two, so weights are exact and a pixel's value does not depend on tile or window. */
static void add_nodes(local float *sum, bst_kernel_frame_params p, int tile_x, int tile_y, int rows,
                      int columns, global const float *background) {
    const float16 lanes = (float16)(0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f,
                                    10.0f, 11.0f, 12.0f, 13.0f, 14.0f, 15.0f);
    float share = 1.0f / (float)p.map_step;
    for (int y = 0; y < rows; y++) {
        int down = tile_y + y - p.map_y0;
        int j = min(down / p.map_step, p.map_rows - 2);
        float t = (float)(down - j * p.map_step) * share;
        global const float *above = background + j * p.map_columns, *below = above + p.map_columns;
        for (int x = 0; x < columns; x += 16) {
            int right = tile_x + x - p.map_x0;
            int i = clamp(right / p.map_step, 0, p.map_columns - 2);
            float16 s = ((float)(right - i * p.map_step) + lanes) * share;
            float16 value = (float16)0.0f;
            /* a vector may span several small cells */
            for (int first = i;; i++) {
                float v0 = above[i] + t * (below[i] - above[i]);
                float v1 = above[i + 1] + t * (below[i + 1] - above[i + 1]);
                float16 here = v0 + s * (v1 - v0);
                value = i == first ? here : select(value, here, s >= 0.0f);
                if (s.sf < 1.0f || i + 2 >= p.map_columns) {
                    break;
                }
                s -= 1.0f;
            }
            local float *at = sum + y * STRIDE + x;
            vstore16(vload16(0, at) + value, 0, at);
        }
    }
}

/* Pixel by pixel: the map has the window's resolution. */
static void add_pixels(local float *sum, bst_kernel_frame_params p, int tile_x, int tile_y, int rows,
                       int columns, global const float *background) {
    int first = max(0, p.map_x0 - tile_x), last = min(columns, p.map_x0 + p.map_columns - tile_x);
    for (int y = 0; y < rows; y++) {
        global const float *row =
            background + (size_t)(tile_y + y - p.map_y0) * p.map_columns + tile_x - p.map_x0;
        local float *out = sum + y * STRIDE;
        for (int x = first; x < last; x++) {
            out[x] += row[x];
        }
    }
}

static void add_background(local float *sum, bst_kernel_frame_params p, int tile_x, int tile_y, int rows,
                           int columns, global const float *background) {
    if (p.map_step > 32768) {
        return; /* there is no background map */
    }
    if (p.map_step == 1) {
        add_pixels(sum, p, tile_x, tile_y, rows, columns, background);
    } else {
        add_nodes(sum, p, tile_x, tile_y, rows, columns, background);
    }
}
#endif
