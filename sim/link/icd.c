#include "sim/link/icd.h"

#include <string.h>

#include "sim/link/crc32c.h"
#include "sim/link/packet.h"
#include "sim/link/payloads.h"
#include "sim/link/shared_frames.h"

static const char opening[] =
    "# Interface control document of the link\n"
    "\n"
    "This page is made by `boresight icd` from the tables with which the program encodes, decodes "
    "and checks;\n"
    "a test keeps it current. How to use the link, with examples: [hardware in the "
    "loop](../how-to/hardware_in_the_loop.md).\n"
    "\n";

static const char transport[] =
    "## Transport\n"
    "\n"
    "- ZeroMQ 4 over `tcp://127.0.0.1:PORT` (any loopback address, also `[::1]`) or `ipc://PATH`. "
    "The simulation binds\n"
    "  a ROUTER socket. A peer connects a DEALER socket, before or after the simulation starts, "
    "any number of times.\n"
    "- A message is a multipart message of two parts: header, payload. `frame` has a third part, "
    "the pixels, unless\n"
    "  they are in shared memory. The simulation disconnects a peer that sends more than 16 MiB in "
    "one part, or by TCP more\n"
    "  than 64 MiB that it has not read yet.\n"
    "- With keys, both sockets use ZeroMQ's CURVE (RFC 26). The simulation is the server and "
    "accepts only the peer's key of\n"
    "  the file (`boresight link-keys`).\n"
    "- All numbers are little-endian. Floats are IEEE 754 binary64.\n"
    "\n"
    "## Header\n"
    "\n"
    "One flat JSON object in printable ASCII without escapes, of at most 1024 bytes, without "
    "duplicate members, in any order except\n"
    "the last. Integers have at most 15 digits, no fraction, no exponent. Unknown members are "
    "ignored.\n"
    "\n"
    "| member | required | value |\n"
    "|---|---|---|\n"
    "| `version` | yes | version of this protocol, above; messages of another version are rejected "
    "|\n"
    "| `type` | yes | one of the messages below |\n"
    "| `tick` | yes | tick of the simulation at which the message was written |\n"
    "| `utc` | no | the same time, for readers |\n"
    "| `sequence` | yes | 0, 1, 2, ... per sender and connection; a peer may continue to count "
    "after `hello`; a rejected message uses up its number |\n"
    "| `step` | in a step | number of the step of this part; an answer repeats it |\n"
    "| `instance` | in a step | the part, `observer/sensor/module`; an answer repeats it |\n"
    "| `lengths` | yes | bytes of the payload; in `frame` also of the pixels |\n"
    "| `crcs` | yes | CRC-32C of each of these parts that is in the message, 8 hexadecimal digits "
    "in lower case |\n"
    "| `slot` | no | number of the frame in shared memory (below); then there is no third part |\n"
    "| `crc32c` | yes, last | CRC-32C of all bytes of the header before `\"crc32c\":` |\n"
    "\n"
    "CRC-32C is that of RFC 3720 (polynomial 0x1EDC6F41 reflected, initial value and final "
    "complement 0xFFFFFFFF): the nine\n"
    "bytes `123456789` give e3069283.\n"
    "\n"
    "## Conversation\n"
    "\n"
    "1. The peer sends `hello` with the parts that it plays. The simulation answers with "
    "`welcome`. A second `hello` for a\n"
    "   part takes it over.\n"
    "2. For each step of a part the simulation sends its new inputs, then `step`, all with the "
    "same `step` and\n"
    "   `instance`. Then it waits.\n"
    "3. The peer sends its outputs, at most one of each type, then `done` with their number. The "
    "simulation continues.\n"
    "4. At the end the simulation sends `end`. A peer that leaves sends `end`.\n"
    "\n"
    "| role | inputs | outputs |\n"
    "|---|---|---|\n"
    "| `imgproc` | `frame`, `predictions`, `pointing_telemetry`, `nav_telemetry`, `truth` on "
    "request | `detections` |\n"
    "| `tracker` | `detections`, `pointing_telemetry`, `nav_telemetry` | `tracks`, `predictions`, "
    "`track_identities`, `tracks_smoothed` |\n"
    "| `control` | `tracks`, `pointing_telemetry`, `nav_telemetry`, `mount_status` | "
    "`los_command`, `sensor_command`, `control_status` |\n"
    "| `gimbal` | `frame` (several if several exposures have ended), `los_command`, `truth` on "
    "request | `pointing`, `target_states`, `target_attitudes`, `sensor_command` if no control "
    "module writes it |\n"
    "\n"
    "If a connection is lost, ZeroMQ reconnects. The simulation answers messages of the new "
    "connection with `error` and the\n"
    "word `stranger`. The peer sends `hello` again, and the current step is repeated (`attempt` in "
    "`step` counts the repetitions).\n"
    "\n"
    "## Faults and answers\n"
    "\n"
    "Each fault has a counter in the run's `manifest.json`. The first twenty are in the log, "
    "further ones in the table `events`. The\n"
    "sender gets `error` with the word (without `link_`), at most 32 in a step.\n"
    "\n"
    "| counter | received | reaction |\n"
    "|---|---|---|\n"
    "| `link_bad_header` | an invalid header | rejected |\n"
    "| `link_bad_version` | another `version` | rejected |\n"
    "| `link_bad_length` | parts or bytes that differ from header or table | rejected |\n"
    "| `link_bad_crc` | a wrong checksum | rejected |\n"
    "| `link_bad_value` | a number outside its table: NaN, no unit quaternion, out of range | "
    "rejected |\n"
    "| `link_unexpected` | an unknown type, or one that this role does not send | rejected |\n"
    "| `link_duplicate` | the sequence of the previous message | rejected |\n"
    "| `link_out_of_order` | an earlier sequence | rejected |\n"
    "| `link_gap` | a later sequence than the next one, also after a header that cannot be read | "
    "accepted |\n"
    "| `link_late` | for another step than the current one | rejected |\n"
    "| `link_repeated` | a second output of a type in a step | rejected: the first one counts |\n"
    "| `link_incomplete` | `done` with another number of outputs than were accepted | rejected: "
    "the step continues |\n"
    "| `link_held` | no answer in time, with a [pacing](../how-to/hardware_in_the_loop.md#pacing) "
    "that does not wait for it | the run continues; the answer counts when it arrives |\n"
    "| `link_skipped` | no answer: a peer with two unanswered steps gets no third one | the inputs "
    "of that step are lost for the peer |\n"
    "| `link_items_dropped` | more items than the capacity | the first ones are accepted |\n"
    "| `link_stranger` | a message without `hello`, or of a peer that plays no part now | rejected "
    "|\n"
    "| `link_refused` | `hello` for no existing part, or a 17th peer | it plays no part |\n"
    "| `link_oversized` | more than 64 MiB by TCP that are not read yet, in one or several "
    "messages | its sender is disconnected |\n"
    "| `link_no_key` | a peer without the required keys | its connection is refused |\n"
    "| `link_flooded` | more than 10000 messages in a step | further messages on this connection "
    "are ignored |\n"
    "| `link_takeover` | `hello` for a part that another peer plays | the new peer plays it |\n"
    "| `link_left` | `end`, or a lost connection | the part waits for a `hello` |\n"
    "| `link_unanswered` | no valid answer within `timeout_s` | `on_timeout`: the run ends with an "
    "error, or continues without the part |\n"
    "| `link_connected`, `link_disconnected` | connections; a part of more than 16 MiB ends one | "
    "the part waits for a `hello` |\n"
    "| `link_hello`, `link_messages` | accepted messages | |\n"
    "\n"
    "`health` and `hello` of a part's peer restart its time-out, for at most ten time-outs in a "
    "step: no step waits longer.\n"
    "\n";

