/* Routes of the panels "Editor" and "Space". */
#ifndef BST_VIEW_PANEL_ROUTES_H
#define BST_VIEW_PANEL_ROUTES_H

#include "view/routes.h"

/* Ends with the path NULL. */
extern const bst_view_route bst_view_panel_routes[];

#endif
