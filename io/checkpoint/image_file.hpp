// An image of a run as the content of an HDF5 file: the part that checkpoints and snapshots share.
//
//   attributes  kind, format, step, time, time_step, domain_low, domain_high, periodic, grains, state_hash
//   /particles/NAME            one dataset a field of the field table, rows in order of gid
//   /gas/NAME                  one dataset a quantity of the gas, (z, y, x); attributes of /gas: cells, low, spacing
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

/// Frame, grains and gas, this rank's equal share of them. Fields that the field table does not have are refused, or
/// listed in `unknown` where it is given. Throws StorageError.
Image read_grains(const Hdf5Reader& file, const World& world = {}, std::vector<std::string>* unknown = nullptr);
/// Contact histories, this rank's equal share of each kind, and accumulators. Throws StorageError.
void read_history(const Hdf5Reader& file, Image& image, const World& world = {});
/// Throws StorageError.
RunRecord read_record(const Hdf5Reader& file);

}  // namespace moraine
