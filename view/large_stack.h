/* Work with a stack of the usual size: the HTTP library gives its threads 100 KB, which the
 * recursion over nested JSON exceeds. */
#ifndef BST_VIEW_LARGE_STACK_H
#define BST_VIEW_LARGE_STACK_H

#include <stdbool.h>

/* Calls a function in a thread of its own, with a stack of 8 MiB, and waits for its end.
 *
 * Returned:  false: there is no such thread; the function was not called
 * Notes:     some 30 microseconds */
bool bst_view_call_with_stack(void (*work)(void *user), void *user);

#endif
