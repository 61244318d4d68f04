#include "sim/link/packet.h"

#include <assert.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "sim/link/crc32c.h"

/* end of a header: "crc32c":"xxxxxxxx"} */
static const char ending[] = "\"crc32c\":\"";
enum { ENDING_BYTES = sizeof ending - 1 + 8 + 2, DEPTH = 8 };

void bst_link_header_seal(char *text, size_t bytes) {
    char room[ENDING_BYTES + 1];
    snprintf(room, sizeof room, "%s%08x\"}", ending, bst_crc32c(text, bytes - ENDING_BYTES));
    memcpy(text + bytes - ENDING_BYTES, room, ENDING_BYTES);
}

size_t bst_link_header_write(const bst_link_header *h, char out[BST_LINK_HEADER_BYTES]) {
    assert(h && out && h->parts >= 0 && h->parts <= BST_LINK_PARTS);
    size_t room = BST_LINK_HEADER_BYTES, n = 0;
    n += (size_t)snprintf(out, room, "{\"version\":%d,\"type\":\"%s\",\"tick\":%" PRId64 ",",
                          BST_LINK_VERSION, bst_wire_message_of(h->type)->name, h->tick);
    if (*h->utc) {
        n += (size_t)snprintf(out + n, room - n, "\"utc\":\"%s\",", h->utc);
    }
    n += (size_t)snprintf(out + n, room - n, "\"sequence\":%" PRId64 ",", h->sequence);
    if (h->step >= 0) {
        n += (size_t)snprintf(out + n, room - n, "\"step\":%" PRId64 ",", h->step);
    }
    if (*h->instance) {
        n += (size_t)snprintf(out + n, room - n, "\"instance\":\"%s\",", h->instance);
    }
    n += (size_t)snprintf(out + n, room - n, "\"lengths\":[");
    for (int i = 0; i < h->parts; i++) {
        n += (size_t)snprintf(out + n, room - n, "%s%" PRId64, i ? "," : "", h->lengths[i]);
    }
    n += (size_t)snprintf(out + n, room - n, "],\"crcs\":[");
    for (int i = 0; i < h->parts - (h->slot >= 0); i++) {
        n += (size_t)snprintf(out + n, room - n, "%s\"%08x\"", i ? "," : "", h->crcs[i]);
    }
    n += (size_t)snprintf(out + n, room - n, "],");
    if (h->slot >= 0) {
        n += (size_t)snprintf(out + n, room - n, "\"slot\":%" PRId64 ",", h->slot);
    }
    n += ENDING_BYTES;
    bst_link_header_seal(out, n);
    return n;
}

/* State of parsing a header. */
typedef struct text {
    const char *at, *end;
    bool bad;
} text;

static void skip_space(text *t) {
    while (t->at < t->end &&
           (*t->at == ' ' || *t->at == '\t' || *t->at == '\n' || *t->at == '\r')) {
        t->at++;
    }
}

/* Skips a character after white space; false: another character. */
static bool take(text *t, char c) {
    skip_space(t);
    if (t->bad || t->at == t->end || *t->at != c) {
        return false;
    }
    t->at++;
    return true;
}

/* Reads one given character; anything else marks the header as bad. */
static void need(text *t, char c) {
    t->bad |= !take(t, c);
}

/* A string of printable ASCII without escapes. */
static void read_string(text *t, char *out, size_t bytes) {
    size_t n = 0;
    need(t, '"');
    while (!t->bad && t->at < t->end && *t->at != '"') {
        char c = *t->at++;
        t->bad |= c < 0x20 || c > 0x7e || c == '\\' || n + 1 >= bytes;
        if (!t->bad) {
            out[n++] = c;
        }
    }
    out[n] = '\0';
    need(t, '"');
}

static int64_t read_integer(text *t) {
    skip_space(t);
    bool negative = take(t, '-');
    int64_t value = 0;
    int digits = 0;
    while (t->at < t->end && *t->at >= '0' && *t->at <= '9') {
        t->bad |= ++digits > 15 || (digits > 1 && value == 0);
        value = t->bad ? 0 : value * 10 + (*t->at - '0');
        t->at++;
    }
    t->bad |= digits == 0;
    return negative ? -value : value;
}

