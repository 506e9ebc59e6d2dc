// Checkpoints and snapshots: damaged byte by byte, or well-formed and rightly sealed, with content that nobody expects.
#include <hdf5.h>

#include <array>
#include <bit>

#include "engine/run/simulation.hpp"
#include "io/checkpoint/checkpoint.hpp"
#include "io/checkpoint/durable_file.hpp"
#include "io/checkpoint/seal.hpp"
#include "io/files/files.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "io/snapshot/snapshot.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/unit/io_images.hpp"

namespace moraine::fuzz {

namespace {

constexpr const char* bed = R"(
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.2]
periodic = [true, false, false]
[time]
end = 1.0
step = 5e-5
gravity = [0.3, 0, -9.81]
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
normal_stiffness = 1000.0
restitution = 0.9
friction = 0.4
[[particles]]
diameter = 0.02
fill = { positions = [[0.01, 0.02, 0.01], [0.0295, 0.02, 0.01], [0.09, 0.02, 0.01], [0.05, 0.09, 0.19]] }
[[inlet]]
name = "feed"
diameter = 0.02
number_rate = 1e4
region = { box = { low = [0.04, 0.04, 0.1], high = [0.07, 0.07, 0.13] } }
[[outlet]]
name = "hole"
box = { low = [0, 0, 0], high = [0.1, 0.05, 0.012] }
recycle = "feed"
[[probe]]
name = "stress"
kind = "fields"
interval = 1e-4
cells = [2, 1, 3]
[[wall]]
name = "press"
plane = { point = [0, 0, 0.2], normal = "-z" }
[[wall.motion]]
type = "servo"
axis = [0, 0, -1]
force = 1.0
max_speed = 0.1
gain = 0.01
[[wall]]
name = "box"
box = { low = [-1, 0, 0], high = [1, 0.1, 0.2] }
[gas]
cells = [2, 2, 3]
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
[[gas.boundary]]
face = "z-low"
type = "velocity"
velocity = [0, 0, 1.0]
[[gas.boundary]]
face = "z-high"
type = "pressure"
)";

const Scene& scene() {
  static const Scene read = read_scene_text(bed, "bed.toml");
  return read;
}

const Image& sound_image() {
  static const Image image = [] {
    Simulation simulation(scene(), 1);
    for (int i = 0; i < 20; ++i) simulation.step();
    return simulation.checkpoint();
  }();
  return image;
}

/// All that reads such files. What each of them refuses, it refuses in its own name.
void read_in_all_ways(const std::filesystem::path& path) {
  const auto attempt = [&](auto&& read) {
    try {
      read();
    } catch (const StorageError&) {
    } catch (const FileError&) {}
  };
  attempt([&] { static_cast<void>(read_checkpoint(path)); });
  attempt([&] { static_cast<void>(read_image_file(path)); });
  attempt([&] { static_cast<void>(load_grains(path)); });
}

void flip(std::string& text, Source& source) {
  while (!source.is_empty() && !text.empty()) {
    const std::size_t at = (source.byte() * 251u + source.byte()) % text.size();
    text[at] = static_cast<char>(text[at] ^ (source.byte() | 1));
  }
}

// ---- well-formed, but not as expected

constexpr std::array<const char*, 18> names = {
    "particles/position",    "particles/gid",          "particles/radius",   "particles/material",
    "particles/nothing",     "particles/velocity",     "gas/pressure",       "gas/%zz",
    "contacts/pairs/image",  "contacts/pairs/gid_low", "contacts/walls/gid", "scene",
    "contacts/walls/energy", "accumulators/a",         "accumulators/%zz",   "accumulators/%00",
    "contacts/pairs",        "contacts/pairs/gid_high"};
constexpr std::array<const char*, 11> attributes = {"kind",       "format",      "step",     "time",
                                                    "time_step",  "domain_low",  "periodic", "grains",
                                                    "state_hash", "domain_high", "version"};

hid_t type_of(Source& source) {
  switch (source.below(8)) {
    case 0: return H5Tcopy(H5T_IEEE_F64LE);
    case 1: return H5Tcopy(H5T_IEEE_F32BE);
    case 2: return H5Tcopy(H5T_STD_U64LE);
    case 3: return H5Tcopy(H5T_STD_I8LE);
    case 4: return H5Tcopy(H5T_STD_U16LE);
    case 5: return H5Tarray_create2(H5T_IEEE_F64LE, 1, std::array<hsize_t, 1>{3}.data());
    default: break;
  }
  const hid_t text = H5Tcopy(H5T_C_S1);
  H5Tset_size(text, source.below(2) == 0 ? H5T_VARIABLE : 1 + source.byte());
  return text;
}

hid_t space_of(Source& source) {
  constexpr std::array<hsize_t, 9> sizes = {0, 1, 2, 3, 4, 1000, hsize_t{1} << 31, hsize_t{1} << 40, hsize_t{1} << 55};
  const int rank = static_cast<int>(source.below(5));
  std::array<hsize_t, 4> shape{};
  for (int i = 0; i < rank; ++i) shape[static_cast<std::size_t>(i)] = sizes[source.below(sizes.size())];
  return rank == 0 ? H5Screate(source.below(2) == 0 ? H5S_SCALAR : H5S_NULL)
                   : H5Screate_simple(rank, shape.data(), nullptr);
}

