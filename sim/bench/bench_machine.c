#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>

#include "boresight/version.h"
#include "sim/bench/bench.h"
#include "sim/core/json_number.h"
#include "sim/device/device.h"

static bst_status describe(bst_ctx *ctx, void *user, void *out) {
    const bst_bench_options *options = user;
    bst_bench_device *d = out;
    bst_device *device;
    BST_TRY(
        bst_device_open(ctx, options->device ? options->device : "", options->threads, &device));
    snprintf(d->description, sizeof d->description, "%s", bst_device_description(device));
    cl_uint units = 0;
    clGetDeviceInfo(bst_device_id(device), CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL);
    clGetDeviceInfo(bst_device_id(device), CL_DRIVER_VERSION, sizeof d->driver - 1, d->driver,
                    NULL);
    d->threads = (int)units;
    bst_device_close(device);
    return BST_OK;
}

bst_status bst_bench_describe_device(bst_ctx *ctx, const bst_bench_options *options,
                                     bst_bench_device *out) {
    memset(out, 0, sizeof *out);
    bst_bench_options copy = *options;
    return bst_bench_apart(ctx, describe, &copy, out, sizeof *out);
}

/* Value of the first line of a file that begins with `key`; "": none. */
static void find_line(const char *path, const char *key, const char *end, char *out, size_t bytes) {
    char line[512];
    FILE *file = fopen(path, "r");
    out[0] = '\0';
    while (file && fgets(line, sizeof line, file)) {
        if (strncmp(line, key, strlen(key)) == 0) {
            const char *value = line + strlen(key) + strspn(line + strlen(key), " \t:=\"");
            snprintf(out, bytes, "%.*s", (int)strcspn(value, end), value);
            break;
        }
    }
    if (file) {
        fclose(file);
    }
}

cJSON *bst_bench_machine(const bst_bench_device *device) {
    cJSON *node = cJSON_CreateObject();
    char text[256];
    struct utsname system;
    find_line("/proc/cpuinfo", "model name", "\n", text, sizeof text);
    cJSON_AddStringToObject(node, "cpu", text[0] ? text : "unknown");
    cJSON_AddNumberToObject(node, "cores", (double)sysconf(_SC_NPROCESSORS_ONLN));
    cJSON_AddNumberToObject(
        node, "memory_mib",
        floor((double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE) / 1048576.0));
    find_line("/etc/os-release", "PRETTY_NAME", "\"\n", text, sizeof text);
    cJSON_AddStringToObject(node, "os", text[0] ? text : "unknown");
    if (uname(&system) == 0) {
        snprintf(text, sizeof text, "%.60s %.60s %.60s", system.sysname, system.release,
                 system.machine);
        cJSON_AddStringToObject(node, "kernel", text);
    }
#if defined(__clang__)
    cJSON_AddStringToObject(node, "compiler", "Clang " __clang_version__);
#elif defined(__GNUC__)
    cJSON_AddStringToObject(node, "compiler", "GCC " __VERSION__);
#else
    cJSON_AddStringToObject(node, "compiler", "unknown");
#endif
    cJSON_AddStringToObject(node, "device", device->description);
    cJSON_AddStringToObject(node, "driver", device->driver);
    cJSON_AddStringToObject(node, "version", bst_version());
    cJSON_AddStringToObject(node, "git_revision", bst_version_git_revision());
    time_t now = time(NULL);
    struct tm utc;
    if (gmtime_r(&now, &utc) && strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc) > 0) {
        cJSON_AddStringToObject(node, "date", text);
    }
    double load[3];
    FILE *file = fopen("/proc/loadavg", "r");
    if (file) { /* load by other processes: timings on a busy machine are unreliable */
        if (fscanf(file, "%lf %lf %lf", &load[0], &load[1], &load[2]) == 3) {
            cJSON_AddNumberToObject(node, "load_before", load[0]);
        }
        fclose(file);
    }
    return node;
}

cJSON *bst_bench_result_json(const bst_bench_result *r, const bst_bench_device *device) {
    cJSON *node = cJSON_CreateObject();
    cJSON_AddStringToObject(node, "name", r->name);
    bst_json_add_number(node, "frames_per_s", r->frames_per_s);
    bst_json_add_number(node, "ms_median", r->ms_median);
    bst_json_add_number(node, "ms_min", r->ms_min);
    bst_json_add_number(node, "cpu_ms", r->cpu_ms);
    bst_json_add_number(node, "latency_ms", r->latency_ms);
    bst_json_add_number(node, "error_sigma_max", r->error_sigma_max);
    bst_json_add_number(node, "error_sigma_rms", r->error_sigma_rms);
    bst_json_add_number(node, "error_peak_max", r->error_peak_max);
    bst_json_add_number(node, "predicted_error_sigma", r->predicted_error_sigma);
    bst_json_add_number(node, "flux_error_rel", r->flux_error_rel);
    bst_json_add_number(node, "centroid_error_px", r->centroid_error_px);
    cJSON_AddNumberToObject(node, "error_sources", r->error_sources);
    bst_json_add_number(node, "peak_rss_mib", r->peak_rss_mib);
    bst_json_add_number(node, "setup_s", r->setup_s);
    bst_json_add_number(node, "ms_max", r->ms_max);
    bst_json_add_number(node, "error_px", r->error_px);
    bst_json_add_number(node, "error_m", r->error_m);
    bst_json_add_number(node, "detections", r->detections);
    bst_json_add_number(node, "detections_lost", r->detections_lost);
    if (r->phase_count > 0) {
        cJSON *phases = cJSON_AddObjectToObject(node, "phases_ms");
        for (int i = 0; i < r->phase_count; i++) {
            bst_json_add_number(phases, r->phases[i].name, r->phases[i].ms);
        }
    }
    cJSON_AddStringToObject(node, "device", device->description);
    cJSON_AddNumberToObject(node, "threads", device->threads);
    return node;
}