static uint32_t read_hex(text *t) {
    char word[9];
    uint32_t value = 0;
    read_string(t, word, sizeof word);
    t->bad |= strlen(word) != 8;
    for (const char *c = word; *c && !t->bad; c++) {
        int digit = *c >= '0' && *c <= '9' ? *c - '0' : *c >= 'a' && *c <= 'f' ? *c - 'a' + 10 : -1;
        t->bad |= digit < 0;
        value = value * 16 + (uint32_t)(digit & 15);
    }
    return value;
}

/* Skips any JSON value; the content of strings is ignored. */
static void skip_value(text *t) {
    int depth = 0;
    do {
        skip_space(t);
        if (t->at == t->end) {
            t->bad = true;
            return;
        }
        char c = *t->at++;
        if (c == '"') {
            while (t->at < t->end && *t->at != '"') {
                t->at += *t->at == '\\' && t->end - t->at > 1 ? 2 : 1;
            }
            t->bad |= t->at == t->end;
            t->at += t->at < t->end;
        } else if (c == '[' || c == '{') {
            t->bad |= ++depth > DEPTH;
        } else if (c == ']' || c == '}') {
            t->bad |= --depth < 0;
        } else if (depth == 0) {
            while (t->at < t->end && !strchr(",]} \t\r\n", *t->at)) {
                t->at++;
            }
        }
    } while (depth > 0 && !t->bad);
}

enum {
    HAS_VERSION = 1,
    HAS_TYPE = 2,
    HAS_TICK = 4,
    HAS_SEQUENCE = 8,
    HAS_LENGTHS = 16,
    HAS_CRCS = 32,
    HAS_STEP = 64,
    HAS_INSTANCE = 128,
    HAS_SLOT = 256,
    HAS_UTC = 512
};

typedef struct reading {
    bst_link_header *header;
    unsigned has;
    int64_t version;
    char type[32];
    int crcs;
} reading;

/* Marks a member as read; a duplicate marks the header as bad. */
static bool first_time(text *t, reading *r, unsigned key) {
    t->bad |= (r->has & key) != 0; /* duplicate member */
    r->has |= key;
    return !t->bad;
}

static int read_list(text *t, bst_link_header *h, bool hex) {
    int n = 0;
    need(t, '[');
    if (take(t, ']')) {
        return 0;
    }
    do {
        t->bad |= n == BST_LINK_PARTS;
        if (!t->bad && hex) {
            h->crcs[n] = read_hex(t);
        } else if (!t->bad) {
            h->lengths[n] = read_integer(t);
            t->bad |= h->lengths[n] < 0;
        }
        n++;
    } while (!t->bad && take(t, ','));
    need(t, ']');
    return n;
}

/* Reads the value of one header member. */
static void read_member(text *t, const char *key, reading *r) {
    bst_link_header *h = r->header;
    if (strcmp(key, "version") == 0 && first_time(t, r, HAS_VERSION)) {
        r->version = read_integer(t);
    } else if (strcmp(key, "type") == 0 && first_time(t, r, HAS_TYPE)) {
        read_string(t, r->type, sizeof r->type);
    } else if (strcmp(key, "tick") == 0 && first_time(t, r, HAS_TICK)) {
        h->tick = read_integer(t);
    } else if (strcmp(key, "utc") == 0 && first_time(t, r, HAS_UTC)) {
        read_string(t, h->utc, sizeof h->utc);
    } else if (strcmp(key, "sequence") == 0 && first_time(t, r, HAS_SEQUENCE)) {
        h->sequence = read_integer(t);
    } else if (strcmp(key, "step") == 0 && first_time(t, r, HAS_STEP)) {
        h->step = read_integer(t);
    } else if (strcmp(key, "instance") == 0 && first_time(t, r, HAS_INSTANCE)) {
        read_string(t, h->instance, sizeof h->instance);
    } else if (strcmp(key, "slot") == 0 && first_time(t, r, HAS_SLOT)) {
        h->slot = read_integer(t);
    } else if (strcmp(key, "lengths") == 0 && first_time(t, r, HAS_LENGTHS)) {
        h->parts = read_list(t, h, false);
    } else if (strcmp(key, "crcs") == 0 && first_time(t, r, HAS_CRCS)) {
        r->crcs = read_list(t, h, true);
    } else if (!t->bad) {
        skip_value(t);
    }
}

