/* The device's vector generator against the words that Random123 publishes (file kat_vectors,
 * philox4x32 7), and lane against lane. */
#include "bst_scenegen_kernels.h"
#include "scenegen/kernels/scene_shared.h"
#include "tests/scenegen/device_fixture.h"

enum { CALLS = 64, LANES = 16, WORDS = CALLS * 4 * LANES };

/* Call i begins at the counter first + 16 i. */
static const bst_device_kernel_source text = {
    "words.cl",
    "kernel void words(bst_kernel_frame_params p, uint first, uint stream, global uint16 *out) {\n"
    "    uint i = (uint)get_global_id(0);\n"
    "    uint16 w[4];\n"
    "    philox_lanes(p, first + 16u * i, stream, w, w + 1, w + 2, w + 3);\n"
    "    for (int k = 0; k < 4; k++) out[4 * i + k] = w[k];\n"
    "}\n",
    0, 0};

static void draw(fixture *f, const uint32_t counter[4], const uint32_t key[2], uint32_t *words) {
    const bst_device_kernel_source *sources[] = {&bst_kernel_scene_shared, &bst_kernel_lanes,
                                                 &bst_kernel_random, &text};
    cl_program program;
    bst_assert_ok(&f->ctx, bst_device_build(&f->ctx, f->device, sources, 4, "", &program));
    cl_int code;
    cl_kernel kernel = clCreateKernel(program, "words", &code);
    bst_assert_ok(&f->ctx, bst_device_check(&f->ctx, code, "kernel"));
    size_t bytes = WORDS * sizeof *words, global = CALLS;
    cl_mem out =
        clCreateBuffer(bst_device_context(f->device), CL_MEM_WRITE_ONLY, bytes, NULL, &code);
    bst_assert_ok(&f->ctx, bst_device_check(&f->ctx, code, "buffer"));
    bst_kernel_frame_params p = {
        .key0 = key[0], .key1 = key[1], .exposure_low = counter[2], .exposure_high = counter[3]};
    clSetKernelArg(kernel, 0, sizeof p, &p);
    clSetKernelArg(kernel, 1, sizeof counter[0], &counter[0]);
    clSetKernelArg(kernel, 2, sizeof counter[1], &counter[1]);
    clSetKernelArg(kernel, 3, sizeof out, &out);
    cl_command_queue queue = bst_device_queue(f->device);
    code = clEnqueueNDRangeKernel(queue, kernel, 1, NULL, &global, NULL, 0, NULL, NULL);
    bst_assert_ok(&f->ctx, bst_device_check(&f->ctx, code, "run"));
    code = clEnqueueReadBuffer(queue, out, CL_TRUE, 0, bytes, words, 0, NULL, NULL);
    bst_assert_ok(&f->ctx, bst_device_check(&f->ctx, code, "read"));
    clReleaseMemObject(out);
    clReleaseKernel(kernel);
    clReleaseProgram(program);
}

static void words_are_the_published_ones(void **state) {
    static const struct {
        uint32_t counter[4], key[2], words[4];
    } cases[] = {
        {{0, 0, 0, 0}, {0, 0}, {0x5f6fb709, 0x0d893f64, 0x4f121f81, 0x4f730a48}},
        {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
         {0xffffffff, 0xffffffff},
         {0x5207ddc2, 0x45165e59, 0x4d8ee751, 0x8c52f662}},
        {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
         {0xa4093822, 0x299f31d0},
         {0x4dfccaba, 0x190a87f0, 0xc47362ba, 0xb6b5242a}},
    };
    static uint32_t words[WORDS];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        draw(*state, cases[i].counter, cases[i].key, words);
        for (int w = 0; w < 4; w++) {
            assert_int_equal(words[w * LANES], cases[i].words[w]);
        }
    }
}

/* Lane l of a call is lane 0 of one that begins l later. */
static void lanes_are_counters(void **state) {
    static uint32_t words[WORDS], later[WORDS];
    const uint32_t key[2] = {5, 6};
    draw(*state, (uint32_t[4]){100, 2, 7, 0}, key, words);
    for (uint32_t lane = 1; lane < LANES; lane++) {
        draw(*state, (uint32_t[4]){100 + lane, 2, 7, 0}, key, later);
        for (int call = 0; call < CALLS; call++) {
            for (int w = 0; w < 4; w++) {
                const uint32_t *row = words + (call * 4 + w) * LANES;
                assert_int_equal(row[lane], later[(call * 4 + w) * LANES]);
            }
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_are_the_published_ones),
        cmocka_unit_test(lanes_are_counters),
    };
    return cmocka_run_group_tests(tests, open_device, close_device);
}
