/* The Slurm executor against stand-ins for sbatch, squeue and scancel: shell scripts that keep a
 * queue in a folder, and that a test makes silent, forgetful or deadly. The real programs are
 * tested by tests/e2e/slurm. */
#include "tests/test_support.h"

#include <sys/stat.h>
#include <unistd.h>

#include "sim/core/wall_clock.h"
#include "sim/studies/slurm.h"

enum { PATH_BYTES = BST_TEST_PATH + 64, MOST_NEWS = 64 };

static char folder[BST_TEST_PATH], path_before[4096];

static void write_program(const char *name, const char *text) {
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/bin/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "#!/bin/sh\nroot='%s'\n%s", folder, text);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(chmod(path, 0755), 0);
}

static void touch(const char *name, const char *text) {
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

static bool exists(const char *name) {
    char path[PATH_BYTES];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return access(path, F_OK) == 0;
}

static int set_up(void **state) {
    (void)state;
    char path[PATH_BYTES + 4096];
    bst_test_template(folder, "slurm");
    assert_non_null(mkdtemp(folder));
    const char *const parts[] = {"bin", "queue", "study", "runs"};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, parts[i]);
        assert_int_equal(mkdir(path, 0755), 0);
    }
    /* a task is in the queue as long as its file in queue/ is there; "hold" keeps tasks from
     * starting, "silent" is a controller that does not answer, "refuse" one that says no */
    write_program(
        "sbatch",
        "[ ! -e $root/silent ] || { echo 'Unable to contact slurm controller' >&2; exit 1; }\n"
        "[ ! -e $root/refuse ] || { echo 'Invalid account' >&2; exit 1; }\n"
        "for word; do\n  case $word in --array=0-*) last=${word#--array=0-};; "
        "--output=*) log=${word#--output=};; esac\n"
        "  echo \"$word\" >>$root/options\ndone\n"
        "job=$(($(cat $root/job 2>/dev/null || echo 100) + 1))\necho $job >$root/job\n"
        "i=0\nwhile [ $i -le $last ]; do\n  echo RUNNING >$root/queue/$job.$i\n"
        "  [ -e $root/hold ] || (SLURM_ARRAY_TASK_ID=$i sh \"$word\" "
        ">\"$(echo \"$log\" | sed s/%a/$i/)\" 2>&1; "
        "rm -f $root/queue/$job.$i) >/dev/null 2>&1 &\n"
        "  i=$((i + 1))\ndone\necho $job\n");
    write_program(
        "squeue",
        "[ ! -e $root/silent ] || { echo 'Unable to contact slurm controller' >&2; exit 1; }\n"
        "cd $root/queue && for task in *; do [ -e \"$task\" ] || continue\n"
        "echo \"${task%.*} ${task#*.} $(cat $task 2>/dev/null)\"; done; exit 0\n");
    write_program("scancel",
                  "echo \"$*\" >>$root/cancelled\n"
                  "case $* in *--state=RUNNING*) ;; *) rm -f $root/queue/*;; esac\n");
    write_program(
        "shard",
        "echo x >>$root/runs/$1\n"
        "case $1 in 7:*) echo 'half done'; kill -KILL $$;; 8:*) echo 'no room on the disk' >&2; "
        "exit 1;; esac\n");
    const char *before = getenv("PATH");
    snprintf(path_before, sizeof path_before, "%s", before ? before : "/usr/bin:/bin");
    snprintf(path, sizeof path, "%s/bin:%s", folder, path_before);
    assert_int_equal(setenv("PATH", path, 1), 0);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    char command[PATH_BYTES];
    setenv("PATH", path_before, 1);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static bst_slurm_site quick(void) {
    bst_slurm_site site;
    bst_ctx ctx = {0};
    bst_assert_ok(&ctx, bst_slurm_site_load(&ctx, NULL, &site));
    site.poll_s = 0.1;
    site.grace_s = 0.3;
    site.patience_s = 1;
    return site;
}

