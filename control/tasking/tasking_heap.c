/* Binary heap of choices (Knuth, The Art of Computer Programming, vol. 3, section 5.2.3). */
#include "control/tasking/tasking_internal.h"

/* True if a choice comes before another: the larger value, then catalogue order. */
static bool comes_before(const bst_tasking_choice *a, const bst_tasking_choice *b) {
    return a->value != b->value ? a->value > b->value : a->object < b->object;
}

/* Moves the choice at a place of a heap down until none below comes before it. */
static void sift_down(bst_tasking_choice *heap, int count, int place) {
    const bst_tasking_choice moved = heap[place];
    for (int below = 2 * place + 1; below < count; below = 2 * place + 1) {
        below += below + 1 < count && comes_before(&heap[below + 1], &heap[below]);
        if (!comes_before(&heap[below], &moved)) {
            break;
        }
        heap[place] = heap[below];
        place = below;
    }
    heap[place] = moved;
}

void bst_tasking_heap_make(bst_tasking_choice *heap, int count) {
    for (int i = count / 2 - 1; i >= 0; i--) {
        sift_down(heap, count, i);
    }
}

void bst_tasking_heap_lower(bst_tasking_choice *heap, int count) {
    sift_down(heap, count, 0);
}

bst_tasking_choice bst_tasking_heap_take(bst_tasking_choice *heap, int *count) {
    const bst_tasking_choice first = heap[0];
    heap[0] = heap[--*count];
    sift_down(heap, *count, 0);
    return first;
}
