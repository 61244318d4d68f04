/* Reads gravity fields in ICGEM format. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "sim/astro/gravity_internal.h"
#include "sim/core/file.h"

#define MAX_FILE_BYTES ((uint64_t)256 << 20)

enum { LINE_BYTES = 512, MAX_WORDS = 8, HIGHEST_DEGREE = 100000 };

typedef struct reader {
    bst_ctx *ctx;
    const char *name;
    const char *next, *end;
    int line_number;
    char line[LINE_BYTES]; /* current line, split into words */
    char *words[MAX_WORDS];
    int word_count;
    double gm, radius;
    int max_degree;
    bool unnormalized;
    int degree, order;
    double (*cs)[2];
    bool *given;
} reader;

static bst_status fail_at(const reader *r, const char *what, const char *found,
                          const char *expected) {
    return bst_fail(r->ctx, BST_ERR_FORMAT, "%.400s:%d: %s (found \"%.60s\"; expected %s)", r->name,
                    r->line_number, what, found, expected);
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r';
}

/* Splits the next line into words; false: end of data. Words beyond MAX_WORDS are dropped. */
static bst_status next_line(reader *r, bool *there) {
    *there = r->next < r->end;
    if (!*there) {
        return BST_OK;
    }
    r->line_number++;
    r->word_count = 0;
    const char *stop = memchr(r->next, '\n', (size_t)(r->end - r->next));
    stop = stop ? stop : r->end;
    size_t length = (size_t)(stop - r->next);
    if (length >= LINE_BYTES) {
        return bst_fail(r->ctx, BST_ERR_FORMAT, "%.400s:%d: line of %zu characters (at most %d)",
                        r->name, r->line_number, length, LINE_BYTES - 1);
    }
    memcpy(r->line, r->next, length);
    r->line[length] = '\0';
    r->next = stop < r->end ? stop + 1 : r->end;
    for (char *c = r->line; *c && r->word_count < MAX_WORDS;) {
        while (is_blank(*c)) {
            c++;
        }
        if (*c) {
            r->words[r->word_count++] = c;
            while (*c && !is_blank(*c)) {
                c++;
            }
            if (*c) {
                *c++ = '\0';
            }
        }
    }
    return BST_OK;
}

/* Parses a finite decimal number; the exponent letter may be E or D. */
static bst_status read_real(const reader *r, const char *word, const char *what, double *out) {
    char text[64];
    size_t length = strlen(word);
    bool good = length > 0 && length < sizeof text && strspn(word, "0123456789+-.eEdD") == length;
    if (good) {
        for (size_t i = 0; i <= length; i++) {
            text[i] = word[i] == 'd' || word[i] == 'D' ? 'e' : word[i];
        }
        char *stop;
        *out = strtod(text, &stop);
        good = *stop == '\0' && stop != text && isfinite(*out);
    }
    return good ? BST_OK : fail_at(r, what, word, "a finite number");
}

static bst_status read_int(const reader *r, const char *word, const char *what, int *out) {
    size_t length = strlen(word);
    bool good = length > 0 && length < 7 && strspn(word, "0123456789") == length;
    *out = good ? (int)strtol(word, NULL, 10) : 0;
    return good && *out <= HIGHEST_DEGREE ? BST_OK
                                          : fail_at(r, what, word, "a whole number 0 to 100000");
}

static bst_status read_header(reader *r) {
    r->gm = r->radius = 0.0;
    r->max_degree = -1;
    for (;;) {
        bool there;
        BST_TRY(next_line(r, &there));
        if (!there) {
            return bst_fail(r->ctx, BST_ERR_FORMAT,
                            "%.400s:%d: the file ends before the line \"end_of_head\"", r->name,
                            r->line_number);
        }
        if (r->word_count == 0) {
            continue;
        }
        const char *key = r->words[0];
        if (strncmp(key, "end_of_head", 11) == 0) {
            break;
        }
        if (r->word_count < 2) {
            continue;
        }
        const char *value = r->words[1];
        if (strcmp(key, "earth_gravity_constant") == 0 || strcmp(key, "gravity_constant") == 0) {
            BST_TRY(read_real(r, value, key, &r->gm));
        } else if (strcmp(key, "radius") == 0) {
            BST_TRY(read_real(r, value, key, &r->radius));
        } else if (strcmp(key, "max_degree") == 0) {
            BST_TRY(read_int(r, value, key, &r->max_degree));
        } else if (strcmp(key, "norm") == 0) {
            r->unnormalized = strcmp(value, "unnormalized") == 0;
            if (!r->unnormalized && strcmp(value, "fully_normalized") != 0) {
                return fail_at(r, "norm", value, "fully_normalized or unnormalized");
            }
        }
    }
    /* must be the Earth, within 1 % */
    if (!(fabs(r->gm / 3.986004415e14 - 1.0) < 0.01)) {
        return bst_fail(r->ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the header must give earth_gravity_constant, about 3.986e14 "
                        "m^3/s^2 (found %g)",
                        r->name, r->line_number, r->gm);
    }
    if (!(fabs(r->radius / 6378136.3 - 1.0) < 0.01)) {
        return bst_fail(r->ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the header must give radius, about 6.378e6 m (found %g)",
                        r->name, r->line_number, r->radius);
    }
    if (r->max_degree < r->degree) {
        return bst_fail(r->ctx, BST_ERR_FORMAT,
                        "%.400s:%d: the file has degree %d at most (max_degree), %d is asked for",
                        r->name, r->line_number, r->max_degree, r->degree);
    }
    return BST_OK;
}

