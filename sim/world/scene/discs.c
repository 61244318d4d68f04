#include "sim/world/scene/discs.h"

#include "sim/optics/band.h"

#include "sim/world/scene/stray.h"

/* Fraction of the Moon's light that is uniform over its disc. It limits the radiance of a thin
 * crescent. */
#define MOON_EVEN 0.01

/* Limb glow of the Earth is computed up to this many scale heights. The sunlit Earth (V = 2.4 per
 * square arcsecond at an albedo of 0.3) is e^18 times a dark sky of V = 22. At this height the limb
 * glow is 2 % of that sky (tests/world/test_skylight.c). */
#define LIMB_HEIGHTS 22.0

/* Flux of the Sun at a distance, relative to a source of V magnitude 0. */
static double sun_radiance_scale(double sun_distance_m) {
    double au = sun_distance_m / BST_AU_M;
    return pow(10.0, -0.4 * BST_SUN_V_MAG) / (au * au);
}

/* Position of the observer `dt` after mid-exposure: free fall about a point mass. */
static bst_vec3 eye_at(const bst_scene_surroundings *a, double dt) {
    double r = bst_vec3_norm(a->eye_m);
    double fall = r > 0.0 ? -0.5 * dt * dt * BST_EARTH_MU_M3PS2 / (r * r * r) : 0.0;
    return bst_vec3_axpy(bst_vec3_scale(a->eye_m, 1.0 + fall), dt, a->eye_mps);
}

/* Scales an Earth-fixed vector so that the Earth's ellipsoid becomes a sphere. */
static bst_vec3 to_unit_sphere(const bst_mat3 *itrf_from_gcrf, bst_vec3 v) {
    bst_vec3 p = bst_mat3_mul_vec(itrf_from_gcrf, v);
    p.z /= 1.0 - BST_EARTH_FLATTENING;
    return p;
}

