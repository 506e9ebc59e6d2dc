// HDF5 files of ours, written and read through few words; every call of the library is checked.
//
// Nothing of HDF5's own headers is seen outside hdf5_file.cpp. Files are deterministic: the same content gives the same bytes
// (no time stamps), on any number of ranks. Groups are made as dataset names need them.
//
// A file is written in three stages. Hdf5Writer lays it out: attributes, what is small, and room for the columns (one
// process). write_tables fills in the columns, each rank its rows. seal_file (seal.hpp) reads back and seals.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "comm/world.hpp"
#include "engine/particles/fields.hpp"
#include "io/checkpoint/seal.hpp"

namespace moraine {

/// A dataset of shape (n), or (n, components) with components > 1. `unit` becomes an attribute unless empty.
struct ColumnForm {
  std::string name;
  FieldType type = FieldType::real;
  int components = 1;
  std::string unit;
  std::array<int, 3> grid{};  // values along x, y, z: the dataset has shape (z, y, x), its rows are values, x fastest
  bool is_grid() const { return grid[0] > 0; }
  std::size_t row_bytes() const { return static_cast<std::size_t>(components) * size_of(type); }
};

/// This rank's rows of a column. `rows` returns where rows [first, first + n) lie, one after the other; it may put them
/// into `buffer`, which has room for them.
struct Column {
  ColumnForm form;
  std::function<const void*(std::size_t first, std::size_t n, std::byte* buffer)> rows;
};

/// Columns of equally many rows.
struct Table {
  std::size_t n_rows = 0;  // of this rank
  std::vector<Column> columns;
};

/// How the rows of a table lie on the ranks, one number each: consecutive rows in order of rank.
struct Spread {
  std::vector<std::uint64_t> rows;
  std::uint64_t total() const;
  std::uint64_t before(int rank) const;
};

/// All ranks call it. One per table.
std::vector<Spread> spread_of(const std::vector<Table>& tables, const World& world);

/// Lays out a file, one process alone. One that goes without close() removes it. All members throw StorageError in the
/// name of `path`.
class Hdf5Writer {
 public:
  /// `written`: where; replaced. `header_bytes`: user block for the seal, see seal_size(). `room` [bytes] that the file
  /// will need, rather more than less: it is reserved before anything is written, as the library is at a loss on a full
  /// disk.
  Hdf5Writer(const std::filesystem::path& written, const std::filesystem::path& path, std::uint64_t header_bytes,
             std::uint64_t room);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  /// Small datasets, written at once.
  void dataset(const std::string& name, std::span<const double> values);
  void text(const std::string& name, const std::string& value);  // UTF-8, one string

  /// Attributes of the file's root.
  void attribute(const std::string& name, const std::string& value);
  void attribute(const std::string& name, double value);
  void attribute(const std::string& name, std::uint64_t value);
  void attribute(const std::string& name, const std::array<double, 3>& value);
  /// Of a group, which is made.
  void attribute_of(const std::string& group, const std::string& name, const std::array<double, 3>& value);

  /// Room for a column, to be filled by write_tables().
  void column(const ColumnForm& form, std::uint64_t n_rows);

  /// A column whose rows lie in other files of the same directory, in a dataset of the same name: `rows[i]` of them in
  /// `files[i]`.
  void column_of_files(const ColumnForm& form, const std::vector<std::string>& files,
                       const std::vector<std::uint64_t>& rows);

  /// Closes the file. Returns its datasets in the order in which they were made; columns have no
  /// slices yet, and those without rows or in other files are not among them.
  std::vector<WrittenPart> close();

 private:
  struct File;
  std::unique_ptr<File> file_;
};

/// Fills in the columns of a file that has been laid out, by parallel HDF5 where there are several ranks, in blocks of
/// rows. Returns the hash of this rank's rows, column by column. All ranks call it; throws StorageError in the name of
/// `path`, the same on all.
std::vector<Hash128> write_tables(const std::filesystem::path& written, const std::filesystem::path& path,
                                  const std::vector<Table>& tables, const std::vector<Spread>& spread,
                                  const World& world);

/// Consecutive rows of a column.
struct RowRange {
  std::uint64_t first = 0;
  std::uint64_t n = 0;
};

/// This rank's equal share of so many rows.
RowRange share_of(std::uint64_t n_rows, const World& world);

/// Reads a file. Members throw StorageError where something is missing or of another form; they are not collective.
class Hdf5Reader {
 public:
  /// Checks the seal first, each byte of the file once for all ranks. `kinds`: those that are accepted. `needs_seal`:
  /// false accepts a plain HDF5 file, such as another tool has rewritten. All ranks call it; throws StorageError, the
  /// same on all.
  Hdf5Reader(const std::filesystem::path& path, const std::vector<std::string>& kinds, bool needs_seal,
             const World& world = {});
  ~Hdf5Reader();
  Hdf5Reader(const Hdf5Reader&) = delete;
  Hdf5Reader& operator=(const Hdf5Reader&) = delete;

  const std::filesystem::path& path() const;
  /// "checkpoint" or "snapshot", from the attribute "kind".
  std::string kind() const;
  /// The files that hold its rows, one for each rank that wrote; none where it holds them itself.
  const std::vector<std::string>& rank_files() const;
  bool exists(const std::string& name) const;
  /// Names of what a group holds, in order of name; empty where there is no such group.
  std::vector<std::string> children(const std::string& group) const;

  /// Values along x, y, z of a dataset of three dimensions.
  std::array<int, 3> grid_of(const std::string& name) const;
  /// The attribute "unit" of a dataset; empty where it has none.
  std::string unit_of(const std::string& name) const;
  std::uint64_t n_rows(const ColumnForm& form) const;
  /// Rows one after the other into `to`, which has room for them.
  void read(const ColumnForm& form, RowRange range, void* to) const;
  /// The same by blocks: `take` gets `n` rows at a time, the first of them `at` rows behind the range's first.
  void read_blocks(const ColumnForm& form, RowRange range,
                   const std::function<void(std::size_t at, std::size_t n, const void* rows)>& take) const;
  std::vector<double> reals(const std::string& name) const;  // a whole dataset of one component
  std::string text(const std::string& name) const;

  std::string text_attribute(const std::string& name) const;
  double real_attribute(const std::string& name) const;
  std::uint64_t integer_attribute(const std::string& name) const;
  std::array<double, 3> vector_attribute(const std::string& name) const;

 private:
  struct File;
  std::unique_ptr<File> file_;
};

}  // namespace moraine
