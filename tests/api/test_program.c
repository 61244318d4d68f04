#define _XOPEN_SOURCE 700 /* mkdtemp */
/* Commands of the program in this process: with its plug-ins, its own files for output and errors,
 * and its signal handlers afterwards. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "boresight/boresight.h"
#include "boresight/plugin.h"
#include "boresight/program.h"
#include "boresight/stages.h"
#include "tests/test_support.h"

static bst_status create(bst_ctx *ctx, const void *config, const bst_frame_stage_env *env,
                         void **self) {
    (void)ctx;
    (void)config;
    *self = (void *)env->camera;
    return BST_OK;
}

static int reported; /* exit status of a command inside a command */

static bst_status apply(void *self, bst_ctx *ctx, const bst_frame_stage_frame *frame,
                        uint16_t *pixels) {
    (void)self;
    (void)pixels;
    assert_int_equal(frame->width, 256);
    assert_int_equal(frame->height, 192);
    assert_int_equal(frame->window.width, 256);
    assert_int_equal(frame->window.height, 192);
    assert_true(frame->end_s > frame->start_s);
    FILE *null = fopen("/dev/null", "w");
    char *words[] = {"boresight", "--version", NULL};
    reported = bst_program_run(2, words, fileno(null), fileno(null));
    fclose(null);
    return bst_fail(ctx, BST_ERR_STATE, "the mark of the stage");
}

static void destroy(void *self) {
    (void)self;
}

static const bst_frame_stage functions = {.create = create, .apply = apply, .destroy = destroy};
static const bst_stage_desc stage = {.abi = BST_STAGE_ABI,
                                     .kind = BST_STAGE_FRAME,
                                     .type = "mark",
                                     .doc = "fails",
                                     .functions = &functions};
static const bst_stage_desc *const stages[] = {&stage, NULL};

/* Runs a command; fills the texts that it wrote. */
static int run(char **words, char output[static 65536], char errors[static 4096]) {
    FILE *out = tmpfile(), *err = tmpfile();
    int count = 0;
    assert_non_null(out);
    assert_non_null(err);
    while (words[count]) {
        count++;
    }
    int code = bst_program_run(count, words, fileno(out), fileno(err));
    rewind(out);
    rewind(err);
    output[fread(output, 1, 65535, out)] = '\0';
    errors[fread(errors, 1, 4095, err)] = '\0';
    fclose(out);
    fclose(err);
    return code;
}

static char output[65536], errors[4096];

static void a_command_writes_to_its_files(void **state) {
    (void)state;
    FILE *before = stdout, *before_errors = stderr;
    char *version[] = {"boresight", "--version", NULL};
    assert_int_equal(run(version, output, errors), 0);
    assert_int_equal(strncmp(output, "boresight ", 10), 0);
    assert_string_equal(errors, "");
    char *unknown[] = {"boresight", "runn", NULL};
    assert_int_equal(run(unknown, output, errors), 2);
    assert_string_equal(output, "");
    assert_non_null(strstr(errors, "did you mean \"run\"?"));
    char *bench[] = {"boresight", "bench", NULL};
    assert_int_equal(run(bench, output, errors), 2); /* measures the program */
    assert_ptr_equal(stdout, before);
    assert_ptr_equal(stderr, before_errors);
    assert_int_equal(bst_program_run(2, version, -1, STDERR_FILENO), 1);
}

static void handler(int number) {
    (void)number;
}

static void a_command_knows_registered_plugins(void **state) {
    (void)state;
    bst_ctx ctx;
    bst_ctx_init(&ctx, NULL, NULL, BST_LOG_ERROR);
    char *check[] = {"boresight",
                     "check",
                     "scenarios/neossat_geo_track.json",
                     "--set",
                     "/observers/0/sensors/0/modules/scenegen/frame_stage={\"plugin\": \"test:x\"}",
                     NULL};
    assert_int_equal(run(check, output, errors), 1);
    assert_non_null(strstr(errors, "no plug-in \"test:x\" is registered in this process"));
    bst_assert_ok(&ctx, bst_plugin_register(&ctx, "test:x", NULL, NULL, stages));
    struct sigaction mine = {.sa_handler = handler}, after;
    sigaction(SIGINT, &mine, NULL);
    assert_int_equal(run(check, output, errors), 0);
    assert_non_null(strstr(output, "\"test:x\""));
    sigaction(SIGINT, NULL, &after);
    assert_ptr_equal(after.sa_handler, handler);
    signal(SIGINT, SIG_DFL);
}

static void one_command_runs_at_a_time(void **state) {
    (void)state;
    char folder[BST_TEST_PATH], out[BST_TEST_PATH + 4], command[BST_TEST_PATH + 16];
    bst_test_template(folder, "boresight_program");
    assert_non_null(mkdtemp(folder));
    snprintf(out, sizeof out, "%s/run", folder);
    char *calls[] = {"boresight",
                     "run",
                     "scenarios/neossat_geo_track.json",
                     "--duration",
                     "1",
                     "--out",
                     out,
                     "--set",
                     "/observers/0/sensors/0/camera/width_px=256",
                     "--set",
                     "/observers/0/sensors/0/camera/height_px=192",
                     "--set",
                     "/observers/0/sensors/0/modules/scenegen/frame_stage={\"plugin\": \"test:x\"}",
                     NULL};
    assert_int_equal(run(calls, output, errors), 1);
    assert_non_null(strstr(errors, "the mark of the stage"));
    assert_int_equal(reported, 1); /* the command inside */
    char *version[] = {"boresight", "--version", NULL};
    assert_int_equal(run(version, output, errors), 0); /* the next one runs */
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    assert_int_equal(system(command), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_writes_to_its_files),
        cmocka_unit_test(a_command_knows_registered_plugins),
        cmocka_unit_test(one_command_runs_at_a_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
