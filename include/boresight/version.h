/* Version of the running library. */
#ifndef BORESIGHT_VERSION_H
#define BORESIGHT_VERSION_H

#pragma GCC visibility push(default)

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the library, "major.minor.patch" by semantic versioning; never NULL. */
const char *bst_version(void);
/* Revision of the sources as `git describe` names it; "" if they were not built in a git tree. */
const char *bst_version_git_revision(void);

#ifdef __cplusplus
}
#endif

#pragma GCC visibility pop

#endif
