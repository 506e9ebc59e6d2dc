#include "io/checkpoint/hdf5_file.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "io/checkpoint/agreement.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/files/hdf5_room.hpp"
#include "io/files/mpi_handle.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// An identifier of the library, closed when it goes out of scope.
class Id {
 public:
  using Closer = herr_t (*)(hid_t);
  Id(hid_t id, Closer closer) : id_(id), closer_(closer) {}
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), closer_(other.closer_) {}
  Id& operator=(Id&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(closer_, other.closer_);
    return *this;
  }
  ~Id() {
    if (id_ >= 0) closer_(id_);
  }
  operator hid_t() const { return id_; }
  /// Closes now; false where the library reports an error.
  bool close() { return closer_(std::exchange(id_, H5I_INVALID_HID)) >= 0; }

 private:
  hid_t id_;
  Closer closer_;
};

/// The library prints its errors unless told not to; ours are thrown.
void quieten() {
  static const bool done = [] {
    H5open();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    return true;
  }();
  (void)done;
}

herr_t keep_description(unsigned, const H5E_error2_t* error, void* text) {
  if (error->desc != nullptr && *error->desc != '\0') *static_cast<std::string*>(text) = error->desc;
  return 0;
}

/// What the library says went wrong: the innermost of its messages, in plain words where it carries an errno; empty where it has none.
std::string hdf5_message() {
  std::string text;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned n, const H5E_error2_t* error, void* to) -> herr_t {
        return n == 0 ? keep_description(n, error, to) : 0;
      },
      &text);
  const std::size_t at = text.find("errno = ");
  if (at != std::string::npos) return explain_errno(std::atoi(text.c_str() + at + 8));
  return text;
}

std::string hdf5_reason() {
  const std::string text = hdf5_message();
  return text.empty() ? "no reason given" : text;
}

/// What ranks that write a file together need besides the file: MPI makes files of its own that they share. Empty where that is there.
std::string shared_files_reason() {
  const char* const temporary = std::getenv("TMPDIR");
  for (const char* const directory : {"/dev/shm", temporary && *temporary ? temporary : "/tmp"}) {
    struct statvfs space {};
    const bool is_known = statvfs(directory, &space) == 0;
    const int cause = !is_known || access(directory, W_OK) != 0 ? errno : space.f_bavail == 0 ? ENOSPC : 0;
    if (cause != 0)
      return std::string("MPI cannot keep the files that ranks share in ") + directory + ": " + explain_errno(cause);
  }
  return {};
}

/// Why a file cannot be written. Of a directory that has been moved away, and of what MPI lacks, the library says no more than that it failed.
std::string reason_at(const fs::path& written) {
  std::error_code error;
  if (!fs::exists(fs::absolute(written, error).parent_path(), error)) return explain_errno(ENOENT);
  std::string reason = hdf5_message();
  if (reason.empty()) reason = shared_files_reason();
  return reason.empty() ? hdf5_reason() : reason;
}

std::string parent_of(const std::string& name) {
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? std::string() : name.substr(0, slash);
}

Id string_type(std::size_t size) {
  Id type(H5Tcopy(H5T_C_S1), &H5Tclose);
  H5Tset_size(type, std::max<std::size_t>(size, 1));
  H5Tset_cset(type, H5T_CSET_UTF8);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  return type;
}

/// The file-access list: no locks, as a snapshot that is open in ParaView must not stop a run, and network file systems often have none.
Id file_access() {
  Id access(H5Pcreate(H5P_FILE_ACCESS), &H5Pclose);
  H5Pset_file_locking(access, false, true);
  H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
  return access;
}

/// Closes a file that is given up. The library writes what it has held back even then; where it cannot, it keeps the file and fails on it
/// again when the process ends. So the rest of it goes into memory: a full disk that others write to has no room even for an emptied file.
void close_without_writing(Id& file, const fs::path& written) {
  void* descriptor = nullptr;
  const int memory = memfd_create("given up", MFD_CLOEXEC);
  const bool is_aside = memory >= 0 && H5Fget_vfd_handle(file, H5P_DEFAULT, &descriptor) >= 0 &&
                        dup3(memory, *static_cast<const int*>(descriptor), O_CLOEXEC) >= 0;
  if (memory >= 0) ::close(memory);
  std::error_code ignored;
  if (!is_aside) fs::resize_file(written, 0, ignored);
  file.close();
}

constexpr std::size_t block_rows = 65536;

