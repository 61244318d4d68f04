/* Search for the blocks of nodes that touch a tile, in the order of sources and blocks. Each
 * work-item of a group searches until it has a block, then all render theirs together. In nested
 * loops over sources and blocks, work-items that share an instruction stream would take turns,
 * because each has its own sources. */

/* State of the search in one tile. Masks have a bit per group, source or block still to visit. */
typedef struct block_search {
    float4 tile; /* first and last pixel: x0, y0, x1, y1 */
    int source_groups, first_group, group, source_index, first_block;
    uint groups, sources, blocks;
    bst_kernel_source_record source; /* of the block found */
} block_search;

/* Bit per lane of a comparison. */
INLINE uint mask_of(int16 v) {
    v &= (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    int8 a = v.lo | v.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (uint)(c.lo | c.hi);
}

/* Mask of the first `count` lanes, at most 16. */
INLINE uint first_lanes(int count) {
    return (1u << min(count, BST_BLOCK)) - 1u;
}

/* Removes the lowest bit of a mask that is not 0; returns its number. */
INLINE int take_lowest(uint *mask) {
    int bit = 31 - (int)clz(*mask & (0u - *mask));
    *mask &= *mask - 1u;
    return bit;
}

/* Which of 16 boxes touch the tile: x0[16], y0[16], x1[16], y1[16]. */
INLINE uint boxes_hit(global const float *box, float4 tile) {
    return mask_of((vload16(0, box) <= tile.z) & (vload16(1, box) <= tile.w) &
                   (vload16(2, box) >= tile.x) & (vload16(3, box) >= tile.y));
}

/* Groups of sources to visit from s->first_group on. group_box 0: all of them. */
INLINE uint groups_hit(const block_search *s, global const float *group_box) {
    uint lanes = first_lanes(s->source_groups - s->first_group);
    return group_box ? lanes & boxes_hit(group_box + s->first_group * 4, s->tile) : lanes;
}

/* Blocks of the source to visit from s->first_block on. A single block has the source's box. */
INLINE uint blocks_hit(const block_search *s, global const float *block_box) {
    uint lanes = first_lanes(s->source.blocks - s->first_block);
    if (s->source.blocks > 1) {
        int box = s->source.first_box * BST_BLOCK + s->first_block;
        lanes &= boxes_hit(block_box + box * 4, s->tile);
    }
    return lanes;
}

INLINE block_search begin_search(float4 tile, int source_groups, global const float *group_box) {
    block_search s;
    s.tile = tile;
    s.source_groups = source_groups;
    s.first_group = s.group = s.source_index = s.first_block = 0;
    s.sources = s.blocks = 0u;
    s.source.blocks = 0;
    s.groups = source_groups > 0 ? groups_hit(&s, group_box) : 0u;
    return s;
}

/* Finds the next block of s->source that may touch the tile; returns its number, or -1 after the
 * last. */
INLINE int next_block(block_search *s, global const bst_kernel_source_record *sources,
                      global const float *block_box, global const float *source_box,
                      global const float *group_box) {
    for (int more = 1; more && !s->blocks;) {
        if (s->first_block + BST_BLOCK < s->source.blocks) {
            s->first_block += BST_BLOCK;
            s->blocks = blocks_hit(s, block_box);
        } else if (s->sources) {
            s->source_index = s->group * BST_BLOCK + take_lowest(&s->sources);
            s->source = sources[s->source_index];
            s->first_block = 0;
            s->blocks = blocks_hit(s, block_box);
        } else if (s->groups) {
            s->group = s->first_group + take_lowest(&s->groups);
            s->sources = boxes_hit(source_box + s->group * 4 * BST_BLOCK, s->tile);
        } else if (s->first_group + BST_BLOCK < s->source_groups) {
            s->first_group += BST_BLOCK;
            s->groups = groups_hit(s, group_box);
        } else {
            more = 0;
        }
    }
    return s->blocks ? s->first_block + take_lowest(&s->blocks) : -1;
}