static bst_mat3 columns(bst_vec3 x, bst_vec3 y, bst_vec3 z) {
    return (bst_mat3){{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
}

/* The point of a ray that is nearest to the Earth's centre, in coordinates in which the Earth is a
 * unit sphere. */
typedef struct nearest_point {
    bst_vec3 way, point;
    double along, depth; /* from the observer; from the centre */
} nearest_point;

static nearest_point nearest_to_earth(const bst_scene_body_disc *d, int k, bst_vec3 direction) {
    nearest_point n;
    n.way = bst_vec3_unit(bst_mat3_mul_vec(&d->frame[k], direction));
    n.along = -bst_vec3_dot(d->eye[k], n.way);
    n.point = bst_vec3_axpy(d->eye[k], n.along, n.way);
    n.depth = bst_vec3_norm(n.point);
    return n;
}

/* Angle between a direction and the edge of the Earth, positive outside. */
static double earth_edge(const bst_scene_body_disc *d, int k, bst_vec3 direction) {
    nearest_point n = nearest_to_earth(d, k, direction);
    return d->distance[k] <= 1.0 ? -BST_PI : atan2(n.depth, n.along) - d->half_angle[k];
}

/* Unit vector to the nearest point of the ray, or to its intersection with the surface. height: of
 * the nearest point above the surface, Earth radii. */
static bst_vec3 earth_place(const bst_scene_body_disc *d, int k, bst_vec3 direction,
                            double *height) {
    nearest_point n = nearest_to_earth(d, k, direction);
    *height = n.along > 0.0 ? n.depth - 1.0 : d->distance[k] - 1.0;
    if (d->distance[k] <= 1.0) {
        return bst_vec3_unit(d->eye[k]);
    }
    double back = n.depth < 1.0 ? sqrt(1.0 - n.depth * n.depth) : 0.0;
    return bst_vec3_unit(bst_vec3_axpy(n.point, -back, n.way));
}

/* Angle in rad from a direction to the edge of a body's disc. */
static double edge_at(const bst_scene_body_disc *d, int body, int k, bst_vec3 direction) {
    return body == BST_BODY_EARTH ? earth_edge(d, k, direction)
                                  : bst_vec3_angle(direction, d->centre[k]) - d->radius_rad;
}

/* Sets the number of time intervals for a disc from its motion across the camera. */
static void choose_parts(bst_scene_body_disc *d, int body, double scale_rad, double sensor_px) {
    double moved = 0.0, size = body == BST_BODY_EARTH
                                   ? asin(fmin(1.0, 1.0 / bst_vec3_norm(d->eye[4])))
                                   : d->radius_rad;
    bst_vec3 z = {0, 0, 1};
    for (int k = 0; k < BST_DISC_PARTS; k++) {
        moved += fabs(edge_at(d, body, k + 1, z) - edge_at(d, body, k, z));
        moved += bst_vec3_angle(d->centre[k], d->centre[k + 1]);
    }
    /* an edge that moves by less than a quarter of disc and sensor is nearly straight and nearly
     * uniform in motion */
    double step = 0.25 * fmin(size, sensor_px * scale_rad);
    d->parts = 1;
    while (d->parts < BST_DISC_PARTS && moved > step * d->parts) {
        d->parts *= 2;
    }
}

/* Angle subtended by one scale height of the atmosphere at the limb, from a distance in Earth
 * radii. */
static double limb_fade_rad(const bst_discs *discs, double distance) {
    return discs->limb_scale / sqrt(fmax(distance * distance - 1.0, 1e-4));
}

/* Sets the disc of the Earth during an exposure. */
static void make_earth(const bst_camera *camera, const bst_scene_surroundings *a, bst_discs *out) {
    bst_scene_body_disc *d = &out->body[BST_BODY_EARTH];
    d->present = camera->background.earth;
    d->radiance = camera->background.earth_albedo / BST_PI *
                  sun_radiance_scale(bst_vec3_norm(a->bodies.sun_m));
    d->night = pow(10.0, -0.4 * camera->background.earth_night_mag_arcsec2) /
               (BST_ARCSEC_RAD * BST_ARCSEC_RAD);
    d->moon = bst_vec3_unit(bst_mat3_mul_vec(&a->itrf_from_gcrf, a->bodies.moon_m));
    bst_vec3 sun_from_moon = bst_vec3_sub(a->bodies.sun_m, a->bodies.moon_m);
    d->moonlight = camera->background.earth_albedo / BST_PI *
                   pow(10.0, -0.4 * bst_scene_moon_v_mag(a->bodies.moon_m, sun_from_moon));
    /* aberration by the observer's motion about the Earth shifts all directions near the boresight
     * equally */
    bst_light moving = {a->eye_mps, a->light.sun_m};
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        bst_vec3 eye = eye_at(a, a->exposure_s * ((double)k / BST_DISC_PARTS - 0.5));
        bst_quat back = bst_quat_conj(a->q[k]);
        bst_vec3 apparent = bst_quat_rotate(back, (bst_vec3){0, 0, 1});
        bst_vec3 geometric = bst_light_unaberrate(&moving, apparent);
        bst_quat turn = bst_quat_from_rotvec(bst_vec3_cross(apparent, geometric));
        bst_vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        for (int i = 0; i < 3; i++) {
            axes[i] = bst_quat_rotate(turn, bst_quat_rotate(back, axes[i]));
            axes[i] = to_unit_sphere(&a->itrf_from_gcrf, axes[i]);
        }
        d->frame[k] = columns(axes[0], axes[1], axes[2]);
        d->eye[k] =
            bst_vec3_scale(to_unit_sphere(&a->itrf_from_gcrf, eye), 1.0 / BST_EARTH_RADIUS_M);
        d->distance[k] = bst_vec3_norm(d->eye[k]);
        d->half_angle[k] = asin(fmin(1.0, 1.0 / d->distance[k]));
        d->centre[k] = bst_quat_rotate(a->q[k], bst_vec3_scale(bst_vec3_unit(eye), -1.0));
        d->sun[k] = bst_vec3_unit(bst_mat3_mul_vec(&a->itrf_from_gcrf, a->bodies.sun_m));
    }
    double fade_px = limb_fade_rad(out, bst_vec3_norm(d->eye[BST_DISC_PARTS / 2])) / out->scale_rad;
    /* the coarse map resolves a limb that fades slowly */
    d->reach_px = fade_px < 128.0 ? LIMB_HEIGHTS * fade_px : 0.0;
}

/* Sets the disc of the Sun or the Moon during an exposure. */
static void make_round(const bst_camera *camera, const bst_scene_surroundings *a, int body,
                       bst_discs *out) {
    bool moon = body == BST_BODY_MOON;
    bst_scene_body_disc *d = &out->body[body];
    bst_vec3 place = moon ? a->bodies.moon_m : a->bodies.sun_m;
    double radius = moon ? BST_MOON_RADIUS_M : BST_SUN_RADIUS_M;
    d->present = moon ? camera->background.moon : camera->background.sun;
    bst_light moving = {moon ? a->eye_mps : a->light.velocity_mps, a->light.sun_m};
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        bst_vec3 eye = eye_at(a, a->exposure_s * ((double)k / BST_DISC_PARTS - 0.5));
        bst_vec3 seen = bst_vec3_unit(bst_vec3_sub(place, eye));
        d->centre[k] = bst_quat_rotate(a->q[k], bst_light_aberrate(&moving, seen));
        d->sun[k] = bst_quat_rotate(a->q[k], bst_vec3_unit(bst_vec3_sub(a->bodies.sun_m, place)));
    }
    bst_vec3 from_eye = bst_vec3_sub(place, a->eye_m);
    double distance = bst_vec3_norm(from_eye);
    d->radius_rad = asin(fmin(1.0, radius / distance));
    double solid = BST_PI * d->radius_rad * d->radius_rad;
    if (!moon) {
        d->radiance = sun_radiance_scale(distance) / solid;
        return;
    }
    bst_vec3 to_sun = bst_vec3_sub(a->bodies.sun_m, place);
    double phase = bst_vec3_angle(bst_vec3_scale(from_eye, -1.0), to_sun);
    double even = 2.0 / (3.0 * BST_PI) * (sin(phase) + (BST_PI - phase) * cos(phase));
    d->radiance =
        pow(10.0, -0.4 * bst_scene_moon_v_mag(from_eye, to_sun)) / (solid * (even + MOON_EVEN));
}

