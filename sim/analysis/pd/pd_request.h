/* The options of boresight pd. */
#ifndef BST_ANALYSIS_PD_PD_REQUEST_H
#define BST_ANALYSIS_PD_PD_REQUEST_H

#include "sim/analysis/pd/pd_pair.h"
#include "sim/cli/load.h"

/* What the command line asks for. */
typedef struct bst_pd_request {
    bst_load_options load;
    bst_pd_options options;
    const char *range, *magnitudes; /* texts of --snr and --magnitude; NULL: not given */
    bool pair;
    bst_pd_pair_options pairs;
    const char *ratios, *separations; /* texts of --ratio and --separation; NULL: not given */
    const char *json, *plot;          /* files to write; NULL: none */
    int64_t threads;
    bool help;
} bst_pd_request;

/* Request without any option given. */
#define BST_PD_REQUEST_DEFAULTS                 \
    {                                           \
        .load = BST_LOAD_DEFAULTS, .options = { \
            .false_splits = -1.0,               \
            .background_e = -1.0,               \
            .jitter_px = -1.0,                  \
            .min_separation_px = 24.0,          \
            .rates_px = 3.0                     \
        }                                       \
    }

/* Table of the options, with offsets in a bst_pd_request. */
extern const bst_option bst_pd_option_table[];

/* Reads FIRST:LAST:STEP, such as "2:12:0.5", into low, high and step of `out`.
 *
 * Given:     name       of the option, for messages
 *            example    one that is right
 *            low, high  least first and greatest last value allowed
 * Errors:    BST_ERR_ARGUMENT: not three finite numbers, out of range, in the wrong order, a step
 *            of 0 or less, or BST_PD_POINTS steps or more */
bst_status bst_pd_range_read(bst_ctx *ctx, const char *name, const char *example, const char *text,
                             double low, double high, bst_pd_options *out) BST_MUST_CHECK;

/* A list of an option. */
typedef struct bst_pd_list {
    const char *name, *example; /* of the option and one that is right, for messages */
    double low, high;           /* least and greatest value allowed */
    double *values;             /* [most], lent */
    int most, count;
} bst_pd_list;

/* Reads ascending numbers such as "20,50,100" into list->values and list->count.
 *
 * Errors:    BST_ERR_ARGUMENT: not such a list, out of range, not ascending, or too long; the
 *            values stay as they are */
bst_status bst_pd_list_read(bst_ctx *ctx, const char *text, bst_pd_list *list) BST_MUST_CHECK;

/* Reads the texts of the request into request->options and checks that its options fit together.
 *
 * Given:     table  options of the command, as bst_load_check takes them
 * Errors:    BST_ERR_ARGUMENT */
bst_status bst_pd_request_settle(bst_ctx *ctx, bst_pd_request *request,
                                 const bst_option *table) BST_MUST_CHECK;

#endif
