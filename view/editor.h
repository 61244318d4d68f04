/* The scenario editor's side of the program: schema, files, checks. The page keeps the document;
 * every call here is complete in itself. Files are relative to the working folder of the program.
 */
#ifndef BST_VIEW_EDITOR_H
#define BST_VIEW_EDITOR_H

#include <cjson/cJSON.h>

#include "boresight/status.h"

/* Satellites that are found. */
enum { BST_VIEW_EDITOR_SATELLITES = 40 };

/* JSON Schema of scenarios, with the modules that come with Boresight.
 *
 * Errors:    BST_ERR_MEMORY
 * Ownership: free *out with cJSON_Delete; so with all functions here */
bst_status bst_view_editor_schema(bst_ctx *ctx, cJSON **out) BST_MUST_CHECK;

/* Lists scenario files of the working folder, of scenarios/ in it, and those that come with
 * Boresight: {folder, files: [{file, name, description, shipped}]}.
 *
 * Errors:    BST_ERR_IO: the working folder is gone */
bst_status bst_view_editor_list(bst_ctx *ctx, cJSON **out) BST_MUST_CHECK;

/* Opens a scenario file, with the files that it extends merged.
 *
 * Given:     body  {"file": PATH}
 * Returned:  *out  {file, text, document}: the path by which a file of the working folder extends
 *                  it; its text; its values, with paths that hold in the working folder
 * Errors:    BST_ERR_ARGUMENT: bad body; those of bst_json_load_described */
bst_status bst_view_editor_open(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

/* Checks a text as `boresight check` does, as a file of the working folder.
 *
 * Given:     body  {"text": TEXT}
 * Returned:  *out  {good, problems: [{kind, pointer, line, column, text}], figures}
 *                  kind: "error" or "warning"; pointer: JSON pointer or ""; line, column: from 1,
 *                  or 0; figures: of `boresight check --figures`, null for a wrong text
 * Errors:    BST_ERR_ARGUMENT: bad body; those of bst_view_child_run */
bst_status bst_view_editor_check(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

/* Margins of the control loops of a text: {loops}, of `boresight loop --json`, or null with the
 * reason in "problem". Given and errors as bst_view_editor_check. */
bst_status bst_view_editor_loops(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

/* Finds satellites of the element sets that come with Boresight.
 *
 * Given:     body  {"find": TEXT}: part of the name, or the beginning of the catalogue number
 * Returned:  *out  {total, satellites: [{name, norad, line1, line2}]}, the first
 *                  BST_VIEW_EDITOR_SATELLITES
 * Errors:    BST_ERR_ARGUMENT: bad body; those of bst_elements_load */
bst_status bst_view_editor_satellites(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

/* Writes a text to a file of the working folder, whole or not at all.
 *
 * Given:     body  {"file": NAME.json, "text": TEXT, "overwrite": true}
 * Returned:  *out  {file}: its path
 * Errors:    BST_ERR_ARGUMENT: bad body, a name that bst_view_is_scenario_name refuses, a text that
 * is no JSON object, a file that is there without overwrite, that the text extends, or that
 * bst_outputs_check refuses; BST_ERR_IO */
bst_status bst_view_editor_save(bst_ctx *ctx, const char *body, cJSON **out) BST_MUST_CHECK;

#endif
