#include "sim/satellite/surface_shadow.h"

#include "sim/satellite/curved_light.h"
#include "sim/satellite/line_shadow.h"
#include "sim/satellite/pose_view.h"

enum {
    PLACES_MAX = 64,
    CHORDS = 16,
    FEW_CORNERS = 8,
    HIDER_CORNERS = 40,
    HALVINGS = 9,
    PLANE_PANELS = 12
};

/* Facets with more corners, of bodies with curved surfaces, are ends of these. */
enum { SIDES_MAX = 7 };

/* Widest panel of azimuth before it is halved, rad. */
static const double PANEL_RAD = 0.7;
/* Error of a panel over its difference from the rule of the middle: a choice, see
 * docs/results/satellites.md. */
static const double ERROR = 0.4;
/* Borders nearer than this times the tolerance are one. */
static const double NEAR = 0.3;
/* Panels of surfaces that matter little are up to this wider. */
static const double WIDEN = 2.0;
/* Tolerance below which panels are not wider than that, and above which the corners of hiders do
 * not matter. */
static const double FINE = 6e-4, COARSE = 2e-2;

/* A surface in the body frame, with lines at the places of one coordinate: azimuth; of polygons the
 * distance along y. */
typedef struct surface {
    bst_line_shadow shadow;
    bst_light_line (*line)(const struct surface *w, double place, int index);
    int lines; /* at each place */
    const bst_curved *curved;
    const bst_brdf *brdf;
    bst_vec3 sun, observer;
    bst_vec3 base, x, y, z; /* of a sphere: z is the axis of bst_curved_panels, x the observer; of a
                               plane facet: z is its normal */
    double slant_m, radial, axial; /* of a cone: length of a line; of its normal */
    double radius_m;               /* of a disc */
    bst_point2 corner[SIDES_MAX];  /* of a polygon */
    int corners;
    double tolerance, share;  /* of one panel, in the unit of the integral; of the whole */
    double narrow;            /* no shadow is sought within panels that are narrower */
    double place[PLACES_MAX]; /* of the corners of hiders */
    int places;
} surface;

/* BRDF times both cosines. */
static double reflected(const surface *w, bst_vec3 normal) {
    double in = fmin(bst_vec3_dot(normal, w->sun), 1.0);
    double out = fmin(bst_vec3_dot(normal, w->observer), 1.0);
    return in > 0.0 && out > 0.0
               ? in * out * bst_brdf_value(w->brdf, in, out, bst_vec3_dot(w->sun, w->observer))
               : 0.0;
}

static bst_vec3 outward_at(const surface *w, double azimuth) {
    return bst_vec3_axpy(bst_vec3_scale(w->x, cos(azimuth)), sin(azimuth), w->y);
}

static bst_light_line cone_line(const surface *w, double azimuth, int index) {
    const bst_curved *c = w->curved;
    bst_vec3 outward = outward_at(w, azimuth), top = bst_vec3_axpy(w->base, c->length_m, w->z);
    (void)index;
    bst_light_line l = {.from = bst_vec3_axpy(w->base, c->radius_m, outward),
                        .to = bst_vec3_axpy(top, c->top_radius_m, outward)};
    l.normal = bst_vec3_axpy(bst_vec3_scale(outward, w->radial), w->axial, w->z);
    double value = reflected(w, l.normal) * w->slant_m;
    l.from_weight = value * c->radius_m;
    l.to_weight = value * c->top_radius_m;
    return l;
}

/* Chords that end outside of the sphere, so that their circle has its area. */
static bst_light_line sphere_line(const surface *w, double azimuth, int index) {
    const double step = BST_PI / CHORDS;
    double r = w->curved->radius_m, far = r * sqrt(step / sin(step));
    double middle = (index + 0.5) * step - 0.5 * BST_PI;
    bst_vec3 outward = outward_at(w, azimuth), end[2];
    for (int i = 0; i < 2; i++) {
        double latitude = middle + (i - 0.5) * step;
        end[i] = bst_vec3_axpy(w->base, far * cos(latitude), outward);
        end[i] = bst_vec3_axpy(end[i], far * sin(latitude), w->z);
    }
    bst_light_line l = {.from = end[0], .to = end[1]};
    l.normal = bst_vec3_axpy(bst_vec3_scale(outward, cos(middle)), sin(middle), w->z);
    l.from_weight = l.to_weight = reflected(w, l.normal) * r * r * step * cos(middle);
    return l;
}

