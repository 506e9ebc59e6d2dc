// Lists of grains as text.
#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <string_view>

#include "io/files/files.hpp"

namespace moraine {

namespace {

enum class Column { x, y, z, r, d, vx, vy, vz, wx, wy, wz, material, count_ };
constexpr std::size_t n_columns = static_cast<std::size_t>(Column::count_);
struct ColumnName {
  std::string_view name;
  Column column;
};
constexpr ColumnName column_names[] = {
    {"x", Column::x},      {"y", Column::y},        {"z", Column::z},   {"r", Column::r},
    {"d", Column::d},      {"vx", Column::vx},      {"vy", Column::vy}, {"vz", Column::vz},
    {"wx", Column::wx},    {"wy", Column::wy},      {"wz", Column::wz}, {"material", Column::material},
    {"radius", Column::r}, {"diameter", Column::d},
};
constexpr const char* known_columns = "x, y, z, r or d, vx, vy, vz, wx, wy, wz, material";

/// The lines of a file, one after the other, unpacked where it is packed (zlib reads plain files as they are).
class Lines {
 public:
  explicit Lines(const std::filesystem::path& file) : file_(file), in_(gzopen(file.c_str(), "rb"), gzclose) {
    if (!in_) throw FileError(fmt::format("cannot be read: {}", file.string()));
    std::error_code error;
    packed_ = std::filesystem::file_size(file, error);
    if (error) packed_ = ~std::uintmax_t{0};
  }

  /// False at the end. A line is good until the next one.
  bool next(std::string_view& line) {
    std::size_t end;
    while ((end = text_.find('\n', at_)) == std::string::npos && !is_at_end_) {
      if (text_.size() - at_ > longest_line)
        throw FileError(fmt::format("has a line of more than {} characters, which no list of grains has: {}",
                                    longest_line, file_.string()));
      read_on();
    }
    if (end == std::string::npos) end = text_.size();
    line = std::string_view(text_).substr(at_, end - at_);
    const bool is_there = at_ < text_.size();
    at_ = std::min(end + 1, text_.size());
    return is_there;
  }

 private:
  /// Real lists have lines of some hundred characters, and are packed to a twentieth at best.
  static constexpr std::size_t longest_line = 1 << 16;
  static constexpr std::uintmax_t most_packed = 64, always_allowed = 1 << 20;  // times; bytes

  void read_on() {
    text_.erase(0, at_);
    at_ = 0;
    constexpr std::size_t size = 1 << 16;
    const std::size_t before = text_.size();
    text_.resize(before + size);
    const int n = gzread(in_.get(), text_.data() + before, static_cast<unsigned>(size));
    text_.resize(before + static_cast<std::size_t>(std::max(n, 0)));
    unpacked_ += static_cast<std::uintmax_t>(std::max(n, 0));
    if (unpacked_ > always_allowed && (unpacked_ - always_allowed) / most_packed > packed_)
      throw FileError(
          fmt::format("is more than {} times as large unpacked as it is packed, which no list of grains is (unpack it "
                      "by gunzip if it "
                      "is one): {}",
                      most_packed, file_.string()));
    if (n == static_cast<int>(size)) return;
    is_at_end_ = true;
    int code = Z_OK;
    const char* reason = gzerror(in_.get(), &code);
    if (n < 0 || (code != Z_OK && code != Z_STREAM_END))
      throw FileError(fmt::format("cannot be unpacked ({}): {}", reason, file_.string()));
  }

  const std::filesystem::path& file_;
  std::unique_ptr<gzFile_s, int (*)(gzFile)> in_;
  std::string text_;
  std::size_t at_ = 0;
  std::uintmax_t packed_ = 0, unpacked_ = 0;  // [bytes]
  bool is_at_end_ = false;
};

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  if (text.size() > 1 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

/// Cells of a line; ' ' as separator stands for any run of blanks.
void split(std::string_view line, char separator, std::vector<std::string_view>& cells) {
  cells.clear();
  if (separator == ' ') {
    while (!(line = trimmed(line)).empty()) {
      const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
      cells.push_back(line.substr(0, end));
      line.remove_prefix(end);
    }
    return;
  }
  for (;;) {
    const std::size_t end = line.find(separator);
    cells.push_back(trimmed(line.substr(0, end)));
    if (end == std::string_view::npos) return;
    line.remove_prefix(end + 1);
  }
}

char separator_of(std::string_view header) {
  for (const char c : {',', ';', '\t'})
    if (header.find(c) != std::string_view::npos) return c;
  return ' ';
}

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return out;
}

class TableReader {
 public:
  TableReader(const std::filesystem::path& file, const GrainFileContext& context)
      : file_(file), context_(context), lines_(file) {
    column_of_.fill(-1);
    grains_.source = file.filename().string();
    grains_.share = context.share;
  }

  files::ShareOfList read() {
    bool has_header = false;
    std::uint64_t n_rows = 0;
    for (std::string_view line; lines_.next(line);) {
      line = trimmed(line);
      ++line_number_;
      if (line.empty() || line.front() == '#') continue;
      if (!has_header)
        read_header(line), has_header = true;
      else if (grains_.share.has(n_rows++))
        read_grain(line);
    }
    if (!has_header) fail_file(fmt::format("holds no header; expected the columns {}", known_columns));
    if (n_rows == 0) fail_file("holds a header but no grains");
    return {std::move(grains_), std::move(problems_)};
  }

 private:
  bool has(Column column) const { return column_of_[static_cast<std::size_t>(column)] >= 0; }

