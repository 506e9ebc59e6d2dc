#include "io/cli/sweep.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/seal.hpp"
#include "io/cli/thread_places.hpp"

namespace moraine {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr double seconds_to_begin = 0.3;  // that a process takes before it measures its own start

void sort_and_unify(std::vector<Layout>& layouts) {
  const auto key = [](const Layout& layout) { return std::pair(layout.total(), layout.ranks); };
  std::sort(layouts.begin(), layouts.end(), [&](const Layout& a, const Layout& b) { return key(a) < key(b); });
  const auto is_same = [&](const Layout& a, const Layout& b) { return key(a) == key(b); };
  layouts.erase(std::unique(layouts.begin(), layouts.end(), is_same), layouts.end());
}

fs::path free_name_beside(const fs::path& directory) {
  for (int number = 1;; ++number) {
    fs::path name = directory;
    name += number == 1 ? std::string(".old") : ".old-" + std::to_string(number);
    if (!fs::exists(name)) return name;
  }
}

bool is_empty_or_missing(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return true;
  return fs::is_directory(path, error) && fs::is_empty(path, error) && !error;
}

}  // namespace

const char* word_for(ScaleKind kind) { return kind == ScaleKind::strong ? "strong" : "weak"; }

std::vector<Layout> layouts_up_to(int n_cores) {
  std::set<int> counts = {n_cores};
  for (int n = 1; n < n_cores; n *= 2) counts.insert(n);
  std::vector<Layout> layouts;
  for (const int n : counts)
    for (int ranks = 1; ranks <= n; ++ranks)
      if (n % ranks == 0) layouts.push_back({ranks, n / ranks});
  return layouts;
}

std::vector<Layout> parse_layouts(const std::string& text) {
  std::vector<Layout> layouts;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) layouts.push_back(parse_layout(word));
  if (layouts.empty() || text.back() == ',')
    throw UsageError("--layouts: expected RANKSxTHREADS, as many as wanted, such as 1x1,1x4,2x2; found \"" + text +
                     '"');
  sort_and_unify(layouts);
  return layouts;
}

std::vector<SweepRun> runs_by_turns(const std::vector<Layout>& layouts, int repeats) {
  std::vector<SweepRun> runs;
  for (int repeat = 1; repeat <= repeats; ++repeat)
    for (const Layout& layout : layouts) runs.push_back({layout, repeat});
  return runs;
}

std::string changes_between(const SweepIdentity& before, const SweepIdentity& now) {
  std::string text;
  const auto say = [&](const std::string& change) { text += (text.empty() ? "" : ", ") + change; };
  if (before.kind != now.kind) say(fmt::format("the kind of sweep ({}, now {})", before.kind, now.kind));
  if (before.scene != now.scene) say("the scene");
  if (before.files != now.files) say("a file that the scene names");
  if (before.program != now.program) say("the program");
  if (before.machine != now.machine) say(fmt::format("the machine ({}, now {})", before.machine, now.machine));
  if (before.steps != now.steps) say(fmt::format("the number of steps ({}, now {})", before.steps, now.steps));
  if (before.warm_up != now.warm_up) say(fmt::format("the warm-up ({} steps, now {})", before.warm_up, now.warm_up));
  return text;
}

