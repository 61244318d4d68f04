/* Vignetting of the sources' light on a tile. Built only with the option VIGNETTING. CENTRE_X,
 * CENTRE_Y (px): boresight. With the squared distance s from it, either COS4 (1 / (1 + COS4 s)^2)
 * or the polynomial 1 + V1 s + V2 s^2 + V3 s^3; LIMIT2: no light beyond. */
#ifdef VIGNETTING
static void shade_tile(local float *sum, int tile_x, int tile_y) {
    const float16 lanes = (float16)(0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f, 8.0f, 9.0f,
                                    10.0f, 11.0f, 12.0f, 13.0f, 14.0f, 15.0f);
    for (int y = 0; y < TILE_H; y++) {
        float dy = (float)(tile_y + y) - CENTRE_Y;
        for (int x = 0; x < TILE_W; x += 16) {
            float16 dx = (float)(tile_x + x) - CENTRE_X + lanes, s = dx * dx + dy * dy;
#ifdef COS4
            float16 secant2 = 1.0f + COS4 * s, share = 1.0f / (secant2 * secant2);
#else
            float16 share = fmax(1.0f + s * (V1 + s * (V2 + s * V3)), (float16)0.0f);
#endif
            share = select(share, (float16)0.0f, s > LIMIT2);
            local float *at = sum + y * STRIDE + x;
            vstore16(share * vload16(0, at), 0, at);
        }
    }
}
#define SHADE_TILE(sum, x, y) shade_tile(sum, x, y)
#else
#define SHADE_TILE(sum, x, y)
#endif