static const char shared_text[] =
    "## Frames in shared memory\n"
    "\n"
    "`welcome` names an object of POSIX shared memory (on Linux a file of `/dev/shm`) of `slots` "
    "slots of `slot_bytes` bytes.\n"
    "A `frame` with the member `slot` = n is in slot n modulo `slots`:\n"
    "\n"
    "| offset | type | content |\n"
    "|---|---|---|\n"
    "| 0 | int64 | n; -1 while it is written |\n"
    "| 8 | int64 | bytes of the pixels |\n"
    "| 16 | | header of the message, then zeros |\n"
    "| 4096 | uint16 | pixels |\n"
    "\n"
    "The slot is not overwritten before the step is answered. Later it is overwritten after "
    "`slots` further frames. A slow\n"
    "reader therefore checks n again after use. Pixels in shared memory have no checksum.\n"
    "\n";

static const char *type_name(const bst_wire_field *f, char *room, size_t bytes) {
    static const char *const names[] = {
        [BST_WIRE_I32] = "int32",   [BST_WIRE_U32] = "uint32", [BST_WIRE_I64] = "int64",
        [BST_WIRE_F64] = "float64", [BST_WIRE_BOOL] = "int32", [BST_WIRE_TEXT] = "char",
    };
    if (f->count == 1) {
        snprintf(room, bytes, "%s", names[f->type]);
    } else {
        snprintf(room, bytes, "%s[%d]", names[f->type], f->count);
    }
    return room;
}