/* Largest angle between the boresight and a body's edge at which its light reaches the sensor,
 * rad. */
static double reach_rad(const bst_camera *camera, const bst_discs *discs, int body,
                        double distance) {
    double limb = body == BST_BODY_EARTH ? LIMB_HEIGHTS * limb_fade_rad(discs, distance) : 0.0;
    return bst_camera_half_diagonal_rad(camera) + limb + 50.0 * discs->sigma_px * discs->scale_rad;
}

/* Largest rotation of the camera from its attitude at mid-exposure. */
static double largest_turn_rad(const bst_scene_surroundings *a) {
    bst_quat mid = bst_quat_unit(a->q[BST_DISC_PARTS / 2]);
    double least = 1.0;
    for (int k = 0; k <= BST_DISC_PARTS; k++) {
        bst_quat q = bst_quat_unit(a->q[k]);
        least = fmin(least, fabs(q.x * mid.x + q.y * mid.y + q.z * mid.z + q.w * mid.w));
    }
    return 2.0 * acos(least);
}

/* Checks that a body stays outside the field during the exposure. It uses the position at
 * mid-exposure and limits for camera rotation, observer motion, aberration (twice that of Earth and
 * observer) and the Earth's oblateness. */
static bool stays_outside(const bst_camera *camera, const bst_scene_surroundings *a,
                          const bst_discs *discs, int body, double turn_rad) {
    static const double TURN_MARGIN = 1e-6;
    const double radii[] = {BST_EARTH_RADIUS_M, BST_MOON_RADIUS_M, BST_SUN_RADIUS_M};
    bst_vec3 places[] = {{0, 0, 0}, a->bodies.moon_m, a->bodies.sun_m};
    bst_vec3 to = bst_vec3_sub(places[body], a->eye_m);
    double distance = bst_vec3_norm(to), r = bst_vec3_norm(a->eye_m), half = 0.5 * a->exposure_s;
    double moved = half * (bst_vec3_norm(a->eye_mps) +
                           (r > 0.0 ? 0.5 * half * BST_EARTH_MU_M3PS2 / (r * r) : 0.0));
    double nearest = distance - radii[body] - moved;
    if (!(nearest > 0.01 * radii[body])) {
        return false;
    }
    double speed = bst_vec3_norm(a->eye_mps) + bst_vec3_norm(a->light.velocity_mps);
    double margin = turn_rad + TURN_MARGIN + moved / nearest + 2.0 * speed / BST_LIGHT_SPEED_MPS +
                    (body == BST_BODY_EARTH ? 2.0 * BST_EARTH_FLATTENING : 0.0);
    bst_vec3 boresight =
        bst_quat_rotate(bst_quat_conj(a->q[BST_DISC_PARTS / 2]), (bst_vec3){0, 0, 1});
    double edge = bst_vec3_angle(boresight, to) - asin(radii[body] / distance);
    double nearest_radii = 1.0 + nearest / radii[body];
    return edge - margin > reach_rad(camera, discs, body, nearest_radii);
}

