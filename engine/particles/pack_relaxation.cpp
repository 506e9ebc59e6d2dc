// Overlap removal by energy minimisation, see pack.hpp.
//
// Every pair that is closer than its contact distance repels with a force proportional to the overlap. Inertia m = r^2
// and stiffness 2 m_i m_j / (m_i + m_j) give every contact about the same frequency whatever the sizes, so that one
// step suits all: a boulder among sand is pushed gently by each grain, and the grains make way.
//
// The radii are inflated a little while the grains move, so that the last overlaps of the true radii vanish in a finite
// number of steps instead of dying away exponentially.
//
// Threads: the grains, sorted along cells, are divided into blocks whose number depends on that of the grains only. A
// block adds up the pushes that its pairs give to its own grains and puts aside those to grains of other blocks, which
// are added afterwards in order; sums are over blocks in order. So the result is the same for any number of threads.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/particles/pack.hpp"
#include "engine/particles/pack_occupied.hpp"
#include "engine/threads.hpp"
#include "kernels/base/random.hpp"

namespace moraine {
namespace {

constexpr double fixed_mass = 1e150;  // of grains that are already there: they take no part of a push
constexpr double list_margin = 0.2;   // pairs are listed up to so much beyond contact, relative to the sum of the radii
constexpr std::int64_t grains_a_block = 20000;
constexpr std::int64_t most_blocks = 32;

/// What a pass over all pairs found.
struct Overlaps {
  double worst = 0.0;   // overlap over contact distance, of the true radii
  double energy = 0.0;  // of the inflated ones [m4], see the masses
};

/// Sums that steer the minimisation: of m a.v, m v^2 and m a^2.
struct Sums {
  double power = 0.0, speed = 0.0, force = 0.0;
};

/// A share of the grains, sorted along cells, with its pairs.
struct Block {
  struct Spill {
    std::int32_t grain = 0;
    Vec3 acceleration;
  };
  Range grains;
  std::vector<std::int64_t> row_begin;  // pairs of the block's grain k: neighbours[row_begin[k] .. row_begin[k + 1])
  std::vector<std::int32_t> neighbours;
  std::vector<Spill> spills;  // pushes for grains of other blocks
  Overlaps overlaps;
  Sums sums;
  bool has_strayed = false;  // some grain is far from where it was when the pairs were listed
};

class Relaxer {
 public:
  Relaxer(const PackProblem& problem, std::span<const PackGrain> grains);

  /// Starts from random points.
  void scatter();
  /// Moves the grains until radii times `scale` do not overlap; false where that comes to rest jammed, or takes too
  /// long.
  bool relax(double scale, double inflation, std::int64_t max_steps);
  /// Moves grains that are stuck deep in others to the emptiest of a few random places; says how many there were.
  std::int64_t relocate(std::uint64_t round);
  std::int64_t n_steps() const { return n_steps_; }
  /// Centres in the order in which the grains were given.
  void positions(std::span<PackGrain> grains) const;

 private:
  /// Calls work(block) for every block, on all threads.
  template <class Work>
  void each_block(Work work);
  bool is_listed();
  void list_pairs();
  void sort_by_cell(const CellLevels& cells);
  void list_row(const CellLevels& cells, Block& block, std::int64_t i);
  void push_apart(double scale, double inflation);
  void push_pairs(Block& block, double scale, double inflation);
  void push_from_bounds(Block& block, double scale, double inflation);
  void sum_up(Block& block);
  void step();
  void move(const Block& block, double keep, double turn);