static void allowed(const bst_wire_field *f, char *room, size_t bytes) {
    *room = '\0';
    if (f->type == BST_WIRE_BOOL) {
        snprintf(room, bytes, "0, 1");
    } else if (f->type == BST_WIRE_TEXT) {
        snprintf(room, bytes, "ends with a zero");
    } else if (f->check == BST_WIRE_RANGE) {
        snprintf(room, bytes, "%.10g to %.10g", f->minimum, f->maximum);
    } else if (f->check != BST_WIRE_COUNT) {
        static const char *const words[] = {[BST_WIRE_ANY] = "any",
                                            [BST_WIRE_FINITE] = "finite",
                                            [BST_WIRE_UNIT] = "of length 1",
                                            [BST_WIRE_UNIT_OR_ZERO] = "of length 1, or all 0"};
        snprintf(room, bytes, "%s", words[f->check]);
    }
}

static void print_table(FILE *out, const bst_wire_field *table) {
    fputs("| offset | type | name | unit | allowed | what |\n|---|---|---|---|---|---|\n", out);
    for (const bst_wire_field *f = table; f->name; f++) {
        char type[32], range[64];
        allowed(f, range, sizeof range);
        fprintf(out, "| %zu | %s | `%s` | %s | %s | %s |\n", bst_wire_offset(table, f),
                type_name(f, type, sizeof type), f->name, f->unit, range, f->doc);
    }
}

static void print_message(FILE *out, const bst_wire_message *m) {
    const char *from = m->from == BST_WIRE_FROM_SIM    ? "from the simulation"
                       : m->from == BST_WIRE_FROM_PEER ? "from a peer"
                                                       : "from either side";
    fprintf(out, "### `%s` (%s)\n\n%s\n\nRecord, %zu bytes:\n\n", m->name, from, m->doc,
            bst_wire_bytes(m->record));
    print_table(out, m->record);
    if (m->items) {
        fprintf(out, "\nItems, `count` of them (0 to %d), %zu bytes each:\n\n", m->max_items,
                bst_wire_bytes(m->items));
        print_table(out, m->items);
    }
    if (m->pixels) {
        fputs("\nSecond part: `height` rows of `width` pixels, uint16, row 0 and column 0 first.\n",
              out);
    }
    fputs("\n", out);
}

static void print_bytes(FILE *out, const uint8_t *bytes, size_t count) {
    for (size_t at = 0; at < count; at += 16) {
        fprintf(out, "%04zx ", at);
        for (size_t i = at; i < at + 16 && i < count; i++) {
            fprintf(out, "%s %02x", i % 8 == 0 && i > at ? " " : "", bytes[i]);
        }
        fputs("\n", out);
    }
}

