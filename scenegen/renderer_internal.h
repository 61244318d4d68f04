/* State of the renderer, for its own files. */
#ifndef BST_SCENEGEN_RENDERER_INTERNAL_H
#define BST_SCENEGEN_RENDERER_INTERNAL_H

#include "scenegen/detector/detector.h"
#include "scenegen/detector/readout.h"
#include "scenegen/device_array.h"
#include "scenegen/fourier/fourier_render.h"
#include "scenegen/frame_pool.h"
#include "scenegen/ramp_intervals.h"
#include "scenegen/renderer.h"
#include "scenegen/saturation_count.h"
#include "scenegen/scene_boxes.h"
#include "scenegen/scene_kernels.h"
#include "scenegen/scene_plan.h"
#include "scenegen/smear/rolling_shutter.h"
#include "scenegen/smear/smear.h"
#include "scenegen/upload_ring.h"

struct bst_renderer {
    bst_camera camera;
    bst_renderer_options options;
    int taps, law_degree; /* of the stamps */
    cl_context context;
    cl_command_queue queue;
    bst_device *device;
    bst_kernel_frame_params fixed; /* parameters of the kernels that are the camera's */
    char tile_options[256];        /* build options of the tile kernels */
    cl_kernel frame_kernel, expected_kernel;
    bst_scene_form form; /* of the tile kernels */
    bst_scene_boxes boxes;
    bst_psf *psf;
    bst_fourier_render *fourier; /* NULL: Gaussian PSF, light from stamps */
    bst_smear *smear;
    bst_parallel *planners; /* for the planning, if the device leaves the processor idle */
    bst_error_budget *budget;
    bst_detector *detector;
    bst_readout *readout;
    bst_rolling *rolling;          /* NULL: all rows are exposed simultaneously */
    bst_ramp_intervals *intervals; /* NULL: one read at the end of the exposure */
    bst_frame_pool *pool;
    cl_mem law; /* profile law of the stamps */
    bst_upload_ring *stage;
    cl_mem sources, shares, table; /* of the current frame; lent */
    bst_device_array expected;
    bst_scene_plan plan;   /* of the latest request, or of its latest band */
    double *rolled_peak_e; /* of all sources, with the bands of a rolling shutter */
    int rolled_capacity, set;
    bst_saturation_count saturation;
    bool rolled;            /* the latest request had a rolling shutter */
    bool summed;            /* stats are those of several images */
    bool map;               /* the background differs between pixels */
    uint64_t most_bytes;    /* largest buffer of the device */
    double tolerance_sigma; /* without the share of the rolling shutter's bands */
    bst_render_stats stats;
};

/* True if the errors of the chosen options can be predicted. */
bool bst_renderer_is_predictable(const bst_renderer *renderer);

#endif
