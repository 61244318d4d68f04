#include "sim/device/device.h"

#include <assert.h>
#include <ctype.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bst_device_kernels.h"
#include "sim/device/build_log.h"
#include "sim/device/kernel_cache.h"

enum { MAX_PLATFORMS = 16, MAX_DEVICES = 32, NAME_BYTES = 256 };

enum { MAX_BUILT = 64, MAX_PROGRAMS = 64, PROGRAM_SOURCES = 32 };

/* A cached OpenCL program. */
typedef struct kept_program {
    cl_program program;
    const bst_device_kernel_source *sources[PROGRAM_SOURCES];
    int count;
    char *options;
} kept_program;

struct bst_device {
    bst_device *origin;      /* the device whose context and programs this one shares; NULL: none */
    cl_device_id parent, id; /* equal unless it is a sub-device */
    cl_context context;
    cl_command_queue queue;
    char description[4 * NAME_BYTES];
    time_t opened;
    bool pocl;
    bool declares_builtins; /* kernels are built with kernels/builtins.cl, not with its headers */
    pthread_mutex_t
        lock; /* protects all members below: cameras that change build programs on any thread */
    const bst_device_kernel_source
        *built[MAX_BUILT]; /* sources of all programs, without duplicates */
    int built_count;
    kept_program programs[MAX_PROGRAMS];
    int program_count;
    int header_builds; /* programs that were built with the device's own headers */
};

static const struct {
    cl_int code;
    const char *name;
} code_names[] = {
    {CL_DEVICE_NOT_FOUND, "CL_DEVICE_NOT_FOUND"},
    {CL_DEVICE_NOT_AVAILABLE, "CL_DEVICE_NOT_AVAILABLE"},
    {CL_COMPILER_NOT_AVAILABLE, "CL_COMPILER_NOT_AVAILABLE"},
    {CL_MEM_OBJECT_ALLOCATION_FAILURE, "CL_MEM_OBJECT_ALLOCATION_FAILURE"},
    {CL_OUT_OF_RESOURCES, "CL_OUT_OF_RESOURCES"},
    {CL_OUT_OF_HOST_MEMORY, "CL_OUT_OF_HOST_MEMORY"},
    {CL_BUILD_PROGRAM_FAILURE, "CL_BUILD_PROGRAM_FAILURE"},
    {CL_MAP_FAILURE, "CL_MAP_FAILURE"},
    {CL_DEVICE_PARTITION_FAILED, "CL_DEVICE_PARTITION_FAILED"},
    {CL_INVALID_VALUE, "CL_INVALID_VALUE"},
    {CL_INVALID_DEVICE, "CL_INVALID_DEVICE"},
    {CL_INVALID_CONTEXT, "CL_INVALID_CONTEXT"},
    {CL_INVALID_MEM_OBJECT, "CL_INVALID_MEM_OBJECT"},
    {CL_INVALID_BUILD_OPTIONS, "CL_INVALID_BUILD_OPTIONS"},
    {CL_INVALID_PROGRAM, "CL_INVALID_PROGRAM"},
    {CL_INVALID_KERNEL_NAME, "CL_INVALID_KERNEL_NAME"},
    {CL_INVALID_KERNEL, "CL_INVALID_KERNEL"},
    {CL_INVALID_ARG_INDEX, "CL_INVALID_ARG_INDEX"},
    {CL_INVALID_ARG_VALUE, "CL_INVALID_ARG_VALUE"},
    {CL_INVALID_ARG_SIZE, "CL_INVALID_ARG_SIZE"},
    {CL_INVALID_KERNEL_ARGS, "CL_INVALID_KERNEL_ARGS"},
    {CL_INVALID_WORK_GROUP_SIZE, "CL_INVALID_WORK_GROUP_SIZE"},
    {CL_INVALID_BUFFER_SIZE, "CL_INVALID_BUFFER_SIZE"},
    {CL_INVALID_GLOBAL_WORK_SIZE, "CL_INVALID_GLOBAL_WORK_SIZE"},
    {-1001, "CL_PLATFORM_NOT_FOUND_KHR"},
};