hid_t type_in_file(FieldType type) {
  switch (type) {
    case FieldType::real: return H5T_IEEE_F64LE;
    case FieldType::gid: return H5T_STD_U64LE;
    default: return H5T_STD_U16LE;
  }
}

hid_t type_in_memory(FieldType type) {
  switch (type) {
    case FieldType::real: return H5T_NATIVE_DOUBLE;
    case FieldType::gid: return H5T_NATIVE_UINT64;
    default: return H5T_NATIVE_UINT16;
  }
}

std::vector<hsize_t> grid_shape(const std::array<int, 3>& grid) {
  return {static_cast<hsize_t>(grid[2]), static_cast<hsize_t>(grid[1]), static_cast<hsize_t>(grid[0])};
}

/// Of rows as they lie in memory, or in a file that has them as a list.
std::vector<hsize_t> shape_of(const ColumnForm& form, std::uint64_t n_rows) {
  std::vector<hsize_t> shape{n_rows};
  if (form.components > 1) shape.push_back(static_cast<hsize_t>(form.components));
  return shape;
}

Id simple_space(const std::vector<hsize_t>& shape) {
  return {H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), &H5Sclose};
}

/// Selects consecutive values of a grid: the rest of a line, lines, planes, lines, and the start of a line.
bool select_values(hid_t space, const std::vector<hsize_t>& shape, hsize_t first, hsize_t n) {
  const hsize_t line = shape[2], plane = shape[1] * shape[2];
  for (H5S_seloper_t how = H5S_SELECT_SET; n > 0; how = H5S_SELECT_OR) {
    const hsize_t start[3] = {first / plane, first % plane / line, first % line};
    hsize_t count[3] = {1, 1, std::min(n, line - start[2])};
    if (first % line == 0 && n >= line) {
      count[2] = line;
      count[1] = std::min(n / line, shape[1] - start[1]);
      if (first % plane == 0 && n >= plane) count[0] = n / plane;
    }
    if (H5Sselect_hyperslab(space, how, start, nullptr, count, nullptr) < 0) return false;
    first += count[0] * count[1] * count[2];
    n -= count[0] * count[1] * count[2];
  }
  return true;
}

/// Selects rows of a column; none for n = 0.
bool select_rows(hid_t space, const ColumnForm& form, std::uint64_t first, std::uint64_t n) {
  if (n == 0) return H5Sselect_none(space) >= 0;
  if (form.is_grid()) return select_values(space, grid_shape(form.grid), first, n);
  const hsize_t start[2] = {first, 0}, count[2] = {n, static_cast<hsize_t>(form.components)};
  return H5Sselect_hyperslab(space, H5S_SELECT_SET, start, nullptr, count, nullptr) >= 0;
}

}  // namespace

struct Hdf5Writer::File {
  fs::path written;
  fs::path path;
  Id id{H5I_INVALID_HID, &H5Fclose};
  std::vector<WrittenPart> parts;

  File(const fs::path& written_, const fs::path& path_, hid_t opened)
      : written(written_), path(path_), id(opened, &H5Fclose) {}

  [[noreturn]] void fail(const std::string& doing) const {
    throw StorageError(path, "cannot be written (" + doing + "): " + reason_at(written));
  }
  void check(bool is_good, const std::string& doing) const {
    if (!is_good) fail(doing);
  }

  void abandon() {
    std::error_code ignored;
    if (id >= 0) close_without_writing(id, written);
    fs::remove(written, ignored);
  }

  void make_groups(const std::string& name) {
    const std::string parent = parent_of(name);
    if (parent.empty()) return;
    make_groups(parent);
    const htri_t is_there = H5Lexists(id, parent.c_str(), H5P_DEFAULT);
    check(is_there >= 0, parent);
    if (is_there > 0) return;
    const Id creation(H5Pcreate(H5P_GROUP_CREATE), &H5Pclose);
    check(H5Pset_obj_track_times(creation, false) >= 0, parent);
    const Id group(H5Gcreate2(id, parent.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), &H5Gclose);
    check(group >= 0, parent);
  }

