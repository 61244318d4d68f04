#include "sim/app/run_space.h"

#include <math.h>

#include "sim/io/run_store.h"

void bst_run_warn_of_space(bst_ctx *ctx, const bst_scenario *scenario, const char *out) {
    const bst_observer_config *observers = scenario->observers.items;
    const bst_record_config *record = &scenario->record;
    /* Rice takes 8-bit noise to about half */
    double bytes = 0.0, per_pixel = record->frames == BST_RECORD_NO_FRAMES ? 0.0
                                    : record->compression                  ? 1.0
                                                                           : 2.0;
    for (uint32_t planes = record->planes; planes; planes &= planes - 1) {
        per_pixel += planes == UINT32_C(1) << BST_PLANE_SATURATION ? 1.0 : 4.0;
    }
    for (int i = 0; i < scenario->observers.count; i++) {
        const bst_sensor_config *sensors = observers[i].sensors.items;
        for (int s = 0; s < observers[i].sensors.count; s++) {
            const bst_exposure_config *e = &sensors[s].exposure;
            double frames = floor((scenario->duration_s - e->first_s) / e->period_s);
            bytes += fmax(frames, 0.0) * per_pixel * (double)sensors[s].camera.width_px *
                     (double)sensors[s].camera.height_px;
        }
    }
    double free_bytes = (double)bst_run_free_bytes(out);
    if (free_bytes >= 0.0 && bytes > free_bytes) {
        bst_log(ctx, BST_LOG_WARNING,
                "%s: the frames will take about %.1f GB and %.1f GB are free there; shorten the "
                "run (--duration), set /record/compression=rice or /record/frames=none, or choose "
                "another output folder",
                out, bytes * 1e-9, free_bytes * 1e-9);
    }
}

/* Steps the simulation and writes what belongs into the folder; the folder is complete when this
 * returns BST_OK. An interrupted run is closed properly and keeps its .partial name. */