bst_status bst_device_check(bst_ctx *ctx, cl_int code, const char *what) {
    if (code == CL_SUCCESS) {
        return BST_OK;
    }
    for (size_t i = 0; i < sizeof code_names / sizeof *code_names; i++) {
        if (code_names[i].code == code) {
            return bst_fail(ctx, BST_ERR_DEVICE, "%s: %s", what, code_names[i].name);
        }
    }
    return bst_fail(ctx, BST_ERR_DEVICE, "%s: OpenCL error %d", what, (int)code);
}

typedef struct candidate {
    cl_device_id id;
    int platform_index, device_index;
    bool cpu, pocl;
    char platform[NAME_BYTES], name[NAME_BYTES];
} candidate;

static void device_string(cl_device_id id, cl_device_info what, char *out, size_t bytes) {
    if (clGetDeviceInfo(id, what, bytes, out, NULL) != CL_SUCCESS) {
        snprintf(out, bytes, "unknown");
    }
}

static bst_status list_devices(bst_ctx *ctx, candidate *list, int *count) {
    cl_platform_id platforms[MAX_PLATFORMS];
    cl_uint platform_count = 0;
    cl_int code = clGetPlatformIDs(MAX_PLATFORMS, platforms, &platform_count);
    if (code != CL_SUCCESS || platform_count == 0) {
        return bst_fail(ctx, BST_ERR_DEVICE,
                        "no OpenCL platform found: install PoCL, which works on any CPU "
                        "(Debian: apt install pocl-opencl-icd; Python: pip install "
                        "boresight[pocl]), or the OpenCL driver of a GPU");
    }
    *count = 0;
    for (cl_uint p = 0; p < platform_count && p < MAX_PLATFORMS; p++) {
        char platform[NAME_BYTES] = "unknown";
        if (clGetPlatformInfo(platforms[p], CL_PLATFORM_NAME, sizeof platform, platform, NULL) !=
            CL_SUCCESS) {
            continue;
        }
        cl_device_id ids[MAX_DEVICES];
        cl_uint n = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, MAX_DEVICES, ids, &n) != CL_SUCCESS) {
            continue;
        }
        for (cl_uint d = 0; d < n && d < MAX_DEVICES && *count < MAX_DEVICES; d++) {
            candidate *c = &list[(*count)++];
            *c = (candidate){.id = ids[d], .platform_index = (int)p, .device_index = (int)d};
            snprintf(c->platform, sizeof c->platform, "%s", platform);
            device_string(ids[d], CL_DEVICE_NAME, c->name, sizeof c->name);
            cl_device_type type = 0;
            if (clGetDeviceInfo(ids[d], CL_DEVICE_TYPE, sizeof type, &type, NULL) == CL_SUCCESS) {
                c->cpu = (type & CL_DEVICE_TYPE_CPU) != 0;
            }
            c->pocl = strstr(platform, "Portable Computing Language") != NULL;
        }
    }
    if (*count == 0) {
        char cache[NAME_BYTES + 512];
        return bst_kernel_cache_is_unusable(cache, sizeof cache)
                   ? bst_fail(ctx, BST_ERR_DEVICE, "%s", cache)
                   : bst_fail(ctx, BST_ERR_DEVICE, "the OpenCL platforms offer no device");
    }
    return BST_OK;
}

static bool contains_ignoring_case(const char *text, const char *part) {
    for (; *text; text++) {
        size_t i = 0;
        while (part[i] && tolower((unsigned char)text[i]) == tolower((unsigned char)part[i])) {
            i++;
        }
        if (!part[i]) {
            return true;
        }
    }
    return false;
}