  void write_attribute(hid_t object, const std::string& name, hid_t file_type, hid_t memory_type, hsize_t n,
                       const void* values) {
    const Id space(n == 1 ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &n, nullptr), &H5Sclose);
    Id attribute(H5Acreate2(object, name.c_str(), file_type, space, H5P_DEFAULT, H5P_DEFAULT), &H5Aclose);
    check(attribute >= 0 && H5Awrite(attribute, memory_type, values) >= 0 && attribute.close(), "attribute " + name);
  }

  void write_text_attribute(hid_t object, const std::string& name, const std::string& value) {
    const Id type = string_type(H5T_VARIABLE);  // Python sees those as str, and texts of fixed length as bytes
    const char* text = value.c_str();
    write_attribute(object, name, type, type, 1, &text);
  }

  Id make_dataset(const std::string& name, hid_t type, hid_t space, hid_t creation) {
    make_groups(name);
    check(H5Pset_obj_track_times(creation, false) >= 0, name);
    Id set(H5Dcreate2(id, name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), &H5Dclose);
    check(set >= 0, name);
    return set;
  }

  /// In one piece, its place in the file known at once.
  Id make_plain_dataset(const std::string& name, hid_t type, hid_t space) {
    const Id creation(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
    check(
        H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY) >= 0 && H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER) >= 0,
        name);
    return make_dataset(name, type, space, creation);
  }

  /// H5Dget_offset counts from the start of the file, the user block included.
  void add_part(const std::string& name, hid_t set, std::vector<Slice> slices) {
    const haddr_t offset = H5Dget_offset(set);
    check(offset != HADDR_UNDEF, name);
    parts.push_back({name, offset, std::move(slices)});
  }

  void write_dataset(const std::string& name, hid_t file_type, hid_t memory_type, hid_t space, const void* values,
                     std::size_t bytes) {
    Id set = make_plain_dataset(name, file_type, space);
    if (bytes > 0) {
      check(H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name);
      add_part(name, set, {{bytes, hash_bytes(values, bytes)}});
    }
    check(set.close(), name);
  }

  void finish_column(const ColumnForm& form, Id set) {
    if (!form.unit.empty()) write_text_attribute(set, "unit", form.unit);
    check(set.close(), form.name);
  }
};

namespace {

/// Tries without the library whether a file can be made in this place: the library's messages are long and name another
/// file, and it cannot close a file that it cannot write, and tries again when the process ends.
void try_file(const fs::path& written, const fs::path& path, std::uint64_t bytes) {
  try {
    FileHandle file(written, O_WRONLY | O_CREAT | O_TRUNC, path);
    file.reserve(bytes);
    file.close();
  } catch (...) {
    std::error_code ignored;
    fs::remove(written, ignored);
    throw;
  }
}

}  // namespace

Hdf5Writer::Hdf5Writer(const fs::path& written, const fs::path& path, std::uint64_t header_bytes, std::uint64_t room) {
  quieten();
  constexpr std::uint64_t for_empty_file = 65536;
  try_file(written, path, header_bytes + for_empty_file);
  const Id creation(H5Pcreate(H5P_FILE_CREATE), &H5Pclose);
  H5Pset_userblock(creation, header_bytes);
  H5Pset_obj_track_times(creation, false);
  const Id access = file_access();
  const hid_t opened = H5Fcreate(written.c_str(), H5F_ACC_TRUNC, creation, access);
  const std::string reason = opened < 0 ? reason_at(written) : std::string();
  file_ = std::make_unique<File>(written, path, opened);
  try {
    if (opened < 0) throw StorageError(path, "cannot be written (new file): " + reason);
    FileHandle handle(written, O_RDWR, path);
    handle.reserve(room);
    handle.close();
  } catch (...) {
    file_->abandon();
    throw;
  }
}

Hdf5Writer::~Hdf5Writer() {
  if (file_) file_->abandon();
}

void Hdf5Writer::dataset(const std::string& name, std::span<const double> values) {
  const Id space = simple_space({values.size()});
  file_->write_dataset(name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, space, values.data(), values.size_bytes());
}

void Hdf5Writer::text(const std::string& name, const std::string& value) {
  const Id type = string_type(value.size());
  const Id space(H5Screate(H5S_SCALAR), &H5Sclose);
  const std::string padded = value.empty() ? std::string(1, '\0') : value;
  file_->write_dataset(name, type, type, space, padded.data(), padded.size());
}

void Hdf5Writer::attribute(const std::string& name, const std::string& value) {
  file_->write_text_attribute(file_->id, name, value);
}

void Hdf5Writer::attribute(const std::string& name, double value) {
  file_->write_attribute(file_->id, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 1, &value);
}

void Hdf5Writer::attribute(const std::string& name, std::uint64_t value) {
  file_->write_attribute(file_->id, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, 1, &value);
}