static bst_vec3 point_of(const surface *w, double x, double y) {
    return bst_vec3_axpy(bst_vec3_axpy(w->base, x, w->x), y, w->y);
}

/* Chords along x at -R cos(azimuth) of y: smooth at both ends. */
static bst_light_line disc_line(const surface *w, double azimuth, int index) {
    double half = w->radius_m * sin(azimuth), y = -w->radius_m * cos(azimuth);
    (void)index;
    return (bst_light_line){.from = point_of(w, -half, y),
                            .to = point_of(w, half, y),
                            .normal = w->z,
                            .from_weight = 2.0 * half * half,
                            .to_weight = 2.0 * half * half};
}

static bst_light_line polygon_line(const surface *w, double y, int index) {
    double low = INFINITY, high = -INFINITY;
    (void)index;
    for (int i = 0; i < w->corners; i++) {
        bst_point2 a = w->corner[i], b = w->corner[i + 1 < w->corners ? i + 1 : 0];
        if ((a.y > y) != (b.y > y)) {
            double x = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            low = fmin(low, x);
            high = fmax(high, x);
        }
    }
    bst_light_line l = {.normal = w->z};
    if (low < high) {
        l.from = point_of(w, low, y);
        l.to = point_of(w, high, y);
        l.from_weight = l.to_weight = high - low;
    }
    return l;
}

/* Light at one place, or the integral over places. */
typedef struct light {
    double all, lost;
    double place;             /* last one of the last panel; of a sum only */
    double share, slope, end; /* lost there, its slope, and the panel's end */
} light;

static light light_at(const surface *w, double place) {
    light sum = {.all = 0.0};
    for (int i = 0; i < w->lines; i++) {
        bst_light_line l = w->line(w, place, i);
        double all = 0.5 * (l.from_weight + l.to_weight);
        sum.all += all;
        sum.lost += all > 0.0 ? bst_line_shadow_lost(&w->shadow, &l) : 0.0;
    }
    return sum;
}

static double lost_share(const light *l) {
    return l->all > 0.0 ? fmin(l->lost / l->all, 1.0) : 0.0;
}

/* Corrects the integral where a shadow begins or ends at once, beside the border of two panels and
 * not at it: the place is found by halving. Returned: the error that is left.
 *
 * Given:     from, first  the border, and the share that is lost at the first place after it
 *            slope        of the share there
 *            density      light by place */
static double mend_jump(const surface *w, double from, double first_place, double first,
                        double slope, double density, light *sum) {
    double low = sum->place, high = first_place, way = high - low, jump = first - sum->share;
    double expected = way * fmax(fabs(slope), fabs(sum->slope));
    double error = density * way * (fabs(jump) - 2.0 * expected);
    if (sum->end != from || !(error > w->tolerance)) {
        return 0.0;
    }
    for (; error > 0.5 * w->tolerance && high - low > 1e-6 * way; error *= 0.5) {
        double middle = 0.5 * (low + high);
        light at = light_at(w, middle);
        bool before = fabs(lost_share(&at) - sum->share) < fabs(lost_share(&at) - first);
        low = before ? middle : low;
        high = before ? high : middle;
    }
    sum->lost += density * jump * (from - 0.5 * (low + high));
    return error;
}

/* Adds a panel by three-point Gauss quadrature. Returned: its difference from the rule of the
 * middle, times ERROR. */