/* Ratio of fully normalised to unnormalised coefficients: sqrt((n + m)! / ((2 - delta_0m) (2n + 1)
 * (n - m)!)). */
static double normalisation(int n, int m) {
    double product = 1.0;
    for (int k = n - m + 1; k <= n + m; k++) {
        product *= sqrt((double)k);
    }
    return product / sqrt((m == 0 ? 1.0 : 2.0) * (2.0 * n + 1.0));
}

static bst_status read_coefficient(reader *r) {
    if (strcmp(r->words[0], "gfc") != 0) {
        return fail_at(r, "not a static coefficient", r->words[0],
                       "\"gfc\": time-variable terms are not read");
    }
    if (r->word_count < 5) {
        return fail_at(r, "a coefficient is cut short", r->words[r->word_count - 1],
                       "\"gfc\", degree, order, C, S");
    }
    int n, m;
    double c, s;
    BST_TRY(read_int(r, r->words[1], "degree", &n));
    BST_TRY(read_int(r, r->words[2], "order", &m));
    BST_TRY(read_real(r, r->words[3], "C", &c));
    BST_TRY(read_real(r, r->words[4], "S", &s));
    if (n > r->max_degree) {
        return fail_at(r, "degree", r->words[1], "at most the header's max_degree");
    }
    if (m > n) {
        return fail_at(r, "order", r->words[2], "at most the degree");
    }
    if (n > r->degree) {
        return BST_OK;
    }
    size_t at = bst_gravity_index(n, m);
    if (r->given[at]) {
        return fail_at(r, "a degree and order that came before", r->words[2], "each once");
    }
    double scale = r->unnormalized ? normalisation(n, m) : 1.0;
    r->cs[at][0] = c * scale;
    r->cs[at][1] = s * scale;
    r->given[at] = true;
    if (!isfinite(r->cs[at][0]) || !isfinite(r->cs[at][1])) {
        return fail_at(r, "a coefficient too large", r->words[3], "a finite normalised value");
    }
    return BST_OK;
}

static bst_status read_field(reader *r) {
    BST_TRY(read_header(r));
    for (;;) {
        bool there;
        BST_TRY(next_line(r, &there));
        if (!there) {
            break;
        }
        if (r->word_count > 0) {
            BST_TRY(read_coefficient(r));
        }
    }
    for (int n = 2; n <= r->degree; n++) {
        for (int m = 0; m <= n && m <= r->order; m++) {
            if (!r->given[bst_gravity_index(n, m)]) {
                return bst_fail(r->ctx, BST_ERR_FORMAT,
                                "%.400s:%d: the file ends without degree %d, order %d", r->name,
                                r->line_number, n, m);
            }
        }
    }
    return BST_OK;
}

bst_status bst_gravity_read_buffer(bst_ctx *ctx, const char *name, const char *data, size_t bytes,
                                   int degree, int order, bst_gravity **out) {
    *out = NULL;
    if (degree < 0 || degree > BST_GRAVITY_MAX_DEGREE || order < 0 || order > degree) {
        return bst_fail(ctx, BST_ERR_ARGUMENT,
                        "gravity field of degree %d, order %d (allowed: degree 0 to %d, order 0 "
                        "to the degree)",
                        degree, order, BST_GRAVITY_MAX_DEGREE);
    }
    BST_TRY(bst_file_check_text(ctx, name, data, bytes));
    size_t count = bst_gravity_index(degree + 1, 0);
    reader r = {.ctx = ctx,
                .name = name,
                .next = data,
                .end = data + bytes,
                .degree = degree,
                .order = order};
    r.cs = calloc(count, sizeof *r.cs);
    r.given = calloc(count, sizeof *r.given);
    bst_status status = r.cs && r.given ? read_field(&r)
                                        : bst_fail(ctx, BST_ERR_MEMORY,
                                                   "%.400s: no memory for degree %d", name, degree);
    if (status == BST_OK) {
        status =
            bst_gravity_make(ctx, r.gm, r.radius, degree, order, (const double(*)[2])r.cs, out);
    }
    free(r.cs);
    free(r.given);
    return status;
}

bst_status bst_gravity_load(bst_ctx *ctx, const char *path, int degree, int order,
                            bst_gravity **out) {
    *out = NULL;
    char *data;
    size_t bytes;
    BST_TRY(bst_file_read(ctx, path, MAX_FILE_BYTES, "a gravity field in the ICGEM format", &data,
                          &bytes));
    bst_status status = bst_gravity_read_buffer(ctx, path, data, bytes, degree, order, out);
    free(data);
    return status;
}