void Hdf5Writer::attribute(const std::string& name, const std::array<double, 3>& value) {
  file_->write_attribute(file_->id, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 3, value.data());
}

void Hdf5Writer::attribute_of(const std::string& group, const std::string& name, const std::array<double, 3>& value) {
  file_->make_groups(group + "/");
  const Id opened(H5Gopen2(file_->id, group.c_str(), H5P_DEFAULT), &H5Gclose);
  file_->check(opened >= 0, group);
  file_->write_attribute(opened, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 3, value.data());
}

void Hdf5Writer::column(const ColumnForm& form, std::uint64_t n_rows) {
  const Id space = simple_space(form.is_grid() ? grid_shape(form.grid) : shape_of(form, n_rows));
  Id set = file_->make_plain_dataset(form.name, type_in_file(form.type), space);
  if (n_rows > 0) file_->add_part(form.name, set, {});
  file_->finish_column(form, std::move(set));
}

namespace {

/// The library would take a percent sign in the name of a file or dataset elsewhere for a place holder.
std::string without_place_holders(const std::string& text) {
  std::string name;
  for (const char c : text) name += c == '%' ? std::string("%%") : std::string(1, c);
  return name;
}

}  // namespace

void Hdf5Writer::column_of_files(const ColumnForm& form, const std::vector<std::string>& files,
                                 const std::vector<std::uint64_t>& rows) {
  const std::uint64_t n_rows = std::accumulate(rows.begin(), rows.end(), std::uint64_t{0});
  if (n_rows == 0) return column(form, 0);
  const Id creation(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
  // What other tools see of rows whose file is missing: no number, or the largest one, rather than a plausible zero.
  const double no_number = std::numeric_limits<double>::quiet_NaN();
  const std::uint64_t no_index = ~std::uint64_t{0};
  const void* fill = form.type == FieldType::real ? static_cast<const void*>(&no_number) : &no_index;
  file_->check(H5Pset_fill_value(creation, type_in_memory(form.type), fill) >= 0, form.name);
  const Id space = simple_space(form.is_grid() ? grid_shape(form.grid) : shape_of(form, n_rows));
  const std::string set_name = without_place_holders(form.name);
  std::uint64_t first = 0;
  for (std::size_t i = 0; i < files.size(); first += rows[i++]) {
    if (rows[i] == 0) continue;
    const Id rows_there = simple_space(shape_of(form, rows[i]));
    file_->check(
        select_rows(space, form, first, rows[i]) &&
            H5Pset_virtual(creation, space, without_place_holders(files[i]).c_str(), set_name.c_str(), rows_there) >= 0,
        form.name);
  }
  H5Sselect_all(space);
  file_->finish_column(form, file_->make_dataset(form.name, type_in_file(form.type), space, creation));
}

std::vector<WrittenPart> Hdf5Writer::close() {
  // Flushed before it is closed: after a failed flush the file can still be given up, after a failed close it cannot.
  file_->check(H5Fflush(file_->id, H5F_SCOPE_GLOBAL) >= 0, "flush");
  hsize_t bytes = 0;
  file_->check(H5Fget_filesize(file_->id, &bytes) >= 0, "flush");
  file_->check(file_->id.close(), "close");
  FileHandle handle(file_->written, O_RDWR, file_->path);
  handle.resize(bytes);  // less than was reserved
  handle.reserve(bytes);
  handle.close();
  std::vector<WrittenPart> parts = std::move(file_->parts);
  file_.reset();
  return parts;
}

std::uint64_t Spread::total() const { return std::accumulate(rows.begin(), rows.end(), std::uint64_t{0}); }

std::uint64_t Spread::before(int rank) const {
  return std::accumulate(rows.begin(), rows.begin() + rank, std::uint64_t{0});
}

std::vector<Spread> spread_of(const std::vector<Table>& tables, const World& world) {
  std::vector<Spread> spread;
  for (const Table& table : tables) spread.push_back({world.gather(static_cast<std::uint64_t>(table.n_rows))});
  return spread;
}

namespace {

/// Writes the rows of one rank. What fails is kept, and the calls that all ranks make together go on: nobody waits for
/// a rank that has given up.
class RowWriter {
 public:
  RowWriter(const fs::path& written, const fs::path& path, const World& world)
      : written_(written), path_(path), world_(world), file_(open(written, world), &H5Fclose) {
    note(file_ >= 0, "open");
    if (world.is_alone()) return;
    // Together, but each rank by itself what is its own: one run of bytes, so that there is nothing to gain from
    // passing it to others first, and an error stays where it is instead of keeping those waiting who have passed
    // theirs on.
    note(H5Pset_dxpl_mpio(transfer_, H5FD_MPIO_COLLECTIVE) >= 0 &&
             H5Pset_dxpl_mpio_collective_opt(transfer_, H5FD_MPIO_INDIVIDUAL_IO) >= 0,
         "open");
  }

  Hash128 write(const Column& column, std::size_t n_rows, const Spread& spread) {
    HashStream hash;
    const ColumnForm& form = column.form;
    if (spread.total() == 0 || file_ < 0) return hash.value();
    const Id set(H5Dopen2(file_, form.name.c_str(), H5P_DEFAULT), &H5Dclose);
    note(set >= 0, form.name);
    const Id space(H5Dget_space(set), &H5Sclose);
    const std::uint64_t before = spread.before(world_.rank());
    const std::uint64_t most = *std::max_element(spread.rows.begin(), spread.rows.end());
    buffer_.resize(std::max(buffer_.size(), std::min(block_rows, n_rows) * form.row_bytes() + 1));
    for (std::uint64_t first = 0; first < most; first += block_rows) {
      const std::size_t n = first < n_rows ? std::min<std::size_t>(block_rows, n_rows - first) : 0;
      const void* rows = n > 0 ? column.rows(first, n, buffer_.data()) : buffer_.data();
      hash.add(rows, n * form.row_bytes());
      put(set, space, form, before + first, n, rows);
    }
    return hash.value();
  }

  void close() {
    if (file_ < 0) return;
    note(H5Fflush(file_, H5F_SCOPE_GLOBAL) >= 0, "flush");
    if (!failure_.empty() && world_.is_alone())
      close_without_writing(file_, written_);
    else
      note(file_.close(), "close");
  }

  void throw_failure() const {
    if (!failure_.empty()) throw StorageError(path_, failure_);
  }

 private:
  static hid_t open(const fs::path& written, const World& world) {
    const Id access = file_access();
    if (!world.is_alone() && H5Pset_fapl_mpio(access, mpi_handle(world), mpi_hints()) < 0) return H5I_INVALID_HID;
    return H5Fopen(written.c_str(), H5F_ACC_RDWR, access);
  }

  void note(bool is_good, const std::string& doing) {
    if (!is_good && failure_.empty()) failure_ = "cannot be written (" + doing + "): " + reason_at(written_);
  }

  /// Takes part even where it has nothing, or nothing more, to write.
  void put(hid_t set, hid_t space, const ColumnForm& form, std::uint64_t first, std::size_t n, const void* rows) {
    const std::size_t n_put = failure_.empty() ? n : 0;
    if (n_put == 0 && world_.is_alone()) return;
    const Id memory = simple_space(shape_of(form, std::max<std::size_t>(n_put, 1)));
    select_rows(space, form, first, n_put);
    if (n_put == 0) H5Sselect_none(memory);
    note(H5Dwrite(set, type_in_memory(form.type), memory, space, transfer_, rows) >= 0, form.name);
  }

  fs::path written_;
  fs::path path_;
  const World& world_;
  Id file_;
  Id transfer_{H5Pcreate(H5P_DATASET_XFER), &H5Pclose};
  std::vector<std::byte> buffer_;
  std::string failure_;
};

}  // namespace

std::vector<Hash128> write_tables(const fs::path& written, const fs::path& path, const std::vector<Table>& tables,
                                  const std::vector<Spread>& spread, const World& world) {
  // Each rank for itself first: a rank that cannot reach the file would keep the others waiting in the library.
  agree(world, path, [&] { FileHandle(written, O_RDWR, path).close(); });
  std::vector<Hash128> hashes;
  agree(world, path, [&] {
    quieten();
    RowWriter writer(written, path, world);
    for (std::size_t i = 0; i < tables.size(); ++i)
      for (const Column& column : tables[i].columns)
        hashes.push_back(writer.write(column, tables[i].n_rows, spread[i]));
    writer.close();
    writer.throw_failure();
  });
  return hashes;
}

RowRange share_of(std::uint64_t n_rows, const World& world) {
  const auto rank = static_cast<std::uint64_t>(world.rank()), size = static_cast<std::uint64_t>(world.size());
  const std::uint64_t each = n_rows / size, larger = n_rows % size;
  return {rank * each + std::min(rank, larger), each + (rank < larger ? 1 : 0)};
}

struct Hdf5Reader::File {
  fs::path path;
  std::vector<std::string> rank_files;
  std::uint64_t bytes = 0;  // of all files together
  Id id{H5I_INVALID_HID, &H5Fclose};

  void count_bytes() {
    std::error_code ignored;
    bytes = fs::file_size(path, ignored);
    for (const std::string& name : rank_files)
      if (const auto size = fs::file_size(path.parent_path() / name, ignored); !ignored) bytes += size;
  }

  /// A dataset that claims more than its file can hold must not be given memory for it.
  void expect_room(hid_t set, const std::string& name, hid_t space, std::size_t value_bytes) const {
    hsize_t shape[H5S_MAX_RANK] = {};
    const int rank = H5Sget_simple_extent_dims(space, shape, nullptr);
    double n_values = 1.0;
    for (int i = 0; i < rank; ++i) n_values *= static_cast<double>(shape[i]);
    if (!files::has_room(set, n_values, value_bytes, bytes))
      fail("dataset '" + name + "' says that it has more values than the file can hold");
  }

  [[noreturn]] void fail(const std::string& problem) const { throw StorageError(path, problem); }

  Id open_attribute(const std::string& name) const {
    Id attribute(H5Aopen(id, name.c_str(), H5P_DEFAULT), &H5Aclose);
    if (attribute < 0) fail("has no attribute '" + name + "'");
    return attribute;
  }

  void read_attribute(const std::string& name, hid_t type, hssize_t n, void* to) const {
    read_value(open_attribute(name), name, type, n, to);
  }

  void read_value(hid_t attribute, const std::string& name, hid_t type, hssize_t n, void* to) const {
    const Id space(H5Aget_space(attribute), &H5Sclose);
    if (H5Sget_simple_extent_npoints(space) != n || H5Aread(attribute, type, to) < 0)
      fail("attribute '" + name + "' is not of the expected form");
  }

  std::string text_of(const Id& attribute, const std::string& name) const {
    const Id type(H5Aget_type(attribute), &H5Tclose);
    if (H5Tget_class(type) != H5T_STRING) fail("attribute '" + name + "' is not a text");
    if (H5Tis_variable_str(type) > 0) {
      char* text = nullptr;
      read_value(attribute, name, type, 1, &text);
      const std::string value = text == nullptr ? "" : text;
      H5free_memory(text);
      return value;
    }
    std::string value(H5Tget_size(type), '\0');
    const Id memory = string_type(value.size());
    read_value(attribute, name, memory, 1, value.data());
    while (!value.empty() && value.back() == '\0') value.pop_back();
    return value;
  }

  /// Opens a dataset and checks its form; returns its number of rows.
  std::pair<Id, std::uint64_t> open_column(const ColumnForm& form) const {
    const std::string &name = form.name, parent = parent_of(name);
    if (H5Lexists(id, parent.empty() ? name.c_str() : parent.c_str(), H5P_DEFAULT) <= 0 ||
        H5Lexists(id, name.c_str(), H5P_DEFAULT) <= 0)
      fail("has no dataset '" + name + "'");
    Id set(H5Dopen2(id, name.c_str(), H5P_DEFAULT), &H5Dclose);
    if (set < 0) fail("dataset '" + name + "' cannot be opened: " + hdf5_reason());
    const Id space(H5Dget_space(set), &H5Sclose);
    check_type(set, form);
    expect_room(set, name, space, size_of(form.type));
    if (form.is_grid()) {
      if (grid_in(space) != form.grid) fail("dataset '" + name + "' has another shape than expected");
      return {std::move(set), static_cast<std::uint64_t>(H5Sget_simple_extent_npoints(space))};
    }
    hsize_t shape[2] = {0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || rank > 2 || H5Sget_simple_extent_dims(space, shape, nullptr) < 0 ||
        (rank == 2 ? shape[1] : 1) != static_cast<hsize_t>(form.components))
      fail("dataset '" + name + "' has another shape than (n" +
           (form.components > 1 ? ", " + std::to_string(form.components) : "") + ")");
    return {std::move(set), shape[0]};
  }

  void check_type(hid_t set, const ColumnForm& form) const {
    const Id stored(H5Dget_type(set), &H5Tclose);
    const H5T_class_t expected = form.type == FieldType::real ? H5T_FLOAT : H5T_INTEGER;
    if (H5Tget_class(stored) != expected || (expected == H5T_INTEGER && H5Tget_size(stored) > size_of(form.type)))
      fail("dataset '" + form.name + "' has another type of numbers than expected");
  }

  /// Values along x, y, z; zeros where a dataset is no grid.
  static std::array<int, 3> grid_in(hid_t space) {
    hsize_t shape[3] = {0, 0, 0};
    if (H5Sget_simple_extent_ndims(space) != 3 || H5Sget_simple_extent_dims(space, shape, nullptr) < 0) return {};
    for (const hsize_t n : shape)
      if (n > static_cast<hsize_t>(std::numeric_limits<int>::max())) return {};
    return {static_cast<int>(shape[2]), static_cast<int>(shape[1]), static_cast<int>(shape[0])};
  }

  void read_rows(hid_t set, const ColumnForm& form, RowRange range, void* to) const {
    if (range.n == 0) return;
    const Id space(H5Dget_space(set), &H5Sclose);
    const hsize_t width = static_cast<hsize_t>(form.components);
    const Id memory = simple_space({range.n * width});
    // A dataset of shape (n) takes the first of the two numbers only.
    if (!select_rows(space, form, range.first, range.n) ||
        H5Dread(set, type_in_memory(form.type), memory, space, H5P_DEFAULT, to) < 0)
      fail("dataset '" + form.name + "' cannot be read: " + hdf5_reason());
  }

  /// Kind and format by its attributes, for files whose seal is gone.
  void check_kind(const Hdf5Reader& reader, const std::vector<std::string>& kinds) const {
    const std::string found = reader.kind();
    if (std::find(kinds.begin(), kinds.end(), found) == kinds.end())
      fail("holds a '" + found + "', which is not expected here");
    const std::uint64_t format = reader.integer_attribute("format");
    if (format > static_cast<std::uint64_t>(file_format))
      fail("is written in format " + std::to_string(format) + ", newer than format " + std::to_string(file_format) +
           " of this program: use a newer Moraine");
  }
};

namespace {

/// Checks a file and those of its ranks, which are shared out. Returns the latter. All ranks call it.
std::vector<RankFile> check_whole(const fs::path& path, const std::vector<std::string>& kinds, bool needs_seal,
                                  const World& world) {
  std::string listed;
  agree_on_root(world, path, [&] {
    const std::optional<SealHeader> header = check_seal(path, kinds);
    if (!header && needs_seal)
      throw StorageError(path,
                         "is an HDF5 file without Moraine's checksums; another program has written or rewritten it");
    if (header)
      for (const RankFile& file : header->rank_files) listed += file.seal.text() + file.name + '\n';
  });
  world.broadcast(listed);
  std::vector<RankFile> files;
  for (std::size_t at = 0, end; at < listed.size(); at = end + 1) {
    end = listed.find('\n', at);
    files.push_back({listed.substr(at + 32, end - at - 32), Hash128::from_text(listed.substr(at, 32))});
  }
  agree(world, path, [&] {
    const auto size = static_cast<std::size_t>(world.size());
    for (std::size_t i = static_cast<std::size_t>(world.rank()); i < files.size(); i += size)
      check_rank_file(path, files[i]);
  });
  return files;
}

}  // namespace

Hdf5Reader::Hdf5Reader(const fs::path& path, const std::vector<std::string>& kinds, bool needs_seal,
                       const World& world) {
  quieten();
  file_ = std::make_unique<File>();
  file_->path = path;
  for (const RankFile& file : check_whole(path, kinds, needs_seal, world)) file_->rank_files.push_back(file.name);
  file_->count_bytes();
  agree(world, path, [&] {
    const Id access = file_access();
    file_->id = Id(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), &H5Fclose);
    if (file_->id < 0) throw StorageError(path, "cannot be opened as HDF5: " + hdf5_reason());
    file_->check_kind(*this, kinds);
  });
}

