#include "io/checkpoint/image_file.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <system_error>
#include <utility>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/rank_files.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

// What is added to a history must be written and read here, or a restart loses it without a word.
static_assert(sizeof(PairHistory) == 7 * 8 && sizeof(FurtherHistory) == 7 * 8 && sizeof(WallHistory) == 13 * 8,
              "a history has changed: checkpoints must keep all of it");

std::array<double, 3> as_array(Vec3 v) { return {v.x, v.y, v.z}; }
Vec3 as_vector(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

ColumnForm form_of(const FieldInfo& row) {
  return {"particles/" + std::string(row.name), row.type, row.components, std::string(row.unit)};
}

/// Names of accumulators are free text; those of datasets must not contain a slash, nor be empty or a dot.
std::string encoded(const std::string& name) {
  std::string text;
  for (const char c : name) text += c == '/' ? "%2F" : c == '%' ? "%25" : c == '\n' ? "%0A" : std::string(1, c);
  if (text.empty()) return "%00";
  return text == "." ? "%2E" : text;
}

std::string decoded(const std::string& text) {
  if (text == "%00") return {};
  std::string name;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned code = 0;
    const char* const digits = text.data() + i + 1;
    if (text[i] != '%' || i + 2 >= text.size() || std::from_chars(digits, digits + 2, code, 16).ptr != digits + 2) {
      name += text[i];
      continue;
    }
    name += static_cast<char>(code);
    i += 2;
  }
  return name;
}

std::size_t n_values(const FieldArray& array) {
  switch (info(array.field).type) {
    case FieldType::real: return array.reals.size();
    case FieldType::gid: return array.gids.size();
    default: return array.indices.size();
  }
}

const void* values_of(const FieldArray& array) {
  switch (info(array.field).type) {
    case FieldType::real: return array.reals.data();
    case FieldType::gid: return array.gids.data();
    default: return array.indices.data();
  }
}

/// Visits the columns of a history: each with its form and where its first number lies in an entry. Energies are apart.
template <class Visit>
void for_pair_columns(Visit&& visit) {
  visit(ColumnForm{"contacts/pairs/gid_low", FieldType::gid, 1, {}}, [](auto& p) { return &p.gid_low; });
  visit(ColumnForm{"contacts/pairs/gid_high", FieldType::gid, 1, {}}, [](auto& p) { return &p.gid_high; });
  visit(ColumnForm{"contacts/pairs/image", FieldType::gid, 1, {}}, [](auto& p) { return &p.image; });
  visit(ColumnForm{"contacts/pairs/displacement", FieldType::real, 3, "m"}, [](auto& p) { return &p.displacement[0]; });
}

template <class Visit>
void for_wall_columns(Visit&& visit) {
  visit(ColumnForm{"contacts/walls/gid", FieldType::gid, 1, {}}, [](auto& w) { return &w.gid; });
  visit(ColumnForm{"contacts/walls/surface", FieldType::gid, 1, {}}, [](auto& w) { return &w.surface; });
  visit(ColumnForm{"contacts/walls/normal", FieldType::real, 3, {}}, [](auto& w) { return &w.normal[0]; });
  visit(ColumnForm{"contacts/walls/displacement", FieldType::real, 3, "m"}, [](auto& w) { return &w.displacement[0]; });
}

/// What rolling resistance and cohesion remember: no dataset in scenes without.
template <class Visit>
void for_further_columns(Visit&& visit) {
  visit(ColumnForm{"contacts/further/gid_low", FieldType::gid, 1, {}}, [](auto& f) { return &f.gid_low; });
  visit(ColumnForm{"contacts/further/gid_high", FieldType::gid, 1, {}}, [](auto& f) { return &f.gid_high; });
  visit(ColumnForm{"contacts/further/image", FieldType::gid, 1, {}}, [](auto& f) { return &f.image; });
  visit(ColumnForm{"contacts/further/angle", FieldType::real, 3, "rad"}, [](auto& f) { return &f.angle[0]; });
  visit(ColumnForm{"contacts/further/bond", FieldType::real, 1, {}}, [](auto& f) { return &f.bond; });
}
template <class Visit>
void for_further_wall_columns(Visit&& visit) {
  visit(ColumnForm{"contacts/walls/angle", FieldType::real, 3, "rad"}, [](auto& w) { return &w.angle[0]; });
  visit(ColumnForm{"contacts/walls/bond", FieldType::real, 1, {}}, [](auto& w) { return &w.bond; });
}

