/* Build tool: writes text files as C strings.
 *
 * embed OUT.c OUT.h FILE...      for each FILE "a/b_c.cl" it defines
 *     `const bst_device_kernel_source bst_kernel_b_c` (see sim/device/device.h) with the file's
 *     name, text and 64-bit FNV-1a hash.
 * embed --page OUT.c FILE...     defines `bst_view_page_files` (see view/page_files.h). */
#include <ctype.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *base_name(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* Writes a byte of a string; a line of the file is a line of the string. */
static void put(FILE *source, int c) {
    if (c == '\n') {
        fprintf(source, "\\n\"\n    \"");
    } else if (c == '"' || c == '\\') {
        fprintf(source, "\\%c", c);
    } else if (c >= 32 && c < 127) {
        fputc(c, source);
    } else {
        fprintf(source, "\\%03o", (unsigned)c);
    }
}

static int embed(FILE *source, FILE *header, const char *path) {
    FILE *in = fopen(path, "rb");
    if (!in) {
        perror(path);
        return 1;
    }
    const char *name = base_name(path);
    char symbol[256];
    size_t n = 0;
    for (; name[n] && name[n] != '.' && n < sizeof symbol - 1; n++) {
        symbol[n] = isalnum((unsigned char)name[n]) ? name[n] : '_';
    }
    symbol[n] = '\0';
    uint64_t hash = 0xCBF29CE484222325u;
    fprintf(source, "\nconst bst_device_kernel_source bst_kernel_%s = {\n    \"%s\",\n    \"",
            symbol, name);
    for (int c; (c = fgetc(in)) != EOF;) {
        hash = (hash ^ (unsigned char)c) * 0x100000001B3u;
        put(source, c);
    }
    fclose(in);
    fprintf(source, "\",\n    0x%08xu,\n    0x%08xu};\n", (unsigned)(hash >> 32), (unsigned)hash);
    fprintf(header, "extern const bst_device_kernel_source bst_kernel_%s;\n", symbol);
    return 0;
}

/* Writes the list of a page's files. */
static int embed_page(const char *out, int count, char **paths) {
    FILE *source = fopen(out, "wb");
    if (!source) {
        perror(out);
        return 1;
    }
    fprintf(source,
            "#include \"view/page_files.h\"\n\n"
            "const bst_view_page_file bst_view_page_files[] = {\n");
    for (int i = 0; i < count; i++) {
        FILE *in = fopen(paths[i], "rb");
        size_t bytes = 0;
        if (!in) {
            perror(paths[i]);
            fclose(source);
            return 1;
        }
        fprintf(source, "    {\"%s\",\n    \"", base_name(paths[i]));
        for (int c; (c = fgetc(in)) != EOF; bytes++) {
            put(source, c);
        }
        fclose(in);
        fprintf(source, "\", %zu},\n", bytes);
    }
    fprintf(source, "    {NULL, NULL, 0}};\n");
    return fclose(source) != 0;
}

int main(int argc, char **argv) {
    if (argc > 3 && strcmp(argv[1], "--page") == 0) {
        return embed_page(argv[2], argc - 3, argv + 3);
    }
    if (argc < 4) {
        fprintf(stderr, "usage: embed OUT.c OUT.h FILE... | --page OUT.c FILE...\n");
        return 2;
    }
    FILE *source = fopen(argv[1], "wb"), *header = fopen(argv[2], "wb");
    if (!source || !header) {
        perror(source ? argv[2] : argv[1]);
        return 1;
    }
    fprintf(source, "#include \"%s\"\n", base_name(argv[2]));
    fprintf(header, "#pragma once\n#include \"sim/device/device.h\"\n");
    int failed = 0;
    for (int i = 3; i < argc; i++) {
        failed |= embed(source, header, argv[i]);
    }
    failed |= fclose(source) != 0;
    failed |= fclose(header) != 0;
    return failed ? 1 : 0;
}
