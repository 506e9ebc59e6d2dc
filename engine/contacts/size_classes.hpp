// Classes of sizes: where grains differ widely, each class has cells of its own, so that a boulder does not make every grain's cell huge.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace moraine {

/// The largest radius of each class [m], ascending. All ranks have the same.
class SizeClasses {
 public:
  SizeClasses() = default;
  explicit SizeClasses(double largest_radius) : limits_{largest_radius} {}

  int size() const { return static_cast<int>(limits_.size()); }
  /// The class of a grain of this radius.
  int of(double radius) const {
    const auto found = std::lower_bound(limits_.begin(), limits_.end() - 1, radius);
    return static_cast<int>(found - limits_.begin());
  }
  double limit(int size_class) const { return limits_[static_cast<std::size_t>(size_class)]; }
  double smallest_limit() const { return limits_.front(); }
  double largest() const { return limits_.back(); }

  /// The radii that occur, in eight bins for each factor of two: what ranks bring together by the largest value of each bin.
  class Census {
   public:
    void add(double radius) {
      const double bin = 8.0 * (std::log2(radius) + 40.0);
      double& largest = largest_[static_cast<std::size_t>(std::clamp(bin, 0.0, n_bins - 1.0))];
      largest = std::max(largest, radius);
    }
    std::array<double, 480>& values() { return largest_; }
    const std::array<double, 480>& values() const { return largest_; }

   private:
    static constexpr double n_bins = 480.0;
    std::array<double, 480> largest_{};  // [m] of each bin, or 0
  };
  /// A class holds sizes up to `ratio` times its smallest; a bed within that is one class. Classes without grains are none.
  explicit SizeClasses(const Census& census) : limits_() {
    constexpr double ratio = 2.5;
    double smallest = 0.0;
    for (const double radius : census.values()) {
      if (radius == 0.0) continue;
      if (limits_.empty() || radius > ratio * smallest) {
        limits_.push_back(radius);
        smallest = radius;
      }
      limits_.back() = radius;
    }
    if (limits_.empty()) limits_.push_back(0.0);
  }

 private:
  std::vector<double> limits_{0.0};
};

}  // namespace moraine
