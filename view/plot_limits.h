/* Limits that are drawn in panels of plots. */
#ifndef BST_VIEW_PLOT_LIMITS_H
#define BST_VIEW_PLOT_LIMITS_H

#include "view/recorded_run_internal.h"

/* Adds the speed limits of the wheels to their panel: [{line, low, high}], rpm. */
void bst_view_add_wheel_limits(const bst_view_run *run, const bst_view_sensor *s, cJSON *panel);
/* Adds the stops of the mount's axes to its panel: [{line, low, high}], deg. A mount whose type the
 * viewer does not know has none. */
void bst_view_add_stops(const bst_view_run *run, const bst_view_sensor *s, cJSON *panel);

#endif
