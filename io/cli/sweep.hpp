// A sweep, over layouts (moraine scale) or over what speed costs in accuracy (moraine pareto): which runs it has, which of them are
// done, and what it is of.
//
//   sweep.json           what the sweep is of: it goes on only where that is still the same
//   runs/2x1-3/          the third run on layout 2x1, a run directory; done where its summary.json says so
//   runs/2x1-3.txt       what that run said
//   scale.csv, .json     results, one row a layout           scale.svg, .png, .gnuplot    plot, and how it was made
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/cli/layout.hpp"
#include "io/cli/summary.hpp"

namespace moraine {

enum class ScaleKind { strong, weak };
const char* word_for(ScaleKind kind);

/// All ranks x threads whose product is 1, 2, 4 ... up to the number of cores, or that number itself; by cores, then
/// ranks.
std::vector<Layout> layouts_up_to(int n_cores);
/// "1x1,1x4,2x2", each once, in the order of layouts_up_to(). Throws UsageError.
std::vector<Layout> parse_layouts(const std::string& text);

/// One run of a sweep.
struct SweepRun {
  Layout layout;
  int repeat = 1;  // from 1
  std::string name() const { return layout.text() + '-' + std::to_string(repeat); }
};
/// Every layout once, then every layout once more, and so on: a busy minute of the machine does not fall on one of
/// them.
std::vector<SweepRun> runs_by_turns(const std::vector<Layout>& layouts, int repeats);

/// What a sweep is of. Where any of it has changed, runs of before and after must not stand in one table.
struct SweepIdentity {
  std::string kind;
  std::string scene;    // its text as run
  std::string files;    // that the scene names: sizes and dates
  std::string program;  // hash of the executable
  std::string machine;
  std::uint64_t steps = 0, warm_up = 0;

  bool operator==(const SweepIdentity&) const = default;
};
/// What has changed, in words, such as "the scene, the number of steps"; empty where nothing has.
std::string changes_between(const SweepIdentity& before, const SweepIdentity& now);
std::string identity_json(const SweepIdentity& identity);
/// Throws StorageError where the file cannot be read or is not of a sweep.
SweepIdentity read_identity(const std::filesystem::path& file);
/// Of this program, this machine, and these files as they are now.
std::string hash_of_program();
std::string this_machine();
std::string state_of_files(const std::vector<std::filesystem::path>& files);

class SweepDirectory {
 public:
  /// Opens the directory of a sweep, or makes it. One of a sweep that was of something else is renamed first, to
  /// DIR.old, DIR.old-2 ... Throws UsageError where there is something that is not a sweep; StorageError.
  SweepDirectory(const std::filesystem::path& path, const SweepIdentity& identity);

  /// What was found: that an old sweep was set aside, and why. Empty where there was none.
  const std::string& remark() const { return remark_; }
  const std::filesystem::path& path() const { return path_; }
  /// Where a run has its directory, what it said, and what it was asked for.
  std::filesystem::path run_directory(const std::string& name) const { return path_ / "runs" / name; }
  std::filesystem::path talk_file(const std::string& name) const { return path_ / "runs" / (name + ".txt"); }
  std::filesystem::path request_file(const std::string& name) const { return path_ / "runs" / (name + ".request"); }
  /// The account of a run that has ended by itself; nothing where it has not.
  std::optional<RunSummary> find(const std::string& name) const;
  /// The same of a run of a scaling sweep, where it has taken the steps of this one.
  std::optional<RunSummary> find(const SweepRun& run) const;
  /// Takes away what an interrupted run has left. Throws StorageError.
  void clear(const std::string& name) const;

 private:
  std::filesystem::path path_;
  SweepIdentity identity_;
  std::string remark_;
};

/// The last lines that a run said, from its talk file; empty where it cannot be read.
std::string last_words(const std::filesystem::path& talk_file, std::size_t n_lines);

/// How long the runs that are left will take, judged by those that are done.
class SweepClock {
 public:
  explicit SweepClock(ScaleKind kind) : kind_(kind) {}
  void add(const Layout& layout, const RunSummary& run);
  /// [s]; nothing where no run is done yet.
  std::optional<double> expected(const Layout& layout) const;

 private:
  struct Done {
    Layout layout;
    double outside = 0.0, steps = 0.0;  // [s]
  };
  ScaleKind kind_;
  std::vector<Done> done_;
};

}  // namespace moraine
