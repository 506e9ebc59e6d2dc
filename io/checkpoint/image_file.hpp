// An image of a run as the content of an HDF5 file: the part that checkpoints and snapshots share.
//
//   attributes  kind, format, step, time, time_step, domain_low, domain_high, periodic, grains, state_hash
//   /particles/NAME            one dataset a field of the field table, rows in order of gid
//   /contacts/pairs/...        checkpoints: gid_low, gid_high, image, displacement, energy
//   /contacts/walls/...        checkpoints: gid, surface, normal, displacement, energy
//   /accumulators/NAME         checkpoints: state of observers and counters
#pragma once

#include "engine/run/image.hpp"
#include "io/checkpoint/hdf5_file.hpp"

namespace moraine {

/// Room that the seal of a file with this image needs [bytes]; `n_more`: further datasets.
std::uint64_t header_size(const Image& image, std::size_t n_more);

/// Attributes and grains. Throws StorageError.
void write_grains(Hdf5Writer& file, const Image& image);
/// Contact history and accumulators. Throws StorageError.
void write_history(Hdf5Writer& file, const Image& image);

/// What write_grains wrote. Fields that the field table does not have are refused, or listed in `unknown` where it is given.
/// Throws StorageError.
Image read_grains(const Hdf5Reader& file, std::vector<std::string>* unknown = nullptr);
/// What write_history wrote. Throws StorageError.
void read_history(const Hdf5Reader& file, Image& image);

}  // namespace moraine
