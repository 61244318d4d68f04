#include "sim/satellite/surface_shadow.h"

#include <assert.h>

#include "sim/satellite/curved_light.h"
#include "sim/satellite/pose_view.h"
#include "sim/satellite/surface_places.h"

enum { BANDS_MAX = 32, LINES_MAX = 2 * BANDS_MAX, HALVINGS = 9, PLANE_PANELS = 12 };

/* Facets with more corners, of bodies with curved surfaces, are ends of these. */
enum { SIDES_MAX = BST_SURFACE_SIDES_MAX };

/* Widest panel of azimuth before it is halved, rad. */
static const double PANEL_RAD = 0.7;
/* Widest band of latitude, rad; and borders of bands about a lobe in its half widths, so that its
 * light is linear in each to 2e-4 of all: tests/satellite/test_surface_shadow.c. */
static const double BAND_RAD = BST_PI / 32.0;
static const double LOBE_BANDS[] = {0.25, 0.5, 0.75, 1.0, 1.4,  1.9,  2.5,
                                    3.3,  4.4, 6.0,  8.5, 12.0, 17.0, 25.0};
/* Error of a panel over its difference from the rule of the middle: a choice, see
 * docs/results/satellites.md. */
static const double ERROR = 0.6;
/* Borders nearer than this times the tolerance, or than this part of the range, are one. */
static const double NEAR = 0.3, NEAREST = 0.02;
/* Panels of surfaces that matter little are up to this wider. */
static const double WIDEN = 2.0;
/* Tolerance below which panels are not wider than that. */
static const double FINE = 6e-4;

/* A band of latitude of a sphere: its chord, and the two points of Gauss' quadrature in it. */
typedef struct band {
    double cosine[2], sine[2];                /* of its borders, times their distance over R */
    double middle_cosine, middle_sine, width; /* width in rad */
    double point_cosine[2];
} band;

/* A surface, with the light of its lines at each place. */
typedef struct surface {
    bst_shaded_surface on;
    int (*lines)(const struct surface *w, double place, bst_light_line *line); /* their number */
    const bst_brdf *brdf;
    bst_vec3 sun, observer;
    double slant_m, radial, axial; /* of a cone: length of a line; of its normal */
    band bands[BANDS_MAX];         /* of a sphere, from the plane of Sun and observer to the pole */
    int band_count;
    double tolerance, share; /* of one panel, in the unit of the integral; of the whole */
    double narrow;           /* no shadow is sought within panels that are narrower */
} surface;

/* BRDF times both cosines. */
static double reflected(const surface *w, double in, double out) {
    in = fmin(in, 1.0);
    out = fmin(out, 1.0);
    return in > 0.0 && out > 0.0
               ? in * out * bst_brdf_value(w->brdf, in, out, bst_vec3_dot(w->sun, w->observer))
               : 0.0;
}

static bst_vec3 outward_at(const surface *w, double azimuth) {
    return bst_vec3_axpy(bst_vec3_scale(w->on.x, cos(azimuth)), sin(azimuth), w->on.y);
}

static int cone_lines(const surface *w, double azimuth, bst_light_line *line) {
    const bst_curved *c = w->on.curved;
    bst_vec3 outward = outward_at(w, azimuth);
    bst_vec3 top = bst_vec3_axpy(w->on.base, c->length_m, w->on.z);
    bst_vec3 normal = bst_vec3_axpy(bst_vec3_scale(outward, w->radial), w->axial, w->on.z);
    double in = bst_vec3_dot(normal, w->sun), out = bst_vec3_dot(normal, w->observer);
    double value = reflected(w, in, out) * w->slant_m;
    *line = (bst_light_line){.from = bst_vec3_axpy(w->on.base, c->radius_m, outward),
                             .to = bst_vec3_axpy(top, c->top_radius_m, outward),
                             .normal = normal,
                             .from_weight = value * c->radius_m,
                             .to_weight = value * c->top_radius_m};
    return 1;
}