static double add_panel(const surface *w, double from, double to, int halvings, light *sum) {
    double half = 0.5 * (to - from), middle = from + half, aside = half * sqrt(0.6);
    light a = light_at(w, middle - aside), m = light_at(w, middle), b = light_at(w, middle + aside);
    bool none = !(a.lost > 0.0 || b.lost > 0.0 || m.lost > 0.0);
    bool all = a.lost >= a.all && b.lost >= b.all && m.lost >= m.all;

    double error = none || all ? 0.0 : ERROR * half * fabs(a.lost + b.lost - 2.0 * m.lost);
    if ((error > w->tolerance || ((none || all) && to - from > w->narrow)) && halvings > 0) {
        return add_panel(w, from, middle, halvings - 1, sum) +
               add_panel(w, middle, to, halvings - 1, sum);
    }
    double share = lost_share(&a), last = lost_share(&b), slope = 0.5 * (last - share) / aside;
    error += mend_jump(w, from, middle - aside, share, slope, fmax(a.all, b.all), sum);
    sum->place = middle + aside;
    sum->share = last;
    sum->slope = slope;
    sum->end = to;
    double whole = half / 9.0 * (5.0 * (a.all + b.all) + 8.0 * m.all);
    sum->all += whole;
    sum->lost += none ? 0.0 : all ? whole : half / 9.0 * (5.0 * (a.lost + b.lost) + 8.0 * m.lost);
    return error;
}

/* Azimuths where a ray of a view meets a curved surface; a cone is continued beyond its ends if
 * `beyond`.
 *
 * Given:     r  a point of the ray, from the base
 * Returned:  their number */
static int meet_curved(const surface *w, const bst_pose_view *v, bst_vec3 r, bool beyond,
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
        if (beyond || c->sphere || (height >= 0.0 && height <= c->length_m)) {
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

/* Places, from `start` on, where the ray of a view through a point of its plane meets the surface
 * or its continuation. Returned: their number. */
static int meet(const surface *w, const bst_pose_view *v, bst_point2 point, bool beyond,
                double start, double place[2]) {
    bst_vec3 q = bst_vec3_axpy(bst_vec3_scale(v->x, point.x), point.y, v->y);
    bst_vec3 r = bst_vec3_sub(q, w->base);
    if (w->curved) {
        int n = meet_curved(w, v, r, beyond, place);
        for (int i = 0; i < n; i++) {
            place[i] = turned_to(place[i], start);
        }
        return n;
    }
    r = bst_vec3_axpy(r, -bst_vec3_dot(r, w->z) / bst_vec3_dot(v->z, w->z), v->z);
    double y = bst_vec3_dot(r, w->y);
    if (w->corners == 0 && !(fabs(y) < w->radius_m)) {
        return 0;
    }
    place[0] = w->corners == 0 ? acos(-y / w->radius_m) : y;
    return 1;
}

static void add_place(surface *w, double place) {
    if (w->places < PLACES_MAX) {
        w->place[w->places++] = place;
    }
}

/* Adds the azimuths between two where an end of a cone crosses an edge of a silhouette. */
static void add_crossings(surface *w, const bst_pose_view *v, bst_point2 p, bst_point2 q,
                          double start, double end) {
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
            double s = side * sqrt(root);
            double cosine = (-a * c - b * s) / height2, sine = (-b * c + a * s) / height2;
            double along = d.x * (x + radius * (cosine * xx + sine * yx)) +
                           d.y * (y + radius * (cosine * xy + sine * yy));
            if (along > 0.0 && along < length2) {
                double place = turned_to(atan2(sine, cosine), start);
                if (place < end) {
                    add_place(w, place);
                }
            }
        }
    }
}

/* Adds the azimuths between two where the shadow of a shell's rim crosses an end of a band within
 * it: circles in the plane of the rim, along the view. */
static void add_rim_crossings(surface *w, const bst_pose_view *v, double start, double end) {
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
            double place = turned_to(middle + side * acos(cosine), start);
            if (place < end) {
                add_place(w, place);
            }
        }
    }
}

