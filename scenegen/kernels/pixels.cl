/* The detector of the tile kernel, from light to digital numbers, with as few random deviates as the
 * accuracy permits. Options: CF_ORDER (noise_law.cl), TAIL (read_tail.cl). */

/* Lanes for which one deviate is not accurate enough: small means with little read noise, and means
 * near the full well, where the charge is clipped before read noise is added. */
INLINE lanes_int needs_two(bst_kernel_frame_params p, lanes mean) {
    return MASK((mean < p.single_from) | (mean > p.near_full_e));
}

/* Vectors of a chunk in memory, for loops over them. */
typedef struct chunk_lines {
    lanes v[4];
} chunk_lines;

INLINE chunk_lines lines_of(chunk c) {
    chunk_lines l = {{c.a, c.b, c.c, c.d}};
    return l;
}

/* Electrons of a chunk with pixels that are far from the near law's means, or struck by charge
 * `over`: e holds those of the others, before the amplifier. Lanes that need two deviates draw
 * charge first, then read noise. Few chunks come here, so loops keep the program short. */
INLINE chunk draw_bright(bst_kernel_frame_params p, chunk mean, chunk over, chunk normal,
                         chunk_flags far_lanes, uint counter, chunk e, chunk_flags *brim) {
    chunk_lines m = lines_of(mean), o = lines_of(over), z = lines_of(normal), out = lines_of(e);
    lanes_int far[4] = {far_lanes.a, far_lanes.b, far_lanes.c, far_lanes.d}, two[4], any = (lanes_int)0;
    KEEP_LOOP
    for (int v = 0; v < 4; v++) {
        if (any_of(far[v])) {
            out.v[v] = select(out.v[v], draw_single(noise_law_of(p, m.v[v]), z.v[v]), far[v]);
        }
        two[v] = needs_two(p, m.v[v]) | MASK(m.v[v] + o.v[v] > p.near_full_e);
        out.v[v] = respond(p, out.v[v] + o.v[v]);
        any |= two[v];
    }
    if (any_of(any)) {
        chunk_words words = chunk_random(p, counter, STREAM_POISSON);
        chunk_lines n = lines_of(chunk_normal(chunk_random(p, counter, STREAM_POISSON_NORMAL)));
        lanes_uint w[4] = {words.a, words.b, words.c, words.d};
        lanes_int full[4];
        KEEP_LOOP
        for (int v = 0; v < 4; v++) {
            lanes charge = draw_charge(m.v[v], w[v], n.v[v], two[v]) + o.v[v];
            full[v] = two[v] & MASK(charge >= p.full_well_e);
            out.v[v] = select(out.v[v], read_out(p, fmin(charge, p.full_well_e), z.v[v]), two[v]);
        }
        brim->a = full[0];
        brim->b = full[1];
        brim->c = full[2];
        brim->d = full[3];
    }
    chunk drawn = {out.v[0], out.v[1], out.v[2], out.v[3]};
    return drawn;
}

#ifdef ONE_LANE
/* Digital numbers plus one half of the lane's pixels of a chunk, before clipping to the converter's
 * range. counter: of the lane. row, column: of its first pixel on the sensor. struck: the chunk has
 * charge of cosmic rays. light: electrons of the sources. brim: pixels with a full well. */
INLINE chunk detect_lane(bst_kernel_frame_params p, detector_maps maps, uint counter, int row,
                         int column, int struck, chunk light, chunk_flags *brim) {
    size_t map = (size_t)row * p.maps_stride + column;
    chunk z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
    chunk m = add_dark(p, maps, map, expected_chunk(p, maps, map, light));
    chunk over = {0.0f, 0.0f, 0.0f, 0.0f};
    chunk_flags all = {-1, -1, -1, -1};
    if (struck) {
        over = load_chunk(maps.overlay + map);
    }
    brim->a = brim->b = brim->c = brim->d = 0;
    return draw_bright(p, m, over, z, all, counter, m, brim);
}
#else
/* Noise law common to all pixels without source light, if they have the same mean. */
typedef struct dark_law {
    noise_law law;
    int single; /* one deviate is accurate enough */
    int steps;  /* steps of the search for a small mean; 0: the search is not used */
    float mean;
} dark_law;

#define MOST_STEPS 128