/* Fails with the reason why a header is invalid. */
static bst_wire_fault fault(bst_ctx *ctx, bst_wire_fault kind, const char *why) {
    bst_fail(ctx, BST_ERR_FORMAT, "header: %s", why);
    return kind;
}

bst_wire_fault bst_link_header_read(bst_ctx *ctx, const char *bytes, size_t count,
                                    bst_link_header *out) {
    *out = (bst_link_header){.type = BST_LINK_TYPES, .sequence = -1, .step = -1, .slot = -1};
    if (count < ENDING_BYTES + 1 || count > BST_LINK_HEADER_BYTES ||
        memcmp(bytes + count - ENDING_BYTES, ending, sizeof ending - 1) != 0) {
        return fault(ctx, BST_WIRE_BAD_HEADER,
                     "it is no JSON object of at most 1024 bytes that ends with "
                     "\"crc32c\":\"xxxxxxxx\"}");
    }
    text t = {bytes + count - 11, bytes + count, false}; /* "xxxxxxxx"} */
    uint32_t stated = read_hex(&t);
    need(&t, '}');
    if (t.bad) {
        return fault(ctx, BST_WIRE_BAD_HEADER,
                     "its crc32c is no 8 hexadecimal digits in lower case");
    }
    if (bst_crc32c(bytes, count - ENDING_BYTES) != stated) {
        return fault(ctx, BST_WIRE_BAD_CRC, "its checksum is wrong");
    }
    t = (text){bytes, bytes + count, false};
    reading r = {.header = out};
    char key[32];
    need(&t, '{');
    do {
        read_string(&t, key, sizeof key);
        need(&t, ':');
        if (!t.bad) {
            read_member(&t, key, &r);
        }
    } while (!t.bad && take(&t, ','));
    need(&t, '}');
    if (t.bad || t.at != t.end) {
        out->sequence = -1;
        return fault(ctx, BST_WIRE_BAD_HEADER,
                     "it is no flat JSON object of the members that docs/reference/icd.md lists");
    }
    if (!(r.has & HAS_VERSION) || r.version != BST_LINK_VERSION) {
        bst_fail(ctx, BST_ERR_FORMAT, "header: version %lld (allowed: %d)", (long long)r.version,
                 BST_LINK_VERSION);
        return BST_WIRE_BAD_VERSION;
    }
    const unsigned required = HAS_TYPE | HAS_TICK | HAS_SEQUENCE | HAS_LENGTHS | HAS_CRCS;
    if ((r.has & required) != required || out->sequence < 0 || out->step < -1 || out->slot < -1) {
        return fault(ctx, BST_WIRE_BAD_HEADER,
                     "it needs type, tick, sequence (0 or more), lengths and crcs");
    }
    out->type = bst_wire_type_of(r.type);
    if (out->type == BST_LINK_TYPES) {
        bst_fail(ctx, BST_ERR_FORMAT, "header: there is no type \"%s\"", r.type);
        return BST_WIRE_UNEXPECTED;
    }
    bool pixels = bst_wire_message_of(out->type)->pixels;
    if (out->parts != (pixels ? 2 : 1) || (out->slot >= 0 && !pixels) ||
        r.crcs != out->parts - (out->slot >= 0)) {
        bst_fail(ctx, BST_ERR_FORMAT, "header: %d lengths and %d crcs (allowed for %s: %d)",
                 out->parts, r.crcs, r.type, pixels ? 2 : 1);
        return BST_WIRE_BAD_LENGTH;
    }
    return BST_WIRE_GOOD;
}

bst_wire_fault bst_link_part_check(bst_ctx *ctx, const bst_link_header *header, int part,
                                   const void *data, size_t bytes) {
    if (part >= header->parts || bytes != (uint64_t)header->lengths[part]) {
        bst_fail(ctx, BST_ERR_FORMAT, "part %d has %zu bytes, the header says %lld", part, bytes,
                 part < header->parts ? (long long)header->lengths[part] : 0LL);
        return BST_WIRE_BAD_LENGTH;
    }
    if (bst_crc32c(data, bytes) != header->crcs[part]) {
        bst_fail(ctx, BST_ERR_FORMAT, "the checksum of part %d is wrong", part);
        return BST_WIRE_BAD_CRC;
    }
    return BST_WIRE_GOOD;
}
