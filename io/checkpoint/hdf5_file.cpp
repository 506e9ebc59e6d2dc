#include "io/checkpoint/hdf5_file.hpp"

#include <fcntl.h>
#include <hdf5.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "io/checkpoint/durable_file.hpp"

namespace moraine {

namespace fs = std::filesystem;

namespace {

/// An identifier of the library, closed when it goes out of scope.
class Id {
 public:
  using Closer = herr_t (*)(hid_t);
  Id(hid_t id, Closer closer) : id_(id), closer_(closer) {}
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), closer_(other.closer_) {}
  Id& operator=(Id&&) = delete;
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

/// What the library says went wrong: the innermost of its messages, in plain words where it carries an errno.
std::string hdf5_reason() {
  std::string text;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned n, const H5E_error2_t* error, void* to) -> herr_t {
        return n == 0 ? keep_description(n, error, to) : 0;
      },
      &text);
  const std::size_t at = text.find("errno = ");
  if (at != std::string::npos) return explain_errno(std::atoi(text.c_str() + at + 8));
  return text.empty() ? "no reason given" : text;
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

}  // namespace

struct Hdf5Writer::File {
  fs::path path;
  fs::path temporary;
  std::string kind;
  std::uint64_t header_bytes;
  Id id{H5I_INVALID_HID, &H5Fclose};
  std::vector<FilePart> parts;

  File(const fs::path& path_, std::string kind_, std::uint64_t header_bytes_, hid_t opened)
      : path(path_),
        temporary(temporary_name(path_)),
        kind(std::move(kind_)),
        header_bytes(header_bytes_),
        id(opened, &H5Fclose) {}

  [[noreturn]] void fail(const std::string& doing) const {
    throw StorageError(path, "cannot be written (" + doing + "): " + hdf5_reason());
  }
  void check(bool is_good, const std::string& doing) const {
    if (!is_good) fail(doing);
  }

  int descriptor() const {
    void* handle = nullptr;
    if (H5Fget_vfd_handle(id, H5P_DEFAULT, &handle) < 0 || handle == nullptr) return -1;
    return *static_cast<int*>(handle);
  }

  /// Gives up. A full disk would make the library fail to close, and then again at exit, so the file is emptied first.
  void abandon() {
    if (id >= 0) {
      const int fd = descriptor();
      if (fd >= 0 && ::ftruncate(fd, 0) != 0) { /* nothing more can be done */
      }
      id.close();
    }
    std::error_code ignored;
    fs::remove(temporary, ignored);
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

  void write_dataset(const std::string& name, hid_t file_type, hid_t memory_type, const std::vector<hsize_t>& shape,
                     const void* values, std::size_t bytes, const std::string& unit) {
    make_groups(name);
    const int rank = static_cast<int>(shape.size());
    const Id space(rank == 0 ? H5Screate(H5S_SCALAR) : H5Screate_simple(rank, shape.data(), nullptr), &H5Sclose);
    const Id creation(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
    check(H5Pset_obj_track_times(creation, false) >= 0 && H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY) >= 0 &&
              H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER) >= 0,
          name);
    Id set(H5Dcreate2(id, name.c_str(), file_type, space, H5P_DEFAULT, creation, H5P_DEFAULT), &H5Dclose);
    check(set >= 0, name);
    if (bytes > 0) {
      check(H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name);
      const haddr_t offset = H5Dget_offset(set);
      check(offset != HADDR_UNDEF, name);
      // H5Dget_offset counts from the start of the file, the user block included.
      parts.push_back({name, offset, bytes, hash_bytes(values, bytes)});
    }
    if (!unit.empty()) write_text_attribute(set, "unit", unit);
    check(set.close(), name);
  }
};

