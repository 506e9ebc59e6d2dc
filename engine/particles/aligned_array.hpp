// A growable array of plain values, aligned for vector loads, on huge pages where it fills them: a processor
// knows where some thousand pages lie, and must look up all others. Growing keeps what was there
// only where asked, so that scratch arrays cost no copy. Memory lives as long as anyone holds its keeper: who shows it to the outside (Python)
// may outlive the array.
#pragma once

#include <sys/mman.h>

#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

namespace moraine {

template <typename T>
class AlignedArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  AlignedArray() = default;
  AlignedArray(const AlignedArray&) = delete;
  AlignedArray& operator=(const AlignedArray&) = delete;
  AlignedArray(AlignedArray&& other) noexcept { swap(other); }
  AlignedArray& operator=(AlignedArray&& other) noexcept {
    swap(other);
    return *this;
  }
  ~AlignedArray() = default;

  void swap(AlignedArray& other) noexcept {
    std::swap(keeper_, other.keeper_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }
  /// Makes room for n values; what was there is lost where the array has to grow.
  void resize_discarding(std::size_t n) {
    if (n > capacity_) {
      release();
      data_ = allocate(n + n / 32);
      keeper_ = std::shared_ptr<void>(data_, std::free);
      capacity_ = n + n / 32;
    }
    size_ = n;
  }
  /// Makes room for n values, of which the first ones are those that were there.
  void resize_keeping(std::size_t n) {
    if (n > capacity_) {
      AlignedArray larger;
      larger.resize_discarding(n);
      if (size_ > 0) std::memcpy(larger.data_, data_, size_ * sizeof(T));
      swap(larger);
    }
    size_ = n;
  }
  /// Gives the memory back.
  void release() { AlignedArray().swap(*this); }

  /// Keeps the memory there, whatever becomes of the array.
  std::shared_ptr<const void> keeper() const { return keeper_; }
  T* data() { return data_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  T& operator[](std::size_t i) { return data_[i]; }
  const T& operator[](std::size_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }

 private:
  static T* allocate(std::size_t n) {
    constexpr std::size_t huge = std::size_t{2} << 20;
    const std::size_t bytes = n * sizeof(T),
                      on_huge_pages = (bytes + huge / 2) / huge * huge;  // not less than half full
    const std::size_t alignment = on_huge_pages > 0 ? huge : 64;
    void* const memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
    if (!memory) throw std::bad_alloc();
    if (on_huge_pages > 0) madvise(memory, on_huge_pages, MADV_HUGEPAGE);
    return static_cast<T*>(memory);
  }

  std::shared_ptr<void> keeper_;
  T* data_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace moraine