void bst_discs_make(const bst_camera *camera, const bst_scene_surroundings *around,
                    bst_discs *out) {
    double sigma = bst_camera_psf_sigma_px(camera);
    double sensor_px = hypot((double)camera->width_px, (double)camera->height_px);
    double turn_rad = largest_turn_rad(around);
    *out = (bst_discs){.scale_rad = bst_camera_scale_rad(camera),
                       .sigma_px = sqrt(sigma * sigma + 1.0 / 12.0),
                       .limb_scale = camera->background.limb_scale_height_m / BST_EARTH_RADIUS_M};
    for (int i = 0; i < BST_BODY_COUNT; i++) {
        bst_scene_body_disc *d = &out->body[i];
        if (stays_outside(camera, around, out, i, turn_rad)) {
            continue;
        }
        if (i == BST_BODY_EARTH) {
            make_earth(camera, around, out);
        } else {
            make_round(camera, around, i, out);
        }
        double nearest = INFINITY, distance = 1.0;
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            nearest = fmin(nearest, edge_at(d, i, k, (bst_vec3){0, 0, 1}));
        }
        choose_parts(d, i, out->scale_rad, sensor_px);
        distance = i == BST_BODY_EARTH ? bst_vec3_norm(d->eye[BST_DISC_PARTS / 2]) : distance;
        d->near = nearest < reach_rad(camera, out, i, distance);
        d->present = d->present && d->near;
    }
}

bool bst_discs_any(const bst_discs *discs) {
    return discs->body[0].present || discs->body[1].present || discs->body[2].present;
}

double bst_discs_share(const bst_discs *discs, const bst_camera *camera, int body, bst_window w) {
    enum { PLACES = 33 };
    const bst_scene_body_disc *d = &discs->body[body];
    const int middle = BST_DISC_PARTS / 2;
    if (!d->near) {
        return 0.0;
    }
    int covered = 0, weight = 0;
    for (int i = 0; i < PLACES * PLACES; i++) {
        const int column = i % PLACES, row = i / PLACES;
        double x = w.x0 - 0.5 + w.width * column / (PLACES - 1.0);
        double y = w.y0 - 0.5 + w.height * row / (PLACES - 1.0);
        if (edge_at(d, body, middle, bst_camera_unproject(camera, x, y)) < 0.0) {
            /* a place on a side stands for half a cell, in a corner for a quarter */
            covered++;
            weight += (column % (PLACES - 1) == 0 ? 1 : 2) * (row % (PLACES - 1) == 0 ? 1 : 2);
        }
    }
    double share = weight / (4.0 * (PLACES - 1) * (PLACES - 1)), x, y;
    if (covered < 10 && body != BST_BODY_EARTH &&
        bst_camera_project(camera, d->centre[middle], &x, &y) && x > w.x0 - 0.5 && y > w.y0 - 0.5 &&
        x < w.x0 + w.width - 0.5 && y < w.y0 + w.height - 0.5) {
        double radius_px = d->radius_rad / discs->scale_rad;
        share = BST_PI * radius_px * radius_px / ((double)w.width * w.height);
    }
    return fmin(share, 1.0);
}

