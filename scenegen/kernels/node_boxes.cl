/* Pixel boxes of blocks of nodes, of sources and of groups of sources: one work-item per source. */

/* Boxes of inclusive pixels, in groups of 16: x0[16], y0[16], x1[16], y1[16]. block_box: of the
 * blocks of a source with several, from its first_box on; source_box: of sources; group_box: of
 * groups of sources. */
__attribute__((reqd_work_group_size(BST_BLOCK, 1, 1))) kernel void bst_scene_nodes(
    bst_kernel_node_params params, global const bst_kernel_source_record *sources, int count, global const float16 *table,
    global float *block_box, global float *source_box, global float *group_box) {
    int i = (int)get_global_id(0), g = i / BST_BLOCK;
    global float *box = source_box + g * 4 * BST_BLOCK + i % BST_BLOCK;
    float x0 = 1e9f, y0 = 1e9f, x1 = -1e9f, y1 = -1e9f;
    if (i < count) {
        bst_kernel_source_record s = sources[i];
        float reach = (float)s.radius;
        for (int b = 0; b < s.blocks; b++) {
            node_block n = nodes_of(params, s, b, table);
            int16 x = n.x >> params.place_bits, y = n.y >> params.place_bits;
            float4 r = (float4)((float)least_of(x) - reach, (float)least_of(y) - reach,
                                (float)most_of(x) + reach + 1.0f, (float)most_of(y) + reach + 1.0f);
            if (s.blocks > 1) {
                int lane = b % BST_BLOCK;
                global float *at = block_box + (s.first_box * BST_BLOCK + b - lane) * 4 + lane;
                at[0] = r.x;
                at[BST_BLOCK] = r.y;
                at[2 * BST_BLOCK] = r.z;
                at[3 * BST_BLOCK] = r.w;
            }
            x0 = fmin(x0, r.x);
            y0 = fmin(y0, r.y);
            x1 = fmax(x1, r.z);
            y1 = fmax(y1, r.w);
        }
    }
    box[0] = x0;
    box[BST_BLOCK] = y0;
    box[2 * BST_BLOCK] = x1;
    box[3 * BST_BLOCK] = y1;
    barrier(CLK_GLOBAL_MEM_FENCE);
    if (i % BST_BLOCK == 0) {
        global float *group = group_box + g / BST_BLOCK * 4 * BST_BLOCK + g % BST_BLOCK;
        group[0] = min_of(vload16(0, box));
        group[BST_BLOCK] = min_of(vload16(1, box));
        group[2 * BST_BLOCK] = max_of(vload16(2, box));
        group[3 * BST_BLOCK] = max_of(vload16(3, box));
    }
}
