#include "imgproc/cv/components.h"

#include <exception>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

struct bst_cv_components {
    cv::Mat labels, stats, centroids;
    int max_width, max_height;
};

extern "C" bst_status bst_cv_components_create(bst_ctx *ctx, int max_width, int max_height,
                                               bst_cv_components **out) noexcept {
    *out = nullptr;
    try {
        bst_cv_components *c = new bst_cv_components;
        c->max_width = max_width;
        c->max_height = max_height;
        *out = c;
        return BST_OK;
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_MEMORY, "OpenCV: %s", e.what());
    }
}

extern "C" void bst_cv_components_free(bst_cv_components *components) noexcept {
    delete components;
}

extern "C" bst_status bst_cv_components_label(bst_ctx *ctx, bst_cv_components *components,
                                              const uint8_t *mask, int width, int height,
                                              const int32_t **labels, int *stride,
                                              int *count) noexcept {
    if (width < 1 || height < 1 || width > components->max_width ||
        height > components->max_height) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "a mask of %d x %d does not fit a work space of %d x %d", width, height,
                        components->max_width, components->max_height);
    }
    try {
        const cv::Mat image(height, width, CV_8UC1, const_cast<uint8_t *>(mask));
        *count = cv::connectedComponentsWithStats(image, components->labels, components->stats,
                                                  components->centroids, 8, CV_32S);
        *labels = components->labels.ptr<int32_t>();
        *stride = static_cast<int>(components->labels.step1());
        return BST_OK;
    } catch (const std::bad_alloc &) {
        return bst_fail(ctx, BST_ERR_MEMORY, "OpenCV: out of memory in connected components");
    } catch (const std::exception &e) {
        return bst_fail(ctx, BST_ERR_STATE, "OpenCV: %s", e.what());
    } catch (...) {
        return bst_fail(ctx, BST_ERR_STATE, "OpenCV: unknown exception in connected components");
    }
}

extern "C" bst_cv_box bst_cv_components_box(const bst_cv_components *components,
                                            int label) noexcept {
    const int32_t *row = components->stats.ptr<int32_t>(label);
    return bst_cv_box{row[cv::CC_STAT_LEFT], row[cv::CC_STAT_TOP], row[cv::CC_STAT_WIDTH],
                      row[cv::CC_STAT_HEIGHT], row[cv::CC_STAT_AREA]};
}