/* steps: cumulative probabilities of the search, equal to those of poisson_search. */
INLINE dark_law dark_law_of(bst_kernel_frame_params p, uint *steps) {
    dark_law dark;
    dark.mean = (p.background_e - p.dark_e) + p.dark_e; /* as the sum of the two below */
    lanes mean = (lanes)dark.mean;
    dark.law = noise_law_of(p, mean);
    int shared = !HAS(p, BST_EFFECT_GAIN | BST_EFFECT_DARK | BST_EFFECT_READOUT);
    dark.single = shared && !any_of(needs_two(p, mean));
    dark.steps = 0;
    if (shared && p.single_from > 0.0f && dark.mean < POISSON_SWITCH &&
        dark.mean <= p.near_full_e) {
        lanes chance = first_chance(mean);
        uint sum = 0u;
        for (int k = 0; k < MOST_STEPS; k++) {
            uint part = convert_uint(chance.s0);
            if (part == 0u && dark.mean < (float)k) {
                break;
            }
            sum = add_sat(sum, part);
            steps[k] = sum;
            dark.steps = k + 1;
            chance *= mean * (1.0f / (float)(k + 1));
        }
    }
    return dark;
}

/* Search results for the words of a dark chunk, by counting instead of stepping. */
INLINE chunk dark_electrons(dark_law dark, const uint *steps, chunk_words w) {
    chunk_flags n = {(lanes_int)0, (lanes_int)0, (lanes_int)0, (lanes_int)0};
    uint last = 0u;
    for (int k = 0; k < dark.steps; k++) {
        last = steps[k];
        n.a += w.a > last;
        n.b += w.b > last;
        n.c += w.c > last;
        n.d += w.d > last;
    }
    lanes mean = (lanes)floor(dark.mean);
    chunk e;
    e.a = select(-to_lanes(n.a), mean, w.a > last);
    e.b = select(-to_lanes(n.b), mean, w.b > last);
    e.c = select(-to_lanes(n.c), mean, w.c > last);
    e.d = select(-to_lanes(n.d), mean, w.d > last);
    return e;
}
/* Digital numbers plus one half of one chunk, before clipping to the converter's range. counter: of
 * its first lane. row, column: of its first pixel on the sensor. light: electrons of the sources,
 * present if `lit`. brim: lanes with a full well. */
INLINE chunk detect_chunk(bst_kernel_frame_params p, detector_maps maps, dark_law dark, near_law near,
                          const uint *steps, const tail_block *tail, uint counter, int row,
                          int column, chunk light, int lit, chunk_flags *brim) {
    chunk e, z = chunk_normal(chunk_random(p, counter, STREAM_NOISE));
    brim->a = brim->b = brim->c = brim->d = (lanes_int)0;
    size_t map = (size_t)row * p.maps_stride + column;
    int struck = HAS(p, BST_EFFECT_OVERLAY) && maps.overlay[overlay_mark(p, map)] != 0.0f;
    if (!lit && !struck && dark.single) {
        e.a = draw_single(dark.law, z.a);
        e.b = draw_single(dark.law, z.b);
        e.c = draw_single(dark.law, z.c);
        e.d = draw_single(dark.law, z.d);
        e = respond_chunk(p, e);
    } else if (!lit && !struck && dark.steps > 0) {
        e = respond_chunk(p, dark_electrons(dark, steps, chunk_random(p, counter, STREAM_POISSON)));
        e.a = fma((lanes)p.read_noise_e, z.a, e.a);
        e.b = fma((lanes)p.read_noise_e, z.b, e.b);
        e.c = fma((lanes)p.read_noise_e, z.c, e.c);
        e.d = fma((lanes)p.read_noise_e, z.d, e.d);
    } else {
        chunk m = add_dark(p, maps, map, expected_chunk(p, maps, map, light));
        /* lane by lane, so that no pixel depends on its neighbours, which a window may not have */
        chunk_flags far = {(lanes_int)-1, (lanes_int)-1, (lanes_int)-1, (lanes_int)-1};
        e = m;
        if (near.serves) {
            chunk x;
            x.a = (m.a - near.mean) * near.per_reach;
            x.b = (m.b - near.mean) * near.per_reach;
            x.c = (m.c - near.mean) * near.per_reach;
            x.d = (m.d - near.mean) * near.per_reach;
            e.a = draw_single(law_near(near, x.a), z.a);
            e.b = draw_single(law_near(near, x.b), z.b);
            e.c = draw_single(law_near(near, x.c), z.c);
            e.d = draw_single(law_near(near, x.d), z.d);
            far.a = fabs(x.a) > 1.0f;
            far.b = fabs(x.b) > 1.0f;
            far.c = fabs(x.c) > 1.0f;
            far.d = fabs(x.d) > 1.0f;
        }
        if (struck || any_of((far.a | far.b) | (far.c | far.d))) {
            chunk over = {(lanes)0.0f, (lanes)0.0f, (lanes)0.0f, (lanes)0.0f};
            if (struck) {
                over = load_chunk(maps.overlay + map);
            }
            e = draw_bright(p, m, over, z, far, counter, e, brim);
        } else {
            e = respond_chunk(p, e);
        }
    }
    return convert_chunk(p, maps, row, column, ADD_TAIL(tail, row, e));
}
#endif