/* Selects an OpenCL device by selector; by default PoCL on the CPU. */
static int choose(const candidate *list, int count, const char *selector) {
    if (!*selector) {
        for (int i = 0; i < count; i++) {
            if (list[i].pocl && list[i].cpu) {
                return i;
            }
        }
        return 0;
    }
    int p, d, end = 0;
    if (sscanf(selector, "%d:%d%n", &p, &d, &end) == 2 && selector[end] == '\0') {
        for (int i = 0; i < count; i++) {
            if (list[i].platform_index == p && list[i].device_index == d) {
                return i;
            }
        }
        return -1;
    }
    for (int i = 0; i < count; i++) {
        if (contains_ignoring_case(list[i].platform, selector) ||
            contains_ignoring_case(list[i].name, selector)) {
            return i;
        }
    }
    return -1;
}

static bst_status unknown_selector(bst_ctx *ctx, const char *selector, const candidate *list,
                                   int count) {
    char text[BST_MESSAGE_BYTES / 2] = "";
    size_t used = 0;
    for (int i = 0; i < count && used < sizeof text; i++) {
        int n =
            snprintf(text + used, sizeof text - used, "%s%d:%d %s / %s", i ? "; " : "",
                     list[i].platform_index, list[i].device_index, list[i].platform, list[i].name);
        used += n > 0 ? (size_t)n : 0;
    }
    return bst_fail(ctx, BST_ERR_NOT_FOUND, "no OpenCL device matches \"%s\"; there is: %s",
                    selector, text);
}

static bst_status limit_threads(bst_ctx *ctx, bst_device *device, const candidate *c, int threads,
                                cl_uint *units) {
    BST_TRY(bst_device_check(
        ctx, clGetDeviceInfo(c->id, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof *units, units, NULL),
        "asking for the number of compute units"));
    if (threads <= 0 || !c->cpu || (cl_uint)threads >= *units) {
        return BST_OK;
    }
    cl_device_partition_property properties[] = {CL_DEVICE_PARTITION_BY_COUNTS, threads,
                                                 CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0};
    cl_device_id sub;
    cl_int code = clCreateSubDevices(c->id, properties, 1, &sub, NULL);
    if (code != CL_SUCCESS) {
        char what[64];
        snprintf(what, sizeof what, "limiting the device to %d threads", threads);
        return bst_device_check(ctx, code, what);
    }
    device->id = sub;
    *units = (cl_uint)threads;
    return BST_OK;
}

bst_status bst_device_open(bst_ctx *ctx, const char *selector, int threads, bst_device **out) {
    *out = NULL;
    candidate *list = calloc(MAX_DEVICES, sizeof *list);
    bst_device *device = calloc(1, sizeof *device);
    bst_status status = BST_OK;
    if (!list || !device) {
        free(list);
        free(device);
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the OpenCL device");
    }
    pthread_mutex_init(&device->lock, NULL);
    int count = 0;
    device->opened = time(NULL);
    if ((status = bst_kernel_cache_prepare(ctx)) != BST_OK ||
        (status = list_devices(ctx, list, &count)) != BST_OK) {
        goto exit;
    }
    int chosen = choose(list, count, selector ? selector : "");
    if (chosen < 0) {
        status = unknown_selector(ctx, selector, list, count);
        goto exit;
    }
    const candidate *c = &list[chosen];
    device->parent = device->id = c->id;
    device->pocl = c->pocl;
    device->declares_builtins = c->pocl && c->cpu; /* PoCL's GPU targets were not tested with it */
    cl_uint units = 1;
    if ((status = limit_threads(ctx, device, c, threads, &units)) != BST_OK) {
        goto exit;
    }
    cl_int code;
    device->context = clCreateContext(NULL, 1, &device->id, NULL, NULL, &code);
    if ((status = bst_device_check(ctx, code, "creating the OpenCL context")) != BST_OK) {
        goto exit;
    }
    device->queue = clCreateCommandQueue(device->context, device->id, 0, &code);
    if ((status = bst_device_check(ctx, code, "creating the OpenCL queue")) != BST_OK) {
        goto exit;
    }
    char version[NAME_BYTES];
    device_string(c->id, CL_DRIVER_VERSION, version, sizeof version);
    snprintf(device->description, sizeof device->description, "%s %s: %s, %u compute unit%s",
             c->pocl ? "PoCL" : c->platform, version, c->name, (unsigned)units,
             units == 1 ? "" : "s");
    *out = device;
    device = NULL;
exit:
    bst_device_close(device);
    free(list);
    return status;
}

