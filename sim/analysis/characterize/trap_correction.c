#include "sim/analysis/characterize/trap_correction.h"

#include <math.h>
#include <string.h>

enum { TURNS = 3 };
static const float LEAST_E = 0.01F;

void bst_trap_pass_line(const bst_detector_traps_config *t, int first, int count, int64_t step,
                        float *q) {
    float held[BST_TRAP_SPECIES] = {0}, density[BST_TRAP_SPECIES], release[BST_TRAP_SPECIES];
    int kinds = 0;
    for (int k = 0; k < BST_TRAP_SPECIES; k++) {
        if (t->traps_per_px[k] > 0.0) {
            density[kinds] = (float)(t->traps_per_px[k] / pow(t->reference_e, t->fill_exponent));
            release[kinds++] = (float)-expm1(-1.0 / t->release_px[k]);
        }
    }
    float exponent = (float)t->fill_exponent - 1.0F;
    for (int i = 0; i < count; i++, q += step) {
        for (int k = 0; k < kinds; k++) {
            if (*q > LEAST_E) {
                float g = (float)(first + i > 1 ? first + i : 1) * density[k] * powf(*q, exponent);
                float caught = fmaxf((g * *q - held[k]) / (g + 1.0F), 0.0F);
                held[k] += caught;
                *q -= caught;
            }
            float released = held[k] * release[k];
            held[k] -= released;
            *q += released;
        }
    }
}

void bst_trap_model_pass(const bst_trap_model *m, int width, int height, float *image) {
    int64_t down = m->top ? -(int64_t)width : width;
    float *first = m->top ? image + (int64_t)width * (height - 1) : image;
    for (int x = 0; x < width && bst_detector_has_traps(&m->parallel); x++) {
        bst_trap_pass_line(&m->parallel, 1, height, down, first + x);
    }
    for (int y = 0; y < height && bst_detector_has_traps(&m->serial); y++) {
        float *row = image + (int64_t)width * y;
        bst_trap_pass_line(&m->serial, 1, width, m->right ? -1 : 1,
                           m->right ? row + width - 1 : row);
    }
}

void bst_trap_model_undo(const bst_trap_model *m, int width, int height, float *image,
                         float *work) {
    size_t pixels = (size_t)width * (size_t)height;
    float *data = work, *moved = work + pixels;
    memcpy(data, image, pixels * sizeof *data);
    for (int turn = 0; turn < TURNS; turn++) {
        memcpy(moved, image, pixels * sizeof *moved);
        bst_trap_model_pass(m, width, height, moved);
        for (size_t i = 0; i < pixels; i++) {
            image[i] += data[i] - moved[i];
        }
    }
}