const ColumnForm pair_energy{"contacts/pairs/energy", FieldType::real, 1, "J"};
const ColumnForm wall_energy{"contacts/walls/energy", FieldType::real, 1, "J"};
constexpr auto energy_in = [](auto& entry) { return &entry.energy; };

/// A column that is gathered from entries, block by block.
template <class Entry, class Place>
Column entry_column(const ColumnForm& form, const std::vector<Entry>& entries, Place place) {
  return {form, [&entries, place, bytes = form.row_bytes()](std::size_t first, std::size_t n, std::byte* buffer) {
            for (std::size_t i = 0; i < n; ++i) std::memcpy(buffer + i * bytes, place(entries[first + i]), bytes);
            return static_cast<const void*>(buffer);
          }};
}

/// Whether there is an entry on any rank of which this holds. All ranks call it.
template <class Entry, class Predicate>
bool is_any(const std::vector<Entry>& entries, const World& world, Predicate holds) {
  std::uint64_t any[] = {std::any_of(entries.begin(), entries.end(), holds)};
  world.max(std::span<std::uint64_t>(any));
  return any[0] != 0;
}

/// What springs hold; scenes without an energy ledger have none, and no dataset. All ranks call it.
template <class Entry>
bool has_energy(const std::vector<Entry>& entries, const World& world) {
  return is_any(entries, world, [](const Entry& entry) { return std::bit_cast<std::uint64_t>(entry.energy) != 0; });
}

Table table_of_grains(const Image& image) {
  Table table;
  for (const FieldArray& array : image.fields) {
    const ColumnForm form = form_of(info(array.field));
    const auto width = static_cast<std::size_t>(form.components);
    if (&array == &image.fields.front()) table.n_rows = n_values(array) / width;
    if (n_values(array) != table.n_rows * width)
      throw std::logic_error(form.name + " of an image has another length than its grains");
    table.columns.push_back({form, [&array, bytes = form.row_bytes()](std::size_t first, std::size_t, std::byte*) {
                               return static_cast<const void*>(static_cast<const std::byte*>(values_of(array)) +
                                                               first * bytes);
                             }});
  }
  return table;
}

Table table_of_pairs(const Image& image, const World& world) {
  Table table{image.pairs.size(), {}};
  for_pair_columns(
      [&](const ColumnForm& form, auto place) { table.columns.push_back(entry_column(form, image.pairs, place)); });
  if (has_energy(image.pairs, world)) table.columns.push_back(entry_column(pair_energy, image.pairs, energy_in));
  return table;
}

Table table_of_walls(const Image& image, const World& world) {
  Table table{image.walls.size(), {}};
  for_wall_columns(
      [&](const ColumnForm& form, auto place) { table.columns.push_back(entry_column(form, image.walls, place)); });
  if (has_energy(image.walls, world)) table.columns.push_back(entry_column(wall_energy, image.walls, energy_in));
  if (is_any(image.walls, world, [](const WallHistory& w) {
        return w.angle[0] != 0.0 || w.angle[1] != 0.0 || w.angle[2] != 0.0 || w.bond != 0.0;
      }))
    for_further_wall_columns(
        [&](const ColumnForm& form, auto place) { table.columns.push_back(entry_column(form, image.walls, place)); });
  return table;
}

