#include "sim/satellite/body_attitude.h"

#include <assert.h>
#include <stdlib.h>

#include "sim/satellite/attitude_propagation.h"
#include "sim/satellite/tumbling.h"

#define EARLIEST_S -1e7 /* start of torques: four months before the epoch */

static const char *const laws[] = {"nadir", "nadir_sun", "velocity", "sun", "inertial",
                                   "spin",  "tumble",    "table",    NULL};

#define T bst_attitude_torques
static const bst_config_desc torques_table[] = {
    BST_BOOL(T, gravity_gradient, "false", "The Earth's gravity gradient."),
    BST_BOOL(T, solar_pressure, "false",
             "Sunlight on the facets of the shape, with shadows between parts and that of the "
             "Earth."),
    BST_BOOL(T, drag, "false",
             "Air on the facets, with the orbit's spacecraft.cd and forces.density_scale."),
    BST_REAL(T, tolerance_rad, "rad", 1e-6, 1, "1e-2",
             "Estimated error of the attitude after a day, by which steps are chosen."),
    BST_CONFIG_END};
#undef T

const bst_config_desc bst_attitude_config_table[] = {
    BST_REAL(bst_attitude_config, from_s, "s", -1e9, 1e9, "-1e9",
             "Start of the phase after the epoch; it lasts until the next one."),
    BST_ENUM(
        bst_attitude_config, law, laws, "\"nadir\"",
        "nadir: z to the Earth's centre, x forward; nadir_sun: z to the Earth's centre, the "
        "Sun on the side of +x; velocity: x forward; sun: z to the Sun; inertial: fixed; spin: "
        "constant rate; tumble: rotation of a rigid body, free or under torques; table: from a "
        "file."),
    BST_REALS(bst_attitude_config, rotation_deg, "deg", -360, 360, "[0, 0, 0]",
              "nadir, nadir_sun, velocity, sun: rotation of the body from there about its x, then "
              "y, then z axis."),
    BST_REALS(bst_attitude_config, quaternion, "", -1, 1, "[0, 0, 0, 0]",
              "inertial, spin, tumble: attitude at from_s, [x, y, z, w] from GCRF to the body; all "
              "zero: as at the end of the phase before, for the first phase the axes of GCRF."),
    BST_REALS(bst_attitude_config, rate_body_deg_per_s, "deg/s", -36000, 36000, "[0, 0, 0]",
              "spin, tumble: angular velocity at from_s in the body frame."),
    BST_REALS(bst_attitude_config, inertia_kg_m2, "kg m2", 0, 1e12, "[1, 1, 1]",
              "tumble: principal moments of inertia about the body's axes."),
    BST_OBJECT(bst_attitude_config, torques, torques_table, "{}",
               "tumble: torques about the centre of mass, the origin of the shape, from from_s on; "
               "without any, the rotation is free."),
    BST_PATH(bst_attitude_config, file, "\"\"",
             "table: file of attitudes, relative to the scenario's folder: CSV with columns "
             "time_s, qx, qy, qz, qw (from GCRF to the body), a CCSDS AEM, or the "
             "frame_updates_file of a sensor; at a constant rate between rows."),
    BST_STRING(bst_attitude_config, object, "\"\"",
               "table: object of the AEM (OBJECT_NAME or OBJECT_ID) or of the frame updates; "
               "empty: the only one."),
    BST_CONFIG_END,
};

typedef struct phase {
    bst_attitude_config config;
    bst_quat offset; /* body from the law's axes */
    bst_quat start;
    bool continues;                        /* start is not yet known */
    bst_tumbling *tumbling;                /* NULL: another law, or torques */
    bst_attitude_propagation *propagation; /* NULL: no torques */
    bst_body_torque_fn torque;
    void *user;
    bst_attitude_row *rows;
    int row_count;
} phase;

struct bst_body_attitude {
    phase *phases;
    int count;
    bst_commanded_attitude *commands; /* NULL: accepts none */
};

void bst_body_attitude_free(bst_body_attitude *a) {
    for (int i = 0; a && i < a->count; i++) {
        bst_tumbling_free(a->phases[i].tumbling);
        bst_attitude_propagation_free(a->phases[i].propagation);
        free(a->phases[i].rows);
    }
    if (a) {
        bst_commanded_attitude_free(a->commands);
        free(a->phases);
        free(a);
    }
}

/* Body axes from those of the law: the body turns about its own x, then y, then z. */
static bst_quat offset_of(const double deg[3]) {
    bst_quat q = BST_QUAT_IDENTITY;
    q = bst_quat_turn_frame(q, (bst_vec3){deg[0] * BST_DEG_RAD, 0, 0});
    q = bst_quat_turn_frame(q, (bst_vec3){0, deg[1] * BST_DEG_RAD, 0});
    return bst_quat_turn_frame(q, (bst_vec3){0, 0, deg[2] * BST_DEG_RAD});
}