/* Divides a hemisphere into bands of latitude, finer about the lobe. */
static void make_bands(surface *w) {
    const int steps = sizeof LOBE_BANDS / sizeof *LOBE_BANDS;
    double lobe = bst_brdf_lobe_rad(w->brdf), from = 0.0;
    for (int i = lobe < 1.0 ? 0 : steps; i <= steps && from < 0.5 * BST_PI; i++) {
        double to = i < steps ? fmin(LOBE_BANDS[i] * lobe, 0.5 * BST_PI) : 0.5 * BST_PI;
        int parts = (int)ceil((to - from) / BAND_RAD - 1e-9);
        double width = (to - from) / parts;
        for (int k = 0; k < parts && w->band_count < BANDS_MAX; k++) {
            band *b = &w->bands[w->band_count++];
            double low = from + k * width, middle = low + 0.5 * width;
            /* chords that end outside of the sphere, so that their circle has its area */
            double far = sqrt(width / sin(width));
            b->width = width;
            b->middle_cosine = cos(middle);
            b->middle_sine = sin(middle);
            for (int side = 0; side < 2; side++) {
                b->cosine[side] = far * cos(low + side * width);
                b->sine[side] = far * sin(low + side * width);
                b->point_cosine[side] = cos(middle + (side - 0.5) * width / sqrt(3.0));
            }
        }
        from = to;
    }
}

/* The chord of a meridian in a band of a hemisphere, 1 or -1, with the light of a piece at both
 * ends. */
static bst_light_line chord(const surface *w, bst_vec3 outward, const band *b, double hemisphere,
                            const double weight[2]) {
    bst_vec3 end[2], z = bst_vec3_scale(w->on.z, hemisphere);
    double r = w->on.curved->radius_m;
    for (int i = 0; i < 2; i++) {
        end[i] = bst_vec3_axpy(w->on.base, r * b->cosine[i], outward);
        end[i] = bst_vec3_axpy(end[i], r * b->sine[i], z);
    }
    return (bst_light_line){
        .from = end[0],
        .to = end[1],
        .normal = bst_vec3_axpy(bst_vec3_scale(outward, b->middle_cosine), b->middle_sine, z),
        .from_weight = weight[0],
        .to_weight = weight[1]};
}

/* Light is linear in each band, through its two points but below 0 nowhere. */
static int sphere_lines(const surface *w, double azimuth, bst_light_line *line) {
    bst_vec3 outward = outward_at(w, azimuth);
    double in = bst_vec3_dot(outward, w->sun), out = bst_vec3_dot(outward, w->observer);
    double r = w->on.curved->radius_m;
    for (int i = 0; i < w->band_count; i++) {
        const band *b = &w->bands[i];
        double value[2], weight[2];
        for (int k = 0; k < 2; k++) {
            double cosine = b->point_cosine[k];
            value[k] = reflected(w, in * cosine, out * cosine) * cosine * r * r * b->width;
        }
        double mean = 0.5 * (value[0] + value[1]), slope = 0.5 * sqrt(3.0) * (value[1] - value[0]);
        slope = fmax(fmin(slope, mean), -mean);
        weight[0] = mean - slope;
        weight[1] = mean + slope;
        line[2 * i] = chord(w, outward, b, 1.0, weight);
        line[2 * i + 1] = chord(w, outward, b, -1.0, weight);
    }
    return 2 * w->band_count;
}

static bst_vec3 point_of(const surface *w, double x, double y) {
    return bst_vec3_axpy(bst_vec3_axpy(w->on.base, x, w->on.x), y, w->on.y);
}

/* Chords along x at -R cos(azimuth) of y: smooth at both ends. */
static int disc_lines(const surface *w, double azimuth, bst_light_line *line) {
    double half = w->on.radius_m * sin(azimuth), y = -w->on.radius_m * cos(azimuth);
    *line = (bst_light_line){.from = point_of(w, -half, y),
                             .to = point_of(w, half, y),
                             .normal = w->on.z,
                             .from_weight = 2.0 * half * half,
                             .to_weight = 2.0 * half * half};
    return 1;
}

static int polygon_lines(const surface *w, double y, bst_light_line *line) {
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < w->on.corners; i++) {
        bst_point2 a = w->on.corner[i], b = w->on.corner[i + 1 < w->on.corners ? i + 1 : 0];
        if ((a.y > y) != (b.y > y)) {
            double x = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            low = fmin(low, x);
            high = fmax(high, x);
        }
    }
    if (!(low < high)) {
        return 0;
    }
    *line = (bst_light_line){.from = point_of(w, low, y),
                             .to = point_of(w, high, y),
                             .normal = w->on.z,
                             .from_weight = high - low,
                             .to_weight = high - low};
    return 1;
}

/* Light at one place, or the integral over places. */
typedef struct light {
    double all, lost;
    double place;             /* last one of the last panel; of a sum only */
    double share, slope, end; /* lost there, its slope, and the panel's end */
    bool skipped;             /* a border was passed over because another one is near */
} light;

