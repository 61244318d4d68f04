#include "boresight/rng.h"
#include "bst_device_kernels.h"
#include "sim/device/build_log.h"
#include "sim/device/device.h"
#include "tests/test_support.h"

static void opens_by_default_by_name_and_by_index(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const char *selectors[] = {"", "0:0"};
    for (size_t i = 0; i < 2; i++) {
        bst_device *device;
        bst_assert_ok(&ctx, bst_device_open(&ctx, selectors[i], 0, &device));
        assert_true(strlen(bst_device_description(device)) > 5);
        assert_non_null(bst_device_context(device));
        assert_non_null(bst_device_queue(device));
        bst_device_close(device);
    }
}

static void unknown_selectors_list_what_there_is(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    const char *selectors[] = {"no such device", "9:9"};
    for (size_t i = 0; i < 2; i++) {
        bst_device *device = (bst_device *)&ctx;
        assert_int_equal(bst_device_open(&ctx, selectors[i], 0, &device), BST_ERR_NOT_FOUND);
        assert_null(device);
        assert_non_null(strstr(ctx.message, selectors[i]));
        assert_non_null(strstr(ctx.message, "0:0 "));
    }
}

static void threads_limit_a_cpu_device(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 1, &device));
    cl_device_type type = 0;
    cl_uint units = 0;
    clGetDeviceInfo(bst_device_id(device), CL_DEVICE_TYPE, sizeof type, &type, NULL);
    clGetDeviceInfo(bst_device_id(device), CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL);
    if (type & CL_DEVICE_TYPE_CPU) {
        assert_int_equal(units, 1);
        assert_non_null(strstr(bst_device_description(device), "1 compute unit"));
    }
    bst_device_close(device);
}

static void build_errors_name_the_file(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 1, &device));
    bst_device_kernel_source bad = {"bad_kernel.cl",
                                    "kernel void f(global int *a) {\n a[0] = nonsense;\n}\n", 0, 0};
    const bst_device_kernel_source *sources[] = {&bst_kernel_philox_shared, &bad};
    cl_program program;
    assert_int_equal(bst_device_build(&ctx, device, sources, 2, "", &program), BST_ERR_DEVICE);
    assert_null(program);
    assert_non_null(strstr(ctx.message, "bad_kernel.cl"));
    assert_non_null(strstr(ctx.message, "nonsense"));
    bst_device_close(device);
}

/* A function that builtins.cl does not declare is found in the headers of the OpenCL
 * implementation. */
static void other_functions_are_found_in_headers(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 1, &device));
    const bool pocl = strncmp(bst_device_description(device), "PoCL", 4) == 0;
    bst_device_kernel_source
        known = {"known.cl", "kernel void f(global float *a) { a[0] = fma(a[1], a[2], a[3]); }\n",
                 0, 0},
        other = {"other.cl", "kernel void f(global float *a) { a[0] = lgamma(a[1]); }\n", 0, 0};
    const bst_device_kernel_source *sources[] = {&known, &other};
    for (int i = 0; i < 2; i++) {
        cl_program program;
        bst_assert_ok(&ctx,
                      bst_device_build(&ctx, device, &sources[i], 1, "-cl-std=CL1.2", &program));
        cl_int code;
        cl_kernel kernel = clCreateKernel(program, "f", &code);
        bst_assert_ok(&ctx, bst_device_check(&ctx, code, "kernel"));
        clReleaseKernel(kernel);
        clReleaseProgram(program);
        assert_int_equal(bst_device_header_builds(device), pocl ? i : i + 1);
    }
    bst_device_close(device);
}

/* The log of NVIDIA's compiler, which ignores #line and counts the lines of all sources. */
static void logs_without_names_get_them(void **state) {
    (void)state;
    bst_device_kernel_source one = {"one.cl", "int a;\nint b;\n", 0, 0},
                             two = {"two.cl", "int c;\nint d = e;\n", 0, 0};
    const bst_device_kernel_source *sources[] = {&one, &two};
    const char *texts[] = {"#define X\n", "\n#line 1 \"one.cl\"\n", one.text,
                           "\n#line 1 \"two.cl\"\n", two.text};
    char *log = bst_build_log_with_names(
        "<kernel>:9:9: error: use of 'e'\n<kernel>:4:5: note\n"
        "<kernel>:1:1: warning <kernel>:99:1: end",
        texts, 5, sources);
    assert_string_equal(log,
                        "two.cl:2:9: error: use of 'e'\none.cl:1:5: note\n"
                        "<kernel>:1:1: warning <kernel>:99:1: end");
    free(log);
}

