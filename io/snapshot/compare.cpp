#include "io/snapshot/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

namespace moraine {

namespace {

using Rows = std::vector<std::pair<std::size_t, std::size_t>>;  // row in a, row in b of the grains that both have

std::vector<std::uint64_t> gids_of(const Image& image) {
  if (const FieldArray* gids = image.find(Field::gid)) return gids->gids;
  std::vector<std::uint64_t> rows(image.n_grains);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = i;
  return rows;
}

/// Both lists ascend.
Rows common_rows(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  Rows rows;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i] == b[j])
      rows.emplace_back(i++, j++);
    else if (a[i] < b[j])
      ++i;
    else
      ++j;
  }
  return rows;
}

double number(const FieldArray& array, std::size_t i) {
  switch (info(array.field).type) {
    case FieldType::real: return array.reals[i];
    case FieldType::gid: return static_cast<double>(array.gids[i]);
    default: return static_cast<double>(array.indices[i]);
  }
}

bool has_same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

double distance(double a, double b) {
  const double difference = std::abs(a - b);
  if (std::isnan(difference)) return std::isnan(a) && std::isnan(b) ? 0.0 : std::numeric_limits<double>::infinity();
  return difference;
}

FieldDifference compare_field(const FieldArray& a, const FieldArray& b, const Rows& rows,
                              const std::vector<std::uint64_t>& gids) {
  const FieldInfo& row = info(a.field);
  const auto width = static_cast<std::size_t>(row.components);
  FieldDifference found{std::string(row.name), std::string(row.unit)};
  for (const auto& [i, j] : rows) {
    bool is_different = false;
    for (std::size_t c = 0; c < width; ++c) {
      const double x = number(a, i * width + c), y = number(b, j * width + c);
      if (has_same_bits(x, y)) continue;
      const bool is_first = found.n_different == 0 && !is_different;
      is_different = true;
      if (!is_first && distance(x, y) <= found.largest) continue;
      found.largest = distance(x, y);
      found.gid = gids[i];
      found.component = static_cast<int>(c);
      found.value_a = x, found.value_b = y;
    }
    found.n_different += is_different;
  }
  return found;
}

GridDifference compare_grid(const GridArray& a, const GridArray& b) {
  GridDifference found{a.name, a.unit};
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double x = a.values[i], y = b.values[i];
    if (has_same_bits(x, y)) continue;
    if (found.n_different++ > 0 && distance(x, y) <= found.largest) continue;
    found.largest = distance(x, y);
    const std::size_t nx = static_cast<std::size_t>(a.n[0]), ny = static_cast<std::size_t>(a.n[1]);
    found.place = {static_cast<int>(i % nx), static_cast<int>(i / nx % ny), static_cast<int>(i / nx / ny)};
    found.value_a = x, found.value_b = y;
  }
  return found;
}

const GridArray* find(const std::vector<GridArray>& grids, const std::string& name) {
  const auto found = std::find_if(grids.begin(), grids.end(), [&](const GridArray& g) { return g.name == name; });
  return found == grids.end() ? nullptr : &*found;
}

void compare_grids(const Image& a, const Image& b, Comparison& result) {
  for (const GridArray& array : a.grids) {
    const GridArray* const other = find(b.grids, array.name);
    if (other == nullptr) {
      result.notes.push_back(fmt::format("gas quantity {} is only in A", array.name));
    } else if (array.n != other->n || array.values.size() != other->values.size()) {
      result.notes.push_back(fmt::format("gas quantity {}: {} x {} x {} values in A, {} x {} x {} in B", array.name,
                                         array.n[0], array.n[1], array.n[2], other->n[0], other->n[1], other->n[2]));
    } else if (GridDifference difference = compare_grid(array, *other); difference.n_different > 0) {
      result.grids.push_back(std::move(difference));
    }
  }
  for (const GridArray& array : b.grids)
    if (find(a.grids, array.name) == nullptr)
      result.notes.push_back(fmt::format("gas quantity {} is only in B", array.name));
}

/// What is kept on grids of probes and on triangles of walls: whether it is the same to the bit.
void compare_fields(const Image& a, const Image& b, Comparison& result) {
  const auto is_same = [](const std::vector<double>& x, const std::vector<double>& y) {
    return x.size() == y.size() && (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0);
  };
  if (a.sums.size() != b.sums.size() || a.maps.size() != b.maps.size()) {
    result.notes.push_back("fields, or maps of forces on walls, are not the same in number");
    return;
  }
  for (std::size_t k = 0; k < a.sums.size(); ++k)
    if (a.sums[k].name != b.sums[k].name || a.sums[k].n != b.sums[k].n || !is_same(a.sums[k].values, b.sums[k].values))
      result.notes.push_back(fmt::format("the sum {} of fields differs", a.sums[k].name));
  for (std::size_t k = 0; k < a.maps.size(); ++k) {
    const WallMap &x = a.maps[k], &y = b.maps[k];
    if (x.name != y.name || !is_same(x.corners, y.corners) || !is_same(x.force, y.force) ||
        !is_same(x.pressure, y.pressure) || !is_same(x.shear, y.shear))
      result.notes.push_back(fmt::format("the map of the forces on wall {} differs", x.name));
  }
}

/// Histories consist of 64-bit numbers only, without padding.
template <class Entry>
bool is_same_entry(const Entry& a, const Entry& b) {
  static_assert(std::is_trivially_copyable_v<Entry>);
  return std::memcmp(&a, &b, sizeof a) == 0;
}