  [[noreturn]] void fail_file(const std::string& what) const {
    throw FileError(fmt::format("{}: {}", what, file_.string()));
  }
  [[noreturn]] void fail_header(const std::string& what) {
    for (std::string_view line; lines_.next(line);) continue;  // a file that cannot be unpacked is told of as such
    throw FileError(fmt::format("{}:{}: {}", file_.string(), line_number_, what));
  }
  void complain(std::size_t column, const std::string& what) {
    problems_.add(line_number_, fmt::format("{}:{}: column {} (\"{}\"): {}", file_.string(), line_number_, column + 1,
                                            column < header_.size() ? header_[column] : "", what));
  }

  /// Column names may carry their unit, as "x [m]" or "x[m]"; only SI units are right.
  void read_header(std::string_view line) {
    separator_ = separator_of(line);
    split(line, separator_, cells_);
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      std::string name = lower(cells_[i]);
      std::string unit;
      if (const std::size_t bracket = name.find('['); bracket != std::string::npos) {
        unit = name.substr(bracket);
        name = std::string(trimmed(std::string_view(name).substr(0, bracket)));
      }
      header_.push_back(name);
      const auto* known =
          std::find_if(std::begin(column_names), std::end(column_names), [&](const auto& c) { return c.name == name; });
      if (known == std::end(column_names))
        fail_header(fmt::format("column {}: \"{}\" is not a known column; expected {}", i + 1, std::string(cells_[i]),
                                known_columns));
      if (!unit.empty() && unit != unit_of(known->column))
        fail_header(fmt::format("column {}: \"{}\" is in {}; expected {}", i + 1, name, unit, unit_of(known->column)));
      int& index = column_of_[static_cast<std::size_t>(known->column)];
      if (index >= 0)
        fail_header(fmt::format("column {}: \"{}\" was there before, as column {}", i + 1, name, index + 1));
      index = static_cast<int>(i);
    }
    check_header();
  }

  static std::string unit_of(Column column) {
    if (column <= Column::d) return "[m]";
    if (column <= Column::vz) return "[m/s]";
    return column <= Column::wz ? "[rad/s]" : "";
  }

  void check_header() {
    for (const Column column : {Column::x, Column::y, Column::z})
      if (!has(column) && !(column == Column::z && context_.z))
        fail_header(fmt::format("column \"{}\" is missing; the first line must name the columns: {}",
                                column_names[static_cast<std::size_t>(column)].name, known_columns));
    if (has(Column::r) && has(Column::d)) fail_header("has both a radius and a diameter; expected one of them");
    has_velocity_ = has(Column::vx) || has(Column::vy) || has(Column::vz);
    has_spin_ = has(Column::wx) || has(Column::wy) || has(Column::wz);
    grains_.has_radius = has(Column::r) || has(Column::d);
    grains_.has_velocity = has_velocity_ || has_spin_;
    grains_.has_material = has(Column::material);
  }

  /// The number in a column; `otherwise` where the file does not have the column.
  double number(Column column, double otherwise) {
    const int index = column_of_[static_cast<std::size_t>(column)];
    if (index < 0) return otherwise;
    std::string_view cell = cells_[static_cast<std::size_t>(index)];
    if (!cell.empty() && cell.front() == '+') cell.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (error != std::errc() || end != cell.data() + cell.size())
      complain(static_cast<std::size_t>(index), fmt::format("\"{}\" is not a number", cell));
    return value;
  }
  Vec3 vector(Column x, Column y, Column z, Vec3 otherwise) {
    return {number(x, otherwise.x), number(y, otherwise.y), number(z, otherwise.z)};
  }

  std::uint16_t material() {
    const int index = column_of_[static_cast<std::size_t>(Column::material)];
    if (index < 0 || context_.material) return context_.material.value_or(0);
    const std::string_view name = cells_[static_cast<std::size_t>(index)];
    const auto found = std::find(context_.materials.begin(), context_.materials.end(), name);
    if (found == context_.materials.end())
      complain(static_cast<std::size_t>(index), fmt::format("\"{}\" is not a material of the scene", name));
    return static_cast<std::uint16_t>(found - context_.materials.begin());
  }

  void read_grain(std::string_view line) {
    split(line, separator_, cells_);
    if (cells_.size() != header_.size()) {
      complain(std::min(cells_.size(), header_.size() - 1),
               fmt::format("the line has {} columns, the header {}", cells_.size(), header_.size()));
      return;
    }
    GrainSeed seed;
    seed.position = vector(Column::x, Column::y, Column::z, {0.0, 0.0, context_.z.value_or(0.0)});
    seed.radius = has(Column::d) ? number(Column::d, 0.0) / 2.0 : number(Column::r, 0.0);
    seed.velocity = has_velocity_ ? vector(Column::vx, Column::vy, Column::vz, {}) : context_.velocity;
    seed.angular_velocity = has_spin_ ? vector(Column::wx, Column::wy, Column::wz, {}) : context_.angular_velocity;
    seed.material = material();
    grains_.grains.push_back(seed);
  }

  const std::filesystem::path& file_;
  const GrainFileContext& context_;
  ListedGrains grains_;
  std::array<int, n_columns> column_of_{};
  std::vector<std::string> header_;
  std::vector<std::string_view> cells_;
  char separator_ = ',';
  bool has_velocity_ = false, has_spin_ = false;
  std::size_t line_number_ = 0;
  Lines lines_;
  files::RowProblems problems_{10};
};

}  // namespace

files::ShareOfList files::load_grain_table(const std::filesystem::path& file, const GrainFileContext& context) {
  return TableReader(file, context).read();
}

}  // namespace moraine