/* Waits until PoCL's worker threads have released the queue. PoCL 3.1 reports a command complete
 * before its worker releases the event, and crashes if queue and context are freed by then. An
 * event holds a reference of its queue: wait until the references are gone. Other references are
 * possible: the wait is limited. */
static void wait_for_workers(cl_command_queue queue) {
    const struct timespec pause = {0, 200000};
    cl_uint references = 2;
    for (int i = 0; i < 100 && references > 1; i++) {
        if (clGetCommandQueueInfo(queue, CL_QUEUE_REFERENCE_COUNT, sizeof references, &references,
                                  NULL) != CL_SUCCESS) {
            return;
        }
        nanosleep(&pause, NULL); /* also after the last reference: the worker is just ending */
    }
}

void bst_device_close(bst_device *device) {
    if (!device) {
        return;
    }
    const bool first = device->origin == NULL;
    for (int i = 0; i < device->program_count; i++) {
        clReleaseProgram(device->programs[i].program);
        free(device->programs[i].options);
    }
    if (device->queue) {
        clFinish(device->queue);
        wait_for_workers(device->queue);
        clReleaseCommandQueue(device->queue);
    }
    if (device->context && first) {
        clReleaseContext(device->context);
    }
    if (device->id != device->parent && first) {
        clReleaseDevice(device->id);
    }
    if (device->pocl && first && device->built_count > 0) {
        bst_kernel_cache_settle(device->opened);
    }
    pthread_mutex_destroy(&device->lock);
    free(device);
}

bst_status bst_device_share(bst_ctx *ctx, bst_device *device, bst_device **out) {
    bst_device *origin = device->origin ? device->origin : device;
    *out = NULL;
    bst_device *copy = calloc(1, sizeof *copy);
    if (!copy) {
        return bst_fail(ctx, BST_ERR_MEMORY, "no memory for the OpenCL device");
    }
    pthread_mutex_init(&copy->lock, NULL);
    copy->origin = origin;
    copy->parent = origin->parent;
    copy->id = origin->id;
    copy->context = origin->context;
    copy->pocl = origin->pocl;
    memcpy(copy->description, origin->description, sizeof copy->description);
    cl_int code;
    copy->queue = clCreateCommandQueue(copy->context, copy->id, 0, &code);
    bst_status status = bst_device_check(ctx, code, "creating an OpenCL queue");
    if (status != BST_OK) {
        copy->queue = NULL;
        bst_device_close(copy);
        return status;
    }
    *out = copy;
    return BST_OK;
}

cl_context bst_device_context(const bst_device *device) {
    return device->context;
}
cl_command_queue bst_device_queue(const bst_device *device) {
    return device->queue;
}
cl_device_id bst_device_id(const bst_device *device) {
    return device->id;
}
bool bst_device_is_cpu(const bst_device *device) {
    cl_device_type type = CL_DEVICE_TYPE_CPU;
    return clGetDeviceInfo(device->id, CL_DEVICE_TYPE, sizeof type, &type, NULL) != CL_SUCCESS ||
           (type & CL_DEVICE_TYPE_CPU) != 0;
}

int bst_device_processors(const bst_device *device) {
    cl_uint units = 0;
    bool known =
        bst_device_is_cpu(device) && clGetDeviceInfo(device->id, CL_DEVICE_MAX_COMPUTE_UNITS,
                                                     sizeof units, &units, NULL) == CL_SUCCESS;
    return known ? (int)units : 0;
}
const char *bst_device_description(const bst_device *device) {
    return device->description;
}

