// Gives all targets their seeds, and so many seeded alterations of each, without libFuzzer: what any compiler can build and a test
// can run. No input may end in an error that is not named, hang, or take more memory than its size is worth.
//
// usage: tests_fuzz SEEDS [N_ALTERATIONS [SEED [TARGET [INPUT]]]]; INPUT repeats one file, such as one that libFuzzer has found
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <vector>

#include "kernels/base/random.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace moraine;
using namespace moraine::fuzz;
namespace fs = std::filesystem;

constexpr unsigned patience = 30;  // [s] an input may take

constexpr const char* finding = "fuzz-finding";  // the input that ended it, in the working directory

char what_runs[512] = "";
std::string_view input;

/// What a file of this size may take in one piece [bytes]. A packed list may have 64 times its size of text, a number of two characters takes
/// eight bytes in memory, and what grows has room to spare.
std::size_t most_at_once() { return (16ULL << 20) + 2048 * input.size(); }

/// Says what was tried, and keeps it, in ways that a handler of signals may use.
[[noreturn]] void end_badly(const char* how) {
  if (const int file = open(finding, O_WRONLY | O_CREAT | O_TRUNC, 0666); file >= 0) {
    const ssize_t ignored = write(file, input.data(), input.size());
    static_cast<void>(ignored);
  }
  for (const char* const text : {how, static_cast<const char*>(what_runs), "\n"}) {
    const ssize_t ignored = write(STDERR_FILENO, text, std::strlen(text));
    static_cast<void>(ignored);
  }
  std::_Exit(1);
}

void note_signal(int signal) { end_badly(signal == SIGALRM ? "hangs: " : "crashes: "); }

std::string read_all(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// Alters bytes in ways that have found faults elsewhere; the same ones for the same numbers.
class Alteration {
 public:
  Alteration(std::uint64_t seed, std::uint64_t number) : seed_(seed), number_(number) {}

  std::string of(std::string text, const std::string& other) {
    for (std::size_t n = 1 + below(4); n > 0; --n) once(text, other);
    if (text.size() > 65536) text.resize(65536);
    return text;
  }

 private:
  std::size_t below(std::size_t n) {
    return n == 0 ? 0 : random_bits(seed_ + 1000003 * number_, count_++, RandomPurpose::choice) % n;
  }

  void once(std::string& text, const std::string& other) {
    static const std::vector<std::string> words = {"1e300",
                                                   "-1",
                                                   "0",
                                                   "nan",
                                                   "inf",
                                                   "9223372036854775807",
                                                   "-9223372036854775808",
                                                   "1e9",
                                                   "1e-300",
                                                   "[",
                                                   "]",
                                                   "{",
                                                   "\"",
                                                   "=",
                                                   "\n",
                                                   ",",
                                                   std::string(1, '\0'),
                                                   "\xff\xff\xff\xff",
                                                   std::string("\0\0\0\x80", 4),
                                                   "4294967296",
                                                   ".",
                                                   "[["};
    const std::size_t at = below(text.size() + 1), n = below(1 + std::min<std::size_t>(text.size() - at, 40));
    switch (below(10)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        break;
      case 1:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        break;
      case 2: text.erase(at, n); break;
      case 3: text.insert(at, text.substr(at, n)); break;
      case 4: text.insert(at, words[below(words.size())]); break;
      case 5: text = text.substr(0, at) + other.substr(std::min(other.size(), below(other.size() + 1))); break;
      case 6: replace_line(text, at, other, below(other.size() + 1)); break;
      default: replace_number(text, at, words[below(words.size())]); break;
    }
  }

  /// The next number of a text, which becomes another.
  static void replace_number(std::string& text, std::size_t at, const std::string& by) {
    const std::size_t begin = text.find_first_of("0123456789", at);
    if (begin == std::string::npos) return;
    text.replace(begin, std::min(text.find_first_not_of("0123456789.e-", begin), text.size()) - begin, by);
  }

  /// The next line, which becomes one of another text.
  static void replace_line(std::string& text, std::size_t at, const std::string& other, std::size_t from) {
    const std::size_t begin = text.find('\n', at), begin_there = other.find('\n', from);
    if (begin == std::string::npos || begin_there == std::string::npos) return;
    const std::size_t end = std::min(text.find('\n', begin + 1), text.size());
    const std::size_t end_there = std::min(other.find('\n', begin_there + 1), other.size());
    text.replace(begin, end - begin, other.substr(begin_there, end_there - begin_there));
  }

  std::uint64_t seed_, number_, count_ = 0;
};

void give(const Target& target, const std::string& text, const std::string& name) {
  std::snprintf(what_runs, sizeof what_runs, "%s, %s", target.name, name.c_str());
  input = text;
  alarm(patience);
  try {
    target.run({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "not named: %s\n", error.what());
    end_badly("by ");
  }
  alarm(0);
}

/// The seeds of a target, by name.
std::vector<fs::path> seeds_of(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::size_t try_target(const Target& target, const fs::path& seeds, std::size_t n_alterations, std::uint64_t seed) {
  const std::vector<fs::path> files = seeds_of(seeds / target.name);
  std::vector<std::string> texts;
  for (const fs::path& file : files) texts.push_back(read_all(file));
  for (std::size_t i = 0; i < texts.size(); ++i) give(target, texts[i], files[i].filename().string());
  for (std::size_t number = 0; number < n_alterations; ++number) {
    const std::size_t i = number % texts.size(), other = (number / texts.size()) % texts.size();
    give(target, Alteration(seed, number).of(texts[i], texts[other]),
         files[i].filename().string() + ", alteration " + std::to_string(number) + " of seed " + std::to_string(seed));
  }
  return texts.size() + n_alterations;
}

}  // namespace

/// An allocation far beyond what any input is worth is a fault, even where the system would grant it.
void* operator new(std::size_t size) {
  if (size > most_at_once()) end_badly("takes more memory at once than its size justifies: ");
  if (void* const memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {  // std::stable_sort asks so
  if (size > most_at_once()) end_badly("takes more memory at once than its size justifies: ");
  return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const fs::path seeds = argv[1];
  const std::size_t n_alterations = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
  const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  const std::string wanted = argc > 4 ? argv[4] : "";
  for (const int signal : {SIGALRM, SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL}) std::signal(signal, note_signal);
  std::size_t n = 0;
  for (const Target& target : targets) {
    if (!wanted.empty() && wanted != target.name) continue;
    if (argc > 5)
      give(target, read_all(argv[5]), argv[5]);
    else
      n += try_target(target, seeds, n_alterations, seed);
  }
  std::printf("%zu inputs, all read or refused by name\n", n);
  return 0;
}
