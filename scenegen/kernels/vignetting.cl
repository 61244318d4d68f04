/* Vignetting of the sources' light. */

/* Share of the light at (dx, dy) from the boresight. */
INLINE lanes shade_of(bst_kernel_vignetting_params v, lanes dx, float dy) {
    lanes s = dx * dx + dy * dy, share;
    if (v.law == BST_SHADE_COS4) {
        lanes secant2 = 1.0f + v.v1 * s;
        share = 1.0f / (secant2 * secant2);
    } else {
        share = fmax(1.0f + s * (v.v1 + s * (v.v2 + s * v.v3)), (lanes)0.0f);
    }
    return select(share, (lanes)0.0f, s > v.limit2);
}

#ifndef ONE_LANE
static void shade_tile(local float *sum, bst_kernel_vignetting_params v, int tile_x, int tile_y) {
    if (v.law == BST_SHADE_NONE) {
        return;
    }
    const float16 numbers = (float16)(0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f,
                                      10.0f, 11.0f, 12.0f, 13.0f, 14.0f, 15.0f);
    for (int y = 0; y < TILE_H; y++) {
        float dy = (float)(tile_y + y) - v.centre_y;
        for (int x = 0; x < TILE_W; x += 16) {
            float16 share = shade_of(v, (float)(tile_x + x) - v.centre_x + numbers, dy);
            local float *at = sum + y * STRIDE + x;
            vstore16(share * vload16(0, at), 0, at);
        }
    }
}
#endif