static bst_status load_rows(bst_ctx *ctx, const bst_attitude_source *source, phase *p) {
    const bst_attitude_config *c = &p->config;
    if (!*c->file) {
        return bst_fail(ctx, BST_ERR_CONFIG, "file: the law table needs a file; give its path");
    }
    bst_status status =
        bst_attitude_table_load(ctx, source, c->file, c->object, &p->rows, &p->row_count);
    return status == BST_OK ? BST_OK : bst_fail_prefix(ctx, status, "file");
}

static bool has_torques(const bst_attitude_config *c) {
    return c->torques.gravity_gradient || c->torques.solar_pressure || c->torques.drag;
}

/* Checks the keys of a phase with torques. */
static bst_status check_torques(bst_ctx *ctx, const bst_attitude_config *c) {
    if (c->law != BST_ATTITUDE_TUMBLE) {
        return bst_fail(
            ctx, BST_ERR_CONFIG,
            "torques: found with the law %s (allowed: with tumble; other laws prescribe "
            "the attitude)",
            laws[c->law]);
    }
    if (c->from_s < EARLIEST_S) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "from_s: found %g with torques, which are integrated from there on "
                        "(allowed: at least %g, such as 0)",
                        c->from_s, EARLIEST_S);
    }
    return bst_tumbling_check(ctx, c->inertia_kg_m2);
}

static bst_status make_phase(bst_ctx *ctx, const bst_attitude_config *config, bool first,
                             const bst_attitude_source *source, phase *p) {
    const double *q = config->quaternion;
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    p->config = *config;
    p->offset = offset_of(config->rotation_deg);
    p->start = bst_quat_unit((bst_quat){q[0], q[1], q[2], q[3]});
    if (norm > 0.0 && fabs(norm - 1.0) > 1e-3) {
        return bst_fail(ctx, BST_ERR_CONFIG,
                        "quaternion: its length is %g (allowed: 1, or all zero)", norm);
    }
    bool moves = config->law == BST_ATTITUDE_INERTIAL || config->law == BST_ATTITUDE_SPIN ||
                 config->law == BST_ATTITUDE_TUMBLE;
    p->continues = moves && !(norm > 0.0) && !first;
    if (config->law == BST_ATTITUDE_TABLE) {
        return load_rows(ctx, source, p);
    }
    if (has_torques(config)) {
        return check_torques(ctx, config);
    }
    if (config->law == BST_ATTITUDE_TUMBLE) {
        bst_vec3 rate =
            bst_vec3_scale(bst_vec3_from_array(config->rate_body_deg_per_s), BST_DEG_RAD);
        return bst_tumbling_create(ctx, config->inertia_kg_m2, rate, &p->tumbling);
    }
    return BST_OK;
}

bst_status bst_body_attitude_create(bst_ctx *ctx, const bst_config_list *phases,
                                    const bst_attitude_source *source, bst_body_attitude **out) {
    static const bst_attitude_config nadir = {.from_s = -1e9, .law = BST_ATTITUDE_NADIR};
    const bst_attitude_config *configs = phases->count ? phases->items : &nadir;
    int count = phases->count ? phases->count : 1;
    *out = NULL;
    bst_body_attitude *a = calloc(1, sizeof *a);
    phase *list = a ? calloc((size_t)count, sizeof *list) : NULL;
    if (!list) {
        free(a);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for an attitude");
    }
    a->phases = list;
    bst_status status = BST_OK;
    for (int i = 0; i < count && status == BST_OK; i++) {
        a->count = i + 1;
        if (i > 0 && !(configs[i].from_s > configs[i - 1].from_s)) {
            status = bst_fail(ctx, BST_ERR_CONFIG,
                              "from_s: found %g after %g (allowed: ascending times)",
                              configs[i].from_s, configs[i - 1].from_s);
        } else {
            status = make_phase(ctx, &configs[i], i == 0, source, &list[i]);
        }
        if (status != BST_OK) {
            status = bst_fail_prefix(ctx, status, "%d", i);
        }
    }
    if (status != BST_OK) {
        bst_body_attitude_free(a);
        return status;
    }
    *out = a;
    return BST_OK;
}

/* q from the reference to a frame whose x points along `x` (unit) and whose z is as close to
 * `near_z` as possible. */
static bst_quat ahead_frame(bst_vec3 x, bst_vec3 near_z) {
    bst_vec3 z = bst_vec3_axpy(near_z, -bst_vec3_dot(x, near_z), x);
    return bst_quat_look(bst_vec3_norm(z) > 1e-9 ? z : bst_vec3_perpendicular(x), x);
}

