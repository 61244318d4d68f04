#include "sim/satellite/polygon_clip.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Room for the pieces of one facet: a plate behind a thousand struts has some thousand pieces. */
enum { PIECES = 8192, POINTS = 131072 };

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

void bst_polygon_clip_start(bst_polygon_clip *clip, const bst_point2 *points, int count) {
    assert(count >= 0 && count <= BST_POLYGON_CORNERS_MAX);
    memcpy(clip->points, points, (size_t)count * sizeof *points);
    clip->pieces[0] = (bst_polygon_piece){0, count};
    clip->point_count = count;
    clip->piece_count = 1;
    clip->overflow = false;
}

/* Distance of a point to the left of the edge a-b, times the edge's length. */
static double left_of(bst_point2 a, bst_point2 b, bst_point2 p) {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

/* True if an edge of q separates p from q. */
static bool separated(const bst_point2 *q, int q_count, const bst_point2 *p, int p_count) {
    for (int i = 0; i < q_count; i++) {
        bst_point2 a = q[i], b = q[i + 1 < q_count ? i + 1 : 0];
        int k = 0;
        while (k < p_count && left_of(a, b, p[k]) <= 0.0) {
            k++;
        }
        if (k == p_count) {
            return true;
        }
    }
    return false;
}

bool bst_polygon_is_separate(const bst_point2 *p, int p_count, const bst_point2 *q, int q_count) {
    return p_count < 3 || q_count < 3 || separated(q, q_count, p, p_count) ||
           separated(p, p_count, q, q_count);
}

/* True if no point is to the right of the edge a-b. */
static bool is_left(bst_point2 a, bst_point2 b, const bst_point2 *p, int count) {
    for (int i = 0; i < count; i++) {
        if (left_of(a, b, p[i]) < 0.0) {
            return false;
        }
    }
    return true;
}

/* Splits a convex polygon along the line a-b. Returned: corner counts of the parts to the left and
 * to the right of the line; 0: none. */
static void split(const bst_point2 *p, int count, bst_point2 a, bst_point2 b, bst_point2 *left,
                  int *left_count, bst_point2 *right, int *right_count) {
    int l = 0, r = 0;
    double before = left_of(a, b, p[count - 1]);
    bst_point2 last = p[count - 1];
    for (int i = 0; i < count; i++) {
        double now = left_of(a, b, p[i]);
        if ((before > 0.0 && now < 0.0) || (before < 0.0 && now > 0.0)) {
            double u = before / (before - now);
            bst_point2 cut = {last.x + u * (p[i].x - last.x), last.y + u * (p[i].y - last.y)};
            left[l++] = cut;
            right[r++] = cut;
        }
        if (now >= 0.0) {
            left[l++] = p[i];
        }
        if (now <= 0.0) {
            right[r++] = p[i];
        }
        before = now;
        last = p[i];
    }
    *left_count = l >= 3 ? l : 0;
    *right_count = r >= 3 ? r : 0;
}

/* Subtracts a convex polygon from one piece. */
static void cut_piece(bst_polygon_clip *clip, int piece, const bst_point2 *q, int q_count) {
    bst_point2 rest[BST_POLYGON_CORNERS_MAX + 8], left[BST_POLYGON_CORNERS_MAX + 8];
    bst_polygon_piece from = clip->pieces[piece];
    const bst_point2 *p = clip->points + from.first;
    if (bst_polygon_is_separate(p, from.count, q, q_count)) {
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
        bst_point2 *outside = clip->points + points;
        int left_count, right_count;
        split(rest, count, q[i], q[i + 1 < q_count ? i + 1 : 0], left, &left_count, outside,
              &right_count);
        if (right_count > 0 && bst_polygon_area(outside, right_count) > 0.0) {
            clip->pieces[pieces++] = (bst_polygon_piece){points, right_count};
            points += right_count;
        }
        memcpy(rest, left, (size_t)left_count * sizeof *rest);
        count = left_count;
    }
    if (count > 0) { /* else they only touch: the piece stays as it is */
        clip->pieces[piece].count = 0;
        clip->piece_count = pieces;
        clip->point_count = points;
    }
}

void bst_polygon_clip_subtract(bst_polygon_clip *clip, const bst_point2 *points, int count) {
    assert(count <= BST_POLYGON_CORNERS_MAX);
    if (count < 3) {
        return;
    }
    for (int i = 0, end = clip->piece_count; i < end; i++) {
        if (clip->pieces[i].count > 0) {
            cut_piece(clip, i, points, count);
        }
    }
}

void bst_polygon_clip_intersect(bst_polygon_clip *clip, const bst_point2 *points, int count) {
    bst_point2 left[BST_POLYGON_CORNERS_MAX + 8], right[BST_POLYGON_CORNERS_MAX + 8];
    assert(count <= BST_POLYGON_CORNERS_MAX);
    for (int k = 0, end = clip->piece_count; k < end; k++) {
        bst_polygon_piece *piece = &clip->pieces[k];
        for (int i = 0; i < count && piece->count > 0; i++) {
            int left_count, right_count;
            if (is_left(points[i], points[i + 1 < count ? i + 1 : 0], clip->points + piece->first,
                        piece->count)) {
                continue;
            }
            if (piece->count + 2 > BST_POLYGON_CORNERS_MAX ||
                clip->point_count + piece->count + 2 > clip->point_capacity) {
                clip->overflow = true;
                return;
            }
            split(clip->points + piece->first, piece->count, points[i],
                  points[i + 1 < count ? i + 1 : 0], left, &left_count, right, &right_count);
            memcpy(clip->points + clip->point_count, left, (size_t)left_count * sizeof *left);
            *piece = (bst_polygon_piece){clip->point_count, left_count};
            clip->point_count += left_count;
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
        while (n >= 2 && left_of(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    for (int i = count - 2, lower = n + 1; i >= 0; i--) {
        while (n >= lower && left_of(hull[n - 2], hull[n - 1], points[i]) <= 0.0) {
            n--;
        }
        hull[n++] = points[i];
    }
    return n > 3 ? n - 1 : 0; /* the last corner is the first one again */
}