Hdf5Reader::~Hdf5Reader() = default;

const fs::path& Hdf5Reader::path() const { return file_->path; }

std::string Hdf5Reader::kind() const { return text_attribute("kind"); }

const std::vector<std::string>& Hdf5Reader::rank_files() const { return file_->rank_files; }

bool Hdf5Reader::exists(const std::string& name) const {
  const std::string parent = parent_of(name);
  return (parent.empty() || exists(parent)) && H5Lexists(file_->id, name.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> Hdf5Reader::children(const std::string& group) const {
  std::vector<std::string> names;
  if (!exists(group)) return names;
  const auto append = [](hid_t, const char* name, const H5L_info_t*, void* to) -> herr_t {
    static_cast<std::vector<std::string>*>(to)->emplace_back(name);
    return 0;
  };
  if (H5Literate_by_name(file_->id, group.c_str(), H5_INDEX_NAME, H5_ITER_INC, nullptr, append, &names, H5P_DEFAULT) <
      0)
    file_->fail("group '" + group + "' cannot be listed: " + hdf5_reason());
  return names;
}

std::array<int, 3> Hdf5Reader::grid_of(const std::string& name) const {
  const Id set(exists(name) ? H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT) : H5I_INVALID_HID, &H5Dclose);
  if (set < 0) file_->fail("has no dataset '" + name + "'");
  const Id space(H5Dget_space(set), &H5Sclose);
  file_->expect_room(set, name, space, sizeof(double));
  const std::array<int, 3> grid = File::grid_in(space);
  if (grid[0] < 1 || grid[1] < 1 || grid[2] < 1) file_->fail("dataset '" + name + "' has another shape than (z, y, x)");
  return grid;
}

std::string Hdf5Reader::unit_of(const std::string& name) const {
  const Id set(exists(name) ? H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT) : H5I_INVALID_HID, &H5Dclose);
  if (set < 0 || H5Aexists(set, "unit") <= 0) return {};
  return file_->text_of(Id(H5Aopen(set, "unit", H5P_DEFAULT), &H5Aclose), "unit");
}

