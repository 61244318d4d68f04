#include "sim/io/plot.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/core/draft.h"
#include "sim/core/text.h"

extern char **environ;

/* Writes a path in gnuplot's single quotes; quotes are doubled. */
static void put_quoted(FILE *script, const char *text) {
    fputc('\'', script);
    for (const char *c = text; *c; c++) {
        if (*c == '\'') {
            fputc('\'', script);
        }
        fputc(*c, script);
    }
    fputc('\'', script);
}

bst_status bst_plot_check_path(bst_ctx *ctx, const char *path) {
    return !path || bst_text_ends_in(path, ".png") || bst_text_ends_in(path, ".svg")
               ? BST_OK
               : bst_fail(
                     ctx, BST_ERR_ARGUMENT,
                     "--plot %.300s: the name says neither PNG nor SVG: end it in .png or .svg",
                     path);
}

bst_status bst_plot_begin(bst_ctx *ctx, bst_plot *plot, const char *path, int width, int height) {
    int n = snprintf(plot->path, sizeof plot->path, "%s", path);
    if (n < 0 || (size_t)n >= sizeof plot->path || strchr(path, '\n')) {
        return bst_fail(ctx, BST_ERR_ARGUMENT, "%s: not a path for a plot", path);
    }
    /* The script is unlinked at once: nothing remains if the process dies. gnuplot writes to a
     * draft, so that a plot appears complete or not at all. */
    int fd;
    BST_TRY(bst_draft_make(ctx, path, plot->draft, sizeof plot->draft, &fd));
    unlink(plot->draft);
    plot->script = fdopen(fd, "w+");
    if (!plot->script) {
        close(fd);
        return bst_fail(ctx, BST_ERR_MEMORY, "out of memory");
    }
    bst_status status = bst_draft_make(ctx, path, plot->draft, sizeof plot->draft, &fd);
    if (status != BST_OK) {
        fclose(plot->script);
        plot->script = NULL;
        return status;
    }
    close(fd); /* gnuplot overwrites the existing file */
    if (bst_text_ends_in(path, ".svg")) {
        fprintf(plot->script,
                "set terminal svg size %d,%d font 'DejaVu Sans,11' background '#ffffff'\n", width,
                height);
    } else {
        fprintf(plot->script,
                "if (strstrt(GPVAL_TERMINALS, 'pngcairo')) {\n"
                "  set terminal pngcairo size %d,%d font 'DejaVu Sans,11' background '#ffffff'\n"
                "} else {\n"
                "  set terminal png size %d,%d background '#ffffff'\n"
                "}\n",
                width, height, width, height);
    }
    /* names keep their underscores */
    fputs("set termoption noenhanced\nset encoding utf8\nset output ", plot->script);
    put_quoted(plot->script, plot->draft);
    fputc('\n', plot->script);
    return BST_OK;
}

/* Runs gnuplot with the script as standard input; false: missing or failed. */
static bool run_gnuplot(int script) {
    posix_spawn_file_actions_t actions;
    if (posix_spawn_file_actions_init(&actions) != 0) {
        return false;
    }
    char name[] = "gnuplot";
    char *arguments[] = {name, NULL};
    pid_t child;
    bool ok =
        posix_spawn_file_actions_adddup2(&actions, script, STDIN_FILENO) == 0 &&
        posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0) == 0 &&
        posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0) == 0 &&
        posix_spawnp(&child, name, &actions, NULL, arguments, environ) == 0;
    posix_spawn_file_actions_destroy(&actions);
    int result = 0;
    if (ok) {
        while (waitpid(child, &result, 0) < 0) {
            if (errno != EINTR) {
                return false;
            }
        }
    }
    return ok && WIFEXITED(result) && WEXITSTATUS(result) == 0;
}

bst_status bst_plot_end(bst_ctx *ctx, bst_plot *plot, bool *made) {
    bool drawn = false;
    fputs("\nunset output\n", plot->script);
    bool written = fflush(plot->script) == 0 && !ferror(plot->script) &&
                   lseek(fileno(plot->script), 0, SEEK_SET) == 0;
    bst_status status = BST_OK;
    if (!written) {
        status =
            bst_fail(ctx, BST_ERR_IO, "%s: cannot be written: %s", plot->path, strerror(errno));
    } else {
        struct stat info;
        drawn =
            run_gnuplot(fileno(plot->script)) && stat(plot->draft, &info) == 0 && info.st_size > 0;
        if (drawn && (chmod(plot->draft, 0644) != 0 || rename(plot->draft, plot->path) != 0)) {
            drawn = false;
            status =
                bst_fail(ctx, BST_ERR_IO, "%s: cannot be made: %s", plot->path, strerror(errno));
        } else if (!drawn) {
            bst_log(ctx, BST_LOG_WARNING,
                    "%s: not drawn: gnuplot is missing or failed (install the package gnuplot-nox)",
                    plot->path);
        }
    }
    if (!drawn) {
        unlink(plot->draft);
    }
    fclose(plot->script);
    plot->script = NULL;
    if (made) {
        *made = drawn;
    }
    return status;
}
