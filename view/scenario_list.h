/* Scenario files of a folder, as the start page and the editor offer them. */
#ifndef BST_VIEW_SCENARIO_LIST_H
#define BST_VIEW_SCENARIO_LIST_H

#include <cjson/cJSON.h>
#include <stdbool.h>

/* Scenario files that are listed. */
enum { BST_VIEW_SCENARIOS = 400 };

/* True if a word can be the name of a scenario in a folder: a file name that ends with .json and is
 * no option of a command. */
bool bst_view_is_scenario_name(const char *name);

/* Adds the scenarios of a folder to `list`: the main scenario first, then by name. A node is {file,
 * name, description, shipped}; schemas and other JSON files are left out.
 *
 * Given:     prefix   before the names of files in "file"
 *            shipped  stands in the nodes */
void bst_view_scenarios_add(const char *folder, const char *prefix, bool shipped, cJSON *list);

#endif
