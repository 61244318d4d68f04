#include "control/guidance/mount_inverse_kinematics.h"

static const double turn_rad = 2.0 * BST_PI;

/* Sine of the angle to the outer axis below which the outer angle is arbitrary. */
#define POLE 1e-9

bool bst_mount_steers(const bst_mount_status *mount) {
    int needed = 0;
    for (int i = 0; i < mount->axes && i < BST_MOUNT_AXES; i++) {
        needed += !mount->axis[i].redundant;
    }
    return needed == 2;
}

/* Rotates v about a unit axis. */
static bst_vec3 about(bst_vec3 axis, double angle, bst_vec3 v) {
    double along = bst_vec3_dot(axis, v);
    bst_vec3 flat = bst_vec3_axpy(v, -along, axis);
    bst_vec3 out = bst_vec3_axpy(bst_vec3_scale(axis, along), cos(angle), flat);
    return bst_vec3_axpy(out, sin(angle), bst_vec3_cross(axis, v));
}

static bst_vec3 at_zero(const bst_mount_status *mount) {
    return bst_quat_rotate(mount->q_body_from_cam_at_zero, (bst_vec3){0, 0, 1});
}

bst_vec3 bst_mount_boresight(const bst_mount_status *mount,
                             const double angle_rad[BST_MOUNT_AXES]) {
    bst_vec3 b = at_zero(mount);
    for (int i = mount->axes - 1; i >= 0; i--) {
        b = about(mount->axis[i].axis_body, angle_rad[i], b);
    }
    return b;
}

/* Angle in the whole turn nearest to `near`. */
static double beside(double angle, double near) {
    return angle - turn_rad * round((angle - near) / turn_rad);
}

/* The two steering axes, with a redundant axis fixed at its angle. */
typedef struct pair {
    int outer, inner;
    bst_vec3 u, v, b0, b; /* axes, boresight at zero angles, wanted direction */
} pair;

static pair pair_of(const bst_mount_status *mount, bst_vec3 direction, const double near[]) {
    pair p = {.outer = -1, .inner = -1, .b0 = at_zero(mount), .b = direction};
    for (int i = 0; i < mount->axes; i++) {
        if (!mount->axis[i].redundant) {
            p.inner = p.outer < 0 ? p.inner : i;
            p.outer = p.outer < 0 ? i : p.outer;
        }
    }
    p.u = mount->axis[p.outer].axis_body;
    p.v = mount->axis[p.inner].axis_body;
    for (int i = mount->axes - 1; i >= 0; i--) {
        const bst_mount_axis *axis = &mount->axis[i];
        if (axis->redundant && i < p.outer) {
            p.b = about(axis->axis_body, -near[i], p.b);
        } else if (axis->redundant) {
            p.b0 = about(axis->axis_body, near[i], p.b0);
            if (i < p.inner) {
                p.v = about(axis->axis_body, near[i], p.v);
            }
        }
    }
    return p;
}

int bst_mount_angles(const bst_mount_status *mount, bst_vec3 direction_body,
                     const double near_rad[BST_MOUNT_AXES], double angle_rad[2][BST_MOUNT_AXES]) {
    if (!bst_mount_steers(mount)) {
        return 0;
    }
    pair p = pair_of(mount, direction_body, near_rad);
    double along = bst_vec3_dot(p.v, p.b0);
    double c = bst_vec3_dot(p.u, p.b0) - bst_vec3_dot(p.u, p.v) * along;
    double s = bst_vec3_dot(p.u, bst_vec3_cross(p.v, p.b0));
    double size = hypot(c, s);
    double share = (bst_vec3_dot(p.u, p.b) - bst_vec3_dot(p.u, p.v) * along) / size;
    if (!(size > 0.0) || fabs(share) > 1.0 + 1e-12) {
        return 0;
    }
    double middle = atan2(s, c), off = acos(fmax(fmin(share, 1.0), -1.0));
    double distance[2] = {0.0, 0.0};
    for (int k = 0; k < 2; k++) {
        double *a = angle_rad[k];
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            a[i] = near_rad[i];
        }
        a[p.inner] = beside(middle + (k ? -off : off), near_rad[p.inner]);
        bst_vec3 w = about(p.v, a[p.inner], p.b0);
        bst_vec3 flat = bst_vec3_cross(p.u, p.b);
        if (bst_vec3_norm(flat) > POLE) {
            double y = bst_vec3_dot(p.u, bst_vec3_cross(w, p.b));
            double x = bst_vec3_dot(w, p.b) - bst_vec3_dot(p.u, w) * bst_vec3_dot(p.u, p.b);
            a[p.outer] = beside(atan2(y, x), near_rad[p.outer]);
        }
        distance[k] =
            fmax(fabs(a[p.outer] - near_rad[p.outer]), fabs(a[p.inner] - near_rad[p.inner]));
    }
    if (distance[1] < distance[0]) {
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            double swap = angle_rad[0][i];
            angle_rad[0][i] = angle_rad[1][i];
            angle_rad[1][i] = swap;
        }
    }
    return off > 0.0 ? 2 : 1;
}