Table table_of_further(const Image& image) {
  Table table{image.further.size(), {}};
  for_further_columns(
      [&](const ColumnForm& form, auto place) { table.columns.push_back(entry_column(form, image.further, place)); });
  return table;
}

/// One of its own for each quantity: they may have different numbers of values.
Table table_of_grid(const GridArray& array, const std::string& dataset) {
  const ColumnForm form{dataset, FieldType::real, 1, array.unit, array.n};
  return {array.values.size(), {{form, [&array](std::size_t first, std::size_t, std::byte*) {
                                   return static_cast<const void*>(array.values.data() + first);
                                 }}}};
}

/// A column of values that lie one row after the other; `values` must outlive it.
Column plain_column(const ColumnForm& form, const void* values) {
  return {form, [values, bytes = form.row_bytes()](std::size_t first, std::size_t, std::byte*) {
            return static_cast<const void*>(static_cast<const std::byte*>(values) + first * bytes);
          }};
}

ColumnForm map_form(const WallMap& map, const char* what, FieldType type, int components, const char* unit) {
  return {map_dataset(map, what), type, components, unit};
}

/// The triangles of a force map, which all ranks have, in the root's hands: their corners, as points, and what belongs to each triangle.
std::vector<Table> tables_of_map(const WallMap& map, const World& world) {
  const std::size_t n = world.is_root() ? map.n_triangles() : 0;
  const Column points = plain_column(map_form(map, "points", FieldType::real, 3, "m"), map.corners.data());
  const ColumnForm numbers = map_form(map, "triangles", FieldType::gid, 3, "");
  const Column triangles{numbers, [](std::size_t first, std::size_t rows, std::byte* buffer) {
                           for (std::size_t k = 0; k < 3 * rows; ++k) {
                             const std::uint64_t number = 3 * first + k;
                             std::memcpy(buffer + k * sizeof number, &number, sizeof number);
                           }
                           return static_cast<const void*>(buffer);
                         }};
  return {{3 * n, {points}},
          {n,
           {triangles, plain_column(map_form(map, "force", FieldType::real, 3, "N"), map.force.data()),
            plain_column(map_form(map, "pressure", FieldType::real, 1, "Pa"), map.pressure.data()),
            plain_column(map_form(map, "shear", FieldType::real, 1, "Pa"), map.shear.data())}}};
}

/// Everything that is written, and how it is shared between the ranks.
struct Content {
  const Image* image;
  const RunRecord* record;
  std::vector<Table> tables;
  std::vector<Spread> spread;
};

void add_grids(const std::vector<GridArray>& grids, std::string (*dataset)(const GridArray&), Content& content) {
  for (const GridArray& array : grids) content.tables.push_back(table_of_grid(array, dataset(array)));
}

void check_grids(const Content& content) {
  for (std::size_t t = 0; t < content.tables.size(); ++t) {
    if (content.tables[t].columns.empty() || !content.tables[t].columns[0].form.is_grid()) continue;
    const ColumnForm& form = content.tables[t].columns[0].form;
    if (content.spread[t].total() !=
        static_cast<std::uint64_t>(std::int64_t{form.grid[0]} * form.grid[1] * form.grid[2]))
      throw std::logic_error(form.name + " of an image has another number of values than its grid");
  }
}

Content content_of(const Image& image, const RunRecord* record, const World& world) {
  Content content{&image, record, {table_of_grains(image)}, {}};
  if (record != nullptr) {
    content.tables.push_back(table_of_pairs(image, world));
    content.tables.push_back(table_of_walls(image, world));
    if (is_any(image.further, world, [](const FurtherHistory&) { return true; }))
      content.tables.push_back(table_of_further(image));
  }
  if (record == nullptr)
    for (const WallMap& map : image.maps)
      for (Table& table : tables_of_map(map, world)) content.tables.push_back(std::move(table));
  add_grids(image.grids, gas_dataset, content);
  if (record != nullptr) add_grids(image.sums, field_dataset, content);
  content.spread = spread_of(content.tables, world);
  check_grids(content);
  if (!image.fields.empty() && content.spread[0].total() != image.n_grains)
    throw std::logic_error("the fields of an image have other lengths than its grains");
  return content;
}

