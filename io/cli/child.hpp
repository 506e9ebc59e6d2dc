// A program that is run and waited for.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace moraine {

/// How it ended.
struct ChildEnd {
  int code = 0;    // exit code
  int killed = 0;  // the signal that has ended it; 0: none
  bool is_good() const { return code == 0 && killed == 0; }
};

/// Runs `words` (program and arguments) in `directory`, in a process group of its own and with the CPUs that this
/// process was started with. What it says goes to the file `talk`. A signal that an InterruptGuard of this process has
/// noted is passed on to it; it is asked to end when this process goes. `tick` is called a few times a second. Throws
/// std::runtime_error where it cannot be started.
ChildEnd run_child(const std::vector<std::string>& words, const std::filesystem::path& directory,
                   const std::filesystem::path& talk, const std::function<void()>& tick = {});

}  // namespace moraine
