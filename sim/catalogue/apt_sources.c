/* Converts apt's sources, in both formats, to deb-src entries of Debian's own repositories. */
#include <ctype.h>
#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "sim/catalogue/star_fetch.h"

/* Checks whether `word` is one of the blank-separated words of `text`. */
static bool has_word(const char *text, const char *word) {
    size_t length = strlen(word);
    for (const char *p = text; *p;) {
        p += strspn(p, " \t\n");
        size_t n = strcspn(p, " \t\n");
        if (n == length && strncmp(p, word, n) == 0) {
            return true;
        }
        p += n;
    }
    return false;
}

/* Identifies Debian's own repositories: others name their key; Debian's may name none. */
static bool is_debians(const char *uris, const char *components, const char *signed_by) {
    if (!has_word(components, "main")) {
        return false;
    }
    if (strstr(signed_by, "debian-archive")) {
        return true;
    }
    return signed_by[strspn(signed_by, " \t\n")] == '\0' && strstr(uris, "debian") != NULL;
}

/* Converts a one-line entry "deb [options] uri suite component...". */
static void convert_line(char *line, FILE *out, int *count) {
    line[strcspn(line, "#\r\n")] = '\0';
    char *p = line + strspn(line, " \t");
    size_t n = strcspn(p, " \t");
    bool is_deb =
        (n == 3 && strncmp(p, "deb", 3) == 0) || (n == 7 && strncmp(p, "deb-src", 7) == 0);
    if (!is_deb) {
        return;
    }
    char *entry = p + n;
    char *uri = entry + strspn(entry, " \t");
    char signed_by[512] = "";
    if (*uri == '[') {
        char *close = strchr(uri, ']');
        if (!close) {
            return;
        }
        char *key = strstr(uri, "signed-by=");
        if (key && key < close) {
            key += strlen("signed-by=");
            snprintf(signed_by, sizeof signed_by, "%.*s", (int)strcspn(key, " \t]"), key);
        }
        uri = close + 1 + strspn(close + 1, " \t");
    }
    size_t uri_length = strcspn(uri, " \t");
    char *suite = uri + uri_length + strspn(uri + uri_length, " \t");
    char *components = suite + strcspn(suite, " \t");
    char address[1024];
    snprintf(address, sizeof address, "%.*s", (int)uri_length, uri);
    if (is_debians(address, components, signed_by)) {
        fprintf(out, "deb-src%s\n", entry);
        (*count)++;
    }
}

static void convert_list(FILE *in, FILE *out, int *count) {
    char *line = NULL;
    size_t room = 0;
    while (getline(&line, &room, in) >= 0) {
        convert_line(line, out, count);
    }
    free(line);
}

/* Reads the value of a deb822 field with its continuation lines; "" if missing. */
static void field_value(const char *stanza, const char *name, char *value, size_t bytes) {
    size_t length = strlen(name), used = 0;
    bool inside = false;
    value[0] = '\0';
    for (const char *p = stanza; *p;) {
        size_t n = strcspn(p, "\n");
        const char *text = p;
        if (*p != ' ' && *p != '\t') {
            inside = n > length && strncasecmp(p, name, length) == 0 && p[length] == ':';
            text = p + length + 1;
        }
        if (inside) {
            int written =
                snprintf(value + used, bytes - used, "%.*s\n", (int)(n - (size_t)(text - p)), text);
            used += (size_t)written < bytes - used ? (size_t)written : bytes - used - 1;
        }
        p += n + (p[n] == '\n');
    }
}