double bst_discs_edge_px(const bst_discs *discs, bst_vec3 direction) {
    double nearest = INFINITY;
    for (int i = 0; i < BST_BODY_COUNT; i++) {
        const bst_scene_body_disc *d = &discs->body[i];
        if (!d->present) {
            continue;
        }
        double low = INFINITY, high = -INFINITY;
        for (int k = 0; k <= BST_DISC_PARTS; k++) {
            double edge = edge_at(d, i, k, direction) / discs->scale_rad;
            low = fmin(low, edge);
            high = fmax(high, edge);
        }
        double away = low > 0.0 ? fmax(low - d->reach_px, 0.0) : high < 0.0 ? -high : 0.0;
        nearest = fmin(nearest, fmax(away - 6.0 * discs->sigma_px, 0.0));
    }
    return nearest;
}

double bst_discs_sharp_edge_px(const bst_discs *discs, bst_vec3 direction) {
    double nearest = INFINITY;
    for (int i = 0; i < BST_BODY_COUNT; i++) {
        const bst_scene_body_disc *d = &discs->body[i];
        if (!d->present) {
            continue;
        }
        /* also in the middle of an interval, whose surface stands for all of it */
        int step = d->parts < BST_DISC_PARTS ? BST_DISC_PARTS / (2 * d->parts) : 1;
        for (int k = 0; k <= BST_DISC_PARTS; k += step) {
            nearest = fmin(nearest, fabs(edge_at(d, i, k, direction)) / discs->scale_rad);
        }
    }
    return fmax(nearest - 6.0 * discs->sigma_px, 0.0);
}

/* Integral of the normal distribution function of z / sigma. */
static double ramp(double z, double sigma) {
    double u = z / sigma;
    return 0.5 * z * erfc(-u / sqrt(2.0)) + sigma * exp(-0.5 * u * u) / sqrt(2.0 * BST_PI);
}

/* Mean fraction of light inside an edge that is blurred by sigma and moves uniformly, for a point
 * that moves from `from` to `to` px outside it. */
static double inside(double from, double to, double sigma) {
    if (fabs(to - from) < 1e-3 * sigma) {
        return 0.5 * erfc(0.5 * (from + to) / (sigma * sqrt(2.0)));
    }
    return fmin(fmax((ramp(-from, sigma) - ramp(-to, sigma)) / (to - from), 0.0), 1.0);
}

/* Normal of the Earth's ellipsoid (unit, ITRF) at a point of the unit-sphere coordinates: x / a, y
 * / a, z / b. */
static bst_vec3 normal_at(bst_vec3 near) {
    return bst_vec3_unit((bst_vec3){near.x, near.y, near.z / (1.0 - BST_EARTH_FLATTENING)});
}

/* Whether the terminator of the Earth, whose disc fills all directions up to radius_rad from an
 * axis, is in none of them. */
static bool no_terminator(const bst_scene_body_disc *d, bst_vec3 axis, double radius_rad) {
    int lit = 0, dark = 0;
    for (int k = 0; k <= BST_DISC_PARTS; k += BST_DISC_PARTS / 2) {
        double height, from_centre = earth_edge(d, k, axis) + d->half_angle[k] + radius_rad;
        if (d->distance[k] <= 1.0 || !(from_centre < d->half_angle[k])) {
            return false;
        }
        /* what a ray that turns by an angle moves on the unit sphere: most at the largest depth,
         * where the way to the sphere is longest and its incidence is lowest */
        double depth = d->distance[k] * sin(from_centre), steep = sqrt(1.0 - depth * depth);
        double way = sqrt(d->distance[k] * d->distance[k] - depth * depth) - steep;
        double most = (1.0 + 2.0 * BST_EARTH_FLATTENING) * radius_rad * way / steep;
        double day = bst_vec3_dot(normal_at(earth_place(d, k, axis, &height)), d->sun[k]);
        lit += day > most;
        dark += day < -most;
    }
    return lit == 3 || dark == 3;
}