/* The shared Philox header gives on the device the words that it gives on the host. */
static void philox_is_the_same_on_the_device(void **state) {
    (void)state;
    enum { N = 1000 };
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    bst_device_kernel_source text = {
        "words.cl",
        "kernel void words(global uint *out, uint k0, uint k1, uint a) {\n"
        "    uint i = (uint)get_global_id(0);\n"
        "    bst_philox_words r = bst_philox4x32(k0, k1, i, 0, a, 0);\n"
        "    for (int w = 0; w < 4; w++) out[4 * i + w] = r.w[w];\n"
        "}\n",
        0, 0};
    const bst_device_kernel_source *sources[] = {&bst_kernel_philox_shared, &text};
    cl_program program;
    bst_assert_ok(&ctx, bst_device_build(&ctx, device, sources, 2, "", &program));
    cl_int code;
    cl_kernel kernel = clCreateKernel(program, "words", &code);
    bst_assert_ok(&ctx, bst_device_check(&ctx, code, "kernel"));
    cl_mem buffer = clCreateBuffer(bst_device_context(device), CL_MEM_WRITE_ONLY,
                                   N * 4 * sizeof(cl_uint), NULL, &code);
    bst_assert_ok(&ctx, bst_device_check(&ctx, code, "buffer"));
    bst_rng_key key = bst_rng_make_key(3, 1, "test", "device");
    cl_uint a = 77;
    clSetKernelArg(kernel, 0, sizeof buffer, &buffer);
    clSetKernelArg(kernel, 1, sizeof(cl_uint), &key.k[0]);
    clSetKernelArg(kernel, 2, sizeof(cl_uint), &key.k[1]);
    clSetKernelArg(kernel, 3, sizeof a, &a);
    size_t global = N;
    bst_assert_ok(&ctx, bst_device_check(&ctx,
                                         clEnqueueNDRangeKernel(bst_device_queue(device), kernel, 1,
                                                                NULL, &global, NULL, 0, NULL, NULL),
                                         "run"));
    static cl_uint words[4 * N];
    bst_assert_ok(&ctx,
                  bst_device_check(&ctx,
                                   clEnqueueReadBuffer(bst_device_queue(device), buffer, CL_TRUE, 0,
                                                       sizeof words, words, 0, NULL, NULL),
                                   "read"));
    for (uint32_t i = 0; i < N; i++) {
        bst_philox_words r = bst_rng_words(key, a, i);
        assert_memory_equal(r.w, &words[4 * i], sizeof r.w);
    }
    clReleaseMemObject(buffer);
    clReleaseKernel(kernel);
    clReleaseProgram(program);
    bst_device_close(device);
}

/* Small and large, with content and without: what is written is read back, and nothing leaks. */
static void buffers_hold_their_content(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_device *device;
    bst_assert_ok(&ctx, bst_device_open(&ctx, "", 0, &device));
    const size_t sizes[] = {4096, 9000000};
    for (size_t i = 0; i < 2; i++) {
        unsigned char *data = malloc(sizes[i]), *back = malloc(sizes[i]);
        for (size_t k = 0; k < sizes[i]; k++) {
            data[k] = (unsigned char)(k * 2654435761u >> 13);
        }
        for (int given = 0; given < 2; given++) {
            cl_mem buffer;
            bst_assert_ok(&ctx, bst_device_buffer(&ctx, bst_device_context(device), sizes[i],
                                                  given ? data : NULL, "a buffer", &buffer));
            cl_command_queue queue = bst_device_queue(device);
            if (!given) {
                assert_int_equal(
                    clEnqueueWriteBuffer(queue, buffer, CL_TRUE, 0, sizes[i], data, 0, NULL, NULL),
                    CL_SUCCESS);
            }
            memset(back, 0, sizes[i]);
            assert_int_equal(
                clEnqueueReadBuffer(queue, buffer, CL_TRUE, 0, sizes[i], back, 0, NULL, NULL),
                CL_SUCCESS);
            assert_memory_equal(data, back, sizes[i]);
            clReleaseMemObject(buffer);
        }
        free(data);
        free(back);
    }
    cl_mem none;
    assert_int_equal(
        bst_device_buffer(&ctx, bst_device_context(device), 0, NULL, "an empty buffer", &none),
        BST_ERR_DEVICE);
    assert_null(none);
    assert_non_null(strstr(ctx.message, "an empty buffer"));
    bst_device_close(device);
}

static void hashes_are_fnv1a_of_the_text(void **state) {
    (void)state;
    unsigned long long hash = 0xCBF29CE484222325u;
    for (const char *c = bst_kernel_philox_shared.text; *c; c++) {
        hash = (hash ^ (unsigned char)*c) * 0x100000001B3u;
    }
    assert_int_equal(bst_kernel_philox_shared.hash_high, (unsigned)(hash >> 32));
    assert_int_equal(bst_kernel_philox_shared.hash_low, (unsigned)hash);
    assert_string_equal(bst_kernel_philox_shared.name, "philox_shared.h");
}

static void check_names_the_code(void **state) {
    (void)state;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_device_check(&ctx, CL_SUCCESS, "nothing"));
    assert_int_equal(bst_device_check(&ctx, CL_OUT_OF_RESOURCES, "rendering"), BST_ERR_DEVICE);
    assert_string_equal(ctx.message, "rendering: CL_OUT_OF_RESOURCES");
    assert_int_equal(bst_device_check(&ctx, -4242, "rendering"), BST_ERR_DEVICE);
    assert_non_null(strstr(ctx.message, "-4242"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opens_by_default_by_name_and_by_index),
        cmocka_unit_test(unknown_selectors_list_what_there_is),
        cmocka_unit_test(threads_limit_a_cpu_device),
        cmocka_unit_test(build_errors_name_the_file),
        cmocka_unit_test(other_functions_are_found_in_headers),
        cmocka_unit_test(logs_without_names_get_them),
        cmocka_unit_test(philox_is_the_same_on_the_device),
        cmocka_unit_test(buffers_hold_their_content),
        cmocka_unit_test(hashes_are_fnv1a_of_the_text),
        cmocka_unit_test(check_names_the_code),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
