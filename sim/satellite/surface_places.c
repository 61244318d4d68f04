#include "sim/satellite/surface_places.h"

#include "sim/satellite/curved_light.h"
#include "sim/satellite/pose_view.h"

enum { FEW_CORNERS = 8 };

/* What is looked for in a view: all places of a hider between two, or the outermost ones. */
typedef struct search {
    const bst_pose_view *view;
    double start, end;
    bool all;
    double low, high; /* found so far */
} search;

/* Azimuth where a ray of a view meets a curved surface.
 *
 * Given:     r  a point of the ray, from the base
 * Returned:  their number */
static int meet_curved(const bst_shaded_surface *w, const bst_pose_view *v, bst_vec3 r,
                       double place[2]) {
    const bst_curved *c = w->curved;
    double k = c->sphere ? 0.0 : (c->top_radius_m - c->radius_m) / c->length_m;
    double rx = bst_vec3_dot(r, w->x), ry = bst_vec3_dot(r, w->y), rz = bst_vec3_dot(r, w->z);
    double dx = bst_vec3_dot(v->z, w->x), dy = bst_vec3_dot(v->z, w->y);
    double dz = bst_vec3_dot(v->z, w->z), radius = c->radius_m + k * rz;
    double a = dx * dx + dy * dy - k * k * dz * dz, b = rx * dx + ry * dy - radius * k * dz;
    double constant = rx * rx + ry * ry - radius * radius;
    if (c->sphere) {
        a += dz * dz;
        b += rz * dz;
        constant += rz * rz;
    }
    double root = b * b - a * constant;
    int n = 0;
    /* what the view sees is the near side, of inner surfaces the far one */
    for (int side = -1; side <= 1 && root > 0.0 && fabs(a) > 1e-12; side += 2) {
        if (a > 0.0 && side * c->side < 0.0) {
            continue;
        }
        double t = (-b + side * sqrt(root)) / a;
        double height = rz + t * dz;
        if (c->sphere || (height >= 0.0 && height <= c->length_m)) {
            place[n++] = atan2(ry + t * dy, rx + t * dx);
        }
    }
    return n;
}

/* The same azimuth, from `start` on. */
static double turned_to(double azimuth, double start) {
    double turn = azimuth - start;
    return start + turn - 2.0 * BST_PI * floor(turn / (2.0 * BST_PI));
}

static void add_place(bst_shaded_surface *w, double place) {
    if (w->places < BST_SURFACE_PLACES_MAX) {
        w->place[w->places++] = place;
    } else {
        w->crowded = true;
    }
}

static void note(bst_shaded_surface *w, search *s, double place) {
    if (place > s->start && place < s->end) {
        s->low = fmin(s->low, place);
        s->high = fmax(s->high, place);
        if (s->all) {
            add_place(w, place);
        }
    }
}

/* Notes where the ray through a point of the view's plane meets the surface. */
static void note_point(bst_shaded_surface *w, search *s, bst_point2 point) {
    const bst_pose_view *v = s->view;
    bst_vec3 q = bst_vec3_axpy(bst_vec3_scale(v->x, point.x), point.y, v->y);
    bst_vec3 r = bst_vec3_sub(q, w->base);
    if (w->curved) {
        double place[2];
        int n = meet_curved(w, v, r, place);
        for (int i = 0; i < n; i++) {
            note(w, s, turned_to(place[i], s->start));
        }
        return;
    }
    r = bst_vec3_axpy(r, -bst_vec3_dot(r, w->z) / bst_vec3_dot(v->z, w->z), v->z);
    double y = bst_vec3_dot(r, w->y);
    if (w->corners > 0) {
        note(w, s, y);
    } else if (fabs(y) < w->radius_m) {
        note(w, s, acos(-y / w->radius_m));
    }
}

/* Notes where a side of a silhouette touches a meridian of a sphere: the sine of the longitude from
 * the view, u / sqrt(R^2 - w^2) with w along the axis and u across it, is extreme there. A side
 * almost along the meridians is noted at three latitudes, too: what it bounds is in a narrow range
 * of longitude. */
static void note_meridians(bst_shaded_surface *w, search *s, bst_point2 p, bst_point2 q) {
    const bst_pose_view *v = s->view;
    bst_vec3 across = bst_vec3_cross(w->z, v->z);
    bst_point2 u = {bst_vec3_dot(across, v->x), bst_vec3_dot(across, v->y)};
    bst_point2 z = {bst_vec3_dot(w->z, v->x), bst_vec3_dot(w->z, v->y)};
    bst_point2 d = {q.x - p.x, q.y - p.y};
    double radius = w->curved->radius_m;
    double pu = p.x * u.x + p.y * u.y - bst_vec3_dot(w->base, across);
    double pw = p.x * z.x + p.y * z.y - bst_vec3_dot(w->base, w->z);
    double du = d.x * u.x + d.y * u.y, dw = d.x * z.x + d.y * z.y, turn = pu * dw - pw * du;
    const double at[] = {-radius * radius * du / turn, 0.0, 0.6 * radius, -0.6 * radius};
    for (int i = 0; i < (fabs(du) < 0.25 * fabs(dw) ? 4 : 1); i++) {
        double along = (at[i] - pw) / dw;
        if (along > 0.0 && along < 1.0) {
            note_point(w, s, (bst_point2){p.x + along * d.x, p.y + along * d.y});
        }
    }
}

