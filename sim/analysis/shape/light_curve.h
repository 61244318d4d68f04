/* boresight lightcurve: magnitude of an object against time. */
#ifndef BST_ANALYSIS_SHAPE_LIGHT_CURVE_H
#define BST_ANALYSIS_SHAPE_LIGHT_CURVE_H

#include "sim/engine/scenario/scenario.h"

/* Object, observer and times of a light curve. */
typedef struct bst_light_curve_request {
    /* a satellite without a scenario; satellite NULL: from the scenario */
    const char *satellite, *elements;
    const char *attitude;          /* a law, or JSON: one phase, or phases as in scenarios */
    int64_t norad, observer_norad; /* observer_norad 0: none */
    bool earthshine;
    /* of a scenario: names; NULL: the first one */
    const char *object, *observer;
    const char *site;  /* "LATITUDE,LONGITUDE,HEIGHT", degrees and metres; NULL: the observer */
    const char *start; /* UTC; NULL: the scenario's epoch */
    double duration_s, step_s;
    double extinction_mag;     /* per air mass, for a site */
    const char *output, *plot; /* CSV, NULL: standard output; PNG or SVG, NULL: none */
} bst_light_curve_request;

/* Request without any option given. */
#define BST_LIGHT_CURVE_DEFAULTS \
    { .attitude = "nadir", .duration_s = 3600.0, .step_s = 10.0 }

/* Computes a light curve and writes its table and plot.
 *
 * Given:     request   what is asked for
 *            scenario  NULL: request->satellite on an orbit of request->elements
 * Errors:    BST_ERR_ARGUMENT with the option, also where the observer is the object itself;
 *            BST_ERR_CONFIG of the satellite, those of the orbits, BST_ERR_IO
 * Notes:     columns: time, seconds after the start, V magnitude (empty: in the shadow, its lit
 *            side not seen, occulted or below the horizon), phase angle, range, visible part of the
 *            Sun, fraction that is earthlight, elevation and azimuth (sites; empty otherwise). For
 *            a site the magnitude includes extinction by the air mass of Kasten and Young, Appl.
 *            Opt. 28, 4735 (1989). */
bst_status bst_light_curve_make(bst_ctx *ctx, const bst_light_curve_request *request,
                                const bst_scenario *scenario) BST_MUST_CHECK;

#endif
