#include "sim/core/subprocess.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

/* Executed in the child after fork: only async-signal-safe calls until exec. Never returns. */
static void run_child(const char *const argv[], const char *directory, int input_fd, int output_fd,
                      const char *error_path, int report_fd) {
    int null_fd = open("/dev/null", O_RDWR);
    int error_fd =
        error_path ? open(error_path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : null_fd;
    if (null_fd >= 0 && error_fd >= 0 &&
        dup2(input_fd >= 0 ? input_fd : null_fd, STDIN_FILENO) >= 0 &&
        dup2(output_fd >= 0 ? output_fd : null_fd, STDOUT_FILENO) >= 0 &&
        dup2(error_fd, STDERR_FILENO) >= 0 && (!directory || chdir(directory) == 0)) {
        execvp(argv[0], (char *const *)(uintptr_t)argv);
    }
    int error = errno;
    ssize_t ignored = write(report_fd, &error, sizeof error);
    (void)ignored;
    _exit(127);
}

static void close_if_open(int fd) {
    if (fd >= 0) {
        close(fd);
    }
}

/* Creates a pipe that closes on exec. */
static bool make_pipe(int ends[2]) {
    return pipe(ends) == 0 && fcntl(ends[0], F_SETFD, FD_CLOEXEC) == 0 &&
           fcntl(ends[1], F_SETFD, FD_CLOEXEC) == 0;
}

/* How a child is started: bits. */
enum { WANT_INPUT = 1, WANT_OUTPUT = 2, OWN_GROUP = 4 };

static bst_status start(bst_ctx *ctx, const char *const argv[], const char *directory, int how,
                        const char *error_path, bst_subprocess *out) {
    const bool want_input = how & WANT_INPUT, want_output = how & WANT_OUTPUT;
    int input[2] = {-1, -1};
    int output[2] = {-1, -1};
    int report[2] = {-1, -1}; /* carries errno if exec fails; closes if it succeeds */
    *out = (bst_subprocess){.pid = -1};
    if ((want_input && !make_pipe(input)) || (want_output && !make_pipe(output)) ||
        !make_pipe(report)) {
        goto failed;
    }
    pid_t pid = fork();
    if (pid == 0) {
        if (how & OWN_GROUP) {
            setpgid(0, 0);
        }
        run_child(argv, directory, input[0], output[1], error_path, report[1]);
    }
    if (pid < 0) {
        goto failed;
    }
    out->pid = pid;
    close_if_open(input[0]);
    close_if_open(output[1]);
    close_if_open(report[1]);
    input[0] = output[1] = report[1] = -1;
    int error = 0;
    ssize_t n;
    do {
        n = read(report[0], &error, sizeof error);
    } while (n < 0 && errno == EINTR);
    if (n == (ssize_t)sizeof error) {
        waitpid(pid, NULL, 0);
        out->pid = -1;
        errno = error;
        goto failed;
    }
    close(report[0]);
    report[0] = -1;
    if (want_output) {
        out->output = fdopen(output[0], "r");
        if (!out->output) {
            close(output[0]);
            output[0] = -1;
            bst_subprocess_wait(out);
            goto failed;
        }
    }
    if (want_input) {
        out->input = fdopen(input[1], "w");
        if (!out->input) {
            close(input[1]);
            input[1] = -1;
            bst_subprocess_wait(out);
            goto failed;
        }
    }
    return BST_OK;

failed:;
    int why = errno;
    close_if_open(input[0]);
    close_if_open(input[1]);
    close_if_open(output[0]);
    close_if_open(output[1]);
    close_if_open(report[0]);
    close_if_open(report[1]);
    return bst_fail(ctx, why == ENOENT ? BST_ERR_NOT_FOUND : BST_ERR_IO, "cannot run %s: %s",
                    argv[0], strerror(why));
}

bst_status bst_subprocess_start(bst_ctx *ctx, const char *const argv[], const char *directory,
                                bool want_output, const char *error_path, bst_subprocess *out) {
    return start(ctx, argv, directory, want_output ? WANT_OUTPUT : 0, error_path, out);
}

bst_status bst_subprocess_start_group(bst_ctx *ctx, const char *const argv[], const char *directory,
                                      const char *error_path, bst_subprocess *out) {
    return start(ctx, argv, directory, WANT_OUTPUT | OWN_GROUP, error_path, out);
}

void bst_subprocess_kill(const bst_subprocess *child) {
    if (child->pid > 0) {
        kill(-child->pid, SIGKILL);
    }
}

bst_status bst_subprocess_start_fed(bst_ctx *ctx, const char *const argv[], const char *error_path,
                                    bst_subprocess *out) {
    return start(ctx, argv, NULL, WANT_INPUT, error_path, out);
}

static int exit_code_of(int wait_status) {
    return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

bool bst_subprocess_poll(bst_subprocess *child, int *exit_code) {
    int status = 0;
    if (waitpid(child->pid, &status, WNOHANG) != child->pid) {
        return false;
    }
    child->pid = -1;
    *exit_code = exit_code_of(status);
    return true;
}

int bst_subprocess_wait(bst_subprocess *child) {
    if (child->input) {
        fclose(child->input);
        child->input = NULL;
    }
    if (child->output) {
        fclose(child->output);
        child->output = NULL;
    }
    int status = 0;
    while (waitpid(child->pid, &status, 0) < 0) {
        if (errno != EINTR) {
            return 127;
        }
    }
    child->pid = -1;
    return exit_code_of(status);
}
