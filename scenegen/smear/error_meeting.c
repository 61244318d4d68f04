#include "scenegen/smear/error_meeting.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

/* More sources, or blocks of nodes, are left to the budget. */
enum { MOST_SOURCES = 64, MOST_BLOCKS = 2048, LEAST_BLOCKS = 128 };

/* Distance of two images, in sigma, up to which their errors meet, besides a read-out pixel: as in
 * the budget's boxes. Nodes are up to SPACING sigma from the path between them. */
#define NEAR_SIGMAS 3.0
#define SPACING_SIGMAS 0.9

typedef struct node_box {
    float low[2], high[2];
} node_box;

struct bst_error_meeting {
    int capacity; /* blocks for which there is memory */
    const bst_error_budget_source *sources;
    bst_error_meeting_paths paths;
    bst_error_budget_motion motion;
    int count, blocks;
    int first[MOST_SOURCES]; /* of their blocks */
    float *x, *y;            /* [blocks][BST_BLOCK], px from the boresight */
    node_box *boxes;         /* [blocks] */
    double error[MOST_SOURCES], noise_e[MOST_SOURCES], sigma_px[MOST_SOURCES];
    float gap_px[MOST_SOURCES][MOST_SOURCES]; /* negative: not known yet */
};

typedef struct bst_error_meeting meeting;

/* Positions of a block's nodes, by the homographies of the table (smear_levels.c), and their box.
 * A node behind the camera makes the box endless. Returns the largest widening, PSF variances. */
static float place_nodes(const meeting *m, const bst_kernel_source_record *s, int block, int at) {
    const float *t = m->paths.table + (size_t)(s->first_table + block) * BST_TABLE_ROWS * BST_BLOCK;
    float *x = m->x + (size_t)at * BST_BLOCK, *y = m->y + (size_t)at * BST_BLOCK, widest = 0.0f;
    node_box box = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};
    for (int n = 0; n < BST_BLOCK; n++) {
        const float *r = t + n;
        float d = r[6 * BST_BLOCK] * s->x_px + r[7 * BST_BLOCK] * s->y_px;
        float depth = d + r[8 * BST_BLOCK];
        float dx = r[0] * s->x_px + r[1 * BST_BLOCK] * s->y_px + r[2 * BST_BLOCK] - s->x_px * d;
        float dy = r[3 * BST_BLOCK] * s->x_px + r[4 * BST_BLOCK] * s->y_px + r[5 * BST_BLOCK] -
                   s->y_px * d;
        x[n] = s->x_px + dx / depth;
        y[n] = s->y_px + dy / depth;
        if (!(depth > 0.0f)) {
            x[n] = y[n] = 0.0f;
            box = (node_box){{-INFINITY, -INFINITY}, {INFINITY, INFINITY}};
        }
        box.low[0] = fminf(box.low[0], x[n]);
        box.low[1] = fminf(box.low[1], y[n]);
        box.high[0] = fmaxf(box.high[0], x[n]);
        box.high[1] = fmaxf(box.high[1], y[n]);
        widest = fmaxf(widest, r[10 * BST_BLOCK]);
    }
    m->boxes[at] = box;
    return widest;
}

/* Squared distance of two boxes, px^2. */
static float boxes_apart(const node_box *a, const node_box *b) {
    float sum = 0.0f;
    for (int i = 0; i < 2; i++) {
        float gap = fmaxf(fmaxf(a->low[i] - b->high[i], b->low[i] - a->high[i]), 0.0f);
        sum += gap * gap;
    }
    return sum;
}

/* Least squared distance of the nodes of two blocks, px^2. */
static float nodes_apart(const meeting *m, int a, int b) {
    const float *ax = m->x + (size_t)a * BST_BLOCK, *ay = m->y + (size_t)a * BST_BLOCK;
    const float *bx = m->x + (size_t)b * BST_BLOCK, *by = m->y + (size_t)b * BST_BLOCK;
    float least[BST_BLOCK], most = INFINITY;
    for (int n = 0; n < BST_BLOCK; n++) {
        least[n] = INFINITY;
    }
    for (int k = 0; k < BST_BLOCK; k++) {
        for (int n = 0; n < BST_BLOCK; n++) {
            float dx = ax[n] - bx[k], dy = ay[n] - by[k], apart = dx * dx + dy * dy;
            least[n] = apart < least[n] ? apart : least[n];
        }
    }
    for (int n = 0; n < BST_BLOCK; n++) {
        most = least[n] < most ? least[n] : most;
    }
    return most;
}

/* Least distance of the nodes of two sources, px; 0 if it is at most near_px. Beyond ten times that
 * a lower bound. */
static float gap_of(meeting *m, int i, int j, float near_px) {
    if (m->gap_px[i][j] >= 0.0f) {
        return m->gap_px[i][j];
    }
    float near2 = near_px * near_px, least = INFINITY;
    int blocks[2] = {m->paths.sources[i].blocks, m->paths.sources[j].blocks};
    for (int k = 0; k < blocks[0] * blocks[1] && least > near2; k++) {
        int a = m->first[i] + k / blocks[1], b = m->first[j] + k % blocks[1];
        float apart = boxes_apart(&m->boxes[a], &m->boxes[b]);
        if (apart < least) {
            apart = apart < 100.0f * near2 ? nodes_apart(m, a, b) : apart;
            least = fminf(least, apart);
        }
    }
    m->gap_px[i][j] = m->gap_px[j][i] = least > near2 ? sqrtf(least) : 0.0f;
    return m->gap_px[i][j];
}

