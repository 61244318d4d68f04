/* Parses one two-line element set. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "boresight/vec.h"
#include "sim/astro/tle_internal.h"

#define LINE_CHARS 69

/* A range of columns of one line; columns count from 1, as documented. */
typedef struct field {
    const bst_text_source *source;
    const bst_text_line *line;
    int first, last;
    const char *what;
} field;

static const char *field_text(const field *f) {
    return f->line->text + (f->first - 1);
}

static int field_length(const field *f) {
    return f->last - f->first + 1;
}

static bst_status fail_field(const field *f, const char *problem, const char *expected) {
    char text[120];
    if (f->first == f->last) {
        snprintf(text, sizeof text, "column %d: %s %s", f->first, f->what, problem);
    } else {
        snprintf(text, sizeof text, "columns %d-%d: %s %s", f->first, f->last, f->what, problem);
    }
    return bst_text_fail_at(f->source, f->line, text, field_text(f), (size_t)field_length(f),
                            expected);
}

static double power_of_ten(int exponent) {
    double p = 1.0;
    for (int i = 0; i < exponent; i++) {
        p *= 10.0;
    }
    return p;
}

/* A decimal number in the form [blanks][sign]digits[.digits][blanks] with at least one digit. Its
 * digits (at most 15, so exact in a double) and how many follow the point. */
static bool scan_decimal(const field *f, bool *negative, int64_t *digits, int *decimals) {
    const char *c = field_text(f), *end = c + field_length(f);
    while (c < end && *c == ' ') {
        c++;
    }
    while (end > c && end[-1] == ' ') {
        end--;
    }
    *negative = c < end && *c == '-';
    if (c < end && (*c == '-' || *c == '+')) {
        c++;
    }
    int seen = 0;
    bool point = false;
    *digits = 0;
    *decimals = 0;
    for (; c < end; c++) {
        if (*c == '.' && !point) {
            point = true;
        } else if (bst_text_is_digit(*c) && seen < 15) {
            *digits = *digits * 10 + (*c - '0');
            seen++;
            *decimals += point;
        } else {
            return false;
        }
    }
    return seen > 0;
}

static bst_status read_decimal(const field *f, double low, double high, const char *expected,
                               double *out) {
    bool negative;
    int64_t digits;
    int decimals;
    if (!scan_decimal(f, &negative, &digits, &decimals)) {
        return fail_field(f, "is not a number", expected);
    }
    double value = (double)digits / power_of_ten(decimals);
    *out = negative ? -value : value;
    if (!(*out >= low && *out <= high)) {
        return fail_field(f, "is out of range", expected);
    }
    return BST_OK;
}

/* Parses an integer after blanks; a blank field is 0. */
static bst_status read_count(const field *f, int *out) {
    const char *c = field_text(f);
    int length = field_length(f), i = 0;
    while (i < length && c[i] == ' ') {
        i++;
    }
    *out = 0;
    for (; i < length; i++) {
        if (!bst_text_is_digit(c[i])) {
            return fail_field(f, "is not a whole number", "digits or blanks");
        }
        *out = *out * 10 + (c[i] - '0');
    }
    return BST_OK;
}

/* Parses "[sign]ddddd[sign]d": implied decimal point before the digits, and a power of ten. Files
 * also have a point, a blank for the exponent's +, and zeros without exponent. */
static bst_status read_implied(const field *f, double *out) {
    const char *expected = "the form \"-12345-6\" for -0.12345e-6";
    const char *c = field_text(f), *end = c + field_length(f);
    while (end > c && end[-1] == ' ') {
        end--;
    }
    while (c < end && *c == ' ') {
        c++;
    }
    *out = 0.0;
    if (c == end) {
        return BST_OK;
    }
    bool negative = *c == '-';
    if (*c == '-' || *c == '+') {
        c++;
    }
    if (c < end && *c == '.') {
        c++;
    }
    int64_t digits = 0;
    int count = 0;
    for (; c < end && bst_text_is_digit(*c); c++) {
        digits = digits * 10 + (*c - '0');
        count++;
    }
    if (count == 0 || (c == end && digits != 0)) {
        return fail_field(f, "is not a number with an exponent", expected);
    }
    int exponent = 0;
    if (c < end) {
        bool negative_exponent = *c == '-';
        int exponent_digits = 0;
        if (*c == '-' || *c == '+' || *c == ' ') {
            c++;
        }
        for (; c < end && bst_text_is_digit(*c); c++) {
            exponent = exponent * 10 + (*c - '0');
            exponent_digits++;
        }
        if (c < end || exponent_digits == 0) {
            return fail_field(f, "is not a number with an exponent", expected);
        }
        exponent = negative_exponent ? -exponent : exponent;
    }
    exponent -= count;
    double value = (double)digits;
    value = exponent < 0 ? value / power_of_ten(-exponent) : value * power_of_ten(exponent);
    *out = negative ? -value : value;
    return BST_OK;
}

