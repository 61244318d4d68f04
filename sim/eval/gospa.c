#include "sim/eval/gospa.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

typedef struct solver {
    int rows, columns;      /* rows <= columns */
    const double *distance; /* [rows * columns] */
    double cutoff, order;
    double *u, *v, *least;
    int *row_of, *way;
    char *done;
} solver;

/* Cost of assigning a truth object to a track: distance^order, cut off. */
static double cost(const solver *s, int row, int column) {
    double d = s->distance[row * s->columns + column];
    return pow(d < s->cutoff ? d : s->cutoff, s->order);
}

/* Finds the shortest augmenting path from one row to a free column of the assignment (Kuhn 1955,
 * Munkres 1957, with dual variables). Row and column 0 mean none. */
static void augment(solver *s, int row) {
    int column = 0;
    s->row_of[0] = row;
    for (int j = 0; j <= s->columns; j++) {
        s->least[j] = INFINITY;
        s->done[j] = 0;
    }
    do {
        s->done[column] = 1;
        int from = s->row_of[column], next = 0;
        double step = INFINITY;
        for (int j = 1; j <= s->columns; j++) {
            if (s->done[j]) {
                continue;
            }
            double reduced = cost(s, from - 1, j - 1) - s->u[from] - s->v[j];
            if (reduced < s->least[j]) {
                s->least[j] = reduced;
                s->way[j] = column;
            }
            if (s->least[j] < step) {
                step = s->least[j];
                next = j;
            }
        }
        for (int j = 0; j <= s->columns; j++) {
            if (s->done[j]) {
                s->u[s->row_of[j]] += step;
                s->v[j] -= step;
            } else {
                s->least[j] -= step;
            }
        }
        column = next;
    } while (s->row_of[column] != 0);
    while (column != 0) {
        int before = s->way[column];
        s->row_of[column] = s->row_of[before];
        column = before;
    }
}

/* Objects and tracks that pairs nearer than the cutoff connect: nodes 0 to truths - 1 are objects,
 * the others tracks. */
typedef struct components {
    int *root;                /* [nodes] union-find */
    int *local;               /* [nodes] number within its side of the component */
    int *first_pair;          /* [nodes] of the component with that root; -1: none */
    int *next_pair;           /* [pairs] */
    int *truth_of, *track_of; /* [truths], [tracks] of the component in hand, by local number */
} components;

static int find_root(int *root, int node) {
    while (root[node] != node) {
        root[node] = root[root[node]];
        node = root[node];
    }
    return node;
}

/* Connects objects and tracks, and lists the pairs of each component. */
static void connect(const bst_gospa_problem *p, components *c) {
    int nodes = p->truths + p->tracks;
    for (int i = 0; i < nodes; i++) {
        c->root[i] = i;
        c->first_pair[i] = c->local[i] = -1;
    }
    for (int i = 0; i < p->count; i++) {
        if (p->pairs[i].distance < p->cutoff) {
            int a = find_root(c->root, p->pairs[i].truth);
            c->root[a] = find_root(c->root, p->truths + p->pairs[i].track);
        }
    }
    for (int i = p->count - 1; i >= 0; i--) {
        if (p->pairs[i].distance < p->cutoff) {
            int root = find_root(c->root, p->pairs[i].truth);
            c->next_pair[i] = c->first_pair[root];
            c->first_pair[root] = i;
        }
    }
}

/* Adds an assigned pair to the localisation error. */
static void add_pair(const bst_gospa_problem *p, int truth, int track, double distance,
                     int *pair_of_truth, bst_gospa_result *out) {
    out->pairs++;
    out->localisation += pow(distance, p->order);
    if (pair_of_truth) {
        pair_of_truth[truth] = track;
    }
}

/* Numbers the objects and tracks of a component. */
static void number(const bst_gospa_problem *p, components *c, int first, int *truths, int *tracks) {
    *truths = *tracks = 0;
    for (int i = first; i >= 0; i = c->next_pair[i]) {
        int truth = p->pairs[i].truth, track = p->pairs[i].track;
        if (c->local[truth] < 0) {
            c->truth_of[*truths] = truth;
            c->local[truth] = (*truths)++;
        }
        if (c->local[p->truths + track] < 0) {
            c->track_of[*tracks] = track;
            c->local[p->truths + track] = (*tracks)++;
        }
    }
}

