// Lists of grains, by one rank or shared by several.
#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "engine/scene/lists.hpp"
#include "io/files/files.hpp"

namespace moraine {

namespace files {

namespace {
constexpr std::size_t row_digits = 20;
}

void RowProblems::add(std::uint64_t row, const std::string& text) {
  ++count_;
  if (told_.size() < most_) told_.push_back(fmt::format("{:0{}}{}", row, row_digits, text));
}

std::string RowProblems::text(const World& world) const {
  std::uint64_t count = count_;
  world.sum(std::span(&count, 1));
  std::string own;
  for (const std::string& line : told_) own += line + '\n';
  std::vector<std::string> lines;
  for (const std::string& of_rank : world.gather_at_root(own)) {
    std::istringstream in(of_rank);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
  }
  std::stable_sort(lines.begin(), lines.end(), [](const std::string& a, const std::string& b) {
    return a.compare(0, row_digits, b, 0, row_digits) < 0;
  });
  lines.resize(std::min(lines.size(), most_));
  std::string text;
  for (const std::string& line : lines) text.append(text.empty() ? 0 : 1, '\n').append(line, row_digits);
  if (most_ > 1 && count > most_) text += fmt::format("\nand {} more", count - most_);
  world.broadcast(text);
  return text;
}

namespace {

ShareOfList load_share(const std::filesystem::path& file, const GrainFileContext& context) {
  if (context.share.is_empty()) {
    ShareOfList none{{}, RowProblems(0)};
    none.list.source = file.filename().string();
    none.list.share = context.share;
    return none;
  }
  expect_readable(file);
  const std::string ending = ending_of(file);
  if (ending == ".h5" || ending == ".hdf5") return load_grain_hdf5(file, context);
  for (const char* known : {".csv", ".txt", ".dat", ".csv.gz", ".txt.gz", ".dat.gz"})
    if (ending == known) return load_grain_table(file, context);
  throw FileError(
      fmt::format("\"{}\" is not a kind of grain list that can be read; expected .csv, .txt or .dat (each also with "
                  ".gz), .h5 or .hdf5: {}",
                  ending, file.string()));
}

/// Throws on all ranks what the first that could not read its share has found.
void agree_on_failure(const World& world, std::string failure) {
  const std::vector<std::uint64_t> has_failed = world.gather(std::uint64_t{!failure.empty()});
  const auto first = std::find(has_failed.begin(), has_failed.end(), 1);
  if (first == has_failed.end()) return;
  world.broadcast(failure, static_cast<int>(first - has_failed.begin()));
  throw FileError(failure);
}

}  // namespace
}  // namespace files

ListedGrains load_grains(const std::filesystem::path& file, const GrainFileContext& context, const World& world) {
  files::ShareOfList read{{}, files::RowProblems(0)};
  std::string failure;
  try {
    read = files::load_share(file, context);
  } catch (const FileError& error) {
    failure = error.what();
  }
  files::agree_on_failure(world, failure);
  if (const std::string problems = read.problems.text(world); !problems.empty()) throw FileError(problems);
  share_facts(world, read.list);
  return std::move(read.list);
}

}  // namespace moraine
