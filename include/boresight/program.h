/* The commands of the program `boresight` in the process of another program, with the plug-ins that
 * this has registered. */
#ifndef BORESIGHT_PROGRAM_H
#define BORESIGHT_PROGRAM_H

#pragma GCC visibility push(default)

/* Runs a command as the program `boresight` does. Scenarios can name the plug-ins that the process
 * has registered (boresight/plugin.h).
 *
 * Given:     argc, argv      words of the command line; argv[0] is not used
 *            output, errors  open file descriptors that take the place of standard output and
 *                            standard error during the call; they stay open
 * Returned:  exit status of the program: 0 done, 1 failed, 2 called wrongly, 4 runs of a study
 *            failed, 130 interrupted; the reason is written to `errors`
 * Notes:     one call at a time; a second one fails. During the call SIGINT, SIGTERM and SIGHUP
 *            request its end, also a second time; their former handlers return afterwards. The C
 *            streams `stdout` and `stderr` of the whole process point to the two files meanwhile.
 *            `bench` is missing: it measures the program. `study` forks its workers from this
 *            process, in which no OpenCL device may be open. */
int bst_program_run(int argc, char **argv, int output, int errors);

#pragma GCC visibility pop

#endif
