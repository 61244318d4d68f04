#include "sim/device/build_log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static long lines_in(const char *text) {
    long lines = 0;
    for (; (text = strchr(text, '\n')) != NULL; text++) {
        lines++;
    }
    return lines;
}

/* Source that holds line `line` of the program, -1: none; *within: its line there. */
static int source_at(const char *const *texts, int text_count, long line, long *within) {
    long first = 1;
    for (int t = 0; t < text_count; t++) {
        long lines = lines_in(texts[t]);
        if (line < first + lines) {
            *within = line - first + 1;
            return t >= 2 && t % 2 == 0 ? t / 2 - 1 : -1;
        }
        first += lines;
    }
    return -1;
}

char *bst_build_log_with_names(const char *log, const char *const *texts, int text_count,
                               const bst_device_kernel_source *const *sources) {
    static const char mark[] = "<kernel>:";
    char *out = NULL;
    size_t bytes = 0;
    FILE *stream = open_memstream(&out, &bytes);
    if (!stream) {
        return NULL;
    }
    for (const char *at; (at = strstr(log, mark)) != NULL;) {
        char *end;
        long within, line = strtol(at + strlen(mark), &end, 10);
        int n = source_at(texts, text_count, line, &within);
        fwrite(log, 1, (size_t)(at - log), stream);
        if (n >= 0) {
            fprintf(stream, "%s:%ld", sources[n]->name, within);
        } else {
            fwrite(at, 1, (size_t)(end - at), stream);
        }
        log = end;
    }
    fputs(log, stream);
    if (fclose(stream) != 0) {
        free(out);
        return NULL;
    }
    return out;
}