Hdf5Writer::Hdf5Writer(const fs::path& path, std::string kind, std::uint64_t header_bytes) {
  quieten();
  // Opened once without the library, whose messages for a missing or unwritable directory are long and name PATH.tmp.
  FileHandle(temporary_name(path), O_WRONLY | O_CREAT | O_TRUNC, path).close();
  const Id creation(H5Pcreate(H5P_FILE_CREATE), &H5Pclose);
  H5Pset_userblock(creation, header_bytes);
  H5Pset_obj_track_times(creation, false);
  const Id access = file_access();
  const hid_t opened = H5Fcreate(temporary_name(path).c_str(), H5F_ACC_TRUNC, creation, access);
  file_ = std::make_unique<File>(path, std::move(kind), header_bytes, opened);
  if (opened < 0) {
    file_->abandon();
    file_->fail("new file");
  }
  attribute("kind", file_->kind);
  attribute("format", static_cast<std::uint64_t>(file_format));
}

Hdf5Writer::~Hdf5Writer() {
  if (file_) file_->abandon();
}

void Hdf5Writer::dataset(const std::string& name, std::span<const double> values, int components,
                         const std::string& unit) {
  const auto width = static_cast<hsize_t>(components);
  std::vector<hsize_t> shape{values.size() / width};
  if (components > 1) shape.push_back(width);
  file_->write_dataset(name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, shape, values.data(), values.size_bytes(), unit);
}

void Hdf5Writer::dataset(const std::string& name, std::span<const std::uint64_t> values) {
  file_->write_dataset(name, H5T_STD_U64LE, H5T_NATIVE_UINT64, {values.size()}, values.data(), values.size_bytes(), {});
}

void Hdf5Writer::dataset(const std::string& name, std::span<const std::uint16_t> values) {
  file_->write_dataset(name, H5T_STD_U16LE, H5T_NATIVE_UINT16, {values.size()}, values.data(), values.size_bytes(), {});
}