/* Notes the azimuths where an end of a cone crosses a side of a silhouette. */
static void note_crossings(bst_shaded_surface *w, search *s, bst_point2 p, bst_point2 q) {
    const bst_pose_view *v = s->view;
    bst_point2 d = {q.x - p.x, q.y - p.y};
    double length2 = d.x * d.x + d.y * d.y;
    double xx = bst_vec3_dot(w->x, v->x), xy = bst_vec3_dot(w->x, v->y);
    double yx = bst_vec3_dot(w->y, v->x), yy = bst_vec3_dot(w->y, v->y);
    for (int i = 0; i < 2; i++) {
        double radius = i == 0 ? w->curved->radius_m : w->curved->top_radius_m;
        bst_vec3 centre = bst_vec3_axpy(w->base, i * w->curved->length_m, w->z);
        double x = bst_vec3_dot(centre, v->x) - p.x, y = bst_vec3_dot(centre, v->y) - p.y;
        double a = radius * (d.x * xy - d.y * xx), b = radius * (d.x * yy - d.y * yx);
        double c = d.x * y - d.y * x, height2 = a * a + b * b, root = height2 - c * c;
        for (int side = -1; side <= 1 && root > 0.0; side += 2) {
            double t = side * sqrt(root);
            double cosine = (-a * c - b * t) / height2, sine = (-b * c + a * t) / height2;
            double along = d.x * (x + radius * (cosine * xx + sine * yx)) +
                           d.y * (y + radius * (cosine * xy + sine * yy));
            if (along > 0.0 && along < length2) {
                note(w, s, turned_to(atan2(sine, cosine), s->start));
            }
        }
    }
}

/* Notes where a side of a silhouette crosses or touches lines of the surface. */
static void note_side(bst_shaded_surface *w, search *s, bst_point2 p, bst_point2 q) {
    if (w->curved && w->curved->sphere) {
        note_meridians(w, s, p, q);
    } else if (w->curved) {
        note_crossings(w, s, p, q);
    }
}

/* Adds the azimuths between two where the shadow of a shell's rim crosses an end of a band within
 * it: circles in the plane of the rim, along the view. */
static void add_rim_crossings(bst_shaded_surface *w, search *s) {
    const bst_pose_view *v = s->view;
    const bst_satellite_pose *p = w->shadow.pose;
    int shell = p->satellite->occluders[w->curved->occluder].shell;
    double radius = p->satellite->shells[shell].radius_m, lower = 0.0, middle = 0.0;
    bst_pose_rim rim = bst_pose_rim_of(p, v, shell);
    for (int i = 0; i < 2; i++) {
        double ring = i == 0 ? w->curved->radius_m : w->curved->top_radius_m;
        bst_vec3 r =
            bst_vec3_sub(bst_vec3_axpy(w->base, i * w->curved->length_m, w->z), rim.centre);
        r = bst_vec3_axpy(r, -bst_vec3_dot(r, rim.axis) / rim.rate, v->z);
        double moved = bst_vec3_norm(r);
        bool same = i == 1 && moved <= 1e-9 * radius; /* the rim itself: the limit from below */
        double cosine =
            same ? (radius - w->curved->radius_m) / lower
                 : (radius * radius - ring * ring - moved * moved) / (2.0 * ring * moved);
        middle = same ? middle : atan2(bst_vec3_dot(r, w->y), bst_vec3_dot(r, w->x));
        lower = moved;
        for (int side = -1; side <= 1 && fabs(cosine) < 1.0; side += 2) {
            note(w, s, turned_to(middle + side * acos(cosine), s->start));
        }
    }
}

/* Adds the places of a hider's silhouette; of those with many corners the outermost ones. */
static void add_hider(bst_shaded_surface *w, search *s, int view, int hider) {
    bst_point2 corner[BST_LINE_CORNERS_MAX], tangent[2][2];
    int count = bst_line_shadow_corners(&w->shadow, view, hider, corner);
    bool round = w->shadow.pose->hiders[hider][1] >= 0;
    s->all = count <= FEW_CORNERS && !round;
    s->low = INFINITY;
    s->high = -INFINITY;
    for (int n = 0; n < count; n++) {
        note_point(w, s, corner[n]);
        note_side(w, s, corner[n], corner[n + 1 < count ? n + 1 : 0]);
    }
    if (!s->all && s->low <= s->high) {
        add_place(w, s->low);
        add_place(w, s->high);
    }
    if (round && bst_line_shadow_tangents(&w->shadow, hider, tangent)) {
        s->all = true;
        for (int i = 0; i < 2; i++) {
            note_side(w, s, tangent[i][0], tangent[i][1]);
            for (int k = 0; k < 2 && !w->curved; k++) {
                note_point(w, s, tangent[i][k]);
            }
        }
    }
}

void bst_surface_find_places(bst_shaded_surface *w, double start, double end) {
    for (int k = 0; k < 2; k++) {
        search s = {.view = &w->shadow.pose->views[k], .start = start, .end = end, .all = true};
        for (int i = w->shadow.first[k]; i < w->shadow.first[k + 1]; i++) {
            if (w->curved && w->shadow.pose->hiders[i][0] == w->curved->occluder) {
                s.all = true;
                add_rim_crossings(w, &s);
            } else {
                add_hider(w, &s, k, i);
            }
        }
    }
    bst_sort_few(w->place, w->places);
}