/* Error with the first lines of the build log. */
static bst_status build_failure(bst_ctx *ctx, const bst_device *device, cl_program program,
                                const char *const *texts, int text_count,
                                const bst_device_kernel_source *const *sources) {
    const char *first_name = sources[0]->name;
    char cache[NAME_BYTES + 512];
    if (strncmp(device->description, "PoCL", 4) == 0 &&
        bst_kernel_cache_is_unusable(cache, sizeof cache)) {
        return bst_fail(ctx, BST_ERR_DEVICE, "building OpenCL kernels (%s ...) failed: %s",
                        first_name, cache);
    }
    size_t bytes = 0;
    clGetProgramBuildInfo(program, device->id, CL_PROGRAM_BUILD_LOG, 0, NULL, &bytes);
    char *log = calloc(bytes + 1, 1);
    if (log && bytes) {
        clGetProgramBuildInfo(program, device->id, CL_PROGRAM_BUILD_LOG, bytes, log, NULL);
        char *named = bst_build_log_with_names(log, texts, text_count, sources);
        if (named) {
            free(log);
            log = named;
        }
    }
    bst_status status =
        bst_fail(ctx, BST_ERR_DEVICE, "building OpenCL kernels (%s ...) for %s failed:\n%.700s",
                 first_name, device->description, log && *log ? log : "(no log)");
    free(log);
    return status;
}

/* Lists a kernel source as built. */
static void note_built(bst_device *device, const bst_device_kernel_source *source) {
    for (int i = 0; i < device->built_count; i++) {
        if (device->built[i] == source) {
            return;
        }
    }
    if (device->built_count < MAX_BUILT) {
        device->built[device->built_count++] = source;
    }
}

const bst_device_kernel_source *bst_device_built(const bst_device *device, int index) {
    return index >= 0 && index < device->built_count ? device->built[index] : NULL;
}

int bst_device_header_builds(const bst_device *device) {
    return (device->origin ? device->origin : device)->header_builds;
}

void bst_device_begin_list(bst_device *device) {
    device->built_count = 0;
}

static cl_program find_program(const bst_device *device,
                               const bst_device_kernel_source *const *sources, int count,
                               const char *options) {
    for (int i = 0; i < device->program_count; i++) {
        const kept_program *kept = &device->programs[i];
        if (kept->count == count && strcmp(kept->options, options) == 0 &&
            memcmp(kept->sources, sources, (size_t)count * sizeof *sources) == 0) {
            return kept->program;
        }
    }
    return NULL;
}

/* Caches a program with a reference of its own, if there is room. */
static void keep_program(bst_device *device, const bst_device_kernel_source *const *sources,
                         int count, const char *options, cl_program program) {
    kept_program *kept = &device->programs[device->program_count];
    if (device->program_count == MAX_PROGRAMS || count > PROGRAM_SOURCES ||
        !(kept->options = strdup(options))) {
        return;
    }
    clRetainProgram(program);
    kept->program = program;
    kept->count = count;
    memcpy(kept->sources, sources, (size_t)count * sizeof *sources);
    device->program_count++;
}

/* Clang warns several hundred times about each 512-bit vector argument on processors without such
 * registers; all functions of a program are compiled alike. Old versions, as in NVIDIA's compiler,
 * warn of the unknown name instead. */
static const char no_abi_warnings[] =
    "#ifdef __has_warning\n"
    "#if __has_warning(\"-Wpsabi\")\n"
    "#pragma clang diagnostic ignored \"-Wpsabi\"\n"
    "#endif\n"
    "#endif\n";

/* The guard of Clang's opencl-c.h. */
static const char no_header[] = " -D_OPENCL_H_";

/* Builds a program for PoCL on a CPU with declarations of the built-in functions in place of its
 * headers, which it would read for 50 ms even if the kernels are cached; false: with the headers,
 * then. */
