#include "scenegen/smear/body_precision.h"

#include <math.h>

/* Shares of the tolerance for cells with a border, in one pose and in some, for curved surfaces,
 * and for their borders; and for the poses of models with curved surfaces, without, and where many
 * blur the image. With STAMP_SHARE and that of the nodes (smear_body.c) they are the whole at most.
 */
#define CELL_SHARE 0.35
#define CELL_SHARE_IN_POSES 0.2
#define CURVED_SHARE 0.12
#define LIMB_SHARE 0.05
#define CURVED_POSES_SHARE 0.12
#define POSES_SHARE 0.4
#define BLURRED_POSES_SHARE 0.6
/* Light of the pixel with the largest error, over that of the body: the derivative of a border's
 * image over the noise of its light has its extremum 0.75 where that is, with 0.24 of it at most.
 */
#define BORDER_LIGHT 0.1

/* Error of the light of a surface that glints: tests/scenegen/test_body_poses.c. */
#define GLINT_ERROR 1e-4
/* Light of a glint that no pose meets, over that of its surface in its width. */
#define LOST_GLINT 2.0
/* Error of the light of curved surfaces, over that light and the error of their parts in px:
 * measured for satellites of scenarios/satellites, at most 2 where lobes are narrow. */
#define CURVED_ERROR 1.5
/* Share of the tolerance by the borders of stamps: of nodes in even light all add up. */
#define STAMP_SHARE 0.08
/* Error by cells in which borders of curved surfaces and shadows meet, over the light of a pixel
 * and the side in px: 6e-5 for centaur_like of 150 px, by the first moments of the cells.
 */
#define CURVED_CELL 1e-4
/* Share of the tolerance for a facet that turns into the light: a larger error asks for poses
 * beside it. */
#define KINK_SHARE 0.03
/* Share for penumbrae at least, over that of the poses, which gives it up if the image takes more
 * than the centre of the Sun. */
#define PENUMBRA_SHARE 0.5
/* Quadratures of the Sun's disc for models with curved surfaces, of which a pose takes some 0.3 s:
 * up to 32 points. */
#define CURVED_SUN_RULES 5
/* Light of the brightest facet over the mean that is expected, at most. */
#define BRIGHTER 4.0
/* Least error of borders of curved surfaces and between their parts that is asked for, px. */
#define LIMB_LEAST_PX 1e-5
/* Motion of borders of shadows over that of the body, about. */
#define FASTER 1.1
/* Motion, PSF sigmas, from which borders fall on all parts of the cells. */
#define BLURRED_SIGMAS 24.0
/* Light of a pixel, over its noise in e-, up to which edges between facets of almost the same light
 * may go without second moments: those of a cell are wrong by 0.0016 of the light at most, with
 * both signs as the edge passes. */
#define EVEN_SIGMAS 120.0

/* Side of cells of images of a few poses, px, in which errors of nodes have the same signs. */
#define SOME_CELL_PX 0.25

/* Error by cells with a border, of which the second moments are right to some 0.02 of the square of
 * the side, over the light of a pixel. */
static double cell_error(const bst_smear *s, const bst_scene_source *source, double side_px) {
    double sides = side_px / s->sigma_px;
    double curved = source->body->satellite->curved_count > 0 ? CURVED_CELL * side_px : 0.0;
    return sides * sides * sides / 240.0 + curved;
}

/* Noise of the pixel with the largest error beside a border of a surface. */
static double border_noise_e(const bst_smear *s, double light_e) {
    return sqrt(BORDER_LIGHT * light_e + s->dark_variance_e2);
}

/* A border that is moved by 1 px changes a pixel beside it by 0.4 / sigma of the light. */
double bst_body_limb_px(const bst_smear *s, double light_e) {
    double allowed_e = LIMB_SHARE * s->options.tolerance_sigma * border_noise_e(s, light_e);
    return fmin(fmax(allowed_e * s->sigma_px / (0.4 * fmax(light_e, 1e-9)), LIMB_LEAST_PX),
                BST_RESOLVED_CURVED_PX);
}

double bst_body_curved_px(const bst_smear *s, double curved_e) {
    double allowed_e = CURVED_SHARE * s->options.tolerance_sigma * border_noise_e(s, curved_e);
    return fmin(fmax(allowed_e / (CURVED_ERROR * fmax(curved_e, 1e-9)), LIMB_LEAST_PX),
                BST_RESOLVED_CURVED_PX);
}

