/* Length of a library as its headers state it, by which a file that is cut short is refused. */
#ifndef BST_ENGINE_SCENARIO_ELF_EXTENT_H
#define BST_ENGINE_SCENARIO_ELF_EXTENT_H

#include "boresight/status.h"

/* Checks that a file has all bytes that the dynamic linker maps: where the file ends before, the
 * process ends by SIGBUS.
 *
 * Given:     path  file; one that is no ELF of this machine's word and byte order passes, as the
 *                  dynamic linker refuses it
 * Errors:    BST_ERR_IO: it cannot be read, or is cut short; the message names the bytes
 * Source:    System V ABI, chapter 4 (ELF header) and 5 (program header): segments PT_LOAD */
bst_status bst_elf_check_extent(bst_ctx *ctx, const char *path) BST_MUST_CHECK;

#endif
