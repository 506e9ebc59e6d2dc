#include "comm/start_cpus.hpp"

#include <sys/syscall.h>
#include <unistd.h>

namespace moraine {

namespace {

cpu_set_t noted[most_cpus / CPU_SETSIZE];
static_assert(sizeof noted == cpu_set_bytes);

/// Before anything is set up: a plain system call, and no check of a sanitizer.
__attribute__((no_sanitize("address", "thread", "undefined"))) void note_cpus(int, char**, char**) {
  syscall(SYS_sched_getaffinity, 0, cpu_set_bytes, noted);
}

// OpenMP's library binds the main thread as it is loaded, before main() and before any constructor of this program. The
// loader runs this array before the libraries' constructors. A module of Python comes too late for it, and takes what it finds.
#ifdef MORAINE_IS_MODULE
__attribute__((constructor)) void note_cpus_late() { note_cpus(0, nullptr, nullptr); }
#else
__attribute__((section(".preinit_array"), used)) void (*note_cpus_first)(int, char**, char**) = note_cpus;
#endif

}  // namespace

const cpu_set_t* cpus_at_start() { return noted; }

}  // namespace moraine
