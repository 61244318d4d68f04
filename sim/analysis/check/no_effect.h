/* Rule `no_effect`: keys of a scenario that another of its keys leaves without effect. */
#ifndef BST_ANALYSIS_CHECK_NO_EFFECT_H
#define BST_ANALYSIS_CHECK_NO_EFFECT_H

#include "sim/engine/scenario/scenario.h"

/* What a governing key must be. */
typedef enum bst_no_effect_test {
    BST_WHEN_NONE = 0, /* there is no condition */
    BST_WHEN_OFF,      /* false, 0, all numbers 0, an empty text or list, null */
    BST_WHEN_ON,       /* anything else */
    BST_WHEN_IS,       /* one of the words (or whole numbers) */
    BST_WHEN_IS_NOT,   /* none of them */
    BST_WHEN_LACKS,    /* a list without the word */
} bst_no_effect_test;

enum { BST_NO_EFFECT_CONDITIONS = 3 };

/* Keys that have no effect while all conditions hold. */
typedef struct bst_no_effect {
    const char *where; /* JSON pointers of the object with all of these keys, separated by spaces;
                          "*": each item of a list */
    const char *keys;  /* JSON pointers from there without the first "/", separated by spaces */
    struct {
        const char *key; /* a pointer as in `keys` */
        bst_no_effect_test test;
        const char *words; /* separated by spaces */
    } when[BST_NO_EFFECT_CONDITIONS];
} bst_no_effect;

extern const bst_no_effect bst_no_effect_table[]; /* ends with where NULL */

/* Warns of each key that the scenario's file, a file that it extends or an override gives, with
 * another value than the default, while its governing keys leave it without effect:
 * "FILE: /path has no effect: KEY is VALUE". Of a key that many observers or objects have, three
 * places are reported, and the number of the others. Governing keys that /changes changes count as
 * if they allowed it. */
void bst_no_effect_warn(bst_ctx *ctx, const bst_scenario *scenario);

#endif