static void convert_stanza(const char *stanza, FILE *out, int *count) {
    char types[256], enabled[64], uris[4096], components[512], signed_by[8192];
    field_value(stanza, "Types", types, sizeof types);
    field_value(stanza, "Enabled", enabled, sizeof enabled);
    field_value(stanza, "URIs", uris, sizeof uris);
    field_value(stanza, "Components", components, sizeof components);
    field_value(stanza, "Signed-By", signed_by, sizeof signed_by);
    const char *e = enabled + strspn(enabled, " \t\n");
    bool off = strncasecmp(e, "no", 2) == 0 || strncasecmp(e, "false", 5) == 0 ||
               strncasecmp(e, "off", 3) == 0 || *e == '0';
    if (off || !(has_word(types, "deb") || has_word(types, "deb-src")) ||
        !is_debians(uris, components, signed_by)) {
        return;
    }
    fputs("Types: deb-src\n", out);
    bool inside_types = false;
    for (const char *p = stanza; *p;) {
        size_t n = strcspn(p, "\n");
        if (*p != ' ' && *p != '\t') {
            inside_types = strncasecmp(p, "Types:", 6) == 0;
        }
        if (!inside_types) {
            fprintf(out, "%.*s\n", (int)n, p);
        }
        p += n + (p[n] == '\n');
    }
    fputc('\n', out);
    (*count)++;
}

static bst_status convert_deb822(bst_ctx *ctx, FILE *in, FILE *out, int *count) {
    char *line = NULL, *stanza = NULL;
    size_t room = 0, used = 0;
    bst_status status = BST_OK;
    bool more = true;
    while (more) {
        more = getline(&line, &room, in) >= 0;
        if (more && line[0] == '#') {
            continue;
        }
        if (more && line[strspn(line, " \t\r\n")] != '\0') {
            size_t n = strlen(line);
            char *grown = realloc(stanza, used + n + 1);
            if (!grown) {
                status = bst_fail(ctx, BST_ERR_MEMORY, "out of memory for apt's sources");
                break;
            }
            stanza = grown;
            memcpy(stanza + used, line, n + 1);
            used += n;
        } else if (used > 0) {
            convert_stanza(stanza, out, count);
            used = 0;
        }
    }
    free(stanza);
    free(line);
    return status;
}

static bool ends_with(const char *name, const char *end) {
    size_t n = strlen(name), m = strlen(end);
    return n > m && strcmp(name + n - m, end) == 0;
}

static bst_status convert_file(bst_ctx *ctx, const char *path, FILE *list, FILE *sources,
                               int *count) {
    FILE *in = fopen(path, "r");
    if (!in) {
        /* some machines make single source files unreadable for users: use the others */
        return BST_OK;
    }
    bst_status status = BST_OK;
    if (ends_with(path, ".sources")) {
        status = convert_deb822(ctx, in, sources, count);
    } else {
        convert_list(in, list, count);
    }
    fclose(in);
    return status;
}

static int wanted_name(const struct dirent *entry) {
    return isalnum((unsigned char)entry->d_name[0]) &&
           (ends_with(entry->d_name, ".list") || ends_with(entry->d_name, ".sources"));
}

bst_status bst_star_fetch_sources(bst_ctx *ctx, const char *etc_apt, FILE *list, FILE *sources,
                                  int *count) {
    *count = 0;
    char path[1024];
    snprintf(path, sizeof path, "%s/sources.list", etc_apt);
    BST_TRY(convert_file(ctx, path, list, sources, count));
    char folder[512];
    snprintf(folder, sizeof folder, "%s/sources.list.d", etc_apt);
    struct dirent **names = NULL;
    int n = scandir(folder, &names, wanted_name, alphasort);
    bst_status status = BST_OK;
    for (int i = 0; i < n; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]->d_name);
        if (status == BST_OK) {
            status = convert_file(ctx, path, list, sources, count);
        }
        free(names[i]);
    }
    free(names);
    if (status == BST_OK && *count == 0) {
        return bst_fail(
            ctx, BST_ERR_NOT_FOUND,
            "none of apt's sources in %s is Debian's: get %s of Debian's source package "
            "tycho2 by hand and run `boresight stars import %s`",
            etc_apt, BST_STAR_TARBALL_NAME, BST_STAR_TARBALL_NAME);
    }
    return status;
}
