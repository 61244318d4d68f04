/* Outlines of masks: decoded again by the even-odd rule they give every pixel back. */
#include <cjson/cJSON.h>
#include <stdbool.h>

#include "sim/io/mask_outline.h"
#include "tests/test_support.h"

enum { SIDE = 24, ITEM = 7 };

static cJSON *outline(const int32_t *mask, int x0, int y0, int x1, int y1) {
    bst_ctx ctx = {0};
    char *text;
    size_t bytes;
    FILE *stream = open_memstream(&text, &bytes);
    bst_assert_ok(&ctx, bst_mask_outline_write(
                            &ctx, &(bst_mask_item){mask, SIDE, ITEM, x0, y0, x1, y1}, stream));
    fclose(stream);
    cJSON *list = cJSON_Parse(text);
    assert_non_null(list);
    free(text);
    return list;
}

/* Whether the centre of pixel (x, y) is inside a polygon: crossings of a ray to the right with any
 * of its lines, slanted seams too. */
static bool is_inside(const cJSON *polygon, double x, double y) {
    int n = cJSON_GetArraySize(polygon) / 2;
    bool inside = false;
    double *v = malloc(2 * (size_t)n * sizeof *v);
    int k = 0;
    for (const cJSON *c = polygon->child; c; c = c->next) {
        v[k++] = c->valuedouble;
    }
    for (int i = 0, j = n - 1; i < n; j = i++) {
        double xi = v[2 * i], yi = v[2 * i + 1], xj = v[2 * j], yj = v[2 * j + 1];
        if ((yi > y) != (yj > y) && x < xi + (y - yi) * (xj - xi) / (yj - yi)) {
            inside = !inside;
        }
    }
    free(v);
    return inside;
}

/* Sets of pixels that share edges, by flooding. */
static int count_parts(const int32_t *mask) {
    bool seen[SIDE * SIDE] = {false};
    int stack[SIDE * SIDE], parts = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        int n = 0;
        if (mask[i] != ITEM || seen[i]) {
            continue;
        }
        parts++;
        seen[stack[n++] = i] = true;
        while (n > 0) {
            int at = stack[--n], x = at % SIDE, y = at / SIDE;
            const int next[4] = {x > 0 ? at - 1 : -1, x < SIDE - 1 ? at + 1 : -1,
                                 y > 0 ? at - SIDE : -1, y < SIDE - 1 ? at + SIDE : -1};
            for (int k = 0; k < 4; k++) {
                if (next[k] >= 0 && mask[next[k]] == ITEM && !seen[next[k]]) {
                    seen[stack[n++] = next[k]] = true;
                }
            }
        }
    }
    return parts;
}

static void check(const int32_t *mask) {
    cJSON *list = outline(mask, 0, 0, SIDE, SIDE);
    assert_int_equal(cJSON_GetArraySize(list), count_parts(mask));
    for (int i = 0; i < SIDE * SIDE; i++) {
        int inside = 0;
        for (const cJSON *p = list->child; p; p = p->next) {
            inside += is_inside(p, i % SIDE + 0.5, i / SIDE + 0.5);
        }
        assert_int_equal(inside, mask[i] == ITEM);
    }
    cJSON_Delete(list);
}

/* From single pixels over mazes with holes in holes to nearly all. */
static void test_random_masks(void **state) {
    (void)state;
    enum { TRIALS = 64 }; /* the share of the item's pixels grows by 1/64 */
    uint32_t noise = 1;
    for (int trial = 0; trial < TRIALS; trial++) {
        int32_t mask[SIDE * SIDE];
        for (int i = 0; i < SIDE * SIDE; i++) {
            noise = noise * 1664525u + 1013904223u;
            mask[i] = (int)(noise >> 24) < trial * 256 / TRIALS ? ITEM : (int)(noise >> 23 & 3);
        }
        check(mask);
    }
}

/* A ring in a ring in a ring. */
static void test_nested_rings(void **state) {
    (void)state;
    int32_t mask[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; i++) {
        int x = i % SIDE, y = i / SIDE;
        int edge = x < y ? x : y;
        edge = edge < SIDE - 1 - x ? edge : SIDE - 1 - x;
        edge = edge < SIDE - 1 - y ? edge : SIDE - 1 - y;
        mask[i] = edge % 4 < 2 ? ITEM : 3;
    }
    check(mask);
}

/* Written out by hand: an L, clockwise, corners only. */
static void test_known_outline(void **state) {
    (void)state;
    int32_t mask[SIDE * SIDE] = {0};
    mask[5 * SIDE + 4] = mask[6 * SIDE + 4] = mask[6 * SIDE + 5] = ITEM;
    cJSON *list = outline(mask, 3, 4, 9, 9);
    char *text = cJSON_PrintUnformatted(list);
    assert_string_equal(text, "[[5,5,5,6,6,6,6,7,4,7,4,5]]");
    free(text);
    cJSON_Delete(list);
    list = outline(mask, 0, 0, 0, 0); /* no pixels */
    assert_int_equal(cJSON_GetArraySize(list), 0);
    cJSON_Delete(list);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_random_masks),
                                       cmocka_unit_test(test_nested_rings),
                                       cmocka_unit_test(test_known_outline)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