  const PackProblem& problem_;
  const PackSpace& space_;
  std::int64_t n_moving_ = 0;
  // One a grain, sorted along cells; the fixed ones among them.
  std::vector<PackGrain> grains_;
  std::vector<double> mass_;
  std::vector<Vec3> velocity_;
  std::vector<Vec3> acceleration_;
  std::vector<std::uint32_t> number_;  // place in the order given; fixed grains come after the moving ones
  std::vector<Vec3> listed_position_;  // when the pairs were listed; empty: they are not
  std::vector<std::int64_t> cell_begin_;
  std::vector<Block> blocks_;
  double listed_scale_ = 0.0;  // times the radii were the contact distances of the list
  Overlaps overlaps_;
  std::int64_t n_steps_ = 0;
  // FIRE
  double dt_ = 0.0, mixing_ = 0.0;
  int n_downhill_ = 0;
};

Relaxer::Relaxer(const PackProblem& problem, std::span<const PackGrain> grains)
    : problem_(problem), space_(problem.container.space()), n_moving_(static_cast<std::int64_t>(grains.size())) {
  for (const PackGrain& grain : grains) grains_.push_back(grain);
  for (const PackGrain& grain : problem.fixed) grains_.push_back(grain);
  const std::size_t n = grains_.size();
  mass_.resize(n);
  for (std::size_t i = 0; i < n; ++i) mass_[i] = i < grains.size() ? grains_[i].radius * grains_[i].radius : fixed_mass;
  velocity_.resize(n);
  acceleration_.resize(n);
  number_.resize(n);
  std::iota(number_.begin(), number_.end(), 0U);
  const auto all = static_cast<std::int64_t>(n);
  const auto n_blocks = static_cast<int>(std::clamp<std::int64_t>(all / grains_a_block, 1, most_blocks));
  blocks_.resize(static_cast<std::size_t>(n_blocks));
  for (int b = 0; b < n_blocks; ++b) blocks_[static_cast<std::size_t>(b)].grains = share_of(all, b, n_blocks);
}

template <class Work>
void Relaxer::each_block(Work work) {
  const auto n_blocks = static_cast<std::int64_t>(blocks_.size());
  const int n_threads = static_cast<int>(std::min<std::int64_t>(problem_.n_threads, n_blocks));
  parallel(n_threads, [&](int thread) {
    const Range share = share_of(n_blocks, thread, n_threads);
    for (std::int64_t b = share.begin; b < share.end; ++b) work(blocks_[static_cast<std::size_t>(b)]);
  });
}

void Relaxer::scatter() {
  // An additive recurrence on the generalised golden ratio (M. Roberts 2018, "The unreasonable effectiveness of
  // quasirandom sequences") spreads the points evenly over the container, so that no far transport is needed
  // afterwards; a random displacement of about the mean distance takes its regularity away.
  constexpr double g = 1.22074408460575947536;
  const Vec3 stride =
      space_.is_flat ? Vec3{1.0 / 1.32471795724474602596, 1.0 / (1.32471795724474602596 * 1.32471795724474602596), 0}
                     : Vec3{1.0 / g, 1.0 / (g * g), 1.0 / (g * g * g)};
  const Container& container = problem_.container;
  const Box extent = container.extent();
  const double n = static_cast<double>(std::max<std::int64_t>(n_moving_, 1));
  const Vec3 size = extent.size();
  const double spacing = space_.is_flat ? std::sqrt(size.x * size.y / n) : std::cbrt(size.x * size.y * size.z / n);
  Vec3 offset;
  for (int k = 0; k < 3; ++k)
    offset[k] =
        random_uniform(problem_.seed, problem_.first_number, RandomPurpose::choice, 1 + static_cast<std::uint64_t>(k));

  // Not into gaps between the fixed grains that are too narrow: nobody gets out of there again.
  std::vector<double> fixed_radii;
  for (const PackGrain& grain : problem_.fixed) fixed_radii.push_back(grain.radius);
  OccupiedSpace taken(space_, extent, fixed_radii);
  for (const PackGrain& grain : problem_.fixed) taken.insert(grain);

  std::uint64_t point = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(n_moving_); ++i) {
    for (int attempt = 0; attempt < 1000; ++attempt) {
      ++point;
      Vec3 p;
      for (int k = 0; k < 3; ++k) {
        const double place = offset[k] + static_cast<double>(point) * stride[k];
        const double shift = random_uniform(problem_.seed, problem_.first_number + i, RandomPurpose::position,
                                            3 * static_cast<std::uint64_t>(attempt) + static_cast<std::uint64_t>(k)) -
                             0.5;
        double q = extent.low[k] + (place - std::floor(place)) * size[k] + 1.2 * shift * spacing;
        // Moved out: come in again on the other side.
        if (size[k] > 0.0) q -= size[k] * std::floor((q - extent.low[k]) / size[k]);
        p[k] = size[k] > 0.0 ? q : extent.low[k];
      }
      grains_[i].position = p;
      if (container.fits(p, 0.0) && !taken.overlaps(grains_[i])) break;
    }
  }
}

std::int64_t Relaxer::relocate(std::uint64_t round) {
  constexpr double stuck =
      0.05;  // overlap relative to the radius; a jammed packing has far less, a cage too narrow more
  constexpr std::uint64_t n_candidates = 200;
  std::vector<double> radii(grains_.size());
  std::transform(grains_.begin(), grains_.end(), radii.begin(), [](const PackGrain& g) { return g.radius; });
  const Box extent = problem_.container.extent();
  OccupiedSpace occupied(space_, extent, radii);
  std::int64_t n_moved = 0;
  for (std::size_t i = 0; i < grains_.size(); ++i) {
    PackGrain& grain = grains_[i];
    if (mass_[i] < fixed_mass) grain.position = space_.wrapped(grain.position);
    double depth = occupied.deepest_overlap(grain);
    if (mass_[i] < fixed_mass && depth > stuck * grain.radius) {
      PackGrain candidate = grain;
      for (std::uint64_t k = 0; k < n_candidates && depth > 0.0; ++k) {
        for (int axis = 0; axis < 3; ++axis)
          candidate.position[axis] =
              extent.low[axis] +
              (extent.high[axis] - extent.low[axis]) *
                  random_uniform(problem_.seed, problem_.first_number + number_[i], RandomPurpose::choice,
                                 1000 + (round * n_candidates + k) * 3 + static_cast<std::uint64_t>(axis));
        double outside = 0.0;
        problem_.container.push(candidate.position, candidate.radius, outside);
        const double there = std::max(outside, occupied.deepest_overlap(candidate));
        if (there >= depth) continue;
        depth = there;
        grain.position = candidate.position;
      }
      ++n_moved;
    }
    occupied.insert(grain);
  }
  listed_position_.clear();
  return n_moved;
}

bool Relaxer::is_listed() {
  if (listed_position_.empty()) return false;
  each_block([this](Block& block) {
    block.has_strayed = false;
    for (std::int64_t k = block.grains.begin; k < block.grains.end && !block.has_strayed; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double far = list_margin * grains_[i].radius;
      block.has_strayed = squared_length(grains_[i].position - listed_position_[i]) > far * far;
    }
  });
  return std::none_of(blocks_.begin(), blocks_.end(), [](const Block& block) { return block.has_strayed; });
}

void Relaxer::sort_by_cell(const CellLevels& cells) {
  const std::size_t n = grains_.size();
  std::vector<std::int64_t> cell(n);
  cell_begin_.assign(static_cast<std::size_t>(cells.n_cells()) + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    if (mass_[i] < fixed_mass) grains_[i].position = space_.wrapped(grains_[i].position);
    cell[i] = cells.cell_of(cells.level_of(grains_[i].radius), grains_[i].position);
    ++cell_begin_[static_cast<std::size_t>(cell[i]) + 1];
  }
  std::partial_sum(cell_begin_.begin(), cell_begin_.end(), cell_begin_.begin());
  std::vector<std::int64_t> next(cell_begin_.begin(), cell_begin_.end() - 1);
  std::vector<std::uint32_t> place(n);
  for (std::size_t i = 0; i < n; ++i) place[i] = static_cast<std::uint32_t>(next[static_cast<std::size_t>(cell[i])]++);
  const auto reorder = [&](auto& values) {
    auto sorted = values;
    for (std::size_t i = 0; i < n; ++i) sorted[place[i]] = values[i];
    values.swap(sorted);
  };
  reorder(grains_);
  reorder(mass_);
  reorder(velocity_);
  reorder(number_);
}

void Relaxer::list_row(const CellLevels& cells, Block& block, std::int64_t i) {
  const PackGrain self = grains_[static_cast<std::size_t>(i)];
  const bool is_fixed = mass_[static_cast<std::size_t>(i)] == fixed_mass;
  const double widen = listed_scale_ * (1.0 + list_margin);
  const int own_level = cells.level_of(self.radius);
  for (int level = 0; level <= own_level; ++level) {
    if (cells.is_empty(level)) continue;
    cells.visit_cells(
        level, self.position, widen * (self.radius + cells.largest_radius(level)), [&](std::int64_t cell) {
          const auto c = static_cast<std::size_t>(cell);
          // Grains lie along the cells: on its own level each pair is met from its first grain.
          for (std::int64_t j = level == own_level ? std::max(cell_begin_[c], i + 1) : cell_begin_[c];
               j < cell_begin_[c + 1]; ++j) {
            const auto other = static_cast<std::size_t>(j);
            const double reach = widen * (self.radius + grains_[other].radius);
            if (squared_length(space_.difference(self.position, grains_[other].position)) >= reach * reach) continue;
            if (is_fixed && mass_[other] == fixed_mass) continue;
            block.neighbours.push_back(static_cast<std::int32_t>(j));
          }
          return false;
        });
  }
}

void Relaxer::list_pairs() {
  std::vector<double> radii(grains_.size());
  std::transform(grains_.begin(), grains_.end(), radii.begin(), [](const PackGrain& g) { return g.radius; });
  const CellLevels cells(space_, problem_.container.extent(), radii);
  sort_by_cell(cells);
  each_block([&](Block& block) {
    block.neighbours.clear();
    block.row_begin.assign(1, 0);
    for (std::int64_t i = block.grains.begin; i < block.grains.end; ++i) {
      list_row(cells, block, i);
      block.row_begin.push_back(static_cast<std::int64_t>(block.neighbours.size()));
    }
  });
  listed_position_.resize(grains_.size());
  std::transform(grains_.begin(), grains_.end(), listed_position_.begin(),
                 [](const PackGrain& g) { return g.position; });
}

void Relaxer::push_apart(double scale, double inflation) {
  each_block([&](Block& block) { push_pairs(block, scale, inflation); });
  for (const Block& block : blocks_)
    for (const Block::Spill& spill : block.spills)
      acceleration_[static_cast<std::size_t>(spill.grain)] += spill.acceleration;
  each_block([&](Block& block) {
    push_from_bounds(block, scale, inflation);
    sum_up(block);
  });
  overlaps_ = {};
  for (const Block& block : blocks_) {
    overlaps_.worst = std::max(overlaps_.worst, block.overlaps.worst);
    overlaps_.energy += block.overlaps.energy;
  }
}

void Relaxer::push_pairs(Block& block, double scale, double inflation) {
  block.overlaps = {};
  block.spills.clear();
  std::fill(acceleration_.begin() + block.grains.begin, acceleration_.begin() + block.grains.end, Vec3{});
  const double true_scale = scale * pack_clearance;
  const double soft_scale = scale * inflation;
  for (std::int64_t own = block.grains.begin; own < block.grains.end; ++own) {
    const auto i = static_cast<std::size_t>(own);
    const auto row = static_cast<std::size_t>(own - block.grains.begin);
    const PackGrain self = grains_[i];
    const double mass = mass_[i];
    Vec3 sum;
    for (std::int64_t k = block.row_begin[row]; k < block.row_begin[row + 1]; ++k) {
      const std::int32_t neighbour = block.neighbours[static_cast<std::size_t>(k)];
      const auto j = static_cast<std::size_t>(neighbour);
      const Vec3 d = space_.difference(self.position, grains_[j].position);
      const double radii = self.radius + grains_[j].radius;
      const double reach = soft_scale * radii;
      const double squared = squared_length(d);
      if (squared >= reach * reach) continue;
      const double distance = std::sqrt(squared);
      const double overlap = reach - distance;
      // Two centres at one point part along x; which way does not matter as long as it is always the same.
      const Vec3 direction = distance > 0.0 ? d / distance : Vec3{1, 0, 0};
      const double share = mass_[j] / (mass + mass_[j]);
      sum += (2.0 * share * overlap) * direction;
      const Vec3 back = (-2.0 * (1.0 - share) * overlap) * direction;
      if (neighbour >= block.grains.begin && neighbour < block.grains.end)
        acceleration_[j] += back;
      else
        block.spills.push_back({neighbour, back});
      block.overlaps.worst = std::max(block.overlaps.worst, (true_scale * radii - distance) / radii);
      block.overlaps.energy += std::min(mass, mass_[j]) * overlap * overlap;
    }
    acceleration_[i] += sum;
  }
}

void Relaxer::push_from_bounds(Block& block, double scale, double inflation) {
  for (std::int64_t k = block.grains.begin; k < block.grains.end; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (mass_[i] == fixed_mass) {
      acceleration_[i] = {};
      continue;
    }
    double depth = 0.0;
    const double radius = grains_[i].radius;
    const Vec3 push = problem_.container.push(grains_[i].position, scale * inflation * radius, depth);
    if (depth > 0.0) {
      acceleration_[i] += 2.0 * push;
      block.overlaps.worst =
          std::max(block.overlaps.worst, (depth - scale * (inflation - pack_clearance) * radius) / radius);
      block.overlaps.energy += mass_[i] * depth * depth;
    }
    if (space_.is_flat) acceleration_[i].z = 0.0;
  }
}

void Relaxer::sum_up(Block& block) {
  block.sums = {};
  for (std::int64_t k = block.grains.begin; k < block.grains.end; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (mass_[i] == fixed_mass) continue;
    block.sums.power += mass_[i] * dot(acceleration_[i], velocity_[i]);
    block.sums.speed += mass_[i] * squared_length(velocity_[i]);
    block.sums.force += mass_[i] * squared_length(acceleration_[i]);
  }
}

void Relaxer::step() {
  constexpr double dt_start = 0.3, dt_max = 0.6, mixing_start = 0.1;  // in units of a contact's period over 2 pi
  if (dt_ == 0.0) {
    dt_ = dt_start;
    mixing_ = mixing_start;
  }
  Sums sums;
  for (const Block& block : blocks_) {
    sums.power += block.sums.power;
    sums.speed += block.sums.speed;
    sums.force += block.sums.force;
  }
  double keep = 1.0, turn = 0.0;
  if (sums.power < 0.0) {
    keep = 0.0;
    dt_ = std::max(0.5 * dt_, 0.05);
    mixing_ = mixing_start;
    n_downhill_ = 0;
  } else if (sums.force > 0.0) {
    keep = 1.0 - mixing_;
    turn = mixing_ * std::sqrt(sums.speed / sums.force);
    if (++n_downhill_ > 5) {
      dt_ = std::min(1.1 * dt_, dt_max);
      mixing_ *= 0.99;
    }
  }
  each_block([&](Block& block) { move(block, keep, turn); });
}

void Relaxer::move(const Block& block, double keep, double turn) {
  for (std::int64_t k = block.grains.begin; k < block.grains.end; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (mass_[i] == fixed_mass) continue;
    velocity_[i] = keep * velocity_[i] + (turn + dt_) * acceleration_[i];
    // Nobody jumps over a neighbour.
    const double longest = 0.3 * grains_[i].radius / dt_;
    const double squared = squared_length(velocity_[i]);
    if (squared > longest * longest) velocity_[i] = (longest / std::sqrt(squared)) * velocity_[i];
    grains_[i].position += dt_ * velocity_[i];
  }
}

bool Relaxer::relax(double scale, double inflation, std::int64_t max_steps) {
  constexpr std::int64_t patience = 400;  // steps in which a packing that is not jammed loses a good part of its energy
  dt_ = 0.0;
  n_downhill_ = 0;
  std::fill(velocity_.begin(), velocity_.end(), Vec3{});
  double energy_before = 0.0;
  for (std::int64_t steps = 0; steps < max_steps; ++steps) {
    if (listed_scale_ != scale * inflation || !is_listed()) {
      listed_scale_ = scale * inflation;
      list_pairs();
    }
    push_apart(scale, inflation);
    ++n_steps_;
    if (overlaps_.worst <= 0.0) return true;
    if (steps % patience == 0) {
      if (steps > 0 && overlaps_.energy > 0.98 * energy_before) return false;
      energy_before = overlaps_.energy;
    }
    step();
  }
  return false;
}

void Relaxer::positions(std::span<PackGrain> grains) const {
  for (std::size_t i = 0; i < grains_.size(); ++i)
    if (number_[i] < grains.size()) grains[number_[i]].position = space_.wrapped(grains_[i].position);
}

}  // namespace

Relaxation pack_by_relaxation(const PackProblem& problem, std::span<PackGrain> grains) {
  struct Stage {
    double inflation;
    std::int64_t max_steps;
  };
  constexpr Stage stages[] = {{1.02, 300}, {1.005, 1500}, {1.002, 6000}, {1.0005, 20000}};
  Relaxer relaxer(problem, grains);
  relaxer.scatter();
  Relaxation result;
  for (const Stage& stage : stages) {
    result.is_free = relaxer.relax(1.0, stage.inflation, stage.max_steps);
    if (result.is_free) break;
  }
  for (std::uint64_t round = 0; !result.is_free && round < 5 && relaxer.relocate(round) > 0; ++round)
    result.is_free = relaxer.relax(1.0, 1.005, 1500);
  // Too dense: let the radii shrink until the packing comes free, to say how far it would go.
  for (int attempt = 0; !result.is_free && attempt < 40; ++attempt) {
    result.scale *= 0.99;
    if (relaxer.relax(result.scale, 1.002, 1500)) break;
  }
  relaxer.positions(grains);
  result.n_steps = relaxer.n_steps();
  return result;
}

}  // namespace moraine