std::uint64_t header_size(const Content& content, std::size_t n_rank_files, std::size_t n_name_characters) {
  std::size_t n_parts = 2 + n_rank_files, n_characters = 40 + n_rank_files * n_name_characters;
  for (const Table& table : content.tables) {
    n_parts += table.columns.size();
    for (const Column& column : table.columns) n_characters += column.form.name.size();
  }
  for (const auto& [name, values] : content.image->accumulators) {
    ++n_parts;
    n_characters += 16 + 3 * name.size();
  }
  return seal_size(n_parts, n_characters);
}

/// Room that a file needs, rather more than less [bytes]: all but its columns.
std::uint64_t common_room(const Content& content, std::uint64_t header_bytes) {
  constexpr std::uint64_t for_structure = 32768, per_dataset = 1024;
  std::uint64_t bytes = header_bytes + for_structure;
  for (const Table& table : content.tables) bytes += per_dataset * table.columns.size();
  if (content.record != nullptr)
    bytes += content.record->scene.size() + content.record->version.size() + content.record->commit.size();
  for (const auto& [name, values] : content.image->accumulators)
    bytes += per_dataset + 3 * name.size() + values.size() * sizeof(double);
  return bytes;
}

std::uint64_t column_room(const Content& content) {
  std::uint64_t bytes = 0;
  for (std::size_t t = 0; t < content.tables.size(); ++t)
    for (const Column& column : content.tables[t].columns) bytes += content.spread[t].total() * column.form.row_bytes();
  return bytes;
}

/// Room for the places of so many files' rows in each column.
std::uint64_t mapping_room(const Content& content, std::size_t n_files, std::size_t n_name_characters) {
  std::uint64_t bytes = 0;
  for (const Table& table : content.tables) bytes += table.columns.size() * n_files * (n_name_characters + 256);
  return bytes;
}

/// Cells of a grid, as attributes of its group.
void write_grid(Hdf5Writer& file, const char* group, const std::array<int, 3>& cells, const Box& box) {
  const Vec3 size = box.size();
  file.attribute_of(group, "cells", {double(cells[0]), double(cells[1]), double(cells[2])});
  file.attribute_of(group, "low", as_array(box.low));
  file.attribute_of(group, "spacing", {size.x / cells[0], size.y / cells[1], size.z / cells[2]});
}

void write_frame(Hdf5Writer& file, const Image& image, const std::string& kind, int format) {
  file.attribute("kind", kind);
  file.attribute("format", static_cast<std::uint64_t>(format));
  file.attribute("step", image.step);
  file.attribute("time", image.time);
  file.attribute("time_step", image.time_step);
  file.attribute("domain_low", as_array(image.domain.low));
  file.attribute("domain_high", as_array(image.domain.high));
  file.attribute("periodic", std::array<double, 3>{double(image.periodic[0]), double(image.periodic[1]),
                                                   double(image.periodic[2])});
  file.attribute("grains", image.n_grains);
  file.attribute("state_hash", image.hash.text());
  if (!image.grids.empty()) write_grid(file, "gas", gas_cells(image), image.domain);
}

/// A checkpoint keeps all that accumulates; a snapshot only shows where the walls are.
bool is_shown(const Content& content, const std::string& name) {
  return content.record != nullptr || name.starts_with(pose_name(""));
}

/// What is the same on all ranks besides the frame.
void write_common(Hdf5Writer& file, const Content& content) {
  if (content.record != nullptr) {
    file.attribute("version", content.record->version);
    file.attribute("commit", content.record->commit);
    file.text("scene", content.record->scene);
  }
  for (const auto& [name, values] : content.image->accumulators)
    if (is_shown(content, name)) file.dataset("accumulators/" + encoded(name), values);
}

