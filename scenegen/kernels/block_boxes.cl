/* Pixel boxes of the blocks of nodes of all sources in order, of groups of BST_BLOCK blocks, and of
 * groups of these, for the search by work-groups (gather.cl). */

/* Source of a block: the last whose first block is not after it. */
INLINE int source_of(global const bst_kernel_source_record *sources, int count, int block) {
    int low = 0, high = count - 1;
    while (low < high) {
        int middle = (low + high + 1) / 2;
        if (sources[middle].first <= block) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return low;
}

/* Side of the box about `count` values, `step` apart: the least of the low sides 0 and 1, the
 * largest of the high sides 2 and 3. */
INLINE float side_of(local const float *values, int step, int count, int side) {
    float found = values[0];
    for (int i = 1; i < count; i++) {
        found = side < 2 ? fmin(found, values[i * step]) : fmax(found, values[i * step]);
    }
    return found;
}

/* Boxes of inclusive pixels: x0, y0, x1, y1. A work-group makes those of BST_BOX_GROUP blocks, a
 * work-item a node at a time. The source of each block follows the blocks' boxes. */
__attribute__((reqd_work_group_size(BST_BOX_GROUP, 1, 1))) kernel void bst_scene_block_boxes(
    bst_kernel_node_params params, global const bst_kernel_source_record *sources, int count,
    int blocks, global const float *table, global float *block_box, global float *group_box,
    global float *far_box) {
    local float place[4][BST_BOX_GROUP], box[BST_BLOCK][4], groups[BST_BLOCK][4];
    int mine = (int)get_local_id(0), far = (int)get_group_id(0), node = mine % BST_BLOCK;
    global int *owner = (global int *)(block_box + 4 * blocks);
    for (int g = 0; g < BST_BLOCK && (far * BST_BLOCK + g) * BST_BLOCK < blocks; g++) {
        int group = far * BST_BLOCK + g, block = group * BST_BLOCK + mine / BST_BLOCK;
        float4 r = (float4)(1e9f, 1e9f, -1e9f, -1e9f);
        if (block < blocks) {
            int i = source_of(sources, count, block);
            bst_kernel_source_record s = sources[i];
            node_block n = nodes_of(params, s, block - s.first, table + node);
            float x = (float)(n.x >> params.place_bits), y = (float)(n.y >> params.place_bits);
            float reach = (float)s.radius;
            r = (float4)(x - reach, y - reach, x + reach + 1.0f, y + reach + 1.0f);
            if (node == 0) {
                owner[block] = i;
            }
        }
        place[0][mine] = r.x;
        place[1][mine] = r.y;
        place[2][mine] = r.z;
        place[3][mine] = r.w;
        barrier(CLK_LOCAL_MEM_FENCE);
        if (mine < 4 * BST_BLOCK) {
            int b = mine / 4, side = mine % 4;
            box[b][side] = side_of(&place[side][b * BST_BLOCK], 1, BST_BLOCK, side);
            if (group * BST_BLOCK + b < blocks) {
                block_box[(group * BST_BLOCK + b) * 4 + side] = box[b][side];
            }
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        if (mine < 4) {
            groups[g][mine] = side_of(&box[0][mine], 4, BST_BLOCK, mine);
            group_box[group * 4 + mine] = groups[g][mine];
        }
    }
    if (mine < 4) { /* of its own sides */
        int made = min((blocks + BST_BLOCK - 1) / BST_BLOCK - far * BST_BLOCK, BST_BLOCK);
        far_box[far * 4 + mine] = side_of(&groups[0][mine], 4, made, mine);
    }
}
