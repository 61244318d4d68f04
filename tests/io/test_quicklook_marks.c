/* Where the quick-look picture draws its marks: all by one map of each view, on a frame that is not
 * square; the calls are recorded in place of the drawing. */
#include <stdlib.h>

#include "sim/io/marks_internal.h"
#include "sim/io/quicklook.h"
#include "tests/io/scratch.h"

enum { WIDTH = 300, HEIGHT = 420, MOST = 200 };

typedef struct call {
    char what;         /* c circle, x cross, r rectangle, d diamond, w window of a view, l line */
    double x, y, w, h; /* of a line its start and its end */
} call;

static call calls[MOST];
static int call_count;

static void keep(char what, double x, double y, double w, double h) {
    if (call_count < MOST) {
        calls[call_count++] = (call){what, x, y, w, h};
    }
}

void __wrap_bst_picture_clip(bst_picture *p, bst_io_box box);
void __wrap_bst_picture_circle(bst_picture *p, double x, double y, double r, bst_io_colour colour,
                               double width);
void __wrap_bst_picture_rectangle(bst_picture *p, double x, double y, double w, double h,
                                  bst_io_colour colour, double width);
void __wrap_bst_mark_cross(bst_picture *p, double x, double y, double gap, double arm);
void __wrap_bst_mark_diamond(bst_picture *p, double x, double y, double r);
void __wrap_bst_picture_line(bst_picture *p, double x0, double y0, double x1, double y1,
                             bst_io_colour colour, double thickness);

void __wrap_bst_picture_line(bst_picture *p, double x0, double y0, double x1, double y1,
                             bst_io_colour colour, double thickness) {
    (void)p;
    (void)colour;
    (void)thickness;
    keep('l', x0, y0, x1, y1);
}

void __wrap_bst_picture_clip(bst_picture *p, bst_io_box box) {
    (void)p;
    keep('w', box.x, box.y, box.width, box.height);
}

void __wrap_bst_picture_circle(bst_picture *p, double x, double y, double r, bst_io_colour colour,
                               double width) {
    (void)p;
    (void)colour;
    (void)width;
    keep('c', x, y, r, r);
}

void __wrap_bst_picture_rectangle(bst_picture *p, double x, double y, double w, double h,
                                  bst_io_colour colour, double width) {
    (void)p;
    (void)colour;
    (void)width;
    keep('r', x, y, w, h);
}

void __wrap_bst_mark_cross(bst_picture *p, double x, double y, double gap, double arm) {
    (void)p;
    keep('x', x, y, gap, arm);
}

void __wrap_bst_mark_diamond(bst_picture *p, double x, double y, double r) {
    (void)p;
    keep('d', x, y, r, r);
}

/* The k-th call of a kind after the w-th window. */
static call nth(int window, char what, int k) {
    int windows = -1;
    for (int i = 0; i < call_count; i++) {
        windows += calls[i].what == 'w';
        if (windows == window && calls[i].what == what && k-- == 0) {
            return calls[i];
        }
    }
    fail_msg("no mark %c in view %d", what, window);
    return calls[0];
}