bool bst_discs_none_begins(const bst_discs *discs, bst_vec3 axis, double radius_rad, double px) {
    /* angles in the coordinates in which the Earth is a sphere */
    const double radius = (1.0 + 2.0 * BST_EARTH_FLATTENING) * radius_rad;
    const bst_scene_body_disc *earth = &discs->body[BST_BODY_EARTH];
    return bst_discs_edge_px(discs, axis) > radius / discs->scale_rad + px &&
           (!earth->present || no_terminator(earth, axis, radius));
}

/* Radiance of the Earth's disc, or of its limb glow, at the middle of a time interval. */
static double earth_radiance(const bst_discs *discs, int k, bst_vec3 direction, double share,
                             double *sunlight, unsigned *sides) {
    const bst_scene_body_disc *d = &discs->body[BST_BODY_EARTH];
    double height;
    bst_vec3 normal = normal_at(earth_place(d, k, direction, &height));
    double lit = fmax(bst_vec3_dot(normal, d->sun[k]), 0.0);
    double above = height > 0.0 && discs->limb_scale > 0.0 ? exp(-height / discs->limb_scale) : 0.0;
    above = height > 0.0 ? above : discs->limb_scale > 0.0 ? 1.0 : 0.0;
    double moonlit = fmax(bst_vec3_dot(normal, d->moon), 0.0);
    *sides = (lit > 0.0 ? 1U : 0U) | (moonlit > 0.0 ? 2U : 0U);
    *sunlight += (d->radiance * lit + d->moonlight * moonlit) * (share + (1.0 - share) * above) +
                 d->night * share;
    return share;
}

static double moon_radiance(const bst_scene_body_disc *d, int k, bst_vec3 direction,
                            unsigned *sides) {
    /* position on the disc, in radii */
    bst_vec3 across =
        bst_vec3_axpy(direction, -bst_vec3_dot(direction, d->centre[k]), d->centre[k]);
    bst_vec3 p = bst_vec3_scale(across, 1.0 / sin(d->radius_rad));
    double r2 = bst_vec3_dot(p, p);
    if (r2 > 1.0) {
        p = bst_vec3_scale(p, 1.0 / sqrt(r2));
        r2 = 1.0;
    }
    bst_vec3 normal = bst_vec3_axpy(p, -sqrt(1.0 - r2), d->centre[k]);
    double lit = fmax(bst_vec3_dot(normal, d->sun[k]), 0.0);
    *sides = lit > 0.0 ? 4U : 0U;
    return d->radiance * (lit + MOON_EVEN);
}

bst_disc_light bst_discs_light(const bst_discs *discs, bst_vec3 direction) {
    bst_disc_light light = {0};
    double beyond = 0.0; /* light of Sun and Moon, which the Earth occults */
    for (int i = BST_BODY_COUNT - 1; i >= 0; i--) {
        const bst_scene_body_disc *d = &discs->body[i];
        if (!d->present) {
            continue;
        }
        int stride = BST_DISC_PARTS / d->parts;
        double from = edge_at(d, i, 0, direction) / discs->scale_rad;
        for (int p = 0; p < d->parts; p++) {
            double to = edge_at(d, i, (p + 1) * stride, direction) / discs->scale_rad;
            double share = inside(from, to, discs->sigma_px) / d->parts;
            int k = p * stride + stride / 2;
            unsigned sides = 0;
            from = to;
            if (i == BST_BODY_SUN) {
                beyond += share * d->radiance;
            } else if (i == BST_BODY_MOON) {
                beyond += share > 0.0 ? share * moon_radiance(d, k, direction, &sides) : 0.0;
            } else {
                double sunlight = 0.0;
                light.earth +=
                    earth_radiance(discs, k, direction, share * d->parts, &sunlight, &sides) /
                    d->parts;
                light.sunlight += sunlight / d->parts;
            }
            light.sides |= sides << 3 * p;
        }
    }
    light.sunlight += beyond * (1.0 - light.earth);
    return light;
}