double bst_body_cell_px(const bst_body_image_plan *p, double area_px2, bool light_only,
                        bool blurred) {
    enum { FINEST = 32, ACROSS = 32, MOST_ACROSS = 4096, MOST_CELLS = 1 << 22 };
    const bst_smear *s = p->s;
    double across_px = 2.0 * bst_smear_radius_px(s, p->source);
    bool some = light_only && p->times.count > 1;
    double side = light_only && blurred ? 1.0 : some ? SOME_CELL_PX : 0.5;
    double share = p->times.count > 1 ? CELL_SHARE_IN_POSES : CELL_SHARE;
    double allowed_e = share * s->options.tolerance_sigma * border_noise_e(s, p->light_e);
    while (!light_only && !blurred && side > 1.0 / FINEST &&
           cell_error(s, p->source, side) * p->light_e > allowed_e &&
           across_px / side <= 0.5 * MOST_ACROSS) {
        side *= 0.5;
    }
    while (side > across_px / ACROSS) {
        side *= 0.5;
    }
    /* some 400 bytes a cell, with those of the threads */
    while (light_only && area_px2 > MOST_CELLS * side * side && side < 0.5) {
        side *= 2.0;
    }
    return side;
}

bool bst_body_even(const bst_body_image_plan *p) {
    return p->light_e < EVEN_SIGMAS * sqrt(p->light_e + p->s->dark_variance_e2);
}

static double poses_share(const bst_body_image_plan *p, bool blurred) {
    return p->source->body->satellite->curved_count > 0 ? CURVED_POSES_SHARE
           : blurred                                    ? BLURRED_POSES_SHARE
                                                        : POSES_SHARE;
}

/* Motion of the body's borders in the exposure, over the standard deviation of the PSF and pixel.
 */
static double border_motion(const bst_body_image_plan *p, double sigma_px) {
    return (p->moved_px + FASTER * p->turned_px) / sigma_px;
}

void bst_body_choose_poses(bst_body_image_plan *p, bst_satellite_pose *pose, bool *blurred) {
    const bst_smear *s = p->s;
    double sigma_px = sqrt(s->sigma_px * s->sigma_px + 1.0 / 12.0);
    /* the limb blurs no border of the body itself */
    double blur = border_motion(p, sigma_px);
    double sigmas = blur + FASTER * p->hidden_px / sigma_px;
    double poses = fmax(0.5 * sigmas, 4.0),
           missed_e = BRIGHTER * p->light_e / (8.0 * poses * poses);
    double allowed_e = KINK_SHARE * s->options.tolerance_sigma * sqrt(s->dark_variance_e2);
    double least_rad = allowed_e / fmax(missed_e, 1e-9);
    p->glints.count = p->glint_count;
    p->kinks_e = 0.0;
    if (least_rad < p->turn_rad) {
        p->kinks_e =
            missed_e * bst_body_kinks_find(p->source, p->turn_rad, least_rad, pose, &p->glints);
    }
    *blurred = blur >= BLURRED_SIGMAS;
    double share = poses_share(p, *blurred) * (p->sun_rule > 0 ? 1.0 - PENUMBRA_SHARE : 1.0);
    const bst_body_times_aim aim = {.sigmas = sigmas,
                                    .pose_e = fmax(p->pose_e, p->light_e),
                                    .light_e = p->light_e,
                                    .dark_variance_e2 = s->dark_variance_e2,
                                    .allowed_sigma = share * s->options.tolerance_sigma,
                                    .glints = p->glints.items,
                                    .glint_count = p->glints.count};
    bst_body_times_choose(&aim, &p->times);
}

double bst_body_shadow_sigma(const bst_body_image_plan *d, const bst_smear_body *b, int rule) {
    if (!d->s->options.penumbrae) {
        return 0.0;
    }
    double weights = 0.0, sigma_px = sqrt(d->s->sigma_px * d->s->sigma_px + 1.0 / 12.0);
    for (int k = 0; k < d->times.count; k++) {
        weights += d->times.weight[k];
    }
    double electrons = d->source->electrons_per_s * d->s->duration_s * weights;
    double swept = b->blurred ? border_motion(d, sigma_px) : 0.0;
    return bst_body_penumbra_sigma(bst_resolved_image_of(b->image), rule, electrons, sigma_px,
                                   swept, d->s->dark_variance_e2);
}

int bst_body_choose_sun(const bst_body_image_plan *d, const bst_smear_body *b,
                        double allowed_sigma) {
    int rule = d->sun_rule;
    if (b->blurred) {
        return rule; /* as many poses again for each point: too slow for what is left */
    }
    double sigma = bst_body_shadow_sigma(d, b, rule);
    double least = PENUMBRA_SHARE * poses_share(d, b->blurred) * d->s->options.tolerance_sigma;
    double left = fmax(allowed_sigma - (b->sigma - sigma), least);
    int rules =
        d->source->body->satellite->curved_count > 0 ? CURVED_SUN_RULES : BST_BODY_SUN_RULES;
    while (sigma > left && rule + 1 < rules) {
        sigma = bst_body_shadow_sigma(d, b, ++rule);
    }
    return rule;
}

