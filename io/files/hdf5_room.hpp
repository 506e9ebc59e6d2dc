// What an HDF5 file says about the size of its datasets is believed only as far as the file can hold them.
#pragma once

#include <hdf5.h>

#include <cstdint>

namespace moraine::files {

/// Whether `n_values` values of `value_bytes` bytes can lie in a dataset of files that have so many bytes in all. Packed
/// ones may be larger than the file, by what zlib can do at most.
inline bool has_room(hid_t dataset, double n_values, std::size_t value_bytes, std::uint64_t file_bytes) {
  constexpr double most_packed = 1100.0;
  const hid_t creation = H5Dget_create_plist(dataset);
  const bool is_packed = creation >= 0 && H5Pget_nfilters(creation) > 0;
  if (creation >= 0) H5Pclose(creation);
  return n_values * static_cast<double>(value_bytes) <=
         (is_packed ? most_packed : 1.0) * static_cast<double>(file_bytes);
}

}  // namespace moraine::files
