#include "sim/study_kinds/study_kinds.h"

const bst_study_kind *bst_study_kind_of(int kind) {
    return kind == BST_STUDY_PD      ? &bst_study_pd_kind
           : kind == BST_STUDY_CUBES ? &bst_study_cubes_kind
                                     : &bst_study_loop_kind;
}