std::string kind_of(const Content& content) { return content.record != nullptr ? "checkpoint" : "snapshot"; }

/// Removes a file under a passing name where writing it has failed.
class Removed {
 public:
  explicit Removed(fs::path path) : path_(std::move(path)) {}
  ~Removed() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove(path_, ignored);
  }
  Removed(const Removed&) = delete;
  Removed& operator=(const Removed&) = delete;
  void keep() { path_.clear(); }

 private:
  fs::path path_;
};

/// The hash of each rank's rows of each column, at the root: [rank][column].
std::vector<std::vector<Hash128>> gather_hashes(const std::vector<Hash128>& hashes, const World& world) {
  std::string bytes(hashes.size() * sizeof(Hash128), '\0');
  if (!hashes.empty()) std::memcpy(bytes.data(), hashes.data(), bytes.size());
  std::vector<std::vector<Hash128>> all;
  for (const std::string& of_rank : world.gather_at_root(bytes)) {
    all.emplace_back(hashes.size());
    if (!hashes.empty()) std::memcpy(all.back().data(), of_rank.data(), of_rank.size());
  }
  return all;
}

/// Gives the columns among the parts the slices of the ranks; those come in the order of the tables.
void add_slices(std::vector<WrittenPart>& parts, const Content& content,
                const std::vector<std::vector<Hash128>>& hashes) {
  std::size_t column_number = 0;
  for (std::size_t t = 0; t < content.tables.size(); ++t)
    for (const Column& column : content.tables[t].columns) {
      const auto part =
          std::find_if(parts.begin(), parts.end(), [&](const WrittenPart& p) { return p.name == column.form.name; });
      for (std::size_t rank = 0; part != parts.end() && rank < hashes.size(); ++rank)
        if (const std::uint64_t n = content.spread[t].rows[rank]; n > 0)
          part->slices.push_back({n * column.form.row_bytes(), hashes[rank][column_number]});
      ++column_number;
    }
}

/// Writes and seals a file that holds the rows of all ranks; `write_start`: attributes and what is small. Returns its seal at the root. All
/// ranks call it.
Hash128 write_sealed(const fs::path& written, const fs::path& path, const std::string& kind, const Content& content,
                     const std::function<void(Hdf5Writer&)>& write_start, const World& world) {
  const std::uint64_t header_bytes = header_size(content, 0, 0);
  std::vector<WrittenPart> parts;
  agree_on_root(world, path, [&] {
    Hdf5Writer file(written, path, header_bytes, common_room(content, header_bytes) + column_room(content));
    write_start(file);
    for (std::size_t t = 0; t < content.tables.size(); ++t)
      for (const Column& column : content.tables[t].columns) file.column(column.form, content.spread[t].total());
    parts = file.close();
  });
  const auto hashes = gather_hashes(write_tables(written, path, content.tables, content.spread, world), world);
  Hash128 seal;
  agree_on_root(world, path, [&] {
    add_slices(parts, content, hashes);
    seal = seal_file(written, path, kind, header_bytes, parts);
  });
  return seal;
}

void write_shared(const fs::path& path, const Content& content, const World& world) {
  Removed left_over(world.is_root() ? temporary_name(path) : fs::path());
  write_sealed(
      temporary_name(path), path, kind_of(content), content,
      [&](Hdf5Writer& file) {
        write_frame(file, *content.image, kind_of(content), whole_file_format);
        write_common(file, content);
      },
      world);
  agree_on_root(world, path, [&] { take_place(path); });
  left_over.keep();
}