std::string identity_json(const SweepIdentity& identity) {
  const Json json = {{"kind", identity.kind},       {"steps", identity.steps},     {"warm_up", identity.warm_up},
                     {"machine", identity.machine}, {"program", identity.program}, {"files", identity.files},
                     {"scene", identity.scene}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

SweepIdentity read_identity(const fs::path& file) {
  const std::string text = read_file(file);
  try {
    const Json json = Json::parse(text);
    return {json.at("kind"),    json.at("scene"), json.at("files"),  json.at("program"),
            json.at("machine"), json.at("steps"), json.at("warm_up")};
  } catch (const Json::exception& error) {
    throw StorageError(file, std::string("does not say what a sweep is of: ") + error.what());
  }
}

std::string hash_of_program() {
  const std::string bytes = read_file("/proc/self/exe");
  return hash_bytes(bytes.data(), bytes.size()).text();
}

std::string this_machine() { return fmt::format("{}: {}, {} CPUs", node_name(), processor_name(), available_cores()); }

std::string state_of_files(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) {
    std::error_code error;
    const auto size = fs::file_size(file, error);
    const auto written = fs::last_write_time(file, error).time_since_epoch();
    text += fmt::format("{}: {} bytes of {}\n", file.string(), size,
                        std::chrono::duration_cast<std::chrono::nanoseconds>(written).count());
  }
  return text;
}

SweepDirectory::SweepDirectory(const fs::path& path, const SweepIdentity& identity) : path_(path), identity_(identity) {
  const fs::path file = path_ / "sweep.json";
  if (fs::exists(file)) {
    const std::string changes = changes_between(read_identity(file), identity);
    if (changes.empty()) return;
    const fs::path aside = free_name_beside(path_);
    std::error_code error;
    fs::rename(path_, aside, error);
    if (error) throw StorageError(path_, "cannot be renamed: " + explain_errno(error.value()));
    remark_ = fmt::format("changed since the sweep in {}: {}; that sweep is now {}, and this one starts anew",
                          path_.string(), changes, aside.string());
  } else if (!is_empty_or_missing(path_)) {
    throw UsageError(path_.string() + " is not empty, and does not hold a sweep; choose another --out");
  }
  make_directory(path_ / "runs");
  write_file(file, identity_json(identity));
}

std::optional<RunSummary> SweepDirectory::find(const std::string& name) const {
  const fs::path file = run_directory(name) / "summary.json";
  if (!fs::exists(file)) return std::nullopt;
  try {
    RunSummary summary = read_summary(file);
    return summary.signal == 0 ? std::optional(std::move(summary)) : std::nullopt;
  } catch (const StorageError&) {
    return std::nullopt;
  }
}

std::optional<RunSummary> SweepDirectory::find(const SweepRun& run) const {
  std::optional<RunSummary> summary = find(run.name());
  const bool is_done = summary && summary->layout == run.layout.text() && summary->n_steps == identity_.steps &&
                       summary->n_warm_up == identity_.warm_up;
  return is_done ? summary : std::nullopt;
}

void SweepDirectory::clear(const std::string& name) const {
  std::error_code error;
  fs::remove_all(run_directory(name), error);
  if (error) throw StorageError(run_directory(name), "cannot be removed: " + explain_errno(error.value()));
}

std::string last_words(const fs::path& talk_file, std::size_t n_lines) {
  std::string text;
  try {
    text = read_file(talk_file);
  } catch (const StorageError&) {
    return {};
  }
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::size_t from = text.size();
  for (std::size_t i = 0; i < n_lines && from != std::string::npos && from > 0; ++i) from = text.rfind('\n', from - 1);
  return from == std::string::npos || from == 0 ? text : text.substr(from + 1);
}

void SweepClock::add(const Layout& layout, const RunSummary& run) {
  const auto n_steps = static_cast<double>(run.n_steps);
  const double steps = run.seconds() * (n_steps + static_cast<double>(run.n_warm_up)) / n_steps;
  const double start = run.over_ranks([](const RankSummary& rank) { return rank.start; }).largest;
  done_.push_back({layout, start + seconds_to_begin, steps});
}

std::optional<double> SweepClock::expected(const Layout& layout) const {
  if (done_.empty()) return std::nullopt;
  double sum = 0.0;
  int n = 0;
  for (const Done& done : done_) {
    if (done.layout.text() != layout.text()) continue;
    sum += done.outside + done.steps;
    ++n;
  }
  if (n > 0) return sum / n;
  // Of another layout: the nearest number of cores.
  const auto distance = [&](const Done& done) {
    return std::abs(std::log2(static_cast<double>(done.layout.total()) / static_cast<double>(layout.total())));
  };
  const auto nearest = std::min_element(done_.begin(), done_.end(),
                                        [&](const Done& a, const Done& b) { return distance(a) < distance(b); });
  const double cores = static_cast<double>(nearest->layout.total()) / static_cast<double>(layout.total());
  return nearest->outside + nearest->steps * (kind_ == ScaleKind::strong ? cores : 1.0);
}

}  // namespace moraine
