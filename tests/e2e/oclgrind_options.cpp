// Preloaded into programs that run under Oclgrind 21.10 (Debian 12) with LLVM 14: inlining
// otherwise marks scopes of aliasing by an intrinsic that Oclgrind does not know.
namespace llvm {
class raw_ostream;
struct StringRef {
    const char *text;
    unsigned long bytes;
};
namespace cl {
bool ParseCommandLineOptions(int, const char *const *, StringRef, raw_ostream *, const char *,
                             bool);
}
}  // namespace llvm

__attribute__((constructor)) static void set_options() {
    const char *words[] = {"program", "-use-noalias-intrinsic-during-inlining=0"};
    llvm::cl::ParseCommandLineOptions(2, words, llvm::StringRef{"", 0}, nullptr, nullptr, false);
}
