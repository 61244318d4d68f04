/* Light of one tile of a frame by a work-group of BST_ROW_LANES work-items for each of its rows, as
 * tile.cl does with one work-item. A work-item has columns 16 v + lane. */

/* Place of this work-item's first pixel: on the sensor, and in the window. */
typedef struct lane_place {
    int x, y, left, top;
    int inside; /* its row is in the window */
} lane_place;

INLINE lane_place place_lane(tile_place t) {
    int mine = (int)get_local_id(0), row = mine / BST_ROW_LANES, lane = mine % BST_ROW_LANES;
    lane_place l = {t.x + lane, t.y + row, t.left + lane, t.top + row, row < t.rows};
    return l;
}

/* Light of a pixel with vignetting, and the background. */
INLINE float whole_light(bst_kernel_frame_params p, float light, int x, int y,
                         global const float *background) {
    if (p.vignetting.law != BST_SHADE_NONE) {
        light *= shade_of(p.vignetting, (float)x - p.vignetting.centre_x,
                          (float)y - p.vignetting.centre_y);
    }
    return light + background_of(p, x, y, background);
}

#ifdef FOURIER
typedef struct gather_room {
    int none;
} gather_room;

/* Light of a pixel from the Fourier path's image (light.cl); rounding leaves the darkest slightly
 * negative. */
INLINE float image_light(bst_kernel_frame_params p, global const float *image, int left, int top) {
    int known = left >= 0 && left < p.window_width && top < p.window_height;
    return known ? fmax(image[p.light_first + (size_t)top * p.light_pitch + left], 0.0f) : 0.0f;
}
#endif

/* Light of this work-item's pixels; block_box, group_box, far_box, owner: of block_boxes.cl. */
INLINE chunk light_lane(local gather_room *room, bst_kernel_frame_params p, tile_place t,
                        lane_place l, global const bst_kernel_source_record *sources,
                        global const float *table, global const float *block_box,
                        global const float *group_box, global const float *far_box,
                        global const float *light, global const float *background) {
#ifdef FOURIER
    chunk c = {image_light(p, light, l.left, l.top), image_light(p, light, l.left + 16, l.top),
               image_light(p, light, l.left + 32, l.top),
               image_light(p, light, l.left + 48, l.top)};
#else
    scene_boxes boxes = {(global const float4 *)block_box, (global const float4 *)group_box,
                         (global const float4 *)far_box,
                         (global const int *)(block_box + 4 * p.blocks)};
    chunk c = gather_light(room, p, t, sources, table, boxes, light);
#endif
    c.a = whole_light(p, c.a, l.x, l.y, background);
    c.b = whole_light(p, c.b, l.x + 16, l.y, background);
    c.c = whole_light(p, c.c, l.x + 32, l.y, background);
    c.d = whole_light(p, c.d, l.x + 48, l.y, background);
    return c;
}
