/* Traces rays through triangles in double precision, for compare_mitsuba.py: prints the mean
 * radiance over irradiance of some pixels, one a line. Facets are one-sided and follow Lambert's
 * law; both sides cast shadows.
 *
 *   trace_rays RAYS < SCENE
 *
 * RAYS: square root of their number in a pixel. SCENE, numbers only: directions to Sun and camera,
 * down in the image, distance, angle of a pixel, pixels along a side; number of pixels, and x and y
 * of each; number of triangles, and reflectance and three corners of each. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "boresight/vec.h"

typedef struct triangle {
    bst_vec3 corner[3], normal;
    double reflectance;
} triangle;

typedef struct scene {
    bst_vec3 sun, eye, right, down, ahead; /* unit */
    double range, scale, middle;
    triangle *all;
    int count;
    int *chosen, *hiders; /* indices of those that may be in the pixel, or may shadow it */
} scene;

static double number(void) {
    double x;
    if (scanf("%lf", &x) != 1) {
        fprintf(stderr, "trace_rays: the scene ends too early\n");
        exit(2);
    }
    return x;
}

static bst_vec3 vector(void) {
    double x = number(), y = number(), z = number();
    return (bst_vec3){x, y, z};
}

/* Distance to a triangle along a ray if it is below *nearest, which it becomes. Reference: Moller
 * and Trumbore, J. Graphics Tools 2, 21 (1997). */
static int meets(const triangle *t, bst_vec3 from, bst_vec3 way, double least, double *nearest) {
    bst_vec3 a = bst_vec3_sub(t->corner[1], t->corner[0]);
    bst_vec3 b = bst_vec3_sub(t->corner[2], t->corner[0]);
    bst_vec3 s = bst_vec3_sub(from, t->corner[0]), h = bst_vec3_cross(way, b);
    double det = bst_vec3_dot(a, h);
    if (det == 0.0) {
        return 0;
    }
    bst_vec3 q = bst_vec3_cross(s, a);
    double u = bst_vec3_dot(s, h) / det, v = bst_vec3_dot(way, q) / det;
    double distance = bst_vec3_dot(b, q) / det;
    if (u < 0.0 || v < 0.0 || u + v > 1.0 || distance <= least || distance >= *nearest) {
        return 0;
    }
    *nearest = distance;
    return 1;
}

/* Place of a point in the image, px. */
static void project(const scene *s, bst_vec3 p, double xy[2]) {
    bst_vec3 r = bst_vec3_axpy(p, -s->range, s->eye);
    double depth = bst_vec3_dot(r, s->ahead) * s->scale;
    xy[0] = bst_vec3_dot(r, s->right) / depth + s->middle;
    xy[1] = bst_vec3_dot(r, s->down) / depth + s->middle;
}

/* Place of a point as seen from the Sun. */
static void drop(const scene *s, bst_vec3 p, double xy[2]) {
    bst_vec3 x = bst_vec3_perpendicular(s->sun);
    xy[0] = bst_vec3_dot(p, x);
    xy[1] = bst_vec3_dot(p, bst_vec3_cross(s->sun, x));
}

/* Triangles whose box meets the box from low to high, by a projection. */
static int choose(const scene *s, void (*place)(const scene *s, bst_vec3 p, double xy[2]),
                  const double low[2], const double high[2], int *list) {
    int n = 0;
    for (int i = 0; i < s->count; i++) {
        double least[2] = {INFINITY, INFINITY}, most[2] = {-INFINITY, -INFINITY};
        for (int k = 0; k < 3; k++) {
            double xy[2];
            place(s, s->all[i].corner[k], xy);
            for (int a = 0; a < 2; a++) {
                least[a] = fmin(least[a], xy[a]);
                most[a] = fmax(most[a], xy[a]);
            }
        }
        if (least[0] <= high[0] && most[0] >= low[0] && least[1] <= high[1] && most[1] >= low[1]) {
            list[n++] = i;
        }
    }
    return n;
}