/* Prints an example of a command as packet bytes. */
static void print_example(FILE *out) {
    const bst_wire_message *m = bst_wire_message_of(BST_LINK_LOS_COMMAND);
    bst_los_command command = {.tick = 12600,
                               .direction_gcrf = {0.6, 0.0, 0.8},
                               .rate_gcrf_radps = {0.0, 7.292115e-5, 0.0}};
    bst_link_header header = {.type = BST_LINK_LOS_COMMAND,
                              .tick = 12000,
                              .sequence = 5,
                              .step = 40,
                              .instance = "neossat/camera/control",
                              .parts = 1,
                              .slot = -1};
    uint8_t payload[256];
    char text[BST_LINK_HEADER_BYTES];
    size_t bytes = bst_wire_encode(m, &command, payload);
    header.lengths[0] = (int64_t)bytes;
    header.crcs[0] = bst_crc32c(payload, bytes);
    size_t length = bst_link_header_write(&header, text);
    fprintf(out,
            "## A message, byte by byte\n\n"
            "In step 40 of `neossat/camera/control`, at tick 12000, a peer wants the boresight at "
            "(0.6, 0, 0.8) at tick 12600,\n"
            "turning with 7.292115e-5 rad/s towards +y. The header, %zu bytes in one line, whose "
            "checksum is over its first %zu bytes:\n\n```text\n",
            length, length - 20);
    fwrite(text, 1, length, out);
    fprintf(out, "\n```\n\nThe payload, %zu bytes:\n\n```text\n", bytes);
    print_bytes(out, payload, bytes);
    fputs("```\n\n", out);
    fputs("| offset | bytes | value |\n|---|---|---|\n", out);
    for (const bst_wire_field *f = m->record; f->name; f++) {
        size_t at = bst_wire_offset(m->record, f), one = bst_wire_number_bytes(f->type);
        for (int i = 0; i < f->count; i++, at += one) {
            char name[64], index[16] = "";
            if (f->count > 1) {
                snprintf(index, sizeof index, "[%d]", i);
            }
            snprintf(name, sizeof name, "%s%s", f->name, index);
            fprintf(out, "| %zu | ", at);
            for (size_t b = 0; b < one; b++) {
                fprintf(out, "%02x%s", payload[at + b], b + 1 < one ? " " : "");
            }
            if (f->type == BST_WIRE_F64) {
                double value;
                memcpy(&value, payload + at, sizeof value);
                fprintf(out, " | `%s` = %.10g |\n", name, value);
            } else {
                int64_t value = 0;
                memcpy(&value, payload + at, one);
                fprintf(out, " | `%s` = %lld |\n", name, (long long)value);
            }
        }
    }
}

bst_status bst_link_icd(bst_ctx *ctx, FILE *out) {
    fputs(opening, out);
    fprintf(out,
            "The version of the protocol is %d. It rises with every change to the layout or the "
            "meaning of a message or of a\n"
            "header's member.\n\n",
            BST_LINK_VERSION);
    fputs(transport, out);
    fputs(shared_text, out);
    fputs(
        "## Payloads\n\n"
        "One record, then `count` items where there are any. Members follow one another without "
        "gaps; a record and an item are\n"
        "filled up with zeros to a multiple of 8 bytes. Directions are in GCRF axes; attitudes "
        "are quaternions, scalar last, that\n"
        "turn what the second name in them has into the first one's axes; pixel (0, 0) has its "
        "centre at (0.0, 0.0)\n"
        "([conventions](conventions.md)). What is outside \"allowed\" is not taken.\n\n",
        out);
    for (int type = 0; type < BST_LINK_TYPES; type++) {
        print_message(out, bst_wire_message_of((bst_link_type)type));
    }
    print_example(out);
    return fflush(out) == 0 && !ferror(out)
               ? BST_OK
               : bst_fail(ctx, BST_ERR_IO, "cannot write the interface control document");
}
