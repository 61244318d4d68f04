#define _DEFAULT_SOURCE /* DT_DIR */
#include "sim/device/kernel_cache_check.h"

#include <dirent.h>
#include <elf.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/core/fnv.h"
#include "sim/core/folder.h"

enum { PATH_BYTES = 4096, DEEPEST = 8 };
static const char sums_name[] = "boresight.sums";

/* Callback for each file of a program; false ends the iteration. */
typedef bool (*visit_file)(void *user, const char *path, const char *below);

/* True if the file holds compiled kernel code. */
static bool is_code(const char *name) {
    const char *end = strrchr(name, '.');
    return end && (strcmp(end, ".so") == 0 || strcmp(end, ".bc") == 0);
}

/* Visits the files *.so and *.bc below a folder; `skip`: length of the path of the program's
 * folder. False: a visit returned false. */
static bool walk(const char *folder, size_t skip, int depth, visit_file visit, void *user) {
    DIR *dir = depth < DEEPEST ? opendir(folder) : NULL;
    bool go_on = true;
    for (struct dirent *entry; dir && go_on && (entry = readdir(dir)) != NULL;) {
        char path[PATH_BYTES];
        struct stat info;
        int n = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_name[0] == '.' || n < 0 || (size_t)n >= sizeof path ||
            lstat(path, &info) != 0) {
            continue;
        }
        if (S_ISDIR(info.st_mode)) {
            go_on = walk(path, skip, depth + 1, visit, user);
        } else if (is_code(entry->d_name)) {
            go_on = visit(user, path, path + skip);
        }
    }
    if (dir) {
        closedir(dir);
    }
    return go_on;
}

/* ------------------------------------------------------------------ one file */

/* Checksum of a file of the kernel cache. */
static bool sum_of(const char *path, uint64_t *sum) {
    char block[16384];
    int fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    ssize_t got = fd >= 0 ? 1 : -1;
    for (*sum = BST_FNV_START; got > 0;) {
        got = read(fd, block, sizeof block);
        *sum = got > 0 ? bst_fnv(*sum, block, (size_t)got) : *sum;
    }
    if (fd >= 0) {
        close(fd);
    }
    return got == 0;
}

/* Checks that the headers of an ELF file and everything they refer to are inside the file. */
static bool is_whole_elf(int fd, const Elf64_Ehdr *head, uint64_t bytes) {
    if (head->e_phentsize != sizeof(Elf64_Phdr) || head->e_phnum == 0 || head->e_phoff > bytes ||
        head->e_phnum * sizeof(Elf64_Phdr) > bytes - head->e_phoff || head->e_shoff > bytes ||
        (uint64_t)head->e_shnum * head->e_shentsize > bytes - head->e_shoff) {
        return false;
    }
    for (int i = 0; i < head->e_phnum; i++) {
        Elf64_Phdr part;
        off_t at = (off_t)(head->e_phoff + (uint64_t)i * sizeof part);
        if (pread(fd, &part, sizeof part, at) != (ssize_t)sizeof part || part.p_offset > bytes ||
            part.p_filesz > bytes - part.p_offset) {
            return false;
        }
    }
    return true;
}

/* Checks the structure of an ELF or LLVM bitcode file (32-bit words, with or without wrapper). */
static bool is_whole(const char *path, uint64_t bytes) {
    Elf64_Ehdr head = {.e_type = 0};
    int fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    ssize_t got = fd >= 0 ? pread(fd, &head, sizeof head, 0) : -1;
    bool good = false;
    if (got >= 4 && strcmp(strrchr(path, '.'), ".bc") == 0) {
        good = bytes % 4 == 0 &&
               (memcmp(&head, "BC\xC0\xDE", 4) == 0 || memcmp(&head, "\xDE\xC0\x17\x0B", 4) == 0);
    } else if (got == (ssize_t)sizeof head && memcmp(head.e_ident, ELFMAG, SELFMAG) == 0) {
        /* 32-bit objects are not checked */
        good = head.e_ident[EI_CLASS] != ELFCLASS64 || is_whole_elf(fd, &head, bytes);
    }
    if (fd >= 0) {
        close(fd);
    }
    return good;
}

/* ------------------------------------------------------------------ one program */

/* Recorded checksums of a program, as text; NULL: none. */
typedef struct judged {
    const char *sums;
    bool damaged;
} judged;

/* Line of a file in the checksums: "SIZE SECONDS NANOSECONDS SUM PATH". */
static const char *line_of(const char *sums, const char *below) {
    size_t length = strlen(below);
    for (const char *line = sums; line && *line; line = strchr(line, '\n')) {
        line += *line == '\n';
        size_t n = strcspn(line, "\n");
        if (n > length && line[n - length - 1] == ' ' &&
            strncmp(line + n - length, below, length) == 0) {
            return line;
        }
    }
    return NULL;
}

static bool judge(void *user, const char *path, const char *below) {
    judged *j = user;
    struct stat info;
    bool good = lstat(path, &info) == 0 && S_ISREG(info.st_mode) &&
                (info.st_uid == geteuid() || info.st_uid == 0) && !(info.st_mode & S_IWOTH);
    const char *line = good && j->sums ? line_of(j->sums, below) : NULL;
    long long size, seconds, nanoseconds;
    uint64_t sum, now;
    if (line && sscanf(line, "%lld %lld %lld %" SCNx64, &size, &seconds, &nanoseconds, &sum) == 4) {
        bool touched = size != (long long)info.st_size ||
                       seconds != (long long)info.st_mtim.tv_sec ||
                       nanoseconds != (long long)info.st_mtim.tv_nsec;
        good = !touched || (size == (long long)info.st_size && sum_of(path, &now) && now == sum);
    } else if (good) {
        good = is_whole(path, (uint64_t)info.st_size);
    }
    j->damaged = !good;
    return good;
}