/// Puts a dataset or an attribute in the place of another; numbers come from the source, large ones have none.
void replace(hid_t file, Source& source) {
  const bool is_attribute = source.below(3) == 0;
  const char* const name =
      is_attribute ? attributes[source.below(attributes.size())] : names[source.below(names.size())];
  const hid_t type = type_of(source), space = space_of(source);
  const hssize_t n = H5Sget_simple_extent_npoints(space);
  const bool is_text = H5Tis_variable_str(type) > 0;
  std::vector<char> values(4096);
  for (char& value : values) value = static_cast<char>(source.byte());
  const char* const text = "text";
  const void* const from = is_text ? static_cast<const void*>(&text) : values.data();
  const bool has_values = n == 1 || (!is_text && n > 0 && static_cast<std::size_t>(n) * H5Tget_size(type) <= 4096);
  if (is_attribute) {
    H5Adelete(file, name);
    const hid_t made = H5Acreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    if (made >= 0 && has_values) H5Awrite(made, type, from);
    if (made >= 0) H5Aclose(made);
  } else {
    H5Ldelete(file, name, H5P_DEFAULT);
    const hid_t made =
        source.below(8) == 0 ? -1 : H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    if (made >= 0 && has_values) H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, from);
    if (made >= 0) H5Dclose(made);
  }
  H5Sclose(space);
  H5Tclose(type);
}

/// A sound checkpoint without its seal, as plain HDF5 tools leave it, and the size of the block before it.
const std::string& sound_file() {
  static const std::string bytes = [] {
    const std::filesystem::path path = scratch() / "sound.h5";
    write_checkpoint(path, sound_image(), {bed, "1", "2"});
    return read_file(path);
  }();
  return bytes;
}

void alter(double& value, Source& source) {
  constexpr std::array<double, 8> ends = {0.0, -1.0, 1e300, -1e300, 1e-300, 0.05, 0.1, 1e9};
  switch (source.below(4)) {
    case 0: value = std::bit_cast<double>(source.word()); break;
    case 1: value = ends[source.below(ends.size())]; break;
    case 2: value = -value; break;
    default: value *= 1.0 + 0.01 * source.byte();
  }
}

template <class Values, class Change>
void alter_one(Values& values, Source& source, Change change) {
  if (!values.empty()) change(values[source.below(values.size())]);
}

void alter(Image& image, Source& source) {
  const auto real = [&](double& value) { alter(value, source); };
  const auto whole = [&](std::uint64_t& value) { value = source.below(2) == 0 ? source.byte() : source.word(); };
  switch (source.below(9)) {
    case 0: whole(image.step); break;
    case 1:
      alter_one(image.pairs, source, [&](PairHistory& pair) {
        std::array<std::uint64_t*, 3> all = {&pair.gid_low, &pair.gid_high, &pair.image};
        whole(*all[source.below(3)]);
      });
      break;
    case 2: alter_one(image.pairs, source, [&](PairHistory& pair) { real(pair.displacement[source.below(3)]); }); break;
    case 3:
      alter_one(image.walls, source, [&](WallHistory& wall) { whole(source.below(2) == 0 ? wall.gid : wall.surface); });
      break;
    case 4: alter_one(image.walls, source, [&](WallHistory& wall) { real(wall.normal[source.below(3)]); }); break;
    case 5: alter_one(image.grids, source, [&](GridArray& grid) { alter_one(grid.values, source, real); }); break;
    case 6: {
      auto entry = image.accumulators.begin();
      std::advance(entry, static_cast<std::ptrdiff_t>(source.below(image.accumulators.size())));
      if (source.below(4) == 0)
        entry->second.resize(source.below(8));
      else
        alter_one(entry->second, source, real);
      break;
    }
    default:
      alter_one(image.fields, source, [&](FieldArray& array) {
        alter_one(array.reals, source, real);
        alter_one(array.gids, source, whole);
        alter_one(array.indices, source, [&](std::uint16_t& index) { index = source.byte(); });
      });
  }
}

}  // namespace

void fuzz_sealed(Bytes bytes) {
  Source source(bytes);
  std::string text = source.byte() % 2 == 0 ? std::string(source.rest()) : sound_file();
  if (text == sound_file()) flip(text, source);
  if (text.starts_with("\x89HDF")) return;  // the library itself does not bear damaged files without a seal
  const std::filesystem::path path = put("a.h5", text);
  try {
    static_cast<void>(read_checkpoint(path));
  } catch (const StorageError&) {}
  try {
    static_cast<void>(read_image_file(path));
  } catch (const StorageError&) {}
}

void fuzz_content(Bytes bytes) {
  Source source(bytes);
  const std::filesystem::path path = put("content.h5", sound_file());
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  if (file < 0) std::abort();
  const bool is_plain = source.below(4) == 0;
  for (int i = 0; i < 6 && !source.is_empty(); ++i) replace(file, source);
  H5Fclose(file);
  const std::optional<SealHeader> header = [&] {
    const std::filesystem::path sound = put("sound.h5", sound_file());
    return check_seal(sound, {"checkpoint"});
  }();
  if (is_plain)  // as other tools write them
    std::ofstream(path, std::ios::in | std::ios::binary).write("\0\0\0\0\0\0\0\0", 8);
  else
    seal_file(path, path, "checkpoint", header->header_bytes, {});
  read_in_all_ways(path);
}

void fuzz_restart(Bytes bytes) {
  Source source(bytes);
  Image image = sound_image();
  while (!source.is_empty()) alter(image, source);
  const std::filesystem::path path = scratch() / "restart.h5";
  write_checkpoint(path, image, {bed, "1", "2"});
  const Checkpoint checkpoint = read_checkpoint(path);
  try {
    Simulation simulation(scene(), 1, checkpoint.image);
    const bool is_the_same = simulation.state_hash() == checkpoint.image.hash;
    if (is_the_same) simulation.step();
  } catch (const SceneError&) {
  } catch (const RunError&) {}
}

}  // namespace moraine::fuzz
