#include "sim/satellite/polygon_clip.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Room for the pieces of one facet: a plate behind a thousand struts has some thousand pieces. */
enum { PIECES = 8192, POINTS = 131072 };

/* Distance over the extent of a polygon below which two corners are one. */
static const double TINY = 1e-12;

bst_status bst_polygon_clip_create(bst_ctx *ctx, bst_polygon_clip *clip) {
    *clip = (bst_polygon_clip){.points = malloc(POINTS * sizeof *clip->points),
                               .pieces = malloc(PIECES * sizeof *clip->pieces),
                               .point_capacity = POINTS,
                               .piece_capacity = PIECES};
    if (!clip->points || !clip->pieces) {
        bst_polygon_clip_free(clip);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the shadows of a satellite");
    }
    return BST_OK;
}

void bst_polygon_clip_free(bst_polygon_clip *clip) {
    free(clip->points);
    free(clip->pieces);
    *clip = (bst_polygon_clip){0};
}

double bst_polygon_area(const bst_point2 *p, int count) {
    double sum = 0.0;
    for (int i = 2; i < count; i++) { /* from the first corner, so that small ones keep digits */
        sum +=
            (p[i - 1].x - p[0].x) * (p[i].y - p[0].y) - (p[i].x - p[0].x) * (p[i - 1].y - p[0].y);
    }
    return 0.5 * sum;
}

/* Distance from the first corner to the farthest one, by coordinates. */
static double extent_of(const bst_point2 *p, int count) {
    double extent = 0.0;
    for (int i = 1; i < count; i++) {
        double far = fabs(p[i].x - p[0].x) + fabs(p[i].y - p[0].y);
        extent = far > extent ? far : extent;
    }
    return extent;
}

/* True if an edge of q separates p from q. An edge as short as rounding has no direction. */
static bool separated(const bst_point2 *q, int q_count, const bst_point2 *p, int p_count) {
    bst_point2 a = q[q_count - 1];
    for (int i = 0; i < q_count; i++) {
        bst_point2 b = q[i];
        int k = 0;
        while (k < p_count && bst_point2_left_of(a, b, p[k]) <= 0.0) {
            k++;
        }
        if (k == p_count) {
            double tiny = TINY * extent_of(q, q_count);
            if (fabs(b.x - a.x) > tiny || fabs(b.y - a.y) > tiny) {
                return true;
            }
        }
        a = b;
    }
    return false;
}

void bst_polygon_clip_start(bst_polygon_clip *clip, const bst_point2 *points, int count) {
    assert(count >= 0 && count <= BST_POLYGON_CORNERS_MAX);
    memcpy(clip->points, points, (size_t)count * sizeof *points);
    clip->pieces[0] = (bst_polygon_piece){0, count};
    clip->point_count = count;
    clip->piece_count = 1;
    clip->overflow = false;
    clip->tiny = TINY * extent_of(points, count);
}

bool bst_polygon_is_separate(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count) {
    return p_count < 3 || q_count < 3 || separated(q, q_count, p, p_count) ||
           separated(p, p_count, q, q_count);
}

/* True if no point is to the right of the edge a-b. */
static bool is_left(bst_point2 a, bst_point2 b, const bst_point2 *p, int count) {
    for (int i = 0; i < count; i++) {
        if (bst_point2_left_of(a, b, p[i]) < 0.0) {
            return false;
        }
    }
    return true;
}

/* Corners of a polygon under construction. Corners closer than `tiny` are one: an edge between them
 * would have a direction of rounding errors. */
typedef struct outline {
    bst_point2 *points;
    int count;
    double tiny;
} outline;

static bool same(bst_point2 a, bst_point2 b, double tiny) {
    return fabs(a.x - b.x) <= tiny && fabs(a.y - b.y) <= tiny;
}

static void push(outline *to, bst_point2 p) {
    if (to->count == 0 || !same(to->points[to->count - 1], p, to->tiny)) {
        to->points[to->count++] = p;
    }
}

/* Ends a polygon: one with fewer than three corners is empty. */
static void close_outline(outline *to) {
    while (to->count > 1 && same(to->points[to->count - 1], to->points[0], to->tiny)) {
        to->count--;
    }
    to->count = to->count >= 3 ? to->count : 0;
}

/* Splits a convex polygon along the line a-b into the parts to its left and right, either of which
 * may be empty. */
static void split(const outline *from, bst_point2 a, bst_point2 b, outline *left, outline *right) {
    const bst_point2 *p = from->points;
    bst_point2 last = p[from->count - 1];
    double before = bst_point2_left_of(a, b, last);
    left->count = right->count = 0;
    for (int i = 0; i < from->count; i++) {
        double now = bst_point2_left_of(a, b, p[i]);
        if ((before > 0.0 && now < 0.0) || (before < 0.0 && now > 0.0)) {
            double u = before / (before - now);
            bst_point2 cut = {last.x + u * (p[i].x - last.x), last.y + u * (p[i].y - last.y)};
            push(left, cut);
            push(right, cut);
        }
        if (now >= 0.0) {
            push(left, p[i]);
        }
        if (now <= 0.0) {
            push(right, p[i]);
        }
        before = now;
        last = p[i];
    }
    close_outline(left);
    close_outline(right);
}