/* Error of source j where that of source i is greatest, in sigma of that pixel; REST of its own
 * where they meet, as in the budget. Of images further apart, what reaches a window beside a source
 * (bst_smear_bring_to_window), and what reaches any distance. */
static double reaching(meeting *m, int i, int j) {
    const bst_error_budget_source *a = &m->sources[i], *b = &m->sources[j];
    double size = fmax(m->sigma_px[i], m->sigma_px[j]), near = NEAR_SIGMAS * size;
    double met = BST_ERROR_REST * m->error[j], spot = fmax(m->motion.sigma_px, 1.0);
    if (!a->apart && !b->apart &&
        hypot((double)(a->x_px - b->x_px), (double)(a->y_px - b->y_px)) < sqrt(2.0) * spot) {
        return m->error[j]; /* two at one place */
    }
    double slack = 2.0 * SPACING_SIGMAS * size, touch = near + m->paths.binning + slack;
    double gap = (double)gap_of(m, i, j, (float)touch) - slack;
    if (!(gap > near)) {
        return met;
    }
    double part = m->paths.gaussian ? 0.1 * pow(near / gap, 6.0) : 0.3 * pow(near / gap, 3.0);
    double far = part * (double)b->predicted_e / m->noise_e[i] +
                 BST_ERROR_REST * (double)b->grid_e / m->noise_e[j];
    return fmin(met, far);
}

/* Greatest error of nodes in any pixel. */
static double greatest_error(meeting *m) {
    int order[MOST_SOURCES];
    double squares = 0.0;
    for (int i = 0; i < m->count; i++) {
        int n = i;
        for (; n > 0 && m->error[order[n - 1]] < m->error[i]; n--) {
            order[n] = order[n - 1];
        }
        order[n] = i;
        squares += m->error[i] * m->error[i];
    }
    double worst = 0.0;
    for (int n = 0; n < m->count; n++) {
        int i = order[n];
        double own = m->error[i];
        if (own + sqrt(squares) <= worst) {
            break;
        }
        double most = 0.0, sum = 0.0;
        for (int k = 0; k < m->count; k++) {
            double met = k == n ? 0.0 : reaching(m, i, order[k]);
            most = fmax(most, met);
            sum += met * met;
        }
        double others = most * most + m->motion.overlap * (sum - most * most);
        worst = fmax(worst, own + sqrt(fmax(others, 0.0)));
    }
    return worst;
}

static void free_room(meeting *m) {
    free(m->x);
    free(m->y);
    free(m->boxes);
    m->x = m->y = NULL;
    m->boxes = NULL;
    m->capacity = 0;
}

/* Memory for the blocks; it grows by half at least. */
static bool make_room(meeting *m) {
    if (m->blocks <= m->capacity) {
        return true;
    }
    const int wanted = m->blocks > m->capacity * 3 / 2 ? m->blocks : m->capacity * 3 / 2;
    const size_t blocks = (size_t)(wanted > LEAST_BLOCKS ? wanted : LEAST_BLOCKS);
    free_room(m);
    m->x = malloc(blocks * BST_BLOCK * sizeof *m->x);
    m->y = malloc(blocks * BST_BLOCK * sizeof *m->y);
    m->boxes = malloc(blocks * sizeof *m->boxes);
    if (!m->x || !m->y || !m->boxes) {
        free_room(m);
        return false;
    }
    m->capacity = (int)blocks;
    return true;
}

static bool make_paths(meeting *m) {
    m->blocks = 0;
    for (int i = 0; i < m->count; i++) {
        m->first[i] = m->blocks;
        m->blocks += m->paths.sources[i].blocks;
        if (m->blocks > MOST_BLOCKS) {
            return false;
        }
    }
    if (!make_room(m)) { /* only an improvement */
        return false;
    }
    double dark = m->motion.dark_variance_e2;
    for (int i = 0; i < m->count; i++) {
        const bst_error_budget_source *s = &m->sources[i];
        float widest = 0.0f;
        for (int b = 0; b < m->paths.sources[i].blocks; b++) {
            widest = fmaxf(widest, place_nodes(m, &m->paths.sources[i], b, m->first[i] + b));
        }
        m->sigma_px[i] = m->motion.sigma_px * sqrt(1.0 + (double)widest);
        m->noise_e[i] = sqrt((double)s->peak_e + dark);
        m->error[i] = (double)s->predicted_e / m->noise_e[i];
        if (s->apart) { /* the budget has their other errors with those of nodes */
            double more = (double)(s->excess_e + s->shared_e) / m->noise_e[i];
            m->error[i] = fmax(m->error[i] + more, (double)s->border_e / sqrt(dark));
        }
        for (int j = 0; j < m->count; j++) {
            m->gap_px[i][j] = -1.0f;
        }
    }
    return true;
}

void bst_error_meeting_free(bst_error_meeting *m) {
    if (m) {
        free_room(m);
        free(m);
    }
}

double bst_error_meeting_sigma(bst_error_meeting **space, bst_error_budget *budget,
                               const bst_error_meeting_paths *paths) {
    assert(space && budget && paths);
    double nodes = INFINITY;
    int count;
    const bst_error_budget_source *sources = bst_error_budget_sources(budget, &count);
    const bool few = count > 1 && count <= MOST_SOURCES;
    if (few && !*space) {
        *space = calloc(1, sizeof **space);
    }
    if (few && *space) {
        meeting *m = *space;
        m->sources = sources;
        m->count = count;
        m->paths = *paths;
        m->motion = *bst_error_budget_frame_motion(budget);
        nodes = make_paths(m) ? greatest_error(m) : INFINITY;
    }
    return bst_error_budget_limited_sigma(budget, nodes);
}