/* True if an axis has unlimited travel. */
static bool endless(const bst_mount_axis *axis) {
    return axis->min_rad == 0.0 && axis->max_rad == 0.0;
}

bool bst_mount_within(const bst_mount_axis *axis, double angle_rad) {
    const double rounding = 1e-12;
    return endless(axis) ||
           (angle_rad >= axis->min_rad - rounding && angle_rad <= axis->max_rad + rounding);
}

static bool all_within(const bst_mount_status *mount, const double angle[]) {
    bool within = true;
    for (int i = 0; i < mount->axes; i++) {
        within = within && bst_mount_within(&mount->axis[i], angle[i]);
    }
    return within;
}

/* Brings an angle into travel by the fewest whole turns; false if none does. */
static bool bring_within(const bst_mount_axis *axis, double *angle) {
    if (!endless(axis) && *angle < axis->min_rad) {
        *angle += turn_rad * ceil((axis->min_rad - *angle) / turn_rad - 1e-12);
    } else if (!endless(axis) && *angle > axis->max_rad) {
        *angle -= turn_rad * ceil((*angle - axis->max_rad) / turn_rad - 1e-12);
    }
    return bst_mount_within(axis, *angle);
}

bool bst_mount_nearest(const bst_mount_status *mount, bst_vec3 direction_body,
                       const double near_rad[BST_MOUNT_AXES], double angle_rad[BST_MOUNT_AXES]) {
    double ways[2][BST_MOUNT_AXES], best = INFINITY;
    int count = bst_mount_angles(mount, direction_body, near_rad, ways);
    for (int k = 0; k < count; k++) {
        double distance = 0.0;
        bool within = true;
        for (int i = 0; i < mount->axes; i++) {
            within = within && bring_within(&mount->axis[i], &ways[k][i]);
            distance = fmax(distance, fabs(ways[k][i] - near_rad[i]));
        }
        if (within && distance < best) {
            best = distance;
            for (int i = 0; i < BST_MOUNT_AXES; i++) {
                angle_rad[i] = ways[k][i];
            }
        }
    }
    return isfinite(best);
}

/* Number of directions that can be followed in order from given angles. */
static int count_followed(const bst_mount_status *mount, const bst_vec3 *directions, int count,
                          const double start[]) {
    double at[BST_MOUNT_AXES], ways[2][BST_MOUNT_AXES];
    for (int i = 0; i < BST_MOUNT_AXES; i++) {
        at[i] = start[i];
    }
    for (int n = 0; n < count; n++) {
        if (bst_mount_angles(mount, directions[n], at, ways) == 0 || !all_within(mount, ways[0])) {
            return n;
        }
        for (int i = 0; i < BST_MOUNT_AXES; i++) {
            at[i] = ways[0][i];
        }
    }
    return count;
}

bool bst_mount_choose_turn(const bst_mount_status *mount, const bst_vec3 *directions_body,
                           int count, bst_mount_turn_choice *out) {
    double present[BST_MOUNT_AXES] = {0.0}, ways[2][BST_MOUNT_AXES];
    for (int i = 0; i < mount->axes; i++) {
        present[i] = mount->axis[i].angle_rad;
    }
    int way_count = count > 0 ? bst_mount_angles(mount, directions_body[0], present, ways) : 0;
    out->serves = 0;
    out->slew_s = INFINITY;
    for (int k = 0; k < way_count; k++) {
        double lowest[BST_MOUNT_AXES];
        int turns[BST_MOUNT_AXES] = {1, 1, 1};
        for (int i = 0; i < mount->axes; i++) {
            const bst_mount_axis *axis = &mount->axis[i];
            lowest[i] = ways[k][i];
            if (!endless(axis) && !axis->redundant) {
                double first = ceil((axis->min_rad - lowest[i]) / turn_rad - 1e-12);
                double last = floor((axis->max_rad - lowest[i]) / turn_rad + 1e-12);
                lowest[i] += turn_rad * first;
                turns[i] = (int)fmax(fmin(last - first + 1.0, 64.0), 0.0);
            }
        }
        for (int n = 0; n < turns[0] * turns[1] * turns[2]; n++) {
            const int which[BST_MOUNT_AXES] = {n % turns[0], n / turns[0] % turns[1],
                                               n / turns[0] / turns[1]};
            bst_mount_turn_choice choice = {.slew_s = 0.0};
            for (int i = 0; i < mount->axes; i++) {
                const bst_mount_axis *axis = &mount->axis[i];
                choice.angle_rad[i] = lowest[i] + turn_rad * which[i];
                double way = fabs(choice.angle_rad[i] - present[i]);
                double rate = axis->rate_limit_radps;
                choice.slew_s = fmax(choice.slew_s, rate > 0.0 ? way / rate : 0.0);
            }
            choice.serves = count_followed(mount, directions_body, count, choice.angle_rad);
            if (choice.serves > out->serves ||
                (choice.serves == out->serves && choice.slew_s < out->slew_s)) {
                *out = choice;
            }
        }
    }
    return out->serves > 0;
}
