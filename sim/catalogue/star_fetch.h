/* Downloads Tycho-2 from Debian's source package `tycho2` with a private apt configuration: the
 * system's sources with source packages enabled, state and cache in a folder of ours. It does not
 * change the system and needs no privilege. */
#ifndef BST_CATALOGUE_STAR_FETCH_H
#define BST_CATALOGUE_STAR_FETCH_H

#include <stdbool.h>
#include <stdio.h>

#include "boresight/status.h"
#include "sim/catalogue/star_import.h"

#define BST_STAR_TARBALL_NAME "tycho2_2.orig.tar.xz"
#define BST_STAR_TARBALL_BYTES 121142216LL
#define BST_STAR_TARBALL_SHA256 "b0d74bd4280e53f7cfc4b37ccb30a1cfbbc30131907dda81c706bbbab5632dfa"

/* Reads apt's sources in `etc_apt` ("/etc/apt": sources.list, sources.list.d/ *.list in one-line
 * and *.sources in deb822 format) and writes those that are Debian's to two files, with type
 * deb-src: one-line entries to `list`, deb822 stanzas to `sources`. *count is the number of entries
 * written. Debian's are those with component main that are signed by Debian's archive keyring, or
 * that name no key and have "debian" in their address; disabled entries are skipped. */
bst_status bst_star_fetch_sources(bst_ctx *ctx, const char *etc_apt, FILE *list, FILE *sources,
                                  int *count) BST_MUST_CHECK;

/* Compares a file with a SHA-256 in lower-case hex. BST_ERR_FORMAT
 * when it differs. */
bst_status bst_star_fetch_verify(bst_ctx *ctx, const char *path, const char *sha256) BST_MUST_CHECK;

/* Downloads the tarball into `folder` (created if necessary) and verifies it; an existing verified
 * tarball is kept. `path`: receives its path. */
bst_status bst_star_fetch_tarball(bst_ctx *ctx, const char *folder, bst_star_progress_fn progress,
                                  void *progress_user, char *path,
                                  size_t path_bytes) BST_MUST_CHECK;

/* Downloads, verifies and imports the complete catalogue to `out_path` (bst_stars_default_path).
 * The folder $XDG_CACHE_HOME/boresight/tycho2 or ~/.cache/boresight/tycho2 is removed after success
 * and kept after a failure for the next attempt. *already: out_path has the complete catalogue;
 * nothing is done. */
bst_status bst_star_fetch(bst_ctx *ctx, const char *out_path, bst_star_progress_fn progress,
                          void *progress_user, bool *already) BST_MUST_CHECK;

#endif
