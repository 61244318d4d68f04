#include "sim/run/run_space.h"

#include <math.h>

#include "sim/io/run_store.h"

/* smaller runs are not reported */
#define WORTH_SAYING_BYTES 1e8

double bst_run_sensor_frames(const bst_scenario *scenario, const bst_sensor_config *sensor) {
    const bst_exposure_config *e = &sensor->exposure;
    const bst_detector_config *detector = &sensor->camera.detector;
    const double rate = (double)scenario->tick_rate_hz;
    /* from the first row to the middle one of a rolling shutter; the cycle is the exposure clock's
     */
    double lead_s = 0.0;
    if (detector->row_time_s != 0.0) {
        lead_s =
            (double)bst_detector_lead_ticks(detector, (int)sensor->camera.height_px, rate) / rate;
    }
    const double cycle_s = fmax(e->period_s, e->exposure_s + 2.0 * lead_s);
    /* those that end before the run does; 1e-9: rounding */
    double left_s = scenario->duration_s - e->first_s - e->exposure_s - lead_s;
    return fmax(ceil(left_s / cycle_s - 1e-9), 0.0);
}

/* Pixels of a frame: of its window, over its binning. */
static double pixels_of(const bst_sensor_config *sensor) {
    const bst_exposure_config *e = &sensor->exposure;
    bool whole = e->window_px[2] == 0.0;
    double width = whole ? (double)sensor->camera.width_px : e->window_px[2];
    double height = whole ? (double)sensor->camera.height_px : e->window_px[3];
    double binning = e->binning > 1 ? (double)e->binning : 1.0;
    return floor(width / binning) * floor(height / binning);
}

double bst_run_sensor_bytes(const bst_scenario *scenario, const bst_sensor_config *sensor) {
    const bst_recorder_config *record = &scenario->record;
    /* Rice compresses noise of a few DN to about half */
    double per_pixel = record->frames == BST_RECORD_NO_FRAMES ? 0.0
                       : bst_recorder_compresses(record)      ? 1.0
                                                              : 2.0;
    for (int plane = 0; plane < BST_PLANE_COUNT; plane++) {
        bool recorded = record->planes & UINT32_C(1) << plane;
        per_pixel += !recorded ? 0.0 : plane == BST_PLANE_SATURATION ? 1.0 : 4.0;
    }
    return bst_run_sensor_frames(scenario, sensor) * per_pixel * pixels_of(sensor);
}

/* Bytes of all frames and planes, without tables. */
static double frame_bytes(const bst_scenario *scenario) {
    const bst_observer_config *observers = scenario->observers.items;
    double bytes = 0.0;
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            bytes += bst_run_sensor_bytes(scenario, &sensors[s]);
        }
    }
    return bytes;
}

bst_status bst_run_check_space(bst_ctx *ctx, const bst_scenario *scenario, const char *out,
                               bool force) {
    double bytes = frame_bytes(scenario), free_bytes = (double)bst_run_free_bytes(out);
    if (!(bytes > WORTH_SAYING_BYTES)) {
        return BST_OK;
    }
    if (free_bytes < 0.0) { /* unknown */
        bst_log(ctx, BST_LOG_INFO, "%s: the frames will take about %.1f GB", out, bytes * 1e-9);
        return BST_OK;
    }
    if (bytes <= free_bytes) {
        bst_log(ctx, BST_LOG_INFO, "%s: the frames will take about %.1f GB of %.1f GB free", out,
                bytes * 1e-9, free_bytes * 1e-9);
        return BST_OK;
    }
    static const char advice[] =
        "shorten the run (--duration), set /record/frames=none, or "
        "choose another output folder";
    if (!force) {
        return bst_fail(ctx, BST_ERR_IO,
                        "%s: the frames will take about %.1f GB and %.1f GB are free there; %s; "
                        "--force starts all the same",
                        out, bytes * 1e-9, free_bytes * 1e-9, advice);
    }
    bst_log(ctx, BST_LOG_WARNING,
            "%s: the frames will take about %.1f GB and %.1f GB are free there; %s", out,
            bytes * 1e-9, free_bytes * 1e-9, advice);
    return BST_OK;
}
