/* Background at a position of the sensor. */
#include <math.h>

#include "sim/world/scene/skylight_internal.h"

int bst_skylight_cell_of(float u, int nodes) {
    const int i = (int)floorf(u);
    return i < 0 ? 0 : i > nodes - 2 ? nodes - 2 : i;
}

float bst_skylight_interpolate(const bst_skylight_lattice *l, float x, float y) {
    float u = (x - (float)l->x0) / (float)l->step, v = (y - (float)l->y0) / (float)l->step;
    int i = bst_skylight_cell_of(u, l->columns), j = bst_skylight_cell_of(v, l->rows);
    float s = u - (float)i, t = v - (float)j;
    const float *a = l->value + (size_t)j * (size_t)l->columns + (size_t)i, *b = a + l->columns;
    float left = a[0] + t * (b[0] - a[0]), right = a[1] + t * (b[1] - a[1]);
    return left + s * (right - left);
}

double bst_skylight_paint_at(const bst_skylight_painter *p, double x, double y, double sky_e,
                             unsigned *sides) {
    const bst_camera *camera = p->b->camera;
    const bst_background_config *c = &camera->background;
    double seen = sky_e;
    *sides = 0;
    if (bst_discs_any(&p->discs)) {
        bst_disc_light light = bst_discs_light(&p->discs, bst_camera_unproject(camera, x, y));
        seen = sky_e * (1.0 - light.earth) + p->sun_e * light.sunlight + p->earth_e * light.earth;
        *sides = light.sides;
    }
    double u = (2.0 * x + 1.0) / (double)camera->width_px - 1.0;
    double v = (2.0 * y + 1.0) / (double)camera->height_px - 1.0;
    double added = c->stray_e_per_s + c->gradient_e_per_s[0] * u + c->gradient_e_per_s[1] * v +
                   c->curvature_e_per_s[0] * u * u + c->curvature_e_per_s[1] * u * v +
                   c->curvature_e_per_s[2] * v * v;
    double e = seen * bst_camera_illumination(camera, x, y) + p->even_e + added;
    return fmax(e, 0.0) * p->around->exposure_s;
}

double bst_skylight_vignetting_edge_px(const bst_camera *camera, double x, double y) {
    double limit = camera->optics.vignetting.limit_px;
    double dx = x - bst_camera_centre_x(camera), dy = y - bst_camera_centre_y(camera);
    return limit > 0.0 ? fabs(hypot(dx, dy) - limit) : INFINITY;
}

double bst_skylight_paint(const bst_skylight_painter *p, int x, int y, unsigned *sides) {
    return bst_skylight_paint_at(
        p, x, y, (double)bst_skylight_interpolate(&p->b->sky, (float)x, (float)y), sides);
}
