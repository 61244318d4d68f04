/* Writes the observations of a track as TDM, JSON or CSV. */
#ifndef BST_RUN_TRACK_FILES_H
#define BST_RUN_TRACK_FILES_H

#include <stdio.h>

#include "sim/run/run_observations.h"

/* Name of the track's object: the sensor's target, or TRACK-7. */
void bst_track_object(const bst_run_track *track, char *name, size_t bytes);

/* Writes a TDM segment after the head. `ephemeris`: OEM with the observer's states (NULL: none);
 * `what`: description of the angles. */
bst_status bst_track_write_tdm(bst_ctx *ctx, FILE *stream, const bst_run_track *track,
                               const char *ephemeris, const char *what) BST_MUST_CHECK;

/* Writes observations as objects of a JSON array in a common format: obTime, ra, declination (deg),
 * raUnc, declinationUnc, mag, snrEst, expDuration, senx ... senvelz (km, km/s, GCRF). `first`:
 * first element of the array. norad 0: unknown. */
bst_status bst_track_write_json(bst_ctx *ctx, FILE *stream, const bst_run_track *track, int norad,
                                bool first) BST_MUST_CHECK;

/* Writes the header row of a CSV of observations.
 *
 * Notes:     columns: utc, track, object, sensor, ra_deg, dec_deg, sigmas and correlation, v_mag,
 *            snr, and the observer's state (m, m/s). */
void bst_track_csv_head(FILE *stream);
/* Writes the observations of a track, one CSV row each; see bst_track_csv_head. */
bst_status bst_track_write_csv(bst_ctx *ctx, FILE *stream,
                               const bst_run_track *track) BST_MUST_CHECK;

#endif