static bst_status read_eccentricity(const field *f, double *out) {
    int64_t digits = 0;
    for (int i = 0; i < field_length(f); i++) {
        char c = field_text(f)[i];
        if (!bst_text_is_digit(c) && c != ' ') {
            return fail_field(f, "is not a fraction", "7 digits after an implied decimal point");
        }
        digits = digits * 10 + (bst_text_is_digit(c) ? c - '0' : 0);
    }
    *out = (double)digits / 1e7;
    return BST_OK;
}

bool bst_tle_decode_number(const char *text, int *out) {
    static const char letters[] = "ABCDEFGHJKLMNPQRSTUVWXYZ";
    int value = 0, i = 0;
    while (i < 4 && text[i] == ' ') {
        i++;
    }
    const char *letter = i == 0 && text[0] != '\0' ? strchr(letters, text[0]) : NULL;
    if (letter) {
        value = 10 + (int)(letter - letters);
        i = 1;
    }
    for (; i < 5; i++) {
        if (!bst_text_is_digit(text[i])) {
            return false;
        }
        value = value * 10 + (text[i] - '0');
    }
    *out = value;
    return true;
}

static bst_status read_number(const field *f, int *out) {
    if (!bst_tle_decode_number(field_text(f), out)) {
        return fail_field(f, "is not one",
                          "5 digits, or Alpha-5: a letter other than I and O and 4 digits");
    }
    return BST_OK;
}

/* Parses two-digit year and day of year with fraction into a two-part Julian date. */
static bst_status read_epoch(const bst_text_source *source, const bst_text_line *line,
                             bst_elements *out) {
    field year_field = {source, line, 19, 20, "epoch year"};
    field day_field = {source, line, 21, 32, "epoch day"};
    const char *y = field_text(&year_field);
    if (!(bst_text_is_digit(y[1]) && (bst_text_is_digit(y[0]) || y[0] == ' '))) {
        return fail_field(&year_field, "is not a number", "2 digits");
    }
    int year = (y[0] == ' ' ? 0 : y[0] - '0') * 10 + (y[1] - '0');
    year += year < 57 ? 2000 : 1900;
    bool negative;
    int64_t digits;
    int decimals;
    if (!scan_decimal(&day_field, &negative, &digits, &decimals)) {
        return fail_field(&day_field, "is not a number", "a day of the year, as in 166.94040701");
    }
    int64_t scale = (int64_t)power_of_ten(decimals);
    int64_t whole = digits / scale;
    bool leap = year % 4 == 0; /* valid from 1901 to 2099 */
    if (negative || whole < 1 || whole > (leap ? 366 : 365)) {
        return fail_field(&day_field, "is out of range",
                          leap ? "1 to 366.99999999" : "1 to 365.99999999 in this year");
    }
    int64_t days = 365 * (year - 1900) + (year - 1901) / 4 + (whole - 1);
    out->epoch_utc_jd1 = 2415020.5 + (double)days; /* from 1900 January 1 */
    out->epoch_utc_jd2 = (double)(digits % scale) / (double)scale;
    return BST_OK;
}

/* Checks a line: length, characters, checksum and blank columns. */
static bst_status check_line(const bst_text_source *source, const bst_text_line *line, char role,
                             const int *blank_columns) {
    for (size_t i = 0; i < line->length; i++) {
        unsigned char c = (unsigned char)line->text[i];
        if (c < 0x20 || c >= 0x7f) {
            char problem[80];
            snprintf(problem, sizeof problem, "column %zu: character is not printable ASCII",
                     i + 1);
            return bst_text_fail_at(source, line, problem, line->text + i, 1,
                                    "letters, digits, signs, blanks");
        }
    }
    if (line->length < LINE_CHARS) {
        char problem[80];
        snprintf(problem, sizeof problem, "line %c of the set is cut short at %zu characters", role,
                 line->length);
        return bst_text_fail_at(source, line, problem, line->text, line->length, "69 characters");
    }
    if (line->length > LINE_CHARS) {
        char problem[80];
        snprintf(problem, sizeof problem, "line %c of the set goes on after column 69", role);
        return bst_text_fail_at(source, line, problem, line->text + LINE_CHARS,
                                line->length - LINE_CHARS, "69 characters");
    }
    if (line->text[0] != role) {
        field f = {source, line, 1, 1, "line number"};
        return fail_field(&f, "is wrong", role == '1' ? "1" : "2");
    }
    for (const int *column = blank_columns; *column; column++) {
        if (line->text[*column - 1] != ' ') {
            field f = {source, line, *column, *column, "separator"};
            return fail_field(&f, "is not blank: the line's columns are shifted", "a blank");
        }
    }
    int sum = 0;
    for (int i = 0; i < LINE_CHARS - 1; i++) {
        char c = line->text[i];
        sum += bst_text_is_digit(c) ? c - '0' : c == '-';
    }
    char expected[2] = {(char)('0' + sum % 10), '\0'};
    if (line->text[LINE_CHARS - 1] != expected[0]) {
        field f = {source, line, LINE_CHARS, LINE_CHARS, "checksum"};
        return fail_field(&f, "is wrong: a character of the line was changed", expected);
    }
    return BST_OK;
}