/// This rank's rows in a file of their own, in place. Returns its name and seal. All ranks call it.
RankFile write_rank_file(const fs::path& path, const Content& content, const World& world) {
  const fs::path draft = rank_file_draft(path, world.rank());
  Removed left_over(temporary_name(draft));
  fs::path place;
  Hash128 seal;
  agree(world, path, [&] {
    Content own = content;
    own.spread = spread_of(own.tables, World());
    for (Table& table : own.tables)  // a part of a grid is a list
      for (Column& column : table.columns) column.form.grid = {};
    seal = write_sealed(
        temporary_name(draft), draft, rank_file_kind, own,
        [&](Hdf5Writer& file) { write_frame(file, *own.image, rank_file_kind, whole_file_format); }, World());
  });
  agree(world, path, [&] {
    place = rank_file_name(path, world.rank(), seal);
    move_to(temporary_name(draft), place);
  });
  left_over.keep();
  return {place.filename().string(), seal};
}

/// The file in front: what is the same on all ranks, and the rows of the ranks' files as its own.
void write_front(const fs::path& path, const Content& content, const std::vector<RankFile>& files) {
  const fs::path written = temporary_name(path);
  Removed left_over(written);
  std::vector<std::string> names;
  for (const RankFile& file : files) names.push_back(file.name);
  const std::size_t n_name_characters = names.back().size();
  const std::uint64_t header_bytes = header_size(content, files.size(), n_name_characters);
  Hdf5Writer file(written, path, header_bytes,
                  common_room(content, header_bytes) + mapping_room(content, files.size(), n_name_characters));
  write_frame(file, *content.image, kind_of(content), file_format);
  write_common(file, content);
  for (std::size_t t = 0; t < content.tables.size(); ++t)
    for (const Column& column : content.tables[t].columns)
      file.column_of_files(column.form, names, content.spread[t].rows);
  // All that it holds itself has been written, and has its hash.
  std::vector<WrittenPart> parts = file.close();
  seal_file(written, path, kind_of(content), header_bytes, parts, files);
  take_place(path);
  left_over.keep();
}

/// Files of ranks first, the one in front last: until it is there, the old one and its files count.
void write_distributed(const fs::path& path, const Content& content, const World& world) {
  const RankFile own = write_rank_file(path, content, world);
  std::vector<RankFile> files;
  for (const std::string& text : world.gather_at_root(own.seal.text() + own.name))
    files.push_back({text.substr(32), Hash128::from_text(text.substr(0, 32))});
  agree_on_root(world, path, [&] { write_front(path, content, files); });
}

void check_length(const Hdf5Reader& file, const ColumnForm& form, std::uint64_t expected) {
  const std::uint64_t found = file.n_rows(form);
  if (found != expected)
    throw StorageError(file.path(), "dataset '" + form.name + "' has " + std::to_string(found) + " rows, expected " +
                                        std::to_string(expected));
}

FieldArray read_field(const Hdf5Reader& file, const FieldInfo& row, std::uint64_t n_grains, RowRange range) {
  FieldArray array;
  array.field = row.field;
  const ColumnForm form = form_of(row);
  check_length(file, form, n_grains);
  const std::size_t n = range.n * static_cast<std::size_t>(row.components);
  switch (row.type) {
    case FieldType::real: array.reals.resize(n); break;
    case FieldType::gid: array.gids.resize(n); break;
    case FieldType::index: array.indices.resize(n); break;
  }
  file.read(form, range, const_cast<void*>(values_of(array)));
  return array;
}

template <class Entry, class Place>
void read_entries(const Hdf5Reader& file, const ColumnForm& form, RowRange range, std::uint64_t n_rows,
                  std::vector<Entry>& entries, Place place) {
  check_length(file, form, n_rows);
  entries.resize(range.n);
  const std::size_t bytes = form.row_bytes();
  file.read_blocks(form, range, [&](std::size_t at, std::size_t n, const void* rows) {
    for (std::size_t i = 0; i < n; ++i)
      std::memcpy(place(entries[at + i]), static_cast<const std::byte*>(rows) + i * bytes, bytes);
  });
}

