/* The version of the library that is running. */
#ifndef BORESIGHT_VERSION_H
#define BORESIGHT_VERSION_H

#pragma GCC visibility push(default)

#ifdef __cplusplus
extern "C" {
#endif

/* "0.1.0": major, minor and patch by semantic versioning. Never NULL. */
const char *bst_version(void);
/* The revision of the sources as `git describe` names it; "" when they were no git tree. */
const char *bst_version_git_revision(void);

#ifdef __cplusplus
}
#endif

#pragma GCC visibility pop

#endif