static bst_status parse_line1(const bst_text_source *source, const bst_text_line *l,
                              bst_elements *out) {
    static const int blanks[] = {2, 9, 18, 33, 44, 53, 62, 64, 0};
    BST_TRY(check_line(source, l, '1', blanks));
    int ephemeris_type;
    BST_TRY(read_number(&(field){source, l, 3, 7, "catalogue number"}, &out->norad));
    bst_text_copy((bst_text_span){l->text + 9, 8}, out->designator, sizeof out->designator);
    BST_TRY(read_epoch(source, l, out));
    BST_TRY(read_decimal(&(field){source, l, 34, 43, "first derivative of mean motion"}, -1e3, 1e3,
                         "the form \"-.00000123\"", &out->ndot_rev_day2));
    BST_TRY(read_implied(&(field){source, l, 45, 52, "second derivative of mean motion"},
                         &out->nddot_rev_day3));
    BST_TRY(read_implied(&(field){source, l, 54, 61, "B*"}, &out->bstar));
    BST_TRY(read_count(&(field){source, l, 63, 63, "ephemeris type"}, &ephemeris_type));
    return read_count(&(field){source, l, 65, 68, "element set number"}, &out->element_set);
}

static bst_status parse_line2(const bst_text_source *source, const bst_text_line *l,
                              bst_elements *out) {
    static const int blanks[] = {2, 8, 17, 26, 34, 43, 52, 0};
    const char *angle = "0 to 360 degrees";
    BST_TRY(check_line(source, l, '2', blanks));
    int number = 0;
    field number_field = {source, l, 3, 7, "catalogue number"};
    BST_TRY(read_number(&number_field, &number));
    if (number != out->norad) {
        char expected[40];
        snprintf(expected, sizeof expected, "that of line 1, which is %d", out->norad);
        return fail_field(&number_field, "is of another satellite", expected);
    }
    double degrees[4] = {0}, rev_per_day = 0.0;
    BST_TRY(read_decimal(&(field){source, l, 9, 16, "inclination"}, 0.0, 180.0, "0 to 180 degrees",
                         &degrees[0]));
    BST_TRY(read_decimal(&(field){source, l, 18, 25, "right ascension of the node"}, 0.0, 360.0,
                         angle, &degrees[1]));
    BST_TRY(read_eccentricity(&(field){source, l, 27, 33, "eccentricity"}, &out->eccentricity));
    BST_TRY(read_decimal(&(field){source, l, 35, 42, "argument of perigee"}, 0.0, 360.0, angle,
                         &degrees[2]));
    BST_TRY(
        read_decimal(&(field){source, l, 44, 51, "mean anomaly"}, 0.0, 360.0, angle, &degrees[3]));
    field motion = {source, l, 53, 63, "mean motion"};
    BST_TRY(read_decimal(&motion, 0.0, 1e4, "revolutions per day above 0", &rev_per_day));
    if (!(rev_per_day > 0.0)) {
        return fail_field(&motion, "is not above 0", "revolutions per day above 0");
    }
    out->inclination_rad = degrees[0] >= 180.0 ? BST_PI : degrees[0] * BST_DEG_RAD;
    out->raan_rad = degrees[1] * BST_DEG_RAD;
    out->arg_perigee_rad = degrees[2] * BST_DEG_RAD;
    out->mean_anomaly_rad = degrees[3] * BST_DEG_RAD;
    out->mean_motion_radpmin = rev_per_day * (2.0 * BST_PI / 1440.0);
    return read_count(&(field){source, l, 64, 68, "revolution number"}, &out->revolution);
}

bst_status bst_tle_parse_set(const bst_text_source *source, const bst_text_line *line1,
                             const bst_text_line *line2, bst_elements *out) {
    memset(out, 0, sizeof *out);
    BST_TRY(parse_line1(source, line1, out));
    return parse_line2(source, line2, out);
}

bst_status bst_tle_parse(bst_ctx *ctx, const char *line1, const char *line2, bst_elements *out) {
    bst_text_source source = {ctx, NULL};
    bst_text_line first = {line1, strlen(line1), 1}, second = {line2, strlen(line2), 2};
    bst_text_trim_end(&first);
    bst_text_trim_end(&second);
    return bst_tle_parse_set(&source, &first, &second, out);
}