/* Adds the places of a hider's corners; of those with many corners the outermost ones. */
static void add_corners(surface *w, int view, int hider, double start, double end) {
    bst_point2 corner[HIDER_CORNERS];
    const bst_pose_view *v = &w->shadow.pose->views[view];
    int count = bst_line_shadow_corners(&w->shadow, view, hider, HIDER_CORNERS, corner);
    bool few = count <= FEW_CORNERS;
    double low = INFINITY, high = -INFINITY, place[2];
    for (int n = 0; n < count; n++) {
        int found = meet(w, v, corner[n], !few, start, place);
        for (int m = 0; m < found; m++) {
            if (place[m] > start && place[m] < end) {
                low = fmin(low, place[m]);
                high = fmax(high, place[m]);
                if (few) {
                    add_place(w, place[m]);
                }
            }
        }
        if (few && w->curved && !w->curved->sphere) {
            add_crossings(w, v, corner[n], corner[n + 1 < count ? n + 1 : 0], start, end);
        }
    }
    bst_point2 tangent[2][2];
    bool straight = bst_line_shadow_tangents(&w->shadow, hider, tangent);
    for (int i = 0; i < 4 && straight; i++) {
        if (!w->curved && meet(w, v, tangent[i / 2][i % 2], false, start, place) > 0 &&
            place[0] > start && place[0] < end) {
            add_place(w, place[0]);
        }
        if (w->curved && !w->curved->sphere && i % 2 == 0) {
            add_crossings(w, v, tangent[i / 2][0], tangent[i / 2][1], start, end);
        }
    }
    if (!few && low <= high) {
        add_place(w, low);
        add_place(w, high);
    }
}

static void add_all_corners(surface *w, double start, double end) {
    for (int k = 0; k < 2; k++) {
        for (int i = w->shadow.first[k]; i < w->shadow.first[k + 1]; i++) {
            if (w->curved && w->shadow.pose->hiders[i][0] == w->curved->occluder) {
                add_rim_crossings(w, &w->shadow.pose->views[k], start, end);
            } else {
                add_corners(w, k, i, start, end);
            }
        }
    }
    bst_sort_few(w->place, w->places);
}

/* Adds the integral between two places, in panels no wider than `widest`. Returned: its error. */
static double add_range(const surface *w, double from, double to, double widest, light *sum) {
    double error = 0.0, start = from, gap = fmin(NEAR * w->share, 0.02) * (to - from);
    for (int n = 0; n <= w->places && start < to; n++) {
        double end = n < w->places ? w->place[n] : to;
        if (end >= to || to - end < gap) {
            end = to;
        } else if (end - start < gap) {
            continue; /* what a jump changes within it is little */
        }
        int parts = (int)ceil((end - start) / widest);
        for (int i = 0; i < parts; i++) {
            error += add_panel(w, start + (end - start) * i / parts,
                               start + (end - start) * (i + 1) / parts, HALVINGS, sum);
        }
        start = end;
    }
    return error;
}

/* Places a curved surface in the body frame. */
static void place_curved(const bst_satellite_pose *p, surface *w) {
    const bst_curved *c = w->curved;
    w->base = bst_pose_moved(p, c->joint, c->base_m);
    w->x = bst_pose_turned(p, c->joint, c->x);
    w->y = bst_pose_turned(p, c->joint, c->y);
    w->z = bst_pose_turned(p, c->joint, c->z);
    double rise = c->top_radius_m - c->radius_m;
    w->slant_m = sqrt(rise * rise + c->length_m * c->length_m);
    w->radial = c->sphere ? 1.0 : c->side * c->length_m / w->slant_m;
    w->axial = c->sphere ? 0.0 : -c->side * rise / w->slant_m;
    if (c->sphere) {
        bst_vec3 axis = bst_vec3_cross(w->observer, w->sun);
        w->z =
            bst_vec3_norm(axis) > 1e-9 ? bst_vec3_unit(axis) : bst_vec3_perpendicular(w->observer);
        w->x = w->observer;
        w->y = bst_vec3_cross(w->z, w->x);
    }
}

/* The free share, and the bound of its error: the differences of panels may all be small by chance,
 * so that a part shadow has at least what one panel may differ by. */
static double share_of(const surface *w, const light *sum, double *error) {
    if (!(sum->all > 0.0)) {
        *error = 0.0;
        return 1.0;
    }
    bool part = sum->lost > 0.0 && sum->lost < sum->all;
    *error = (*error + (part ? w->tolerance : 0.0)) / sum->all;
    return fmax(1.0 - sum->lost / sum->all, 0.0);
}

