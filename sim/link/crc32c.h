/* CRC-32C (Castagnoli): checksum of link packets. */
#ifndef BST_LINK_CRC32C_H
#define BST_LINK_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/* CRC-32C of `bytes` bytes: polynomial 0x1EDC6F41, reflected, initial value and final complement
 * 0xFFFFFFFF (RFC 3720, appendix B.4: "123456789" gives 0xE3069283). Uses SSE 4.2 if the processor
 * has it; the result is the same. */
uint32_t bst_crc32c(const void *data, size_t bytes);
/* CRC-32C by the portable table, for tests. */
uint32_t bst_crc32c_portable(const void *data, size_t bytes);

#endif