template <class Entry>
void compare_histories(const std::vector<Entry>& a, const std::vector<Entry>& b, const char* name,
                       std::vector<std::string>& notes) {
  if (a.size() != b.size()) {
    notes.push_back(fmt::format("{}: {} in A, {} in B", name, a.size(), b.size()));
    return;
  }
  std::size_t n_different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) n_different += !is_same_entry(a[i], b[i]);
  if (n_different > 0) notes.push_back(fmt::format("{}: {} of {} differ", name, n_different, a.size()));
}

void compare_accumulators(const Image& a, const Image& b, std::vector<std::string>& notes) {
  for (const auto& [name, values] : a.accumulators) {
    const auto other = b.accumulators.find(name);
    if (other == b.accumulators.end())
      notes.push_back(fmt::format("accumulator '{}' is only in A", name));
    else if (!std::equal(values.begin(), values.end(), other->second.begin(), other->second.end(), has_same_bits))
      notes.push_back(fmt::format("accumulator '{}' differs", name));
  }
  for (const auto& [name, values] : b.accumulators)
    if (a.accumulators.count(name) == 0) notes.push_back(fmt::format("accumulator '{}' is only in B", name));
}

void compare_frame(const Image& a, const Image& b, std::vector<std::string>& notes) {
  if (a.step != b.step) notes.push_back(fmt::format("step: {} in A, {} in B", a.step, b.step));
  if (!has_same_bits(a.time, b.time)) notes.push_back(fmt::format("time: {} s in A, {} s in B", a.time, b.time));
  if (!has_same_bits(a.time_step, b.time_step))
    notes.push_back(fmt::format("time step: {} s in A, {} s in B", a.time_step, b.time_step));
  if (!(a.domain == b.domain)) notes.emplace_back("domain: different boxes");
  if (a.periodic != b.periodic) notes.emplace_back("domain: periodic in different directions");
}

/// Checkpoints have accumulators and histories; snapshots have neither.
bool has_history(const Image& image) {
  return !image.accumulators.empty() || !image.pairs.empty() || !image.walls.empty();
}

}  // namespace

Comparison compare(const Image& a, const Image& b) {
  Comparison result;
  compare_frame(a, b, result.notes);
  const std::vector<std::uint64_t> gids_a = gids_of(a), gids_b = gids_of(b);
  const Rows rows = common_rows(gids_a, gids_b);
  result.n_common = rows.size();
  result.n_only_a = gids_a.size() - rows.size();
  result.n_only_b = gids_b.size() - rows.size();
  std::size_t n_fields_compared = 0;
  for (const FieldInfo& row : field_table) {
    const FieldArray *in_a = a.find(row.field), *in_b = b.find(row.field);
    if (in_a == nullptr && in_b == nullptr) continue;
    if (in_a == nullptr || in_b == nullptr) {
      result.notes.push_back(fmt::format("field {} is only in {}", row.name, in_a != nullptr ? 'A' : 'B'));
      continue;
    }
    ++n_fields_compared;
    const FieldDifference difference = compare_field(*in_a, *in_b, rows, gids_a);
    if (difference.n_different > 0) result.fields.push_back(difference);
  }
  if (n_fields_compared == 0 && a.n_grains + b.n_grains > 0)
    result.notes.emplace_back("the two have no field in common");
  compare_grids(a, b, result);
  compare_fields(a, b, result);
  if (has_history(a) && has_history(b)) {
    compare_histories(a.pairs, b.pairs, "contact histories", result.notes);
    compare_histories(a.further, b.further, "rolling and bonds of pairs", result.notes);
    compare_histories(a.walls, b.walls, "wall contact histories", result.notes);
    compare_accumulators(a, b, result.notes);
  }
  result.is_equal = result.notes.empty() && result.fields.empty() && result.grids.empty() && result.n_only_a == 0 &&
                    result.n_only_b == 0;
  return result;
}

std::string comparison_text(const Comparison& comparison) {
  std::string text;
  if (comparison.n_only_a + comparison.n_only_b > 0)
    text += fmt::format("grains: {} in both, {} only in A, {} only in B\n", comparison.n_common, comparison.n_only_a,
                        comparison.n_only_b);
  for (const std::string& note : comparison.notes) text += note + '\n';
  if (!comparison.fields.empty())
    text += fmt::format("{:<18}{:>14}{:>24}{:>12}  {:>24}{:>26}\n", "field", "grains differ", "largest difference",
                        "gid", "in A", "in B");
  constexpr const char* axes[] = {"x", "y", "z"};
  for (const FieldDifference& field : comparison.fields) {
    const int width = info(*field_by_name(field.name)).components;
    const std::string name = width == 1   ? field.name
                             : width == 3 ? field.name + '.' + axes[field.component]
                                          : fmt::format("{}[{}]", field.name, field.component);
    text += fmt::format("{:<18}{:>14}{:>24}{:>12}  {:>24}{:>26}\n", name, field.n_different,
                        fmt::format("{:.6g} {}", field.largest, field.unit), field.gid,
                        fmt::format("{}", field.value_a), fmt::format("{}", field.value_b));
  }
  if (!comparison.grids.empty())
    text += fmt::format("{:<18}{:>14}{:>24}{:>16}{:>22}{:>26}\n", "gas", "values differ", "largest difference", "cell",
                        "in A", "in B");
  for (const GridDifference& grid : comparison.grids)
    text += fmt::format("{:<18}{:>14}{:>24}{:>16}{:>22}{:>26}\n", grid.name, grid.n_different,
                        fmt::format("{:.6g} {}", grid.largest, grid.unit),
                        fmt::format("({}, {}, {})", grid.place[0], grid.place[1], grid.place[2]),
                        fmt::format("{}", grid.value_a), fmt::format("{}", grid.value_b));
  return text + (comparison.is_equal ? "equal\n" : "not equal\n");
}

}  // namespace moraine