/* Assigns the objects and tracks of one component. Returns false if there is no memory. */
static bool assign(const bst_gospa_problem *p, components *c, int first, int *pair_of_truth,
                   bst_gospa_result *out) {
    int truths, tracks;
    if (c->next_pair[first] < 0) {
        const bst_gospa_pair *only = &p->pairs[first];
        add_pair(p, only->truth, only->track, only->distance, pair_of_truth, out);
        return true;
    }
    number(p, c, first, &truths, &tracks);
    bool turned = truths > tracks;
    solver s = {.rows = turned ? tracks : truths,
                .columns = turned ? truths : tracks,
                .cutoff = p->cutoff,
                .order = p->order};
    size_t n = (size_t)s.columns + 1, cells = (size_t)s.rows * (size_t)s.columns;
    double *reals = calloc(3 * n + cells, sizeof *reals), *distance = reals + 3 * n;
    int *ints = calloc(2 * n, sizeof *ints);
    s.done = calloc(n, 1);
    bool enough = reals && ints && s.done;
    if (enough) {
        s.distance = distance;
        s.u = reals;
        s.v = reals + n;
        s.least = reals + 2 * n;
        s.row_of = ints;
        s.way = ints + n;
        for (size_t i = 0; i < cells; i++) {
            distance[i] = p->cutoff;
        }
        for (int i = first; i >= 0; i = c->next_pair[i]) {
            int a = c->local[p->pairs[i].truth], b = c->local[p->truths + p->pairs[i].track];
            distance[turned ? b * s.columns + a : a * s.columns + b] = p->pairs[i].distance;
        }
        for (int row = 1; row <= s.rows; row++) {
            augment(&s, row);
        }
    }
    for (int j = 0; enough && j < s.columns; j++) {
        int row = s.row_of[j + 1] - 1;
        double d = row >= 0 ? distance[row * s.columns + j] : p->cutoff;
        if (d < p->cutoff) {
            int a = turned ? j : row, b = turned ? row : j;
            add_pair(p, c->truth_of[a], c->track_of[b], d, pair_of_truth, out);
        }
    }
    free(reals);
    free(ints);
    free(s.done);
    return enough;
}

/* Checks the problem. */
static bst_status check(bst_ctx *ctx, const bst_gospa_problem *p) {
    if (p->truths < 0 || p->tracks < 0 || p->count < 0 || !(p->cutoff > 0.0) ||
        !(p->order >= 1.0) || !isfinite(p->order) || !isfinite(p->cutoff)) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "gospa: needs counts >= 0, a finite cutoff > 0 and an order >= 1");
    }
    for (int i = 0; i < p->count; i++) {
        const bst_gospa_pair *pair = &p->pairs[i];
        if (!(pair->distance >= 0.0) || pair->truth < 0 || pair->truth >= p->truths ||
            pair->track < 0 || pair->track >= p->tracks) {
            return bst_fail(ctx, BST_ERR_ARGUMENT,
                            "gospa: pair %d: needs a distance >= 0, an object of %d and a track "
                            "of %d",
                            i, p->truths, p->tracks);
        }
    }
    return BST_OK;
}

bst_status bst_gospa_near(bst_ctx *ctx, const bst_gospa_problem *p, int *pair_of_truth,
                          bst_gospa_result *out) {
    memset(out, 0, sizeof *out);
    BST_TRY(check(ctx, p));
    for (int i = 0; pair_of_truth && i < p->truths; i++) {
        pair_of_truth[i] = -1;
    }
    size_t nodes = (size_t)p->truths + (size_t)p->tracks;
    int *ints = calloc(4 * nodes + (size_t)p->count + 1, sizeof *ints);
    bool enough = ints != NULL;
    if (enough) {
        components c = {.root = ints,
                        .local = ints + nodes,
                        .first_pair = ints + 2 * nodes,
                        .truth_of = ints + 3 * nodes,
                        .track_of = ints + 3 * nodes + p->truths,
                        .next_pair = ints + 4 * nodes};
        connect(p, &c);
        for (size_t i = 0; i < nodes && enough; i++) {
            enough = c.first_pair[i] < 0 || assign(p, &c, c.first_pair[i], pair_of_truth, out);
        }
    }
    free(ints);
    if (!enough) {
        return bst_fail(ctx, BST_ERR_MEMORY, "gospa: out of memory");
    }
    double half = 0.5 * pow(p->cutoff, p->order);
    out->missed_count = p->truths - out->pairs;
    out->false_count = p->tracks - out->pairs;
    out->missed = half * out->missed_count;
    out->false_tracks = half * out->false_count;
    out->gospa = pow(out->localisation + out->missed + out->false_tracks, 1.0 / p->order);
    return BST_OK;
}

bst_status bst_gospa(bst_ctx *ctx, const double *distance, int truths, int tracks, double cutoff,
                     double order, int *pair_of_truth, bst_gospa_result *out) {
    memset(out, 0, sizeof *out);
    size_t cells = truths > 0 && tracks > 0 ? (size_t)truths * (size_t)tracks : 0;
    bst_gospa_pair *pairs = calloc(cells + 1, sizeof *pairs);
    if (!pairs) {
        return bst_fail(ctx, BST_ERR_MEMORY, "gospa: out of memory");
    }
    for (size_t i = 0; i < cells; i++) {
        pairs[i] =
            (bst_gospa_pair){(int)(i / (size_t)tracks), (int)(i % (size_t)tracks), distance[i]};
    }
    const bst_gospa_problem problem = {pairs, (int)cells, truths, tracks, cutoff, order};
    bst_status status = bst_gospa_near(ctx, &problem, pair_of_truth, out);
    free(pairs);
    return status;
}
