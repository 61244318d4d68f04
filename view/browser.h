/* Opens a page in the user's browser. */
#ifndef BST_VIEW_BROWSER_H
#define BST_VIEW_BROWSER_H

/* Opens an address by the desktop's program for it (xdg-open), if there is a display. The address
 * is printed anyway: nothing happens where there is no display or no such program.
 *
 * Notes:     while the program starts, other users of the machine can read the address in the list
 *            of processes. */
void bst_view_open_browser(const char *url);

#endif
