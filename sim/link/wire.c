#include "sim/link/wire.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "numbers are copied as they lie in memory, which has to be little-endian"
#endif

size_t bst_wire_number_bytes(bst_wire_type type) {
    return type == BST_WIRE_I64 || type == BST_WIRE_F64 ? 8 : type == BST_WIRE_TEXT ? 1 : 4;
}

static size_t field_bytes(const bst_wire_field *f) {
    return bst_wire_number_bytes(f->type) * (size_t)f->count;
}

static size_t filled_up(size_t bytes) {
    return (bytes + 7) / 8 * 8;
}

size_t bst_wire_offset(const bst_wire_field *table, const bst_wire_field *field) {
    size_t offset = 0;
    for (const bst_wire_field *f = table; f != field; f++) {
        offset += field_bytes(f);
    }
    return offset;
}

size_t bst_wire_bytes(const bst_wire_field *table) {
    const bst_wire_field *end = table;
    while (end && end->name) {
        end++;
    }
    return table ? filled_up(bst_wire_offset(table, end)) : 0;
}

size_t bst_wire_payload_bytes(const bst_wire_message *message, int items) {
    return bst_wire_bytes(message->record) + bst_wire_bytes(message->items) * (size_t)items;
}

static const bst_wire_field *count_field(const bst_wire_message *message) {
    for (const bst_wire_field *f = message->record; f->name; f++) {
        if (f->check == BST_WIRE_COUNT) {
            return f;
        }
    }
    return NULL;
}

int bst_wire_items(const bst_wire_message *message, const void *payload) {
    const bst_wire_field *f = count_field(message);
    int32_t count = 0;
    if (f) {
        memcpy(&count, (const char *)payload + f->offset, sizeof count);
    }
    return count;
}

void bst_wire_set_items(const bst_wire_message *message, void *payload, int items) {
    const bst_wire_field *f = count_field(message);
    int32_t count = items;
    if (f) {
        memcpy((char *)payload + f->offset, &count, sizeof count);
    }
}

static size_t encode_record(const bst_wire_field *table, const char *from, uint8_t *out) {
    uint8_t *p = out;
    for (const bst_wire_field *f = table; f->name; f++) {
        if (f->type == BST_WIRE_BOOL) {
            int32_t value = *(const bool *)(const void *)(from + f->offset);
            memcpy(p, &value, sizeof value);
        } else if (f->type == BST_WIRE_TEXT) {
            size_t used = strnlen(from + f->offset, (size_t)f->count - 1);
            memcpy(p, from + f->offset, used);
            memset(p + used, 0, (size_t)f->count - used);
        } else {
            memcpy(p, from + f->offset, field_bytes(f));
        }
        p += field_bytes(f);
    }
    size_t bytes = (size_t)(p - out);
    memset(p, 0, filled_up(bytes) - bytes);
    return filled_up(bytes);
}

size_t bst_wire_encode(const bst_wire_message *message, const void *payload, uint8_t *out) {
    assert(message && payload && out);
    size_t bytes = encode_record(message->record, payload, out);
    int count = bst_wire_items(message, payload);
    for (int i = 0; i < count; i++) {
        bytes += encode_record(
            message->items,
            (const char *)payload + message->header_bytes + (size_t)i * message->item_bytes,
            out + bytes);
    }
    return bytes;
}

const char *bst_wire_fault_name(bst_wire_fault fault) {
    static const char *const names[BST_WIRE_FAULTS] = {
        "good", "bad_header", "bad_version", "bad_length", "bad_crc", "bad_value", "unexpected",
    };
    return (unsigned)fault < BST_WIRE_FAULTS ? names[fault] : "unknown";
}

static double number_at(const bst_wire_field *f, const uint8_t *p) {
    union {
        int32_t i32;
        uint32_t u32;
        int64_t i64;
        double f64;
    } number;
    memcpy(&number, p, bst_wire_number_bytes(f->type));
    return f->type == BST_WIRE_F64   ? number.f64
           : f->type == BST_WIRE_I64 ? (double)number.i64
           : f->type == BST_WIRE_U32 ? (double)number.u32
                                     : (double)number.i32;
}

static bst_wire_fault check_text(bst_ctx *ctx, const bst_wire_message *message,
                                 const bst_wire_field *f, const uint8_t *p) {
    int used = 0;
    while (used < f->count && p[used]) {
        if (p[used] < 0x20 || p[used] > 0x7e) {
            bst_fail(ctx, BST_ERR_FORMAT, "%s: %s is no ASCII text", message->name, f->name);
            return BST_WIRE_BAD_VALUE;
        }
        used++;
    }
    for (int i = used; i < f->count; i++) {
        if (used == f->count || p[i]) {
            used = f->count;
        }
    }
    if (used == f->count) {
        bst_fail(ctx, BST_ERR_FORMAT, "%s: %s does not end with zeros", message->name, f->name);
        return BST_WIRE_BAD_VALUE;
    }
    return BST_WIRE_GOOD;
}