static bst_executor create(const bst_slurm_site *site) {
    bst_ctx ctx = {0};
    bst_executor executor;
    char study[PATH_BYTES];
    snprintf(study, sizeof study, "%s/study", folder);
    const char *program[] = {"shard", NULL};
    bst_assert_ok(&ctx, bst_slurm_create(&ctx, site, study, program, &executor));
    return executor;
}

static void start(bst_executor *executor, int64_t id, int64_t first, int64_t shards) {
    bst_ctx ctx = {0};
    for (int64_t i = 0; i < shards; i++) {
        bst_study_shard_job job = {.id = id + i, .first = first + i, .count = 1, .attempt = 1};
        bst_assert_ok(&ctx, executor->start(&ctx, executor->self, &job, 1));
    }
}

/* All news of the next `seconds`, at most until `wanted` came. */
static int gather(bst_executor *executor, double seconds, int wanted, bst_study_shard_news *news) {
    bst_ctx ctx = {0};
    int reported = 0;
    double until = bst_wall_seconds() + seconds;
    while (reported < wanted && bst_wall_seconds() < until) {
        int count = 0;
        bst_assert_ok(&ctx, executor->poll(&ctx, executor->self, 100, news + reported,
                                           MOST_NEWS - reported, &count));
        reported += count;
    }
    return reported;
}

static int bytes_of(const char *name) {
    char path[PATH_BYTES];
    struct stat about;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return stat(path, &about) == 0 ? (int)about.st_size : 0;
}

/* Five shards in arrays of two: each runs once and is reported once. */
static void test_shards_run_once(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    site.array_size = 2;
    snprintf(site.account, sizeof site.account, "sst");
    snprintf(site.options, sizeof site.options, "--nice=10 --exclude=node7");
    bst_executor executor = create(&site);
    bst_study_shard_news news[MOST_NEWS];
    start(&executor, 0, 20, 5);
    assert_int_equal(gather(&executor, 20, 5, news), 5);
    int64_t ids = 0;
    for (int i = 0; i < 5; i++) {
        assert_int_equal(news[i].kind, BST_SHARD_ENDED);
        ids |= (int64_t)1 << news[i].id;
    }
    assert_int_equal(ids, 31);
    for (int i = 20; i < 25; i++) {
        char run[32];
        snprintf(run, sizeof run, "runs/%d:1", i);
        assert_int_equal(bytes_of(run), 2);
    }
    executor.close(executor.self);
    assert_false(exists("cancelled"));
    FILE *file = NULL;
    char path[PATH_BYTES], options[8192] = "";
    snprintf(path, sizeof path, "%s/options", folder);
    file = fopen(path, "r");
    assert_non_null(file);
    assert_true(fread(options, 1, sizeof options - 1, file) > 0);
    fclose(file);
    assert_non_null(strstr(options, "--account=sst\n"));
    assert_non_null(strstr(options, "--nice=10\n--exclude=node7\n"));
    assert_non_null(strstr(options, "--array=0-1\n"));
    assert_non_null(strstr(options, "--array=0-0\n"));
    assert_null(strstr(options, "--partition"));
}

/* A shard that a signal killed is lost; one that says why it cannot go on has ended with that. */
static void test_ends_are_told_apart(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    bst_executor executor = create(&site);
    bst_study_shard_news news[MOST_NEWS];
    start(&executor, 0, 7, 2);
    assert_int_equal(gather(&executor, 20, 2, news), 2);
    for (int i = 0; i < 2; i++) {
        if (news[i].id == 0) {
            assert_int_equal(news[i].kind, BST_SHARD_LOST);
            /* with the end of its log */
            const char *said = strstr(news[i].text, "killed by signal 9 on ");
            assert_ptr_equal(said, news[i].text);
            assert_non_null(strstr(said, ": half done"));
        } else {
            assert_int_equal(news[i].kind, BST_SHARD_ENDED);
            assert_non_null(strstr(news[i].text, "no room on the disk"));
        }
    }
    executor.close(executor.self);
}

/* A task that vanished without its exit code is lost, but only while the controller answers; a
 * silent controller is an error after the site's patience, not before. */
