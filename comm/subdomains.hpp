// Subdomains: space divided into one box a rank by recursive cuts along cell boundaries, weighted by cost
// (Berger & Bokhari 1987, IEEE Trans. Comput. 36, 570).
//
// No part is narrower than two grains can be apart and still be a pair, so that no rank reaches past its neighbours, nor across a
// periodic direction into itself. Cuts lie on the boundaries of a grid much finer than that. Where there is no room for all parts, some
// are empty. Outer faces of directions that are not periodic lie at infinity: every grain has an owner.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "comm/world.hpp"
#include "kernels/base/box.hpp"

namespace moraine {

/// A grain as the cuts see it.
struct WeightedPoint {
  Vec3 position;       // [m]
  float weight = 1.0;  // work, in any unit
};

/// Space that is cut.
struct CutSpace {
  Box domain;  // [m]
  std::array<bool, 3> periodic{};
  double cell_width = 0.0;  // [m] parts are no narrower
};

class Subdomains {
 public:
  /// One part, all of space.
  Subdomains() = default;
  /// Cuts space into n_parts for the points of all ranks of `world` (each rank gives its own). The same on every layout that holds the same
  /// points with the same weights: weights are summed as integers. All ranks call it.
  static Subdomains cut(const World& world, int n_parts, std::span<const WeightedPoint> points, const CutSpace& space);

  int size() const { return static_cast<int>(boxes_.size()); }
  /// Half-open; infinite at outer faces that are not periodic; empty (low = high) for a part without room.
  const Box& box(int part) const { return boxes_[static_cast<std::size_t>(part)]; }
  bool is_empty(int part) const;
  /// The part that holds a point of the domain (or of beyond, where it is not periodic).
  int owner(Vec3 position) const;
  /// True where the axis is cut anywhere, so that parts need not span it.
  bool is_cut(int axis) const { return is_cut_[static_cast<std::size_t>(axis)]; }
  bool is_periodic(int axis) const { return periodic_[static_cast<std::size_t>(axis)]; }
  /// True where the axis is periodic and the part takes all of it: its grains then meet their own images along it.
  bool spans(int part, int axis) const;
  /// Width of the narrowest part along cut periodic axes [m]; infinite where there are none. Pairs must not reach further, as a part
  /// would then meet its own images.
  double narrowest() const { return narrowest_; }

  /// Lengths of the domain [m]; those of periodic directions are the periods.
  Vec3 period() const { return domain_.size(); }

  /// A part that is near another, seen through a periodic shift: x + steps * period of a grain of the one lies near the other.
  struct Near {
    int part = 0;
    std::array<int, 3> steps{};
  };
  /// Whose boxes, shifted by whole periods, come nearer than `reach` to the box of `part` (itself left out, empty ones too), in order of part.
  /// `steps` shift grains of `part` towards the other. Symmetric: the other finds
  /// `part` with the steps negated. A walk down the tree: the time grows with what is found, not with the number of parts.
  std::vector<Near> near(int part, double reach) const;

  /// The parts that share a face with `part`, periodic ones too, in order; an empty part is linked with the part in whose piece there was no
  /// room for it. Symmetric, and all parts hang together by links.
  std::vector<int> linked(int part) const;
  /// From any part to any other there are no more links than this. Exact for up to 128 parts, at most twice as many for more.
  int most_hops() const;

  bool operator==(const Subdomains&) const = default;

 private:
  struct Cut {
    int axis = -1;  // -1: a leaf, and `lower` is the part
    double at = 0.0;
    std::int32_t lower = 0, upper = 0;  // nodes: below `at`, and from it on
    bool operator==(const Cut&) const = default;
  };
  /// Squared distance of two boxes, the first shifted by whole periods [m2].
  double squared_gap(const Box& own, const Box& there, const std::array<int, 3>& steps) const;
  /// Goes down the tree from a node that lies within a box.
  void add_near(int part, double reach, const std::array<int, 3>& steps, std::int32_t node, const Box& within,
                std::vector<Near>& found) const;

  std::vector<Box> boxes_{1, Box{{-infinity_, -infinity_, -infinity_}, {infinity_, infinity_, infinity_}}};
  std::vector<Cut> tree_{1};
  std::array<bool, 3> is_cut_{};
  std::array<bool, 3> periodic_{};
  Box domain_;
  double narrowest_ = infinity_;
  static constexpr double infinity_ = std::numeric_limits<double>::infinity();
};

/// Squared distance of a point from a box (zero inside) [m2]; infinite for an empty box.
double squared_distance(Vec3 point, const Box& box);

}  // namespace moraine