/// Quantities on a grid, this rank's equal share of the values of each.
std::vector<GridArray> read_grids(const Hdf5Reader& file, const std::string& group, const World& world) {
  std::vector<GridArray> grids;
  for (const std::string& name : file.children(group)) {
    const std::string dataset = group + "/" + name;
    GridArray array{decoded(name), file.unit_of(dataset), file.grid_of(dataset), {}};
    const ColumnForm form{dataset, FieldType::real, 1, array.unit, array.n};
    const RowRange range = share_of(file.n_rows(form), world);
    array.values.resize(range.n);
    file.read(form, range, array.values.data());
    grids.push_back(std::move(array));
  }
  return grids;
}

/// Force maps, whole on each rank.
std::vector<WallMap> read_maps(const Hdf5Reader& file) {
  std::vector<WallMap> maps;
  for (const std::string& name : file.children("walls")) {
    WallMap map;
    map.name = decoded(name);
    const auto read = [&](const char* what, int components, std::vector<double>& values) {
      const ColumnForm form = map_form(map, what, FieldType::real, components, "");
      const std::uint64_t n = file.n_rows(form);
      values.resize(n * static_cast<std::size_t>(components));
      file.read(form, {0, n}, values.data());
    };
    read("points", 3, map.corners);
    read("force", 3, map.force);
    read("pressure", 1, map.pressure);
    read("shear", 1, map.shear);
    maps.push_back(std::move(map));
  }
  return maps;
}

}  // namespace

std::string gas_dataset(const GridArray& array) { return "gas/" + encoded(array.name); }
std::string field_dataset(const GridArray& array) { return "fields/" + encoded(array.name); }
std::string map_dataset(const WallMap& map, const char* what) { return "walls/" + encoded(map.name) + "/" + what; }

void write_field_image(const fs::path& path, const FieldImage& fields, const World& world) {
  const Image none;  // of grains
  Content content{&none, nullptr, {}, {}};
  add_grids(fields.arrays, field_dataset, content);
  content.spread = spread_of(content.tables, world);
  check_grids(content);
  Removed left_over(world.is_root() ? temporary_name(path) : fs::path());
  write_sealed(
      temporary_name(path), path, field_file_kind, content,
      [&](Hdf5Writer& file) {
        file.attribute("kind", field_file_kind);
        file.attribute("format", static_cast<std::uint64_t>(whole_file_format));
        file.attribute("name", fields.name);
        file.attribute("step", fields.step);
        file.attribute("time", fields.time);
        file.attribute("time_step", fields.time_step);
        file.attribute("from", fields.from);
        file.attribute("samples", fields.n_samples);
        file.attribute("domain_low", as_array(fields.box.low));
        file.attribute("domain_high", as_array(fields.box.high));
        write_grid(file, "fields", fields.n, fields.box);
      },
      world);
  agree_on_root(world, path, [&] { take_place(path); });
  left_over.keep();
}

FieldImage read_field_image(const fs::path& path) {
  const Hdf5Reader file(path, {field_file_kind}, false);
  FieldImage fields;
  fields.name = file.text_attribute("name");
  fields.step = file.integer_attribute("step");
  fields.time = file.real_attribute("time");
  fields.time_step = file.real_attribute("time_step");
  fields.from = file.real_attribute("from");
  fields.n_samples = file.integer_attribute("samples");
  fields.box = {as_vector(file.vector_attribute("domain_low")), as_vector(file.vector_attribute("domain_high"))};
  fields.arrays = read_grids(file, "fields", World());
  if (!fields.arrays.empty()) fields.n = fields.arrays[0].n;
  return fields;
}

std::array<int, 3> gas_cells(const Image& image) {
  if (image.grids.empty()) return {};
  std::array<int, 3> cells = image.grids[0].n;
  for (const GridArray& array : image.grids)
    for (std::size_t axis = 0; axis < 3; ++axis) cells[axis] = std::min(cells[axis], array.n[axis]);
  return cells;
}

