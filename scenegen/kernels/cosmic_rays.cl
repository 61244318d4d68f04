/* Charge of cosmic rays on the overlay of the detector's maps (detector.cl), whose rows have `stride`
 * pixels. */

/* A charge deposit of the overlay: pixel index and charge. */
typedef struct deposit_pixel {
    int index;
    float electrons;
} deposit_pixel;

__attribute__((reqd_work_group_size(BST_HIT_GROUP, 1, 1))) kernel void bst_detector_deposit(
    global const deposit_pixel *deposits, float sign, global float *overlay, int count, int stride,
    int rows) {
    int i = (int)get_global_id(0);
    if (i < count) {
        overlay[deposits[i].index] = sign * deposits[i].electrons;
        overlay[(size_t)stride * (size_t)rows + deposits[i].index / 64] = sign;
    }
}