static double trace(const scene *s, int x, int y, int rays) {
    const double low[2] = {x, y}, high[2] = {x + 1, y + 1};
    double sun_low[2] = {INFINITY, INFINITY}, sun_high[2] = {-INFINITY, -INFINITY}, sum = 0.0;
    int chosen = choose(s, project, low, high, s->chosen), hits = 0, hiders = 0;
    bst_vec3 *point = malloc((size_t)(rays * rays) * sizeof *point),
             eye = bst_vec3_scale(s->eye, s->range);
    int *facet = malloc((size_t)(rays * rays) * sizeof *facet);
    for (int k = 0; point && facet && k < rays * rays; k++) {
        /* multiples of the golden ratio's generalisation to two dimensions (Roberts 2018) */
        double u = s->scale * (x + fmod(0.5 + 0.7548776662466927 * k, 1.0) - s->middle);
        double v = s->scale * (y + fmod(0.5 + 0.5698402909980532 * k, 1.0) - s->middle);
        double nearest = INFINITY, xy[2];
        bst_vec3 way = bst_vec3_axpy(bst_vec3_axpy(s->ahead, u, s->right), v, s->down);
        int found = -1;
        for (int i = 0; i < chosen; i++) {
            found = meets(&s->all[s->chosen[i]], eye, way, 0.0, &nearest) ? s->chosen[i] : found;
        }
        if (found < 0 || bst_vec3_dot(s->all[found].normal, way) >= 0.0 ||
            bst_vec3_dot(s->all[found].normal, s->sun) <= 0.0) {
            continue;
        }
        point[hits] = bst_vec3_axpy(eye, nearest, way);
        facet[hits] = found;
        drop(s, point[hits++], xy);
        for (int a = 0; a < 2; a++) {
            sun_low[a] = fmin(sun_low[a], xy[a]);
            sun_high[a] = fmax(sun_high[a], xy[a]);
        }
    }
    hiders = choose(s, drop, sun_low, sun_high, s->hiders);
    for (int k = 0; k < hits; k++) {
        const triangle *t = &s->all[facet[k]];
        double far = INFINITY;
        int dark = 0;
        for (int i = 0; i < hiders && !dark; i++) {
            dark = s->hiders[i] != facet[k] &&
                   meets(&s->all[s->hiders[i]], point[k], s->sun, 1e-7, &far);
        }
        sum += dark ? 0.0 : t->reflectance / BST_PI * bst_vec3_dot(t->normal, s->sun);
    }
    free(point);
    free(facet);
    return sum / (rays * rays);
}

int main(int argc, char **argv) {
    int rays = argc == 2 ? atoi(argv[1]) : 0;
    if (rays < 1) {
        fprintf(stderr, "usage: trace_rays RAYS < SCENE\n");
        return 2;
    }
    scene s = {.sun = vector()};
    s.eye = vector();
    s.down = vector();
    s.range = number();
    s.scale = number();
    s.middle = 0.5 * number();
    s.ahead = bst_vec3_scale(s.eye, -1.0);
    s.right = bst_vec3_cross(s.down, s.ahead);
    int pixels = (int)number();
    int(*place)[2] = malloc((size_t)(pixels + 1) * sizeof *place);
    for (int i = 0; place && i < pixels; i++) {
        place[i][0] = (int)number();
        place[i][1] = (int)number();
    }
    s.count = (int)number();
    s.all = malloc((size_t)(s.count + 1) * sizeof *s.all);
    s.chosen = malloc((size_t)(s.count + 1) * sizeof *s.chosen);
    s.hiders = malloc((size_t)(s.count + 1) * sizeof *s.hiders);
    if (!place || !s.all || !s.chosen || !s.hiders) {
        fprintf(stderr, "trace_rays: no memory for %d triangles\n", s.count);
        return 1;
    }
    for (int i = 0; i < s.count; i++) {
        triangle *t = &s.all[i];
        t->reflectance = number();
        for (int k = 0; k < 3; k++) {
            t->corner[k] = vector();
        }
        bst_vec3 n = bst_vec3_cross(bst_vec3_sub(t->corner[1], t->corner[0]),
                                    bst_vec3_sub(t->corner[2], t->corner[0]));
        t->normal = bst_vec3_norm(n) > 0.0 ? bst_vec3_unit(n) : n;
    }
    for (int i = 0; i < pixels; i++) {
        printf("%.12g\n", trace(&s, place[i][0], place[i][1], rays));
    }
    free(s.all);
    free(s.chosen);
    free(s.hiders);
    free(place);
    return 0;
}
