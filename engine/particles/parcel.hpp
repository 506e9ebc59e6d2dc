// Plain values into bytes for another rank, and back.
#pragma once

#include <cstddef>
#include <cstring>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "engine/particles/particles.hpp"

namespace moraine {

class ParcelWriter {
 public:
  template <typename T>
  void put(const T& value) {
    put_all(std::span<const T>(&value, 1));
  }
  template <typename T>
  void put_all(std::span<const T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (values.empty()) return;
    const std::size_t end = bytes_.size();
    bytes_.resize(end + values.size_bytes());
    std::memcpy(bytes_.data() + end, values.data(), values.size_bytes());
  }
  bool empty() const { return bytes_.empty(); }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

class ParcelReader {
 public:
  explicit ParcelReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <typename T>
  T get() {
    T value;
    get_all(std::span<T>(&value, 1));
    return value;
  }
  template <typename T>
  void get_all(std::span<T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (values.size_bytes() > bytes_.size())
      throw std::logic_error("a message between ranks is shorter than its content");
    if (!values.empty()) std::memcpy(values.data(), bytes_.data(), values.size_bytes());
    bytes_ = bytes_.subspan(values.size_bytes());
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const std::byte> bytes_;
};

/// All that travels with a grain to a new owner, or (as_ghost) with the ghost of one.
void put_grain(const Particles& particles, std::int32_t i, bool as_ghost, ParcelWriter& parcel);
/// Sets what put_grain has put.
void get_grain(ParcelReader& parcel, bool as_ghost, Particles& particles, std::int32_t i);

}  // namespace moraine
