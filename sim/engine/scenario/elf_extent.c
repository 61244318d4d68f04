#include "sim/engine/scenario/elf_extent.h"

#include <elf.h>
#include <link.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static const union {
    uint16_t number;
    unsigned char bytes[2];
} byte_order = {.number = 1};

/* True if a file begins as an ELF of this machine's word and byte order. */
static bool is_native(const ElfW(Ehdr) * header) {
    return memcmp(header->e_ident, ELFMAG, SELFMAG) == 0 &&
           header->e_ident[EI_CLASS] == (sizeof(void *) == 8 ? ELFCLASS64 : ELFCLASS32) &&
           header->e_ident[EI_DATA] == (byte_order.bytes[0] ? ELFDATA2LSB : ELFDATA2MSB) &&
           header->e_phentsize == sizeof(ElfW(Phdr));
}

/* Bytes that a file must have: those of its header, its program headers and its segments, so far
 * as the file holds them. */
static uint64_t needed_bytes(FILE *file) {
    ElfW(Ehdr) header;
    size_t got = fread(&header, 1, sizeof header, file);
    if (got < sizeof header) {
        bool begun = got >= SELFMAG && memcmp(header.e_ident, ELFMAG, SELFMAG) == 0;
        return begun ? sizeof header : 0;
    }
    if (!is_native(&header)) {
        return 0;
    }
    uint64_t most = header.e_phoff + (uint64_t)header.e_phnum * sizeof(ElfW(Phdr));
    if (header.e_phoff > INT32_MAX || fseek(file, (long)header.e_phoff, SEEK_SET) != 0) {
        return most;
    }
    for (int i = 0; i < header.e_phnum; i++) {
        ElfW(Phdr) part;
        if (fread(&part, sizeof part, 1, file) != 1) {
            return most;
        }
        uint64_t end = part.p_offset + part.p_filesz;
        end = end < part.p_offset ? UINT64_MAX : end;
        most = part.p_type == PT_LOAD && part.p_filesz > 0 && end > most ? end : most;
    }
    return most;
}

bst_status bst_elf_check_extent(bst_ctx *ctx, const char *path) {
    FILE *file = fopen(path, "rb");
    struct stat about;
    if (!file || fstat(fileno(file), &about) != 0) {
        if (file) {
            fclose(file);
        }
        return bst_fail(ctx, BST_ERR_IO, "%s: cannot be read", path);
    }
    uint64_t needed = needed_bytes(file);
    fclose(file);
    if (needed > (uint64_t)about.st_size) {
        return bst_fail(ctx, BST_ERR_IO,
                        "%s is cut short: it has %llu bytes, its headers need %llu; build or copy "
                        "it again",
                        path, (unsigned long long)about.st_size, (unsigned long long)needed);
    }
    return BST_OK;
}