static bst_quat phase_at(const phase *p, const bst_attitude_state *s) {
    bst_vec3 down = bst_vec3_scale(bst_vec3_unit(s->position_m), -1.0), speed = s->velocity_mps;
    bst_vec3 ahead = bst_vec3_unit(speed);
    double since = s->seconds - p->config.from_s;
    bst_vec3 rate = bst_vec3_scale(bst_vec3_from_array(p->config.rate_body_deg_per_s), BST_DEG_RAD);
    bst_quat law;
    switch (p->config.law) {
        case BST_ATTITUDE_SPIN:
            return bst_quat_turn_frame(p->start, bst_vec3_scale(rate, since));
        case BST_ATTITUDE_TUMBLE:
            return p->propagation
                       ? bst_attitude_propagation_at(p->propagation, s->seconds, NULL)
                       : bst_quat_mul(bst_tumbling_at(p->tumbling, since, NULL), p->start);
        case BST_ATTITUDE_INERTIAL:
            return p->start;
        case BST_ATTITUDE_TABLE:
            return bst_attitude_table_at(p->rows, p->row_count, s->seconds);
        case BST_ATTITUDE_NADIR_SUN:
            law = bst_quat_look(down, s->sun);
            break;
        case BST_ATTITUDE_VELOCITY:
            law = ahead_frame(ahead, down);
            break;
        case BST_ATTITUDE_SUN:
            law = bst_quat_look(s->sun, (bst_vec3){0, 0, 1});
            break;
        default:
            law = bst_quat_look(down, ahead);
            break;
    }
    return bst_quat_mul(p->offset, law);
}

bool bst_body_attitude_has_torques(const bst_body_attitude *a) {
    for (int i = 0; i < a->count; i++) {
        if (has_torques(&a->phases[i].config)) {
            return true;
        }
    }
    return false;
}

static bool phase_torque(void *user, double seconds, bst_quat q, bst_vec3 *torque_nm) {
    const phase *p = user;
    return p->torque(p->user, &p->config, seconds, q, torque_nm);
}

bst_status bst_body_attitude_set_torque(bst_ctx *ctx, bst_body_attitude *a,
                                        bst_body_torque_fn torque, void *user) {
    for (int i = 0; i < a->count; i++) {
        phase *p = &a->phases[i];
        const bst_attitude_config *c = &p->config;
        if (!has_torques(c)) {
            continue;
        }
        bst_attitude_motion start = {
            .start_s = c->from_s,
            .q_body_from_gcrf = p->start,
            .rate_radps = bst_vec3_scale(bst_vec3_from_array(c->rate_body_deg_per_s), BST_DEG_RAD)};
        for (int k = 0; k < 3; k++) {
            start.inertia_kg_m2[k] = c->inertia_kg_m2[k];
        }
        p->torque = torque;
        p->user = user;
        BST_TRY(bst_attitude_propagation_create(ctx, &start, c->torques.tolerance_rad, phase_torque,
                                                p, &p->propagation));
    }
    return BST_OK;
}

static const phase *phase_for(const bst_body_attitude *a, double seconds) {
    int i = a->count - 1;
    while (i > 0 && seconds < a->phases[i].config.from_s) {
        i--;
    }
    return &a->phases[i];
}

bool bst_body_attitude_next_start(const bst_body_attitude *a, int *index, double *seconds) {
    for (int i = *index; i < a->count; i++) {
        if (a->phases[i].continues) {
            *index = i;
            *seconds = a->phases[i].config.from_s;
            return true;
        }
    }
    return false;
}

void bst_body_attitude_start(bst_body_attitude *a, int index, const bst_attitude_state *state) {
    assert(index > 0 && index < a->count);
    a->phases[index].start = phase_at(&a->phases[index - 1], state);
    a->phases[index].continues = false;
    if (a->phases[index].propagation) {
        bst_attitude_propagation_start(a->phases[index].propagation, a->phases[index].start);
    }
}

bst_quat bst_body_attitude_at(const bst_body_attitude *a, const bst_attitude_state *state) {
    bst_quat q;
    double rate;
    return a->commands && bst_commanded_attitude_at(a->commands, state->seconds, &q, &rate)
               ? q
               : bst_quat_unit(phase_at(phase_for(a, state->seconds), state));
}

bst_status bst_body_attitude_accept(bst_ctx *ctx, bst_body_attitude *a) {
    return bst_commanded_attitude_create(ctx, &a->commands);
}

bst_commanded_attitude *bst_body_attitude_commands(const bst_body_attitude *a) {
    return a->commands;
}

double bst_body_attitude_rate_radps(const bst_body_attitude *a, double seconds) {
    const phase *p = phase_for(a, seconds);
    bst_quat q;
    double commanded;
    if (a->commands && bst_commanded_attitude_at(a->commands, seconds, &q, &commanded)) {
        return commanded;
    }
    if (p->config.law == BST_ATTITUDE_TABLE) {
        return bst_attitude_table_rate_radps(p->rows, p->row_count, seconds);
    }
    bool turns = p->config.law == BST_ATTITUDE_SPIN || p->config.law == BST_ATTITUDE_TUMBLE;
    double rate = bst_vec3_norm(bst_vec3_from_array(p->config.rate_body_deg_per_s)) * BST_DEG_RAD;
    if (p->propagation) {
        bst_vec3 now;
        bst_attitude_propagation_at(p->propagation, seconds, &now);
        rate = bst_vec3_norm(now);
    }
    if (p->config.law == BST_ATTITUDE_TUMBLE) { /* energy bounds the rate about the smallest axis */
        const double *i = p->config.inertia_kg_m2;
        rate *= sqrt(fmax(fmax(i[0], i[1]), i[2]) / fmin(fmin(i[0], i[1]), i[2]));
    }
    return turns ? rate : 0.0;
}
