/* Light of one tile by a work-group, for devices whose work-items share instructions: each work-item
 * gathers the light of its own pixels. The group searches the boxes of block_boxes.cl, generates
 * the nodes that touch the tile, computes their taps into local memory, and each work-item adds them
 * to its pixels. Options: ONE_LANE, TILE_H (rows of a tile of 64 columns), TAPS, DEGREE as in splat.cl.
 *
 * Every pixel receives its nodes in the order of sources, blocks and nodes, as in splat.cl: queues
 * are filled in the order of the work-items. */

#define GROUP_ITEMS (BST_ROW_LANES * TILE_H)
#define WORDS ((GROUP_ITEMS + 31) / 32)
/* Length of the queues: what is left to do and the finds of a whole group. */
#define QUEUE (2 * GROUP_ITEMS)
/* Nodes whose taps are in local memory at a time, and the distance of a tap from the next: odd, so
 * that neighbours lie in different banks. */
#if TAPS > 128
#define BATCH 8
#else
#define BATCH 32
#endif
#define BATCH_STRIDE (BATCH + 1)

typedef struct gather_room {
    uint words[WORDS]; /* a bit for each work-item */
    int far[GROUP_ITEMS], group[GROUP_ITEMS], block[QUEUE];
    /* nodes: fixed-point position relative to the tile, radius, light, widening */
    int x[QUEUE], y[QUEUE], radius[QUEUE];
    float electrons[QUEUE], width[QUEUE];
    /* of the nodes of a batch: column of the first tap, taps along x, light on each row of the tile;
     * the others are 0 */
    int left[BATCH];
    float along[TAPS * BATCH_STRIDE], rows[TILE_H * BATCH_STRIDE];
} gather_room;

/* Place of this work-item among those of the group with `hit`; *hits: how many they are. A barrier
 * must follow before the next call. */