std::uint64_t Hdf5Reader::n_rows(const ColumnForm& form) const { return file_->open_column(form).second; }

void Hdf5Reader::read(const ColumnForm& form, RowRange range, void* to) const {
  const auto [set, rows] = file_->open_column(form);
  file_->read_rows(set, form, range, to);
}

void Hdf5Reader::read_blocks(const ColumnForm& form, RowRange range,
                             const std::function<void(std::size_t, std::size_t, const void*)>& take) const {
  const auto [set, rows] = file_->open_column(form);
  std::vector<std::byte> buffer(std::min<std::uint64_t>(block_rows, range.n) * form.row_bytes());
  for (std::uint64_t at = 0; at < range.n; at += block_rows) {
    const std::uint64_t n = std::min<std::uint64_t>(block_rows, range.n - at);
    file_->read_rows(set, form, {range.first + at, n}, buffer.data());
    take(at, n, buffer.data());
  }
}

std::vector<double> Hdf5Reader::reals(const std::string& name) const {
  const ColumnForm form{name, FieldType::real, 1, {}};
  std::vector<double> values(n_rows(form));
  read(form, {0, values.size()}, values.data());
  return values;
}

std::string Hdf5Reader::text(const std::string& name) const {
  const Id set(exists(name) ? H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT) : H5I_INVALID_HID, &H5Dclose);
  if (set < 0) file_->fail("has no dataset '" + name + "'");
  const Id type(H5Dget_type(set), &H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0)
    file_->fail("dataset '" + name + "' is not a text");
  const Id space(H5Dget_space(set), &H5Sclose);
  file_->expect_room(set, name, space, H5Tget_size(type));
  if (H5Sget_simple_extent_npoints(space) != 1) file_->fail("dataset '" + name + "' is not one text");
  std::string value(H5Tget_size(type), '\0');
  const Id memory = string_type(value.size());
  if (H5Dread(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()) < 0)
    file_->fail("dataset '" + name + "' cannot be read: " + hdf5_reason());
  while (!value.empty() && value.back() == '\0') value.pop_back();
  return value;
}

std::string Hdf5Reader::text_attribute(const std::string& name) const {
  return file_->text_of(file_->open_attribute(name), name);
}

double Hdf5Reader::real_attribute(const std::string& name) const {
  double value = 0.0;
  file_->read_attribute(name, H5T_NATIVE_DOUBLE, 1, &value);
  return value;
}

std::uint64_t Hdf5Reader::integer_attribute(const std::string& name) const {
  std::uint64_t value = 0;
  file_->read_attribute(name, H5T_NATIVE_UINT64, 1, &value);
  return value;
}

std::array<double, 3> Hdf5Reader::vector_attribute(const std::string& name) const {
  std::array<double, 3> value{};
  file_->read_attribute(name, H5T_NATIVE_DOUBLE, 3, value.data());
  return value;
}

}  // namespace moraine