static void test_lost_and_silent(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    site.patience_s = 60;
    touch("hold", "");
    bst_executor executor = create(&site);
    bst_study_shard_news news[MOST_NEWS];
    start(&executor, 0, 0, 2);
    assert_int_equal(gather(&executor, 0.5, 1, news), 0);
    touch("silent", "");
    char queued[PATH_BYTES];
    snprintf(queued, sizeof queued, "%s/queue/101.1", folder);
    assert_int_equal(unlink(queued), 0);
    assert_int_equal(gather(&executor, 1, 1, news), 0);
    snprintf(queued, sizeof queued, "%s/silent", folder);
    assert_int_equal(unlink(queued), 0);
    assert_int_equal(gather(&executor, 10, 1, news), 1);
    assert_int_equal(news[0].kind, BST_SHARD_LOST);
    assert_int_equal(news[0].id, 1);
    /* what Slurm holds after a failure would wait for ever */
    touch("queue/101.0", "PENDING (launch failed requeued held)");
    assert_int_equal(gather(&executor, 10, 1, news), 1);
    assert_int_equal(news[0].kind, BST_SHARD_LOST);
    assert_true(exists("cancelled"));
    executor.close(executor.self);

    site.patience_s = 0.3;
    executor = create(&site);
    touch("silent", "");
    start(&executor, 0, 0, 1);
    bst_ctx ctx = {0};
    bst_status status = BST_OK;
    double until = bst_wall_seconds() + 20;
    while (status == BST_OK && bst_wall_seconds() < until) {
        int count;
        status = executor.poll(&ctx, executor.self, 100, news, MOST_NEWS, &count);
    }
    assert_int_equal(status, BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "has not answered"));
    executor.close(executor.self);
}

/* A submission that the controller could not take is made later; one that it refuses is an error
 * with its words. */
static void test_submission(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    site.patience_s = 60;
    bst_executor executor = create(&site);
    bst_study_shard_news news[MOST_NEWS];
    touch("silent", "");
    start(&executor, 0, 20, 1);
    assert_int_equal(gather(&executor, 0.5, 1, news), 0);
    char silent[PATH_BYTES];
    snprintf(silent, sizeof silent, "%s/silent", folder);
    assert_int_equal(unlink(silent), 0);
    assert_int_equal(gather(&executor, 20, 1, news), 1);
    assert_int_equal(news[0].kind, BST_SHARD_ENDED);

    touch("refuse", "");
    start(&executor, 1, 21, 1);
    bst_ctx ctx = {0};
    int count;
    assert_int_equal(executor.poll(&ctx, executor.self, 1000, news, MOST_NEWS, &count), BST_ERR_IO);
    assert_non_null(strstr(ctx.message, "Invalid account"));
    executor.close(executor.self);
}

/* Jobs of a driver that died are cancelled by the next; cancelling reports every task. */
static void test_cancelling(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    touch("queue/77.0", "RUNNING");
    bst_executor executor = create(&site);
    assert_true(exists("cancelled"));
    assert_false(exists("queue/77.0"));
    touch("hold", "");
    bst_study_shard_news news[MOST_NEWS];
    start(&executor, 0, 0, 3);
    assert_int_equal(gather(&executor, 0.3, 1, news), 0);
    start(&executor, 3, 3, 1);
    executor.cancel(executor.self, true);
    assert_int_equal(executor.room(executor.self), 0);
    assert_int_equal(gather(&executor, 20, 4, news), 4);
    executor.close(executor.self);
}

static void test_no_slurm_here(void **state) {
    (void)state;
    bst_slurm_site site = quick();
    bst_ctx ctx = {0};
    bst_executor executor;
    const char *program[] = {"shard", NULL};
    setenv("PATH", "/nonexistent", 1);
    assert_int_equal(bst_slurm_create(&ctx, &site, folder, program, &executor), BST_ERR_NOT_FOUND);
    assert_non_null(strstr(ctx.message, "Slurm"));
    setenv("PATH", path_before, 1);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_shards_run_once, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_ends_are_told_apart, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_lost_and_silent, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_submission, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_cancelling, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_no_slurm_here, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