INLINE int place_among(local gather_room *room, int hit, int *hits) {
    int mine = (int)get_local_id(0), place = 0, all = 0;
    if (mine < WORDS) {
        room->words[mine] = 0u;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (hit) {
        atomic_or(&room->words[mine / 32], 1u << (mine % 32));
    }
    barrier(CLK_LOCAL_MEM_FENCE);
#pragma unroll
    for (int w = 0; w < WORDS; w++) {
        uint word = room->words[w];
        uint before = w < mine / 32 ? word : w == mine / 32 ? word & ((1u << (mine % 32)) - 1u) : 0u;
        place += (int)popcount(before);
        all += (int)popcount(word);
    }
    *hits = all;
    return place;
}

/* Puts the numbers of the boxes that touch the tile into `queue` from `queued` on: box `number` of
 * `boxes`, one for each work-item. Returns how many are queued then. */
INLINE int find_boxes(local gather_room *room, float4 tile, global const float4 *box, int number,
                      int boxes, local int *queue, int queued) {
    int hit = 0, hits;
    if (number < boxes) {
        float4 b = box[number];
        hit = b.x <= tile.z && b.y <= tile.w && b.z >= tile.x && b.w >= tile.y;
    }
    int place = place_among(room, hit, &hits);
    if (hit) {
        queue[queued + place] = number;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return queued + hits;
}

/* Number of the box that this work-item examines below a queue of groups of boxes. */
INLINE int box_below(local const int *queue, int queued, int first) {
    int at = first + (int)get_local_id(0) / BST_BLOCK;
    return at < queued ? queue[at] * BST_BLOCK + (int)get_local_id(0) % BST_BLOCK : INT_MAX;
}

/* Tap k of a node of this radius: its share of the light, times `height`. within, more: as in
 * splat.cl. */
INLINE float tap_of(float within, float more, float height, int radius, int k,
                    global const float *law) {
#ifdef DEGREE
    if (more <= law[1]) {
        int d = k > radius ? k - radius : radius + 1 - k;
        global const float *c = law + BST_LAW_HEAD + (d - 1) * LAW_FLOATS;
        float g = fma(2.0f, within, -1.0f), g2 = g * g;
        int wide = more > 0.0f;
        float even = law_power(c, LAW_POWERS - 2, more, wide);
        float odd = law_power(c, LAW_POWERS - 1, more, wide);
#pragma unroll
        for (int q = LAW_POWERS - 4; q >= 0; q -= 2) {
            even = fma(even, g2, law_power(c, q, more, wide));
            odd = fma(odd, g2, law_power(c, q + 1, more, wide));
        }
        odd *= g;
        return (k > radius ? even + odd : even - odd) * height;
    }
#endif
    float scale = rsqrt(1.0f + more) * law[0];
    float before = (float)(k - 1 - radius) + 0.5f - within;
    float after = (float)(k - radius) + 0.5f - within;
    height *= 0.5f;
    return error_function(after * scale) * height - error_function(before * scale) * height;
}

/* Computes the taps of `count` nodes of the queue, from `first` on, into local memory. Work-items
 * side by side take the same tap of different nodes, and so the same coefficients. */
INLINE void make_taps(local gather_room *room, bst_kernel_node_params p, int first, int count,
                      global const float *law) {
    const int rest = (1 << p.place_bits) - 1;
    for (int i = (int)get_local_id(0); i < (TAPS + TILE_H) * BATCH; i += GROUP_ITEMS) {
        int n = i % BATCH, k = i / BATCH;
        if (n >= count) {
            continue;
        }
        int at = first + n, radius = room->radius[at], taps = 2 * radius + 2;
        float more = room->width[at];
        if (k == 0) {
            room->left[n] = (room->x[at] >> p.place_bits) - radius;
        }
        int along = k < TAPS, place = along ? room->x[at] : room->y[at];
        int tap = along ? k : k - TAPS - ((place >> p.place_bits) - radius);
        float light = 0.0f;
        if (tap >= 0 && tap < taps) {
            float within = (float)(place & rest) * p.per_parts;
            light = tap_of(within, more, along ? room->electrons[at] : 1.0f, radius, tap, law);
        }
        *(along ? &room->along[k * BATCH_STRIDE + n]
                : &room->rows[(k - TAPS) * BATCH_STRIDE + n]) = light;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
}

/* Adds the queued nodes to this work-item's pixels. */
INLINE void add_nodes(local gather_room *room, bst_kernel_node_params p, int nodes,
                      global const float *law, chunk *sum) {
    int lane = (int)get_local_id(0) % BST_ROW_LANES, row = (int)get_local_id(0) / BST_ROW_LANES;
    for (int first = 0; first < nodes; first += BATCH) {
        int count = min(nodes - first, BATCH);
        make_taps(room, p, first, count, law);
        for (int n = 0; n < count; n++) {
            float light = room->rows[row * BATCH_STRIDE + n];
            if (light == 0.0f) {
                continue;
            }
            int left = room->left[n];
            local const float *along = room->along + n;
#if TAPS <= BST_ROW_LANES
            /* at most one of the pixels is on the node's taps, which are followed by zeros */
            int v = (left - lane + 15) >> 4, tap = lane + 16 * v - left;
            float share = tap < TAPS ? along[tap * BATCH_STRIDE] : 0.0f;
            sum->a = v == 0 ? fma(light, share, sum->a) : sum->a;
            sum->b = v == 1 ? fma(light, share, sum->b) : sum->b;
            sum->c = v == 2 ? fma(light, share, sum->c) : sum->c;
            sum->d = v == 3 ? fma(light, share, sum->d) : sum->d;
#else
            float *sums[4] = {&sum->a, &sum->b, &sum->c, &sum->d};
#pragma unroll
            for (int v = 0; v < 4; v++) {
                int tap = lane + 16 * v - left;
                if (tap >= 0 && tap < TAPS) {
                    *sums[v] = fma(light, along[tap * BATCH_STRIDE], *sums[v]);
                }
            }
#endif
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

/* Lists of what a tile is rendered from: the buffers of block_boxes.cl. */
typedef struct scene_boxes {
    global const float4 *block, *group, *far;
    global const int *owner;
} scene_boxes;

/* Generates the nodes of the queued blocks that touch the tile and adds their light. */
INLINE void add_blocks(local gather_room *room, bst_kernel_frame_params p, tile_place t, int blocks,
                       global const bst_kernel_source_record *sources, global const float *table,
                       global const int *owner, global const float *law, chunk *sum) {
    int nodes = 0, node = (int)get_local_id(0) % BST_BLOCK, bits = p.nodes.place_bits;
    for (int first = 0; first < blocks; first += GROUP_ITEMS / BST_BLOCK) {
        int at = first + (int)get_local_id(0) / BST_BLOCK, hit = 0, hits, radius = 0;
        node_block n = {0, 0, 0.0f, 0.0f};
        if (at < blocks) {
            int block = room->block[at];
            bst_kernel_source_record s = sources[owner[block]];
            n = nodes_of(p.nodes, s, block - s.first, table + node);
            radius = s.radius;
            n.x -= t.x << bits;
            n.y -= t.y << bits;
            int left = (n.x >> bits) - radius, top = (n.y >> bits) - radius, taps = 2 * radius + 2;
            hit = left < 64 && left + taps > 0 && top < TILE_H && top + taps > 0 &&
                  n.electrons > 0.0f;
        }
        int place = nodes + place_among(room, hit, &hits);
        if (hit) {
            room->x[place] = n.x;
            room->y[place] = n.y;
            room->radius[place] = radius;
            room->electrons[place] = n.electrons;
            room->width[place] = n.width;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        nodes += hits;
        if (nodes > QUEUE - GROUP_ITEMS || first + GROUP_ITEMS / BST_BLOCK >= blocks) {
            add_nodes(room, p.nodes, nodes, law, sum);
            nodes = 0;
        }
    }
}

/* Light of the sources in this work-item's pixels of the tile: columns 16 v + lane of a row. */
INLINE chunk gather_light(local gather_room *room, bst_kernel_frame_params p, tile_place t,
                          global const bst_kernel_source_record *sources, global const float *table,
                          scene_boxes boxes, global const float *law) {
    chunk sum = {0.0f, 0.0f, 0.0f, 0.0f};
    float4 tile = (float4)((float)t.x, (float)t.y, (float)(t.x + 63), (float)(t.y + TILE_H - 1));
    int groups = (p.blocks + BST_BLOCK - 1) / BST_BLOCK, fars = (groups + BST_BLOCK - 1) / BST_BLOCK;
    int mine = (int)get_local_id(0), blocks = 0;
    const int step = GROUP_ITEMS / BST_BLOCK;
    for (int f = 0; f < fars; f += GROUP_ITEMS) {
        int far = find_boxes(room, tile, boxes.far, f + mine, fars, room->far, 0);
        for (int g = 0; g < far; g += step) {
            int number = box_below(room->far, far, g);
            int group = find_boxes(room, tile, boxes.group, number, groups, room->group, 0);
            for (int b = 0; b < group; b += step) {
                number = box_below(room->group, group, b);
                blocks = find_boxes(room, tile, boxes.block, number, p.blocks, room->block, blocks);
                if (blocks > QUEUE - GROUP_ITEMS) {
                    add_blocks(room, p, t, blocks, sources, table, boxes.owner, law, &sum);
                    blocks = 0;
                }
            }
        }
    }
    if (blocks > 0) {
        add_blocks(room, p, t, blocks, sources, table, boxes.owner, law, &sum);
    }
    return sum;
}
