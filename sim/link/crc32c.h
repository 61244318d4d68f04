/* CRC-32C (Castagnoli): the checksum of the link's packets. */
#ifndef BST_LINK_CRC32C_H
#define BST_LINK_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/* The checksum of `bytes` bytes: polynomial 0x1EDC6F41, reflected, initial value and final
 * complement 0xFFFFFFFF (RFC 3720, appendix B.4: "123456789" gives 0xE3069283). The same value by
 * any route; three streams of the processor's instruction where it has one (SSE 4.2). */
uint32_t bst_crc32c(const void *data, size_t bytes);
/* The same by the table alone, for tests. */
uint32_t bst_crc32c_portable(const void *data, size_t bytes);

#endif