/* Subtracts a convex polygon from one piece. */
static void cut_piece(bst_polygon_clip *clip, int piece, const bst_point2 *q, int q_count,
                      bool overlaps) {
    bst_point2 rest[BST_POLYGON_CORNERS_MAX + 8], left[BST_POLYGON_CORNERS_MAX + 8];
    bst_polygon_piece from = clip->pieces[piece];
    const bst_point2 *p = clip->points + from.first;
    if (!overlaps && bst_polygon_is_separate(p, from.count, q, q_count)) {
        return;
    }
    int pieces = clip->piece_count, points = clip->point_count, count = from.count;
    memcpy(rest, p, (size_t)count * sizeof *rest);
    for (int i = 0; i < q_count && count > 0; i++) {
        if (is_left(q[i], q[i + 1 < q_count ? i + 1 : 0], rest, count)) {
            continue;
        }
        if (pieces == clip->piece_capacity || points + count + 2 > clip->point_capacity ||
            count + 2 > BST_POLYGON_CORNERS_MAX) {
            clip->overflow = true;
            return; /* the piece stays whole */
        }
        outline whole = {rest, count, clip->tiny}, inside = {left, 0, clip->tiny};
        outline outside = {clip->points + points, 0, clip->tiny};
        split(&whole, q[i], q[i + 1 < q_count ? i + 1 : 0], &inside, &outside);
        if (outside.count > 0 && bst_polygon_area(outside.points, outside.count) > 0.0) {
            clip->pieces[pieces++] = (bst_polygon_piece){points, outside.count};
            points += outside.count;
        }
        memcpy(rest, left, (size_t)inside.count * sizeof *rest);
        count = inside.count;
    }
    if (count > 0) { /* else they only touch: the piece stays as it is */
        clip->pieces[piece].count = 0;
        clip->piece_count = pieces;
        clip->point_count = points;
    }
}

/* Copies a polygon without corners that are one. Returned: their number. */
static int clean(const bst_polygon_clip *clip, const bst_point2 *points, int count,
                 bst_point2 *to) {
    assert(count <= BST_POLYGON_CORNERS_MAX);
    outline out = {to, 0, clip->tiny};
    for (int i = 0; i < count; i++) {
        push(&out, points[i]);
    }
    close_outline(&out);
    return out.count;
}

void bst_polygon_clip_subtract(bst_polygon_clip *clip, const bst_point2 *points, int count,
                               bool overlaps) {
    bst_point2 q[BST_POLYGON_CORNERS_MAX];
    int corners = clean(clip, points, count, q);
    overlaps = overlaps && clip->piece_count == 1 && clip->pieces[0].first == 0;
    for (int i = 0, end = clip->piece_count; i < end && corners > 0; i++) {
        if (clip->pieces[i].count > 0) {
            cut_piece(clip, i, q, corners, overlaps);
        }
    }
}

/* Keeps what one piece has to the left of a line. */
static void keep_left(bst_polygon_clip *clip, bst_polygon_piece *piece, bst_point2 a,
                      bst_point2 b) {
    bst_point2 right[BST_POLYGON_CORNERS_MAX + 8];
    if (is_left(a, b, clip->points + piece->first, piece->count)) {
        return;
    }
    if (piece->count + 2 > BST_POLYGON_CORNERS_MAX ||
        clip->point_count + piece->count + 2 > clip->point_capacity) {
        clip->overflow = true;
        return;
    }
    outline whole = {clip->points + piece->first, piece->count, clip->tiny};
    outline inside = {clip->points + clip->point_count, 0, clip->tiny};
    outline outside = {right, 0, clip->tiny};
    split(&whole, a, b, &inside, &outside);
    *piece = (bst_polygon_piece){clip->point_count, inside.count};
    clip->point_count += inside.count;
}

void bst_polygon_clip_intersect(bst_polygon_clip *clip, const bst_point2 *points, int count) {
    bst_point2 q[BST_POLYGON_CORNERS_MAX];
    int corners = clean(clip, points, count, q);
    for (int k = 0; k < clip->piece_count; k++) {
        bst_polygon_piece *piece = &clip->pieces[k];
        piece->count = corners > 0 ? piece->count : 0;
        for (int i = 0; i < corners && piece->count > 0; i++) {
            keep_left(clip, piece, q[i], q[i + 1 < corners ? i + 1 : 0]);
        }
    }
}

bool bst_polygon_clip_is_empty(const bst_polygon_clip *clip) {
    for (int i = 0; i < clip->piece_count; i++) {
        if (clip->pieces[i].count > 0) {
            return false;
        }
    }
    return true;
}

double bst_polygon_clip_area(const bst_polygon_clip *clip) {
    double sum = 0.0;
    for (int i = 0; i < clip->piece_count; i++) {
        sum += bst_polygon_area(clip->points + clip->pieces[i].first, clip->pieces[i].count);
    }
    return sum;
}

/* Sorts by x, then y (Shell 1959, with the gaps of Ciura 2001): half the time of qsort for the
 * hundred corners of a round body. */
static void sort_points(bst_point2 *points, int count) {
    static const int gaps[] = {301, 132, 57, 23, 10, 4, 1};
    for (size_t g = 0; g < sizeof gaps / sizeof gaps[0]; g++) {
        for (int gap = gaps[g], i = gap; i < count; i++) {
            bst_point2 p = points[i];
            int k = i;
            for (; k >= gap && (points[k - gap].x > p.x ||
                                (points[k - gap].x == p.x && points[k - gap].y > p.y));
                 k -= gap) {
                points[k] = points[k - gap];
            }
            points[k] = p;
        }
    }
}

int bst_polygon_hull(bst_point2 *points, int count, bst_point2 *hull) {
    if (count < 3) {
        return 0;
    }
    sort_points(points, count);
    int n = 0;
    for (int i = 0; i < count; i++) {
        while (n >= 2 && bst_point2_left_of(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    for (int i = count - 2, lower = n + 1; i >= 0; i--) {
        while (n >= lower && bst_point2_left_of(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    return n > 3 ? n - 1 : 0; /* the last corner is the first one again */
}