static bool build_without_headers(bst_device *device, const char **texts, cl_uint count,
                                  const char *options, cl_program *out) {
    const char *prelude = texts[0];
    size_t bytes = strlen(prelude) + strlen(bst_kernel_builtins.text) + 1,
           option_bytes = strlen(options) + sizeof no_header;
    char *declared = malloc(bytes), *all_options = malloc(option_bytes);
    cl_program program = NULL;
    if (declared && all_options) {
        snprintf(declared, bytes, "%s%s", prelude, bst_kernel_builtins.text);
        snprintf(all_options, option_bytes, "%s%s", options, no_header);
        texts[0] = declared;
        program = clCreateProgramWithSource(device->context, count, texts, NULL, NULL);
        texts[0] = prelude;
    }
    if (program && clBuildProgram(program, 1, &device->id, all_options, NULL, NULL) != CL_SUCCESS) {
        clReleaseProgram(program);
        program = NULL;
    }
    free(declared);
    free(all_options);
    *out = program;
    return program != NULL;
}

/* Builds an OpenCL program, or returns the one already built. */
static bst_status build(bst_ctx *ctx, bst_device *device,
                        const bst_device_kernel_source *const *sources, int count,
                        const char *options, cl_program *out) {
    *out = find_program(device, sources, count, options ? options : "");
    if (*out) {
        clRetainProgram(*out);
        for (int i = 0; i < count; i++) {
            note_built(device, sources[i]);
        }
        return BST_OK;
    }
    /* a #line before each source: the build log then names the file */
    const char **texts = calloc((size_t)count * 2 + 1, sizeof *texts);
    char(*lines)[NAME_BYTES] = calloc((size_t)count, sizeof *lines);
    cl_program program = NULL;
    bst_status status = BST_OK;
    if (!texts || !lines) {
        status = bst_fail(ctx, BST_ERR_MEMORY, "no memory for the kernel sources");
        goto exit;
    }
    texts[0] = no_abi_warnings;
    for (int i = 0; i < count; i++) {
        snprintf(lines[i], sizeof lines[i], "\n#line 1 \"%s\"\n", sources[i]->name);
        texts[2 * i + 1] = lines[i];
        texts[2 * i + 2] = sources[i]->text;
    }
    if (device->declares_builtins && build_without_headers(device, texts, (cl_uint)count * 2 + 1,
                                                           options ? options : "", &program)) {
        goto built;
    }
    device->header_builds++;
    cl_int code;
    program =
        clCreateProgramWithSource(device->context, (cl_uint)count * 2 + 1, texts, NULL, &code);
    if ((status = bst_device_check(ctx, code, "creating an OpenCL program")) != BST_OK) {
        goto exit;
    }
    code = clBuildProgram(program, 1, &device->id, options ? options : "", NULL, NULL);
    if (code != CL_SUCCESS) {
        status = build_failure(ctx, device, program, texts, count * 2 + 1, sources);
        goto exit;
    }
built:
    for (int i = 0; i < count; i++) {
        note_built(device, sources[i]);
    }
    keep_program(device, sources, count, options ? options : "", program);
    *out = program;
    program = NULL;
exit:
    if (program) {
        clReleaseProgram(program);
    }
    free(texts);
    free(lines);
    return status;
}

bst_status bst_device_build(bst_ctx *ctx, bst_device *device,
                            const bst_device_kernel_source *const *sources, int count,
                            const char *options, cl_program *out) {
    assert(device && sources && count >= 1 && options && out);
    bst_device *origin = device->origin ? device->origin : device;
    pthread_mutex_lock(&origin->lock);
    bst_status status = build(ctx, origin, sources, count, options, out);
    pthread_mutex_unlock(&origin->lock);
    if (status == BST_OK && device != origin) {
        pthread_mutex_lock(&device->lock);
        for (int i = 0; i < count; i++) {
            note_built(device, sources[i]);
        }
        pthread_mutex_unlock(&device->lock);
    }
    return status;
}