static void marks_are_at_their_places(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    uint16_t *pixels = malloc(sizeof *pixels * WIDTH * HEIGHT);
    assert_non_null(pixels);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        pixels[i] = (uint16_t)(100 + i % 11);
    }
    /* the first is in front and so the last one that is drawn */
    const bst_io_mark marks[2] = {{.x_px = 20.5, .y_px = 391.25, .radius_px = 30.0},
                                  {.x_px = 271.0, .y_px = 33.5, .radius_px = 40.0}};
    const bst_quicklook_frame frame = {.pixels = pixels,
                                       .width = WIDTH,
                                       .height = HEIGHT,
                                       .detections = marks,
                                       .detection_count = 2,
                                       .has_target = true,
                                       .target_x_px = 97.0,
                                       .target_y_px = 301.0,
                                       .has_track = true,
                                       .track_x_px = 101.5,
                                       .track_y_px = 296.25,
                                       .boresight_x_px = 160.5,
                                       .boresight_y_px = 230.75};
    scratch_make(&s);
    bst_assert_ok(&ctx, bst_quicklook_write(&ctx, scratch_path(&s, "q.png"), "t", &frame, NULL));
    for (int view = 0; view < 2; view++) { /* the panel, and the target's surroundings in it */
        call a = nth(view, 'c', 1), b = nth(view, 'c', 0), window = nth(view, 'w', 0);
        double scale = (b.x - a.x) / (marks[1].x_px - marks[0].x_px);
        assert_true(scale > 0.5);
        bst_assert_close((b.y - a.y) / (marks[1].y_px - marks[0].y_px), scale, 1e-9);
        bst_assert_close(a.w, 30.0 * scale, 1e-9);
        bst_assert_close(b.w, 40.0 * scale, 1e-9);
        double x0 = a.x - scale * marks[0].x_px, y0 = a.y - scale * marks[0].y_px;
        call cross = nth(view, 'x', 0), box = nth(view, 'r', 0), diamond = nth(view, 'd', 0);
        bst_assert_close(cross.x, x0 + scale * 160.5, 1e-9);
        bst_assert_close(cross.y, y0 + scale * 230.75, 1e-9);
        bst_assert_close(box.x + 0.5 * box.w, x0 + scale * 97.0, 1e-9);
        bst_assert_close(box.y + 0.5 * box.h, y0 + scale * 301.0, 1e-9);
        bst_assert_close(diamond.x, x0 + scale * 101.5, 1e-9);
        bst_assert_close(diamond.y, y0 + scale * 296.25, 1e-9);
        if (view == 0) { /* the whole frame: pixel 0 is centred half a pixel from the corner */
            bst_assert_close(window.w, WIDTH * scale, 0.51);
            bst_assert_close(window.h, HEIGHT * scale, 0.51);
            bst_assert_close(x0, window.x + 0.5 * scale - 0.5, 1e-9);
            bst_assert_close(y0, window.y + 0.5 * scale - 0.5, 1e-9);
        } else { /* the target's pixel is next to the middle */
            bst_assert_close(window.w, window.h, 0.0);
            bst_assert_close(x0 + scale * 97.0, window.x + 0.5 * window.w, scale);
            bst_assert_close(y0 + scale * 301.0, window.y + 0.5 * window.h, scale);
        }
    }
    /* the enlarged part as it is marked on the panel: as wide as the inset shows */
    call a = nth(0, 'c', 1), b = nth(0, 'c', 0), part = nth(1, 'r', 2);
    double scale = (b.x - a.x) / (marks[1].x_px - marks[0].x_px);
    bst_assert_close(part.x + 0.5 * part.w, a.x + scale * (97.0 - marks[0].x_px), scale);
    bst_assert_close(part.y + 0.5 * part.h, a.y + scale * (301.0 - marks[0].y_px), scale);
    bst_assert_close(part.w, part.h, 1e-9);
    scratch_remove(&s);
    free(pixels);
}

/* Number of lines with these ends, to rounding. */
static int lines(double x0, double y0, double x1, double y1) {
    int found = 0;
    for (int i = 0; i < call_count; i++) {
        const call *c = &calls[i];
        found += c->what == 'l' && hypot(c->x - x0, c->y - y0) < 1e-6 &&
                 hypot(c->w - x1, c->h - y1) < 1e-6;
    }
    return found;
}

/* Of a target outside the frame an arrow from the boresight shows the way, in all directions. */
static void an_arrow_to_what_is_outside(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    scratch s;
    uint16_t *pixels = calloc(WIDTH * HEIGHT, sizeof *pixels);
    assert_non_null(pixels);
    scratch_make(&s);
    for (int k = 0; k < 7; k++) {
        const bst_io_mark marks[2] = {{.x_px = 20.5, .y_px = 391.25, .radius_px = 30.0},
                                      {.x_px = 271.0, .y_px = 33.5, .radius_px = 40.0}};
        double dx = cos(0.3 + 0.9 * k), dy = sin(0.3 + 0.9 * k);
        const bst_quicklook_frame frame = {.pixels = pixels,
                                           .width = WIDTH,
                                           .height = HEIGHT,
                                           .detections = marks,
                                           .detection_count = 2,
                                           .has_target = true,
                                           .target_x_px = 160.5 + 900.0 * dx,
                                           .target_y_px = 230.75 + 900.0 * dy,
                                           .boresight_x_px = 160.5,
                                           .boresight_y_px = 230.75};
        call_count = 0;
        bst_assert_ok(&ctx,
                      bst_quicklook_write(&ctx, scratch_path(&s, "q.png"), "t", &frame, NULL));
        call cross = nth(0, 'x', 0);
        double x = cross.x + 98.0 * dx, y = cross.y + 98.0 * dy;
        assert_int_equal(lines(cross.x + 28.0 * dx, cross.y + 28.0 * dy, x, y), 1);
        for (int side = -1; side < 2; side += 2) { /* the head's lines go back from its tip */
            assert_int_equal(
                lines(x, y, x - 11.0 * dx - side * 6.0 * dy, y - 11.0 * dy + side * 6.0 * dx), 1);
        }
    }
    scratch_remove(&s);
    free(pixels);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(marks_are_at_their_places),
                                       cmocka_unit_test(an_arrow_to_what_is_outside)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