void Hdf5Writer::text(const std::string& name, const std::string& value) {
  const Id type = string_type(value.size());
  const std::string padded = value.empty() ? std::string(1, '\0') : value;
  file_->write_dataset(name, type, type, {}, padded.data(), padded.size(), {});
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

void Hdf5Writer::close() {
  // Flushed before it is closed: after a failed flush the file can still be emptied and closed, after a failed close it cannot.
  file_->check(H5Fflush(file_->id, H5F_SCOPE_GLOBAL) >= 0, "flush");
  file_->check(file_->id.close(), "close");
  seal_file(file_->temporary, file_->path, file_->kind, file_->header_bytes, file_->parts);
  take_place(file_->path);
  file_.reset();
}

struct Hdf5Reader::File {
  fs::path path;
  Id id;

  [[noreturn]] void fail(const std::string& problem) const { throw StorageError(path, problem); }

  Id open_attribute(const std::string& name) const {
    Id attribute(H5Aopen(id, name.c_str(), H5P_DEFAULT), &H5Aclose);
    if (attribute < 0) fail("has no attribute '" + name + "'");
    return attribute;
  }

  void read_attribute(const std::string& name, hid_t type, hssize_t n, void* to) const {
    const Id attribute = open_attribute(name);
    const Id space(H5Aget_space(attribute), &H5Sclose);
    if (H5Sget_simple_extent_npoints(space) != n || H5Aread(attribute, type, to) < 0)
      fail("attribute '" + name + "' is not of the expected form");
  }

  /// Opens a dataset and checks its shape; returns its number of rows.
  std::pair<Id, std::size_t> open_dataset(const std::string& name, int components) const {
    if (H5Lexists(id, parent_of(name).empty() ? name.c_str() : parent_of(name).c_str(), H5P_DEFAULT) <= 0 ||
        H5Lexists(id, name.c_str(), H5P_DEFAULT) <= 0)
      fail("has no dataset '" + name + "'");
    Id set(H5Dopen2(id, name.c_str(), H5P_DEFAULT), &H5Dclose);
    if (set < 0) fail("dataset '" + name + "' cannot be opened: " + hdf5_reason());
    const Id space(H5Dget_space(set), &H5Sclose);
    hsize_t shape[2] = {0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || rank > 2 || H5Sget_simple_extent_dims(space, shape, nullptr) < 0 ||
        (rank == 2 ? shape[1] : 1) != static_cast<hsize_t>(components))
      fail("dataset '" + name + "' has another shape than (n" +
           (components > 1 ? ", " + std::to_string(components) : "") + ")");
    return {std::move(set), static_cast<std::size_t>(shape[0])};
  }

  template <class T>
  std::vector<T> read(const std::string& name, int components, hid_t type, H5T_class_t type_class) const {
    const auto [set, rows] = open_dataset(name, components);
    const Id stored(H5Dget_type(set), &H5Tclose);
    if (H5Tget_class(stored) != type_class || (type_class == H5T_INTEGER && H5Tget_size(stored) > sizeof(T)))
      fail("dataset '" + name + "' has another type of numbers than expected");
    std::vector<T> values(rows * static_cast<std::size_t>(components));
    if (!values.empty() && H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
      fail("dataset '" + name + "' cannot be read: " + hdf5_reason());
    return values;
  }
};

Hdf5Reader::Hdf5Reader(const fs::path& path, const std::vector<std::string>& kinds, bool needs_seal) {
  quieten();
  if (!check_seal(path, kinds) && needs_seal)
    throw StorageError(path,
                       "is an HDF5 file without Moraine's checksums; another program has written or rewritten it");
  const Id access = file_access();
  const hid_t opened = H5Fopen(path.c_str(), H5F_ACC_RDONLY, access);
  if (opened < 0) throw StorageError(path, "cannot be opened as HDF5: " + hdf5_reason());
  file_ = std::make_unique<File>(File{path, Id(opened, &H5Fclose)});
  const std::string found = kind();
  if (std::find(kinds.begin(), kinds.end(), found) == kinds.end())
    throw StorageError(path, "holds a '" + found + "', which is not expected here");
  const std::uint64_t format = integer_attribute("format");
  if (format > static_cast<std::uint64_t>(file_format))
    throw StorageError(path, "is written in format " + std::to_string(format) + ", newer than format " +
                                 std::to_string(file_format) + " of this program: use a newer Moraine");
}

Hdf5Reader::~Hdf5Reader() = default;

const fs::path& Hdf5Reader::path() const { return file_->path; }

std::string Hdf5Reader::kind() const { return text_attribute("kind"); }

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

std::vector<double> Hdf5Reader::reals(const std::string& name, int components) const {
  return file_->read<double>(name, components, H5T_NATIVE_DOUBLE, H5T_FLOAT);
}

std::vector<std::uint64_t> Hdf5Reader::gids(const std::string& name) const {
  return file_->read<std::uint64_t>(name, 1, H5T_NATIVE_UINT64, H5T_INTEGER);
}

std::vector<std::uint16_t> Hdf5Reader::indices(const std::string& name) const {
  return file_->read<std::uint16_t>(name, 1, H5T_NATIVE_UINT16, H5T_INTEGER);
}

std::string Hdf5Reader::text(const std::string& name) const {
  const Id set(exists(name) ? H5Dopen2(file_->id, name.c_str(), H5P_DEFAULT) : H5I_INVALID_HID, &H5Dclose);
  if (set < 0) file_->fail("has no dataset '" + name + "'");
  const Id type(H5Dget_type(set), &H5Tclose);
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0)
    file_->fail("dataset '" + name + "' is not a text");
  std::string value(H5Tget_size(type), '\0');
  const Id memory = string_type(value.size());
  if (H5Dread(set, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()) < 0)
    file_->fail("dataset '" + name + "' cannot be read: " + hdf5_reason());
  while (!value.empty() && value.back() == '\0') value.pop_back();
  return value;
}

std::string Hdf5Reader::text_attribute(const std::string& name) const {
  const Id attribute = file_->open_attribute(name);
  const Id type(H5Aget_type(attribute), &H5Tclose);
  if (H5Tget_class(type) != H5T_STRING) file_->fail("attribute '" + name + "' is not a text");
  if (H5Tis_variable_str(type) > 0) {
    char* text = nullptr;
    file_->read_attribute(name, type, 1, &text);
    const std::string value = text == nullptr ? "" : text;
    H5free_memory(text);
    return value;
  }
  std::string value(H5Tget_size(type), '\0');
  const Id memory = string_type(value.size());
  file_->read_attribute(name, memory, 1, value.data());
  while (!value.empty() && value.back() == '\0') value.pop_back();
  return value;
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
