/* Objects that no detection has shown: the Poisson part of BST_MTT_PMB, with one mean number for
 * the whole field (Williams, IEEE Trans. AES 51, 2015, section II.B: survivors thinned by the
 * probability of a missed detection, plus births). */
#include <assert.h>
#include <math.h>

#include "tracker/mtt/multitarget_internal.h"

/* Mean number of objects in a field of sky that has not been observed: a design choice. */
static const double UNOBSERVED = 0.3;

void bst_mtt_predict_undetected(bst_mtt *m, const bst_mtt_frame *frame) {
    assert(m && frame && m->params.field_sr > 0.0);
    const bst_vec3 none = {0, 0, 0};
    bool known = bst_vec3_norm(frame->boresight) > 0.0 && bst_vec3_norm(m->boresight) > 0.0;
    double moved = known ? bst_vec3_angle(m->boresight, frame->boresight) : 0.0;
    double entering = m->params.max_rate_radps * fmax(frame->seconds - m->seconds, 0.0);
    double fresh = m->started ? fmin((moved + entering) / sqrt(m->params.field_sr), 1.0) : 1.0;
    m->undetected += fresh * (UNOBSERVED - m->undetected);
    m->boresight = bst_vec3_norm(frame->boresight) > 0.0 ? frame->boresight : none;
}

void bst_mtt_observe_undetected(bst_mtt *m, bool partial) {
    m->now.undetected = m->undetected;
    m->undetected *= partial ? 1.0 : 1.0 - m->params.detection_probability;
}