/* Checks a field of a message. `item`: index of the item, -1: the record. */
static bst_wire_fault check_field(bst_ctx *ctx, const bst_wire_message *message,
                                  const bst_wire_field *f, const uint8_t *p, int item) {
    if (f->type == BST_WIRE_TEXT) {
        return check_text(ctx, message, f, p);
    }
    double squares = 0.0, bad = 0.0;
    bool good = true;
    for (int i = 0; i < f->count; i++) {
        double value = number_at(f, p + (size_t)i * bst_wire_number_bytes(f->type));
        squares += value * value;
        bool allowed = f->type == BST_WIRE_BOOL     ? value == 0.0 || value == 1.0
                       : f->check == BST_WIRE_ANY   ? true
                       : f->check == BST_WIRE_RANGE ? value >= f->minimum && value <= f->maximum
                                                    : isfinite(value);
        if (good && !allowed) {
            good = false;
            bad = value;
        }
    }
    bool unit = f->check == BST_WIRE_UNIT || f->check == BST_WIRE_UNIT_OR_ZERO;
    bool zero = f->check == BST_WIRE_UNIT_OR_ZERO && squares == 0.0;
    if (good && unit && !zero && !(fabs(squares - 1.0) <= 1e-6)) {
        good = false;
        bad = sqrt(squares);
    }
    if (good) {
        return BST_WIRE_GOOD;
    }
    char where[32] = "", allowed[80];
    if (item >= 0) {
        snprintf(where, sizeof where, " of item %d", item);
    }
    if (f->type == BST_WIRE_BOOL) {
        snprintf(allowed, sizeof allowed, "0 or 1");
    } else if (f->check == BST_WIRE_RANGE) {
        snprintf(allowed, sizeof allowed, "%.9g to %.9g", f->minimum, f->maximum);
    } else {
        snprintf(allowed, sizeof allowed, "%s",
                 unit ? "finite, of length 1 within 5e-7" : "finite numbers");
    }
    bst_fail(ctx, BST_ERR_FORMAT, "%s: %s%s is %.9g (allowed: %s)", message->name, f->name, where,
             bad, allowed);
    return BST_WIRE_BAD_VALUE;
}

static bst_wire_fault decode_record(bst_ctx *ctx, const bst_wire_message *message,
                                    const bst_wire_field *table, const uint8_t *p, int item,
                                    char *out) {
    for (const bst_wire_field *f = table; f->name; f++) {
        bst_wire_fault fault = check_field(ctx, message, f, p, item);
        if (fault != BST_WIRE_GOOD) {
            return fault;
        }
        if (out && f->type == BST_WIRE_BOOL) {
            *(bool *)(void *)(out + f->offset) = p[0] != 0;
        } else if (out) {
            memcpy(out + f->offset, p, field_bytes(f));
        }
        p += field_bytes(f);
    }
    return BST_WIRE_GOOD;
}

bst_wire_fault bst_wire_decode(bst_ctx *ctx, const bst_wire_message *message, const uint8_t *data,
                               size_t bytes, void *payload, int capacity, int *dropped) {
    assert(message && (data || bytes == 0) && payload && capacity >= 0);
    size_t record = bst_wire_bytes(message->record), item = bst_wire_bytes(message->items);
    const bst_wire_field *counting = count_field(message);
    int32_t count = 0;
    if (dropped) {
        *dropped = 0;
    }
    if (bytes >= record && counting) {
        memcpy(&count, data + bst_wire_offset(message->record, counting), sizeof count);
    }
    if (bytes < record || count < 0 || count > message->max_items ||
        bytes != record + item * (size_t)count) {
        bst_fail(ctx, BST_ERR_FORMAT,
                 "%s: %zu bytes with %d items (allowed: %zu bytes and %zu more for each of 0 to %d "
                 "items)",
                 message->name, bytes, count, record, item, message->max_items);
        return BST_WIRE_BAD_LENGTH;
    }
    bst_wire_fault fault = decode_record(ctx, message, message->record, data, -1, payload);
    for (int i = 0; fault == BST_WIRE_GOOD && i < count; i++) {
        char *to = i < capacity
                       ? (char *)payload + message->header_bytes + (size_t)i * message->item_bytes
                       : NULL;
        fault =
            decode_record(ctx, message, message->items, data + record + item * (size_t)i, i, to);
    }
    if (fault == BST_WIRE_GOOD && counting && count > capacity) {
        int32_t kept = capacity;
        memcpy((char *)payload + counting->offset, &kept, sizeof kept);
        if (dropped) {
            *dropped = count - capacity;
        }
    }
    return fault;
}

/* Checks a record of a struct in its packed form. */
static bst_status check_record(bst_ctx *ctx, const bst_wire_message *message,
                               const bst_wire_field *table, const char *from, int item) {
    uint8_t packed[4096];
    assert(bst_wire_bytes(table) <= sizeof packed);
    encode_record(table, from, packed);
    return decode_record(ctx, message, table, packed, item, NULL) == BST_WIRE_GOOD ? BST_OK
                                                                                   : BST_ERR_FORMAT;
}

bst_status bst_wire_check_struct(bst_ctx *ctx, const bst_wire_message *message, const void *payload,
                                 int capacity) {
    assert(message && payload && capacity >= 0);
    int count = bst_wire_items(message, payload);
    if (count < 0 || (message->items && count > capacity)) {
        return bst_fail(ctx, BST_ERR_FORMAT, "%s: %d items (allowed: 0 to %d)", message->name,
                        count, capacity);
    }
    BST_TRY(check_record(ctx, message, message->record, payload, -1));
    const char *item = (const char *)payload + message->header_bytes;
    for (int i = 0; i < count; i++, item += message->item_bytes) {
        BST_TRY(check_record(ctx, message, message->items, item, i));
    }
    return BST_OK;
}
