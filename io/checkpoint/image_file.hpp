// An image of a run as the content of an HDF5 file: the part that checkpoints and snapshots share.
//
//   attributes  kind, format, step, time, time_step, domain_low, domain_high, periodic, grains, state_hash
//   /particles/NAME            one dataset a field of the field table, rows in order of gid
//   /gas/NAME                  one dataset a quantity of the gas, (z, y, x); attributes of /gas: cells, low, spacing
//   /walls/NAME/...            snapshots: of walls that have a force map, points, triangles, force, pressure, shear
//   /fields/NAME               checkpoints: what probes of kind fields have added up, (z, y, x)
//   /contacts/pairs/...        checkpoints: gid_low, gid_high, image, displacement, energy
//   /contacts/walls/...        checkpoints: gid, surface, normal, displacement, energy
//   /accumulators/NAME         checkpoints: state of observers and counters
#pragma once

#include "comm/world.hpp"
#include "engine/run/image.hpp"
#include "io/checkpoint/hdf5_file.hpp"

namespace moraine {

/// Where a checkpoint comes from.
struct RunRecord {
  std::string scene;    // the scene file as run, overrides applied
  std::string version;  // of the program
  std::string commit;   // of its source
};

/// Writes an image, each rank its rows, whole or not at all; with a record and history as a checkpoint, without as a
/// snapshot. `distributed`: one file per rank and one in front, where there are several ranks. All ranks call it;
/// throws StorageError, the same on all.
void write_image(const std::filesystem::path& path, const Image& image, const RunRecord* record, const World& world,
                 bool distributed);

/// Cells of the gas grid along x, y, z: quantities on faces have one value more. Zeros where the image has no gas.
std::array<int, 3> gas_cells(const Image& image);

/// Where a quantity of the gas lies in a file: "gas/NAME".
std::string gas_dataset(const GridArray& array);
/// Where a quantity of a file of fields lies: "fields/NAME".
std::string field_dataset(const GridArray& array);
/// Where something of a wall with a force map lies: "walls/NAME/WHAT".
std::string map_dataset(const WallMap& map, const char* what);

/// Writes coarse-grained fields, each rank its values, as a file of kind "fields": attributes as above, but for those of grains, and
/// `samples`, `from`; of /fields: cells, low, spacing. Whole or not at all. All ranks call it; throws StorageError, the same on all.
void write_field_image(const std::filesystem::path& path, const FieldImage& fields, const World& world);
/// Reads one back, whole. Throws StorageError.
FieldImage read_field_image(const std::filesystem::path& path);

/// Frame, grains and gas, this rank's equal share of them. Fields that the field table does not have are refused, or
/// listed in `unknown` where it is given. Throws StorageError.
Image read_grains(const Hdf5Reader& file, const World& world = {}, std::vector<std::string>* unknown = nullptr);
/// Contact histories, this rank's equal share of each kind, and accumulators. Throws StorageError.
void read_history(const Hdf5Reader& file, Image& image, const World& world = {});
/// Throws StorageError.
RunRecord read_record(const Hdf5Reader& file);

}  // namespace moraine
