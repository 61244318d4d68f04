/* boresight version: versions of the program and of what it is made of. */
#include <GeographicLib/Config.h>
#include <civetweb.h>
#include <erfaextra.h>
#include <expat.h>
#include <fitsio.h>
#include <png.h>
#include <sqlite3.h>
#include <stdio.h>
#include <tiffio.h>
#include <unistd.h>
#include <zlib.h>
#include <zmq.h>
#include <opencv2/core/version.hpp>

#include "boresight/version.h"
#include "sim/app/app.h"
#include "sim/bench/bench.h"
#include "sim/catalogue/stars.h"
#include "sim/cli/cli.h"
#include "sim/cli/command_line.h"
#include "sim/cli/options.h"
#include "sim/cli/print_json.h"
#include "sim/core/fft.h"
#include "sim/link/packet.h"

static const char help_text[] =
    "usage: boresight version [options]\n"
    "\n"
    "Prints version and revision of the program. --verbose adds what a report of a fault should\n"
    "contain: machine, compiler, OpenCL device and driver, versions of the libraries in use, star\n"
    "catalogue, version of the link's protocol.\n"
    "\n"
    "  boresight version --verbose\n"
    "  boresight version --json | jq -r .libraries.SQLite\n"
    "\n"
    "options:\n";

/* Versions of the libraries that are loaded, or were compiled in where they have no call for it. */
static cJSON *libraries(void) {
    cJSON *out = cJSON_CreateObject();
    char text[64];
    int major, minor, patch;
    float cfitsio;
    cJSON_AddStringToObject(out, "OpenCV", CV_VERSION);
    cJSON_AddStringToObject(out, "ERFA", eraVersion());
    snprintf(text, sizeof text, "%.4g", (double)fits_get_version(&cfitsio));
    cJSON_AddStringToObject(out, "cfitsio", text);
    cJSON_AddStringToObject(out, "GeographicLib", GEOGRAPHICLIB_VERSION_STRING);
    cJSON_AddStringToObject(out, "SQLite", sqlite3_libversion());
    cJSON_AddStringToObject(out, "Fourier transforms", bst_fft_library());
    zmq_version(&major, &minor, &patch);
    snprintf(text, sizeof text, "%d.%d.%d", major, minor, patch);
    cJSON_AddStringToObject(out, "ZeroMQ", text);
    cJSON_AddStringToObject(out, "cJSON", cJSON_Version());
    cJSON_AddStringToObject(out, "libpng", png_get_libpng_ver(NULL));
    unsigned tiff[3] = {0};
    (void)sscanf(TIFFGetVersion(), "LIBTIFF, Version %u.%u.%u", &tiff[0], &tiff[1], &tiff[2]);
    snprintf(text, sizeof text, "%u.%u.%u", tiff[0], tiff[1], tiff[2]);
    cJSON_AddStringToObject(out, "libtiff", text);
    cJSON_AddStringToObject(out, "zlib", zlibVersion());
    cJSON_AddStringToObject(out, "civetweb", mg_version());
    XML_Expat_Version expat = XML_ExpatVersionInfo();
    snprintf(text, sizeof text, "%d.%d.%d", expat.major, expat.minor, expat.micro);
    cJSON_AddStringToObject(out, "Expat", text);
    return out;
}

/* Everything as JSON; a device that cannot be opened is given by its error. */
static cJSON *describe(bst_ctx *ctx) {
    const bst_bench_options options = {.device = ""};
    bst_bench_device device;
    if (bst_bench_describe_device(ctx, &options, &device) != BST_OK) {
        snprintf(device.description, sizeof device.description, "none: %.200s", ctx->message);
        device.driver[0] = '\0';
    }
    cJSON *out = bst_bench_machine(&device);
    char stars[4096];
    cJSON_DeleteItemFromObjectCaseSensitive(out, "date");
    cJSON_DeleteItemFromObjectCaseSensitive(out, "load_before");
    if (bst_stars_default_path(ctx, stars, sizeof stars) == BST_OK) {
        bool there = access(stars, F_OK) == 0;
        cJSON_AddStringToObject(out, "star_catalogue", there ? stars : "embedded stars");
    }
    cJSON_AddNumberToObject(out, "link_protocol", BST_LINK_VERSION);
    cJSON_AddItemToObject(out, "libraries", libraries());
    return out;
}

static void print(const cJSON *node, int indent) {
    for (const cJSON *item = node ? node->child : NULL; item; item = item->next) {
        printf("%*s%-*s", indent, "", 20 - indent, item->string);
        if (cJSON_IsObject(item)) {
            printf("\n");
            print(item, indent + 2);
        } else if (cJSON_IsString(item)) {
            printf(" %s\n", item->valuestring);
        } else {
            printf(" %.10g\n", item->valuedouble);
        }
    }
}

int bst_cmd_version(int argc, char **argv) {
    bool help = false, verbose = false, json = false;
    const bst_option table[] = {
        {.name = "verbose",
         .kind = BST_OPTION_FLAG,
         .target = &verbose,
         .doc = "also machine, device, libraries and files"},
        {.name = "json",
         .kind = BST_OPTION_FLAG,
         .target = &json,
         .doc = "print all of it as JSON, for scripts"},
        {.name = "help", .kind = BST_OPTION_FLAG, .target = &help, .doc = "print this"},
        {.name = NULL},
    };
    bst_ctx ctx;
    bst_ctx_init(&ctx, bst_cli_log, NULL, BST_LOG_WARNING);
    int code = BST_EXIT_OK;
    const bst_command_line line = {"version", help_text, table, &help};
    if (!bst_command_line_read(&ctx, &line, argc, argv, NULL, &code)) {
        return code;
    }
    if (json) {
        return bst_cli_print_json(describe(&ctx));
    }
    printf("boresight %s (%s)\n", bst_version(), bst_version_git_revision());
    if (verbose) {
        cJSON *all = describe(&ctx);
        cJSON_DeleteItemFromObjectCaseSensitive(all, "version");
        cJSON_DeleteItemFromObjectCaseSensitive(all, "git_revision");
        print(all, 0);
        cJSON_Delete(all);
    }
    return BST_EXIT_OK;
}
