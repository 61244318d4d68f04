/* What the leak sanitizer is to overlook: what the OpenCL compiler keeps until the program ends.
 * Linked into every test of a sanitized build, visible to the sanitizer's run time. */
__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);

const char *__lsan_default_suppressions(void) {
    return "leak:libpocl.so\n"
           "leak:libLLVM\n"
           "leak:libclang-cpp\n";
}
