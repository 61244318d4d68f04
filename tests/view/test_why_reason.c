/* Reasons for which a target is detected in a frame, or not: each by the one fact that decides. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "view/why.h"

/* A target of SNR 20 that is seen: 0.4 px from a detection that updated track 3. */
static bst_view_why_facts seen(void) {
    return (bst_view_why_facts){.processed = true,
                                .threshold_snr = 5.2,
                                .recorded = true,
                                .listed = true,
                                .in_field = true,
                                .snr = 20.0,
                                .sunlit_fraction = 1.0,
                                .star_px = NAN,
                                .object_px = NAN,
                                .object = "B",
                                .detection_px = 0.4,
                                .detection_snr = 19.0,
                                .track = 3,
                                .track_status = "confirmed",
                                .near_px = NAN,
                                .near_sigma = NAN};
}

static void expect(bst_view_why_facts f, const char *kind, const char *part) {
    char text[400];
    assert_string_equal(bst_view_why_reason(&f, text, sizeof text), kind);
    if (!strstr(text, part)) {
        fail_msg("\"%s\" lacks \"%s\"", text, part);
    }
}

static void detected(void **state) {
    (void)state;
    bst_view_why_facts f = seen();
    expect(f, "tracked", "it updated track 3 (confirmed)");
    f.is_blend = true;
    expect(f, "tracked", "blended");
    f.track = 0;
    expect(f, "detected", "no track has it yet");
    f.near_track = 4;
    f.near_px = 12.0;
    f.near_sigma = 5.3;
    expect(f, "detected", "no track"); /* track 4 has another detection */
    f.near_coasts = true;
    expect(f, "gated", "12.0 px from where track 4 expected it: about 5.3 sigma");
    f.no_attitude = true;
    expect(f, "no_attitude", "no attitude from stars");
    f.is_star = true;
    expect(f, "star", "identified as a star");
}

static void not_visible(void **state) {
    (void)state;
    bst_view_why_facts f = seen();
    f.processed = false;
    expect(f, "unprocessed", "image processing");
    f.sunlit_fraction = 0.0;
    expect(f, "dark", "shadow");
    f.in_field = false;
    expect(f, "outside", "outside the field");
    f.occulted = true;
    expect(f, "occulted", "behind the Earth");
    f.listed = false;
    expect(f, "outside", "far outside");
    f.recorded = false;
    expect(f, "unlisted", "did not record");
    f.dropped = true;
    expect(f, "dropped", "dropped");
}

static void missed(void **state) {
    (void)state;
    bst_view_why_facts f = seen();
    f.detection_px = 3.01; /* beyond BST_VIEW_WHY_REACH_PX */
    expect(f, "chance", "though SNR 20.0 is above the threshold of 5.2: noise");
    f.lost = 2;
    expect(f, "chance", "room for");
    f.star_px = 4.0;
    f.star_v_mag = 9.5;
    expect(f, "near_star", "a star of V 9.5, 4.0 px away");
    f.object_px = 2.5;
    expect(f, "merged", "merged with B, 2.5 px away");
    f.object_px = 6.1;
    expect(f, "near_star", "star");
    f.saturated = true;
    expect(f, "saturated", "saturated");
    f.snr = 3.1;
    expect(f, "faint", "SNR 3.1 is below the threshold of 5.2");
    f.detection_px = NAN;
    expect(f, "faint", "below");
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(detected), cmocka_unit_test(not_visible),
                                       cmocka_unit_test(missed)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
