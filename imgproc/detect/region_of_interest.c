#include "imgproc/detect/region_of_interest.h"

#include <assert.h>
#include <math.h>
#include <string.h>

bool bst_region_of_interest_add(bst_region_of_interest *windows, const bst_window *frame,
                                const bst_searched_window *why, double half_x_px,
                                double half_y_px) {
    const double x_px = why->x_px, y_px = why->y_px;
    assert(windows && frame && windows->count >= 0 && windows->count <= BST_WINDOWS_MAX);
    assert(half_x_px >= 0.0 && half_y_px >= 0.0);
    double x0 = fmax(floor(x_px - half_x_px), frame->x0);
    double y0 = fmax(floor(y_px - half_y_px), frame->y0);
    double x1 = fmin(ceil(x_px + half_x_px), frame->x0 + frame->width - 1.0);
    double y1 = fmin(ceil(y_px + half_y_px), frame->y0 + frame->height - 1.0);
    if (windows->count == BST_WINDOWS_MAX || !(x1 >= x0 && y1 >= y0)) {
        return false;
    }
    bst_searched_window *planned = &windows->planned[windows->planned_count++];
    *planned = *why;
    planned->number = windows->count;
    windows->items[windows->count++] =
        (bst_window){(int)x0, (int)y0, (int)(x1 - x0) + 1, (int)(y1 - y0) + 1};
    return true;
}

void bst_region_of_interest_clear(bst_region_of_interest *windows) {
    windows->count = windows->planned_count = 0;
}

/* Gives the reasons of window `from` to window `to`; -1: removes them. */
static void move_reasons(bst_region_of_interest *windows, int from, int to) {
    int kept = 0;
    for (int i = 0; i < windows->planned_count; i++) {
        bst_searched_window r = windows->planned[i];
        r.number = r.number == from ? to : r.number;
        if (r.number >= 0) {
            windows->planned[kept++] = r;
        }
    }
    windows->planned_count = kept;
}

/* True if two windows overlap or touch. */
static bool touch(const bst_window *a, const bst_window *b) {
    return a->x0 <= b->x0 + b->width && b->x0 <= a->x0 + a->width && a->y0 <= b->y0 + b->height &&
           b->y0 <= a->y0 + a->height;
}

static int least(int a, int b) {
    return a < b ? a : b;
}

static int most(int a, int b) {
    return a > b ? a : b;
}

/* Widens start and length of a window along one axis to whole binned pixels of the frame. */
static void align(int *start, int *length, int origin, int size, int binning) {
    int first = (*start - origin) / binning;
    int end = (*start + *length - origin + binning - 1) / binning;
    end = least(end, size / binning);
    *start = origin + first * binning;
    *length = (end - first) * binning;
}

bool bst_region_of_interest_settle(bst_region_of_interest *windows, const bst_window *frame,
                                   int binning, double share) {
    int kept = 0;
    for (int i = 0; i < windows->count; i++) {
        bst_window w = windows->items[i];
        align(&w.x0, &w.width, frame->x0, frame->width, binning);
        align(&w.y0, &w.height, frame->y0, frame->height, binning);
        if (w.width > 0 && w.height > 0) {
            move_reasons(windows, i, kept);
            windows->items[kept++] = w;
        } else {
            move_reasons(windows, i, -1);
        }
    }
    windows->count = kept;
    for (int i = 0; i < windows->count; i++) {
        for (int j = 0; j < i; j++) {
            bst_window *a = &windows->items[j], *b = &windows->items[i];
            if (!touch(a, b)) {
                continue;
            }
            int x1 = most(a->x0 + a->width, b->x0 + b->width);
            int y1 = most(a->y0 + a->height, b->y0 + b->height);
            a->x0 = least(a->x0, b->x0);
            a->y0 = least(a->y0, b->y0);
            a->width = x1 - a->x0;
            a->height = y1 - a->y0;
            *b = windows->items[--windows->count];
            move_reasons(windows, i, j);
            move_reasons(windows, windows->count, i);
            /* the merged window may touch others */
            i = -1;
            break;
        }
    }
    for (int i = 0; i < windows->planned_count; i++) {
        windows->planned[i].window = windows->items[windows->planned[i].number];
    }
    double area = 0.0;
    for (int i = 0; i < windows->count; i++) {
        area += (double)windows->items[i].width * (double)windows->items[i].height;
    }
    return windows->count > 0 && area <= share * (double)frame->width * (double)frame->height;
}

bool bst_region_of_interest_hold(const bst_region_of_interest *windows, double x_px, double y_px,
                                 double margin_px) {
    for (int i = 0; i < windows->count; i++) {
        const bst_window *w = &windows->items[i];
        if (x_px > w->x0 - margin_px && x_px < w->x0 + w->width - 1 + margin_px &&
            y_px > w->y0 - margin_px && y_px < w->y0 + w->height - 1 + margin_px) {
            return true;
        }
    }
    return false;
}

bst_imgproc_frame bst_region_of_interest_crop(const bst_imgproc_frame *frame, const bst_window *w,
                                              uint16_t *pixels) {
    assert(frame && frame->pixels && w && pixels && frame->binning >= 1);
    int b = frame->binning;
    size_t stride = (size_t)(frame->window.width / b), width = (size_t)(w->width / b);
    size_t x = (size_t)((w->x0 - frame->window.x0) / b);
    size_t y = (size_t)((w->y0 - frame->window.y0) / b);
    for (size_t j = 0; j < (size_t)(w->height / b); j++) {
        memcpy(pixels + j * width, frame->pixels + (y + j) * stride + x, width * sizeof *pixels);
    }
    bst_imgproc_frame window = *frame;
    window.pixels = pixels;
    window.window = *w;
    return window;
}