double bst_curved_free_share(bst_satellite_pose *p, int curved, double light_m2, double tolerance,
                             double *error) {
    const bst_curved *c = &p->satellite->curved[curved];
    surface w = {.curved = c,
                 .line = c->sphere ? sphere_line : cone_line,
                 .lines = c->sphere ? CHORDS : 1,
                 .brdf = &p->satellite->materials[c->material].brdf,
                 .observer = p->views[0].z,
                 .sun = p->views[1].z};
    double panel[BST_CURVED_PANELS_MAX][2];
    light sum = {.end = NAN};
    *error = 0.0;
    place_curved(p, &w);
    bst_line_ring rings[2] = {{w.base, w.z, c->radius_m},
                              {bst_vec3_axpy(w.base, c->length_m, w.z), w.z, c->top_radius_m}};
    if (c->sphere) {
        rings[0].axis = (bst_vec3){0};
    }
    if (!bst_line_shadow_make(p, c->occluder, c->side < 0.0, rings, c->sphere ? 1 : 2, &w.shadow)) {
        return 1.0;
    }
    if (c->side < 0.0 &&
        !(w.shadow.rim[0].radius_m[0] > 0.0 && w.shadow.rim[1].radius_m[0] > 0.0)) {
        return 0.0; /* Sun or observer are behind the rim */
    }
    bst_vec3 sun = bst_pose_turned_back(p, c->joint, w.sun);
    bst_vec3 observer = bst_pose_turned_back(p, c->joint, w.observer);
    int panels = bst_curved_panels(c, w.brdf, sun, observer, panel);
    w.share = tolerance;
    w.tolerance = tolerance * light_m2;
    double width = PANEL_RAD * fmin(fmax(cbrt(tolerance / FINE), 1.0), WIDEN);
    w.narrow = 1.01 * width;
    if (panels > 0 && tolerance < COARSE) {
        add_all_corners(&w, panel[0][0], panel[panels - 1][1]);
    }
    for (int i = 0; i < panels; i++) {
        *error += add_range(&w, panel[i][0], panel[i][1], width, &sum);
    }
    return share_of(&w, &sum, error);
}

bool bst_plane_is_round(const bst_satellite_pose *p, int index) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    if (s->occluders[f->occluder].curved_count > 0) {
        return f->count > SIDES_MAX;
    }
    if (s->occluder_count > BST_SEPARATION_BODIES || f->count > SIDES_MAX) {
        return false;
    }
    uint64_t hiders = p->views[0].hiders[f->occluder] | p->views[1].hiders[f->occluder];
    for (int o = 0; o < s->occluder_count; o++) {
        if ((hiders >> o & 1) && s->occluders[o].curved_count > 0) {
            return true;
        }
    }
    return false;
}

double bst_plane_free_share(bst_satellite_pose *p, int index, double tolerance, double *error) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    const int *corner = s->corner + f->first;
    bool disc = f->count > SIDES_MAX;
    surface w = {.line = disc ? disc_line : polygon_line, .lines = 1, .z = p->normals[index]};
    double low = INFINITY, high = -INFINITY;
    light sum = {.end = NAN};
    *error = 0.0;
    bst_line_ring rings[SIDES_MAX];
    w.base = p->vertices[corner[0]];
    w.x = bst_vec3_unit(bst_vec3_sub(p->vertices[corner[1]], w.base));
    w.y = bst_vec3_cross(w.z, w.x);
    if (disc) {
        w.base = bst_pose_middle_of(p, f);
        w.radius_m = sqrt(f->area_m2 / BST_PI);
        low = 0.0;
        high = BST_PI;
        rings[0] = (bst_line_ring){w.base, w.z, w.radius_m};
    }
    w.corners = disc ? 0 : f->count;
    for (int i = 0; i < w.corners; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[corner[i]], w.base);
        w.corner[i] = (bst_point2){bst_vec3_dot(r, w.x), bst_vec3_dot(r, w.y)};
        low = fmin(low, w.corner[i].y);
        high = fmax(high, w.corner[i].y);
        rings[i] = (bst_line_ring){p->vertices[corner[i]], {0.0, 0.0, 0.0}, 0.0};
    }
    if (!bst_line_shadow_make(p, f->occluder, f->inside, rings, disc ? 1 : f->count, &w.shadow)) {
        return 1.0;
    }
    w.share = tolerance;
    w.tolerance = tolerance * f->area_m2;
    w.narrow = 0.5 * (high - low) / PLANE_PANELS;
    add_all_corners(&w, low, high);
    *error = add_range(&w, low, high, (high - low) / PLANE_PANELS, &sum);
    return share_of(&w, &sum, error);
}
