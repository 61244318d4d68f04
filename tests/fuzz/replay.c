/* Runs a fuzzer's function on every file of the folders given, without libFuzzer: what once went
 * wrong stays right. Prints each name before its run, and fails when there is no file. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

static int replay(const char *path) {
    FILE *file = fopen(path, "rb");
    long bytes = -1;
    if (file && fseek(file, 0, SEEK_END) == 0) {
        bytes = ftell(file);
        rewind(file);
    }
    /* of exact size, so that the address sanitizer sees a read beyond the end */
    uint8_t *data = bytes >= 0 ? malloc((size_t)bytes + (bytes == 0)) : NULL;
    int bad = !data || fread(data, 1, (size_t)bytes, file) != (size_t)bytes;
    if (file) {
        fclose(file);
    }
    if (bad) {
        fprintf(stderr, "%s: cannot be read\n", path);
    } else {
        printf("%s, %ld bytes\n", path, bytes);
        fflush(stdout);
        LLVMFuzzerTestOneInput(data, (size_t)bytes);
    }
    free(data);
    return bad;
}

int main(int argc, char **argv) {
    int files = 0, failures = 0;
    for (int i = 1; i < argc; i++) {
        DIR *folder = opendir(argv[i]);
        for (struct dirent *entry; folder && (entry = readdir(folder));) {
            char path[4096];
            if (entry->d_name[0] != '.') {
                snprintf(path, sizeof path, "%s/%s", argv[i], entry->d_name);
                failures += replay(path);
                files++;
            }
        }
        if (folder) {
            closedir(folder);
        }
    }
    if (files == 0) {
        fprintf(stderr, "no file to run\n");
    }
    return files == 0 || failures > 0;
}
