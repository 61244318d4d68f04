#include "sim/study_kinds/study_kinds.h"

const bst_study_kind *bst_app_study_kind(int kind) {
    return kind == BST_STUDY_PD      ? &bst_app_study_pd
           : kind == BST_STUDY_CUBES ? &bst_app_study_cubes
                                     : &bst_app_study_loop;
}
