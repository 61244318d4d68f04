/* 1/f noise of single pixels: of each the expected processes, given all its frames so far, and the
 * noise of this frame from one normal deviate, read noise included (pixel_flicker.h). */

/* state: [rows][chunks of 64 columns][terms][64], e-. noise: as the maps of detector.cl, e-. The
 * deviates are those of the read noise. One work-item per row of the sensor. */
READOUT_GROUP kernel void bst_detector_flicker(bst_kernel_flicker_params t, global float *state,
                                               global float *noise) {
    bst_kernel_frame_params p = t.frame;
    int row = (int)get_global_id(0);
    if (row >= p.maps_rows) {
        return;
    }
    for (int x = 0; x < p.maps_stride; x += 64) {
        size_t map = (size_t)row * p.maps_stride + x;
        chunk deviates = chunk_normal(chunk_random(p, counter_of(row, x, p.sensor_width),
                                                   STREAM_NOISE));
        lanes z[4] = {deviates.a, deviates.b, deviates.c, deviates.d}, sum[4];
        for (int v = 0; v < 4; v++) {
            sum[v] = t.spread * z[v];
        }
        global lanes *m = (global lanes *)(state + map * t.terms);
        for (int k = 0; k < t.terms; k++, m += 4) {
            for (int v = 0; v < 4; v++) {
                lanes expected = m[v];
                sum[v] = fma(expected, (lanes)t.weight[k], sum[v]);
                m[v] = fma(expected, (lanes)t.decay[k], t.gain[k] * z[v]);
            }
        }
        chunk all = {sum[0], sum[1], sum[2], sum[3]};
        store_chunk(noise + map, all);
    }
}