static light light_at(const surface *w, double place) {
    bst_light_line line[LINES_MAX];
    light sum = {.all = 0.0};
    int count = w->lines(w, place, line);
    for (int i = 0; i < count; i++) {
        double all = 0.5 * (line[i].from_weight + line[i].to_weight);
        sum.all += all;
        sum.lost += all > 0.0 ? bst_line_shadow_lost(&w->on.shadow, &line[i]) : 0.0;
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
 * middle for the share that is lost, times ERROR. */
static double add_panel(const surface *w, double from, double to, int halvings, light *sum) {
    double half = 0.5 * (to - from), middle = from + half, aside = half * sqrt(0.6);
    light a = light_at(w, middle - aside), m = light_at(w, middle), b = light_at(w, middle + aside);
    bool none = !(a.lost > 0.0 || b.lost > 0.0 || m.lost > 0.0);
    bool all = a.lost >= a.all && b.lost >= b.all && m.lost >= m.all;
    double others = a.lost + b.lost - lost_share(&m) * (a.all + b.all);

    double error = none || all ? 0.0 : ERROR * half * fabs(others);
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

/* Adds the integral between two places, in panels no wider than `widest`. Returned: its error. */
static double add_range(const surface *w, double from, double to, double widest, light *sum) {
    double error = 0.0, start = from, gap = fmin(NEAR * w->share, NEAREST) * (to - from);
    for (int n = 0; n <= w->on.places && start < to; n++) {
        double end = n < w->on.places ? fmin(w->on.place[n], to) : to;
        if (end <= start) {
            continue;
        }
        if (end < to && (end - start < gap || to - end < gap)) {
            sum->skipped = true; /* what a jump changes within it is little */
            continue;
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
    bst_shaded_surface *on = &w->on;
    const bst_curved *c = on->curved;
    on->base = bst_pose_moved(p, c->joint, c->base_m);
    on->x = bst_pose_turned(p, c->joint, c->x);
    on->y = bst_pose_turned(p, c->joint, c->y);
    on->z = bst_pose_turned(p, c->joint, c->z);
    double rise = c->top_radius_m - c->radius_m;
    w->slant_m = sqrt(rise * rise + c->length_m * c->length_m);
    w->radial = c->side * c->length_m / w->slant_m;
    w->axial = -c->side * rise / w->slant_m;
    if (c->sphere) {
        bst_vec3 axis = bst_vec3_cross(w->observer, w->sun);
        on->z =
            bst_vec3_norm(axis) > 1e-9 ? bst_vec3_unit(axis) : bst_vec3_perpendicular(w->observer);
        on->x = w->observer;
        on->y = bst_vec3_cross(on->z, on->x);
        make_bands(w);
    }
}

/* The free share, and the estimate of its error: the differences of panels may all be small by
 * chance, so that a part shadow has at least what one panel may differ by. */
static double share_of(const surface *w, const light *sum, double *error) {
    if (!(sum->all > 0.0)) {
        *error = 0.0;
        return 1.0;
    }
    bool part = sum->lost > 0.0 && sum->lost < sum->all;
    bool unsure = part || sum->skipped || w->on.crowded;
    *error = (*error + (unsure ? w->tolerance : 0.0)) / sum->all;
    return fmax(1.0 - sum->lost / sum->all, 0.0);
}

double bst_curved_free_share(bst_satellite_pose *p, int curved, double light_m2, bool disc,
                             double tolerance, double *error) {
    const bst_curved *c = &p->satellite->curved[curved];
    surface w = {.lines = c->sphere ? sphere_lines : cone_lines,
                 .brdf = &p->satellite->materials[c->material].brdf,
                 .observer = p->views[0].z,
                 .sun = p->views[1].z};
    double panel[BST_CURVED_PANELS_MAX][2];
    light sum = {.end = NAN};
    *error = 0.0;
    w.on.curved = c;
    bst_vec3 base = bst_pose_moved(p, c->joint, c->base_m);
    bst_vec3 axis = bst_pose_turned(p, c->joint, c->z);
    bst_line_ring rings[2] = {{base, axis, c->radius_m},
                              {bst_vec3_axpy(base, c->length_m, axis), axis, c->top_radius_m}};
    if (c->sphere) {
        rings[0].axis = (bst_vec3){0};
    }
    bst_line_shadow *shadow = &w.on.shadow;
    if (!bst_line_shadow_make(p, c->occluder, c->side < 0.0, rings, c->sphere ? 1 : 2, shadow)) {
        return 1.0;
    }
    if (c->side < 0.0 && !(shadow->rim[0].radius_m[0] > 0.0 && shadow->rim[1].radius_m[0] > 0.0)) {
        return 0.0; /* Sun or observer are behind the rim */
    }
    place_curved(p, &w);
    bst_vec3 sun = bst_pose_turned_back(p, c->joint, w.sun);
    bst_vec3 observer = bst_pose_turned_back(p, c->joint, w.observer);
    int panels = bst_curved_panels(c, w.brdf, sun, observer, panel);
    w.share = tolerance;
    w.tolerance = tolerance * light_m2;
    double width = PANEL_RAD * fmin(fmax(cbrt(tolerance / FINE), 1.0), WIDEN);
    w.narrow = 1.01 * width;
    if (panels > 0) {
        bst_surface_find_places(&w.on, panel[0][0], panel[panels - 1][1]);
    }
    for (int i = 0; i < panels; i++) {
        *error += add_range(&w, panel[i][0], panel[i][1], width, &sum);
    }
    double share = share_of(&w, &sum, error);
    if (share > 0.0 && share < 1.0 && !disc) {
        *error += fabs(sum.all / light_m2 - 1.0);
    }
    return share;
}

bool bst_plane_is_round(const bst_satellite_pose *p, int index) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    if (f->count > SIDES_MAX && s->occluders[f->occluder].curved_count > 0) {
        return true;
    }
    bool few = s->occluder_count <= BST_SEPARATION_BODIES;
    double bounds[2][6];
    for (int k = 0; k < 2; k++) {
        bst_pose_start_bounds(bounds[k]);
        for (int i = 0; i < f->count && !few; i++) {
            bst_pose_add_to_bounds(&p->views[k], s->corner[f->first + i], bounds[k]);
        }
    }
    for (int i = 0; i < s->curved_count; i++) {
        int o = s->curved[i].occluder;
        for (int k = 0; k < 2 && o != f->occluder; k++) {
            const bst_pose_view *v = &p->views[k];
            if (few ? v->hiders[f->occluder] >> o & 1
                    : bst_pose_may_hide(v->bounds[o], bounds[k])) {
                return true;
            }
        }
    }
    return false;
}

bool bst_plane_has_lines(const bst_satellite_pose *p, int index) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    return f->count <= SIDES_MAX || s->occluders[f->occluder].curved_count > 0;
}

double bst_plane_free_share(bst_satellite_pose *p, int index, double tolerance, double *error) {
    const bst_satellite *s = p->satellite;
    const bst_facet *f = &s->facets[index];
    const int *corner = s->corner + f->first;
    bool disc = f->count > SIDES_MAX;
    surface w = {.lines = disc ? disc_lines : polygon_lines};
    bst_shaded_surface *on = &w.on;
    double low = INFINITY, high = -INFINITY;
    light sum = {.end = NAN};
    *error = 0.0;
    bst_line_ring rings[SIDES_MAX];
    assert(bst_plane_has_lines(p, index));
    on->base = p->vertices[corner[0]];
    on->z = p->normals[index];
    on->x = bst_vec3_unit(bst_vec3_sub(p->vertices[corner[1]], on->base));
    on->y = bst_vec3_cross(on->z, on->x);
    if (disc) {
        on->base = bst_pose_middle_of(p, f);
        on->radius_m = sqrt(f->area_m2 / BST_PI);
        low = 0.0;
        high = BST_PI;
        rings[0] = (bst_line_ring){on->base, on->z, on->radius_m};
    }
    on->corners = disc ? 0 : f->count;
    for (int i = 0; i < on->corners; i++) {
        bst_vec3 r = bst_vec3_sub(p->vertices[corner[i]], on->base);
        on->corner[i] = (bst_point2){bst_vec3_dot(r, on->x), bst_vec3_dot(r, on->y)};
        low = fmin(low, on->corner[i].y);
        high = fmax(high, on->corner[i].y);
        rings[i] = (bst_line_ring){p->vertices[corner[i]], {0.0, 0.0, 0.0}, 0.0};
    }
    if (!bst_line_shadow_make(p, f->occluder, f->inside, rings, disc ? 1 : f->count, &on->shadow)) {
        return 1.0;
    }
    w.share = tolerance;
    w.tolerance = tolerance * f->area_m2;
    w.narrow = 0.5 * (high - low) / PLANE_PANELS;
    bst_surface_find_places(on, low, high);
    *error = add_range(&w, low, high, (high - low) / PLANE_PANELS, &sum);
    return share_of(&w, &sum, error);
}