void write_image(const fs::path& path, const Image& image, const RunRecord* record, const World& world,
                 bool distributed) {
  const Content content = content_of(image, record, world);
  const auto clean_up = [&] {
    if (world.is_root()) remove_stale_rank_files(path);
    world.wait_for_all();  // or a rank's next file might already lie there
  };
  try {
    if (distributed && !world.is_alone())
      write_distributed(path, content, world);
    else
      write_shared(path, content, world);
  } catch (const StorageError&) {
    clean_up();
    throw;
  }
  clean_up();
}

Image read_grains(const Hdf5Reader& file, const World& world, std::vector<std::string>* unknown) {
  Image image;
  image.step = file.integer_attribute("step");
  image.time = file.real_attribute("time");
  image.time_step = file.real_attribute("time_step");
  image.domain = {as_vector(file.vector_attribute("domain_low")), as_vector(file.vector_attribute("domain_high"))};
  const std::array<double, 3> periodic = file.vector_attribute("periodic");
  for (std::size_t axis = 0; axis < 3; ++axis) image.periodic[axis] = periodic[axis] != 0.0;
  image.n_grains = file.integer_attribute("grains");
  try {
    image.hash = Hash128::from_text(file.text_attribute("state_hash"));
  } catch (const std::invalid_argument&) {
    throw StorageError(file.path(), "attribute 'state_hash' is not a hash of 32 hexadecimal digits");
  }
  for (const std::string& name : file.children("particles")) {
    if (field_by_name(name)) continue;
    if (unknown == nullptr)
      throw StorageError(file.path(), "holds the field '" + name + "', which this program does not know");
    unknown->push_back(name);
  }
  const RowRange range = share_of(image.n_grains, world);
  for (const FieldInfo& row : field_table)
    if (file.exists(form_of(row).name)) image.fields.push_back(read_field(file, row, image.n_grains, range));
  image.grids = read_grids(file, "gas", world);
  image.sums = read_grids(file, "fields", world);
  image.maps = read_maps(file);
  for (const std::string& name : file.children("accumulators"))
    image.accumulators[decoded(name)] = file.reals("accumulators/" + name);
  return image;
}

void read_history(const Hdf5Reader& file, Image& image, const World& world) {
  const std::uint64_t n_pairs = file.n_rows({"contacts/pairs/gid_low", FieldType::gid, 1, {}});
  const RowRange pairs = share_of(n_pairs, world);
  const auto read_pairs = [&](const ColumnForm& form, auto place) {
    read_entries(file, form, pairs, n_pairs, image.pairs, place);
  };
  for_pair_columns(read_pairs);
  if (file.exists(pair_energy.name)) read_pairs(pair_energy, energy_in);

  const std::uint64_t n_walls = file.n_rows({"contacts/walls/gid", FieldType::gid, 1, {}});
  const RowRange walls = share_of(n_walls, world);
  const auto read_walls = [&](const ColumnForm& form, auto place) {
    read_entries(file, form, walls, n_walls, image.walls, place);
  };
  for_wall_columns(read_walls);
  if (file.exists(wall_energy.name)) read_walls(wall_energy, energy_in);
  for_further_wall_columns([&](const ColumnForm& form, auto place) {
    if (file.exists(form.name)) read_walls(form, place);
  });

  const ColumnForm first_further{"contacts/further/gid_low", FieldType::gid, 1, {}};
  if (file.exists(first_further.name)) {
    const std::uint64_t n_further = file.n_rows(first_further);
    const RowRange further = share_of(n_further, world);
    for_further_columns([&](const ColumnForm& form, auto place) {
      read_entries(file, form, further, n_further, image.further, place);
    });
  }
}

RunRecord read_record(const Hdf5Reader& file) {
  return {file.text("scene"), file.text_attribute("version"), file.text_attribute("commit")};
}

}  // namespace moraine
