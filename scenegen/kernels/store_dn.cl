/* Digital numbers of a chunk, stored in the frame. */

INLINE lanes_ushort clip_dn(bst_kernel_frame_params p, lanes dn) {
    return to_lanes_ushort(to_lanes_int(clamp(dn, 0.0f, p.max_dn)));
}

#ifdef ONE_LANE
/* Stores a pixel's digital number (plus one half) in the window's row; returns 1 if it is saturated
 * (`brim`, or converter at its maximum). Pixels outside the window are not stored. */
INLINE int store_pixel(bst_kernel_frame_params p, detector_maps maps, float dn, int brim, int column,
                       global ushort *row, global uchar *marks) {
    if (column < 0 || column >= p.window_width) {
        return 0;
    }
    int top = MASK(dn >= p.max_dn);
    ushort value = clip_dn(p, dn);
    row[column] = HAS(p, BST_EFFECT_CODES) ? maps.codes[value] : value;
    if (HAS(p, BST_EFFECT_FLAGS)) {
        marks[column] = (uchar)((brim & BST_FLAG_FULL_WELL) | (top & BST_FLAG_CONVERTER));
    }
    return -(brim | top);
}

/* Stores the lane's pixels of a chunk, the first at `column`; returns how many are saturated.
 * marks: row of flags, if they are stored. */
INLINE int store_lane(bst_kernel_frame_params p, detector_maps maps, chunk dn, chunk_flags brim,
                      int column, global ushort *row, global uchar *marks) {
    return store_pixel(p, maps, dn.a, brim.a, column, row, marks) +
           store_pixel(p, maps, dn.b, brim.b, column + 16, row, marks) +
           store_pixel(p, maps, dn.c, brim.c, column + 32, row, marks) +
           store_pixel(p, maps, dn.d, brim.d, column + 48, row, marks);
}
#else
/* 16 digital numbers at an odd address: vstore16 may become 16 stores. */
typedef ushort16 __attribute__((aligned(2))) ushort16_anywhere;

/* Stores 16 pixels as store_dn does, each alone. */
INLINE int16 store_pixels(bst_kernel_frame_params p, detector_maps maps, float16 dn, int16 brim,
                          int column, global ushort *row, global uchar *marks) {
    ushort values[16];
    int wells[16], tops[16], flags[16];
    vstore16(clip_dn(p, dn), 0, values);
    vstore16(brim, 0, wells);
    vstore16(dn >= p.max_dn, 0, tops);
    KEEP_LOOP
    for (int i = 0; i < 16; i++) {
        flags[i] = 0;
        if (column + i >= 0 && column + i < p.window_width) {
            flags[i] = wells[i] | tops[i];
            row[column + i] = HAS(p, BST_EFFECT_CODES) ? maps.codes[values[i]] : values[i];
            if (HAS(p, BST_EFFECT_FLAGS)) {
                marks[column + i] =
                    (uchar)((wells[i] & BST_FLAG_FULL_WELL) | (tops[i] & BST_FLAG_CONVERTER));
            }
        }
    }
    return vload16(0, flags);
}

/* Output codes of 16 digital numbers. */
INLINE ushort16 codes_of(detector_maps maps, ushort16 dn) {
    ushort values[16], found[16];
    vstore16(dn, 0, values);
    for (int i = 0; i < 16; i++) {
        found[i] = maps.codes[values[i]];
    }
    return vload16(0, found);
}

/* 16 numbers of the frame, inside the window. */
INLINE ushort16 number_of(bst_kernel_frame_params p, detector_maps maps, float16 dn) {
    ushort16 values = clip_dn(p, dn);
    if (HAS(p, BST_EFFECT_CODES)) {
        values = codes_of(maps, values);
    }
    return values;
}

/* Stores the digital numbers (plus one half) of a chunk in the window's row at `column`. Returns
 * saturated pixels (`brim`, or converter at its maximum) as -1, added up by float16; pixels outside
 * the window are 0. marks: row of flags, if they are stored. */
INLINE int16 store_dn(bst_kernel_frame_params p, detector_maps maps, chunk dn, chunk_flags brim,
                      int column, global ushort *row, global uchar *marks) {
    if (!HAS(p, BST_EFFECT_FLAGS) && column >= 0 &&
        column + 64 <= p.window_width) {
        global ushort16_anywhere *to = (global ushort16_anywhere *)(row + column);
        to[0] = number_of(p, maps, dn.a);
        to[1] = number_of(p, maps, dn.b);
        to[2] = number_of(p, maps, dn.c);
        to[3] = number_of(p, maps, dn.d);
        return (brim.a | (dn.a >= p.max_dn)) + (brim.b | (dn.b >= p.max_dn)) +
               (brim.c | (dn.c >= p.max_dn)) + (brim.d | (dn.d >= p.max_dn));
    }
    float16 numbers[4] = {dn.a, dn.b, dn.c, dn.d};
    int16 brims[4] = {brim.a, brim.b, brim.c, brim.d}, full = (int16)0;
    KEEP_LOOP
    for (int v = 0; v < 4; v++) {
        int at = column + 16 * v;
        if (!HAS(p, BST_EFFECT_FLAGS) && at >= 0 &&
            at + 16 <= p.window_width) {
            *(global ushort16_anywhere *)(row + at) = number_of(p, maps, numbers[v]);
            full += brims[v] | (numbers[v] >= p.max_dn);
        } else {
            full += store_pixels(p, maps, numbers[v], brims[v], at, row, marks);
        }
    }
    return full;
}
#endif