/* Most light in a pixel of the image, electrons before the PSF. */
static double peak_e(const bst_resolved_image *m, double electrons) {
    int n = (int)fmax(round(1.0 / m->cell_px), 1.0);
    double most = 0.0;
    for (int j = 0; j < m->height; j += n) {
        for (int i = 0; i < m->width; i += n) {
            double sum = 0.0;
            for (int k = 0; k < n * n; k++) {
                int x = i + k % n, y = j + k / n;
                sum += x < m->width && y < m->height
                           ? (double)m->cells[(size_t)y * (size_t)m->width + (size_t)x].light
                           : 0.0;
            }
            most = fmax(most, sum);
        }
    }
    return electrons * most;
}

/* Error of curved surfaces, sigma. */
static double curved_sigma(const bst_body_image_plan *d, const bst_resolved_image *m,
                           double curved_e) {
    const bst_smear *s = d->s;
    double sigma_px = sqrt(s->sigma_px * s->sigma_px + 1.0 / 12.0);
    double curved_px = fmax(d->curved_px, m->reached_px[0]);
    double limb = 0.4 * fmax(fmin(d->limb_px, d->curved_px), m->reached_px[1]) / sigma_px;
    return (CURVED_ERROR * curved_px + limb) * curved_e / border_noise_e(s, curved_e);
}

/* Error of one pose that turns, over the light of a pixel. */
static double turn_error(const bst_body_image_plan *d) {
    double sigma2 = d->s->sigma_px * d->s->sigma_px + 1.0 / 12.0;
    double turned_px = d->turned_px + d->hidden_px;
    return turned_px * turned_px / 12.0 * 0.12 / sigma2;
}

double bst_body_least_error(const bst_body_image_plan *next, const bst_smear_body *b,
                            double curved_e) {
    const bst_smear *s = next->s;
    bool light_only = bst_resolved_may_add_light(b->satellite);
    double error = b->one_pose ? turn_error(next) : 0.0;
    if (b->one_pose && !light_only) {
        error += cell_error(s, next->source, bst_body_cell_px(next, 0.0, false, false));
    }
    return error * next->light_e / border_noise_e(s, next->light_e) +
           curved_sigma(next, bst_resolved_image_of(b->image), curved_e) +
           STAMP_SHARE * s->options.tolerance_sigma;
}

void bst_body_set_error(bst_body_image_plan *d, bst_smear_body *b, double *light_e,
                        double *curved_e) {
    const bst_smear *s = d->s;
    const bst_resolved_image *m = bst_resolved_image_of(b->image);
    double electrons = d->source->electrons_per_s * s->duration_s, weights = 0.0;
    double error = 0.0;
    *light_e = peak_e(m, electrons);
    for (int k = 0; k < d->times.count; k++) {
        weights += d->times.weight[k];
    }
    *curved_e = fmin(m->curved_light * weights * electrons, *light_e);
    /* of one pose, which its motion spreads */
    double swept_px = 1.0 + d->moved_px + d->turned_px + d->hidden_px;
    d->pose_e = m->surface_light * weights * electrons;
    d->pose_e = fmax(fmin(d->pose_e, swept_px * *light_e), *light_e);
    if (b->one_pose) {
        error = turn_error(d);
    }
    if (!b->blurred && (!m->second || (d->times.count > 1 && b->cell_px > SOME_CELL_PX))) {
        error += cell_error(s, d->source, b->cell_px);
    }
    b->sigma = error * *light_e / border_noise_e(s, *light_e) + curved_sigma(d, m, *curved_e) +
               bst_body_times_sigma(&d->times, d->pose_e, *light_e, s->dark_variance_e2);
    b->sigma += bst_body_shadow_sigma(d, b, d->sun_rule);
    b->sigma += STAMP_SHARE * s->options.tolerance_sigma;
    if (d->glint_count > 0) {
        b->sigma += GLINT_ERROR * *light_e / sqrt(*light_e + s->dark_variance_e2);
    }
    if (!b->one_pose) {
        double lost_e = LOST_GLINT * fmin(d->glints.lost, 1.0) * d->pose_e + d->kinks_e;
        b->sigma += lost_e / sqrt(*light_e + s->dark_variance_e2);
    }
}