static void remove_below(const char *folder, int depth) {
    DIR *dir = depth < DEEPEST + 2 ? opendir(folder) : NULL;
    for (struct dirent *entry; dir && (entry = readdir(dir)) != NULL;) {
        char path[PATH_BYTES];
        int n = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        struct stat info;
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0 || n < 0 ||
            (size_t)n >= sizeof path || lstat(path, &info) != 0) {
            continue;
        }
        if (S_ISDIR(info.st_mode)) {
            remove_below(path, depth + 1);
        } else {
            unlink(path);
        }
    }
    if (dir) {
        closedir(dir);
    }
    rmdir(folder);
}

static char *read_sums(const char *program) {
    char path[PATH_BYTES];
    struct stat info;
    snprintf(path, sizeof path, "%.3900s/%s", program, sums_name);
    int fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    char *text = fd >= 0 && fstat(fd, &info) == 0 && info.st_size < 1 << 20
                     ? calloc((size_t)info.st_size + 1, 1)
                     : NULL;
    if (text && read(fd, text, (size_t)info.st_size) != (ssize_t)info.st_size) {
        free(text);
        text = NULL;
    }
    if (fd >= 0) {
        close(fd);
    }
    return text;
}

static bool write_line(void *user, const char *path, const char *below) {
    struct stat info;
    uint64_t sum;
    if (lstat(path, &info) == 0 && S_ISREG(info.st_mode) && sum_of(path, &sum)) {
        fprintf(user, "%lld %lld %lld %016" PRIx64 " %s\n", (long long)info.st_size,
                (long long)info.st_mtim.tv_sec, (long long)info.st_mtim.tv_nsec, sum, below);
    }
    return true;
}

static void write_sums(const char *program) {
    char path[PATH_BYTES], draft[PATH_BYTES + 64];
    bst_ctx quiet = {0};
    int fd;
    snprintf(path, sizeof path, "%.3900s/%s", program, sums_name);
    if (bst_draft_make(&quiet, path, draft, sizeof draft, &fd) != BST_OK) {
        return; /* if the cache is read-only, only the structure is checked */
    }
    FILE *file = fdopen(fd, "w");
    if (file) {
        walk(program, strlen(program) + 1, 0, write_line, file);
    } else {
        close(fd);
    }
    if (!file || fclose(file) != 0 || rename(draft, path) != 0) {
        unlink(draft);
    }
}

/* ------------------------------------------------------------------ all programs */

typedef struct sweep {
    time_t since; /* recording; 0: repairing or linking */
    int removed;
    const char *to; /* linking: the other cache */
    size_t root;    /* linking: length of the path of this cache */
} sweep;

/* Links a file of a program into the other cache. A file there stays. */
static bool link_file(void *user, const char *path, const char *below) {
    const char *to = user;
    char other[PATH_BYTES + 1];
    bst_ctx quiet = {0};
    int n = snprintf(other, sizeof other, "%s/%s", to, below);
    return n < 0 || (size_t)n >= sizeof other ||
           (bst_folder_make_above(&quiet, other) == BST_OK &&
            (link(path, other) == 0 || errno == EEXIST));
}

/* Repairing or linking: removes a damaged program, or links one that is whole. */
static void check(sweep *s, const char *program) {
    char *sums = read_sums(program);
    judged j = {.sums = sums};
    walk(program, strlen(program) + 1, 0, judge, &j);
    free(sums);
    if (s->to) {
        if (!j.damaged) {
            walk(program, s->root + 1, 0, link_file, (void *)(uintptr_t)s->to);
        }
    } else if (j.damaged) {
        remove_below(program, 0);
        s->removed++;
    }
}

/* Checks a program folder of the kernel cache, or records its checksums. */
static void look_at(sweep *s, const char *program) {
    struct stat info;
    if (s->since == 0) {
        check(s, program);
    } else if (stat(program, &info) == 0 && info.st_mtim.tv_sec >= s->since) {
        write_sums(program);
    }
}

/* Visits ROOT/XX/PROGRAM; XX: two letters. */
static void each_program(const char *folder, int depth, sweep *s) {
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && (entry = readdir(dir)) != NULL;) {
        char path[PATH_BYTES];
        int n = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_name[0] == '.' || (depth == 0 && strlen(entry->d_name) != 2) || n < 0 ||
            (size_t)n >= sizeof path || (entry->d_type != DT_DIR && entry->d_type != DT_UNKNOWN)) {
            continue;
        }
        if (depth == 0) {
            each_program(path, 1, s);
        } else {
            look_at(s, path);
        }
    }
    if (dir) {
        closedir(dir);
    }
}

int bst_kernel_cache_repair(const char *root) {
    sweep s = {.since = 0};
    each_program(root, 0, &s);
    return s.removed;
}

void bst_kernel_cache_note(const char *root, time_t since) {
    sweep s = {.since = since > 0 ? since : 1};
    each_program(root, 0, &s);
}

void bst_kernel_cache_link(const char *root, const char *to) {
    sweep s = {.to = to, .root = strlen(root)};
    each_program(root, 0, &s);
}
