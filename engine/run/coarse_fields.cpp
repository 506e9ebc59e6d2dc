#include "engine/run/coarse_fields.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

#include "comm/totals.hpp"
#include "engine/particles/parcel.hpp"
#include "engine/run/grid_rows.hpp"
#include "engine/scene/kept_count.hpp"
#include "engine/scene/lists.hpp"
#include "engine/threads.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/fixed_point.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

/// What is summed over the grains of a species in a cell, each by its weight: numbers, kg, m3, kg m/s, and m v v [J] in the order xx yy zz
/// xy xz yz.
enum OfGrains : std::size_t { number, mass, volume, momentum, flux = momentum + 3, n_of_grains = flux + 6 };
/// And over all: force times branch [J] in the order xx xy xz yx ..., forces of walls, forces of gravity, damping and gas [N].
enum OfAll : std::size_t { contact, wall = contact + 9, body = wall + 3, n_of_all = body + 3 };

using SpeciesSums = std::array<double, n_of_grains>;
using CommonSums = std::array<double, n_of_all>;

constexpr const char* grain_sum_names[n_of_grains] = {"number",     "mass",       "volume",  "momentum_x",
                                                      "momentum_y", "momentum_z", "flux_xx", "flux_yy",
                                                      "flux_zz",    "flux_xy",    "flux_xz", "flux_yz"};
constexpr const char* grain_sum_units[n_of_grains] = {"",  "kg", "m3", "kg m/s", "kg m/s", "kg m/s",
                                                      "J", "J",  "J",  "J",      "J",      "J"};
constexpr const char* all_sum_names[n_of_all] = {"contact_xx", "contact_xy", "contact_xz", "contact_yx", "contact_yy",
                                                 "contact_yz", "contact_zx", "contact_zy", "contact_zz", "wall_x",
                                                 "wall_y",     "wall_z",     "body_x",     "body_y",     "body_z"};
constexpr const char* all_sum_units[n_of_all] = {"J", "J", "J", "J", "J", "J", "J", "J",
                                                 "J", "N", "N", "N", "N", "N", "N"};

constexpr std::array<std::array<int, 2>, 6> flux_axes = {{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
constexpr const char* axis_names[] = {"x", "y", "z"};

/// Cells of a rank's share at least: smaller grids are kept on fewer ranks.
constexpr std::int64_t least_cells = 4096;

}  // namespace

/// The line along which a contact carries momentum, from the other grain, or from where a wall is touched, to the grain.
struct CoarseFields::Branch {
  Vec3 begin;  // [m]
  Vec3 way;    // [m]
  Vec3 force;  // [N] on the grain at its end
  bool is_wall = false;
};

/// What one thread has added up, in the cells that its grains and contacts reach.
class CoarseFields::Sums {
 public:
  Sums(const WeightGrid& grid, std::size_t n_quantities) : grid_(&grid), n_quantities_(n_quantities) {
    for (std::size_t a = 0; a < 3; ++a) block_.low[a] = grid[a].n;
  }

  /// Makes room for the cells of a block of weights.
  void include(const CellWeights& weights) {
    for (std::size_t a = 0; a < 3; ++a) {
      const int n = (*grid_)[a].n;
      int low = weights.low[a], high = low + weights.size[a];
      if ((*grid_)[a].wraps && (low < 0 || high > n)) low = 0, high = n;
      block_.low[a] = std::min(block_.low[a], std::max(low, 0));
      block_.high[a] = std::max(block_.high[a], std::min(high, n));
    }
  }
  void allocate() {
    if (!block_.is_empty()) values_.assign(static_cast<std::size_t>(block_.n_cells()) * n_quantities_, 0);
  }

  /// Adds values (in integer units) times the weights to the quantities from `first` on.
  void add(const CellWeights& weights, std::size_t first, std::span<const double> values) {
    for (std::size_t a = 0; a < 3; ++a) {
      places_[a].resize(static_cast<std::size_t>(weights.size[a]));
      for (int i = 0; i < weights.size[a]; ++i) {
        const int cell = grid_cell((*grid_)[a], weights.low[a] + i);
        places_[a][static_cast<std::size_t>(i)] = cell < 0 ? -1 : cell - block_.low[a];
      }
    }
    const double* weight = weights.values.data();
    for (const int k : places_[2])
      for (const int j : places_[1])
        for (const int i : places_[0]) {
          const double w = *weight++;
          if (w == 0.0 || i < 0 || j < 0 || k < 0) continue;
          const std::int64_t cell = (std::int64_t{k} * block_.size(1) + j) * block_.size(0) + i;
          std::int64_t* const sums = values_.data() + static_cast<std::size_t>(cell) * n_quantities_ + first;
          for (std::size_t q = 0; q < values.size(); ++q) sums[q] += std::llrint(w * values[q]);
        }
  }

  /// Hands cells over to the ranks that have them: number of the cell (x fastest), then its sums.
  void put(const GridShare& share, std::vector<ParcelWriter>& writers) const {
    if (values_.empty()) return;
    const std::int64_t* sums = values_.data();
    for (int k = block_.low[2]; k < block_.high[2]; ++k)
      for (int j = block_.low[1]; j < block_.high[1]; ++j) {
        ParcelWriter& writer = writers[static_cast<std::size_t>(share.owner(j, k))];
        for (int i = block_.low[0]; i < block_.high[0]; ++i, sums += n_quantities_) {
          const std::span<const std::int64_t> own(sums, n_quantities_);
          if (std::all_of(own.begin(), own.end(), [](std::int64_t x) { return x == 0; })) continue;
          writer.put((std::int64_t{k} * share.n[1] + j) * share.n[0] + i);
          writer.put_all(own);
        }
      }
  }

 private:
  const WeightGrid* grid_;
  std::size_t n_quantities_;
  CellBlock block_;
  std::vector<std::int64_t> values_;
  std::array<std::vector<int>, 3> places_;
};

std::size_t CoarseFields::first_of_all() const { return species_.size() * n_of_grains; }

double CoarseFields::cell_volume() const { return grid_[0].spacing * grid_[1].spacing * grid_[2].spacing; }

WeightGrid field_grid(const Scene& scene, const Probe& probe) {
  WeightGrid grid;
  const Box domain = scene.domain.box();
  for (std::size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    WeightAxis& side = grid[a];
    const double low = probe.region.low[axis], high = probe.region.high[axis];
    const bool is_periodic = scene.domain.periodic[a], begins = low <= domain.low[axis],
               ends = high >= domain.high[axis];
    side.n = probe.cells[a];
    side.width = probe.width;
    side.low = low;
    side.spacing = (high - low) / side.n;
    side.wraps = is_periodic && begins && ends;
    if (side.is_whole()) {
      // What touches a wall in the face of the domain does so on either side of it, by rounding.
      const bool is_all = axis == 2 && scene.domain.dimensions == 2;
      if (!(is_all || side.wraps || (begins && !is_periodic))) side.begin = low;
      if (!(is_all || side.wraps || (ends && !is_periodic))) side.end = high;
    } else if (!side.wraps) {
      const int margin = probe.margin.value_or(2 * probe.width);
      side.low -= margin * side.spacing;
      side.n += 2 * margin;
    }
  }
  return grid;
}

double memory_of_fields(const Scene& scene, const Probe& probe) {
  const WeightGrid grid = field_grid(scene, probe);
  const std::size_t n_species = probe.by_material ? scene.materials.size() : 1;
  const double n_cells = static_cast<double>(grid[0].n) * grid[1].n * grid[2].n;
  // Sums over time, those of a sample where they are made, and where they are collected.
  return 3.0 * 8.0 * n_cells * static_cast<double>(n_species * n_of_grains + n_of_all);
}

CoarseFields::CoarseFields(const Scene& scene, const Probe& probe, const World& world)
    : world_(world),
      name_(probe.name),
      species_of_(scene.materials.size(), 0),
      gravity_(scene.time.gravity),
      damping_(scene.time.damping),
      from_(probe.from),
      dimensions_(scene.domain.dimensions),
      grid_(field_grid(scene, probe)) {
  if (probe.by_material) {
    const std::vector<bool> is_grain = grain_materials(scene);
    for (std::size_t m = 0; m < is_grain.size(); ++m) {
      if (!is_grain[m]) continue;
      species_of_[m] = species_.size();
      species_.push_back(scene.materials[m].name);
    }
  }
  if (species_.empty()) species_.emplace_back();
  std::array<int, 3> n{};
  std::array<bool, 3> wraps{};
  for (std::size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    n[a] = grid_[a].n;
    wraps[a] = grid_[a].wraps;
    if (scene.domain.periodic[a] && !wraps[a]) image_period_[a] = scene.domain.box().size()[axis];
    box_.low[axis] = grid_[a].low;
    box_.high[axis] = grid_[a].low + grid_[a].n * grid_[a].spacing;
  }
  share_ = share_out(n, wraps, world.size(), least_cells);
  block_ = share_.block(world.rank());
  const GridLayout layout = block_.is_empty() ? GridLayout() : GridLayout(block_, 0);
  for (std::size_t q = 0; q < species_.size() * n_of_grains + n_of_all; ++q) sums_.emplace_back(layout);
}

// ---- one sample

std::vector<CoarseFields::Branch> CoarseFields::branches_of(const FieldSample& sample) const {
  std::vector<Branch> branches;
  sample.contacts.for_each_contact(sample.particles, sample.dt, [&](const ContactReport& c) {
    if (!c.is_ours) return;
    const Vec3 end = sample.particles.position(c.grain);
    const double distance =
        c.other < 0 ? 0.0 : sample.particles.radius(c.grain) + sample.particles.radius(c.other) - c.overlap;
    const Vec3 way = c.other < 0 ? end - c.point : distance * c.normal;
    branches.push_back({end - way, way, c.result.force, c.other < 0});
  });
  return branches;
}

/// Powers of two by which the contributions to each quantity become integers, so large that all of the scene fit into one cell; the same on
/// all ranks.
std::vector<double> CoarseFields::scales_for(const FieldSample& sample, const std::vector<Branch>& branches) const {
  const Particles& p = sample.particles;
  std::array<double, 7> largest = {
      1.0, 0.0, 0.0, 0.0,
      0.0, 0.0, 0.0};  // number, mass, volume, speed, body force over mass, force times branch, wall force
  std::array<std::uint64_t, 2> n = {0, branches.size()};
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i)) continue;
    ++n[0];
    largest[1] = std::max(largest[1], 1.0 / p.inverse_mass(i));
    largest[2] = std::max(largest[2], sphere_volume(p.radius(i)));
    largest[3] = std::max(largest[3], length(sample.velocities[static_cast<std::size_t>(i)]));
    if (sample.push) {
      const double* const push = sample.push + 3 * std::ptrdiff_t{i};
      largest[4] = std::max(largest[4], length(Vec3{push[0], push[1], push[2]}));
    }
  }
  for (const Branch& branch : branches) {
    largest[5] = std::max(largest[5], length(branch.force) * length(branch.way));
    if (branch.is_wall) largest[6] = std::max(largest[6], length(branch.force));
  }
  world_.max(largest);
  world_.sum(std::span<std::uint64_t>(n));
  const bool has_images = image_period_ != std::array<double, 3>{};
  const int bits = 61 - static_cast<int>(std::bit_width(std::max(n[0], n[1]))) - (has_images ? 5 : 0);
  const double mv = largest[1] * largest[3];
  std::vector<double> scales;
  for (std::size_t s = 0; s < species_.size(); ++s)
    for (std::size_t q = 0; q < n_of_grains; ++q)
      scales.push_back(scale_for(q < momentum ? largest[q] : q < flux ? mv : mv * largest[3], bits));
  const double body_force = largest[1] * (length(gravity_) + damping_ * largest[3] + largest[4]);
  for (std::size_t q = 0; q < n_of_all; ++q)
    scales.push_back(scale_for(q < wall ? largest[5] : q < body ? largest[6] : body_force, bits));
  return scales;
}

/// Shifts [m] by which a line, in one of its periodic images, comes to the grid.
std::vector<Vec3> CoarseFields::images_of(Vec3 begin, Vec3 way) const {
  std::vector<Vec3> shifts = {Vec3{}};
  for (std::size_t a = 0; a < 3; ++a) {
    if (image_period_[a] == 0.0) continue;
    std::vector<Vec3> more;
    for (const Vec3 shift : shifts)
      for (const int periods : {-1, 0, 1}) {
        more.push_back(shift);
        more.back()[static_cast<int>(a)] = periods * image_period_[a];
      }
    shifts = std::move(more);
  }
  if (shifts.size() == 1) return shifts;
  std::erase_if(shifts, [&](Vec3 shift) {
    CellWeights block;
    find_block(grid_, begin + shift, way, block);
    for (std::size_t a = 0; a < 3; ++a)
      if (!grid_[a].wraps && !grid_[a].is_whole() && (block.low[a] >= grid_[a].n || block.low[a] + block.size[a] <= 0))
        return true;
    return false;
  });
  return shifts;
}

/// What a grain adds to the quantities of its species, then its body force.
void CoarseFields::set_grain(const FieldSample& sample, std::int32_t i, Values& values) const {
  const Particles& p = sample.particles;
  const double m = 1.0 / p.inverse_mass(i);
  const Vec3 v = sample.velocities[static_cast<std::size_t>(i)];
  values.assign(n_of_grains + 3, 0.0);
  values[number] = 1.0;
  values[mass] = m;
  values[volume] = sphere_volume(p.radius(i));
  Vec3 force = gravity_ - damping_ * v;
  if (sample.push) {
    const double* const push = sample.push + 3 * std::ptrdiff_t{i};
    force += Vec3{push[0], push[1], push[2]};
  }
  if (dimensions_ == 2.0) force.z = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    values[momentum + a] = m * v[static_cast<int>(a)];
    values[n_of_grains + a] = m * force[static_cast<int>(a)];
  }
  for (std::size_t k = 0; k < flux_axes.size(); ++k) values[flux + k] = m * v[flux_axes[k][0]] * v[flux_axes[k][1]];
}

/// Room for the cells that these grains and lines reach.
void CoarseFields::make_room(const FieldSample& sample, const std::vector<Branch>& branches, Range grains, Range lines,
                             Sums& sums) const {
  const Particles& p = sample.particles;
  CellWeights block;
  const auto include = [&](Vec3 begin, Vec3 way) {
    for (const Vec3 shift : images_of(begin, way)) {
      find_block(grid_, begin + shift, way, block);
      sums.include(block);
    }
  };
  for (std::int64_t i = grains.begin; i < grains.end; ++i)
    if (p.is_here(static_cast<std::int32_t>(i))) include(p.position(i), {});
  for (std::int64_t n = lines.begin; n < lines.end; ++n) {
    const Branch& line = branches[static_cast<std::size_t>(n)];
    include(line.begin, line.way);
  }
  sums.allocate();
}

void CoarseFields::add_grains(const FieldSample& sample, const std::vector<double>& scales, Range grains,
                              Sums& sums) const {
  const std::size_t all = first_of_all();
  CellWeights weights;
  Values values;
  for (std::int64_t n = grains.begin; n < grains.end; ++n) {
    const auto i = static_cast<std::int32_t>(n);
    if (!sample.particles.is_here(i)) continue;
    const Vec3 position = sample.particles.position(i);
    const std::size_t first = species_of_[sample.particles.material(i)] * n_of_grains;
    set_grain(sample, i, values);
    for (std::size_t q = 0; q < n_of_grains; ++q) values[q] *= scales[first + q];
    for (std::size_t q = 0; q < 3; ++q) values[n_of_grains + q] *= scales[all + body + q];
    for (const Vec3 shift : images_of(position, {})) {
      point_weights(grid_, position + shift, weights);
      sums.add(weights, first, std::span(values).first(n_of_grains));
      sums.add(weights, all + body, std::span(values).last(3));
    }
  }
}

void CoarseFields::add_branches(const std::vector<Branch>& branches, const std::vector<double>& scales, Range lines,
                                Sums& sums) const {
  const std::size_t all = first_of_all();
  CellWeights weights;
  for (std::int64_t n = lines.begin; n < lines.end; ++n) {
    const Branch& line = branches[static_cast<std::size_t>(n)];
    std::array<double, 9> stress;
    std::array<double, 3> force;
    for (std::size_t k = 0; k < 9; ++k)
      stress[k] = line.force[static_cast<int>(k / 3)] * line.way[static_cast<int>(k % 3)] * scales[all + contact + k];
    for (std::size_t k = 0; k < 3; ++k) force[k] = line.force[static_cast<int>(k)] * scales[all + wall + k];
    for (const Vec3 shift : images_of(line.begin, line.way)) {
      line_weights(grid_, line.begin + shift, line.way, weights);
      sums.add(weights, all + contact, stress);
      if (!line.is_wall) continue;
      point_weights(grid_, line.begin + shift, weights);
      sums.add(weights, all + wall, force);
    }
  }
}

/// What this rank's grains and contacts add to cells, for the ranks that have them.
std::vector<Parcel> CoarseFields::deposit(const FieldSample& sample, const std::vector<Branch>& branches,
                                          const std::vector<double>& scales) const {
  std::vector<std::vector<ParcelWriter>> writers(static_cast<std::size_t>(std::max(1, sample.n_threads)));
  parallel(sample.n_threads, [&](int thread) {
    const int n_threads = static_cast<int>(writers.size());
    const Range grains = share_of(sample.particles.size(), thread, n_threads);
    const Range lines = share_of(static_cast<std::int64_t>(branches.size()), thread, n_threads);
    Sums sums(grid_, sums_.size());
    make_room(sample, branches, grains, lines, sums);
    add_grains(sample, scales, grains, sums);
    add_branches(branches, scales, lines, sums);
    std::vector<ParcelWriter>& own = writers[static_cast<std::size_t>(thread)];
    own.resize(static_cast<std::size_t>(world_.size()));
    sums.put(share_, own);
  });
  std::vector<Parcel> parcels;
  for (std::vector<ParcelWriter>& own : writers)
    for (std::size_t rank = 0; rank < own.size(); ++rank)
      if (!own[rank].empty()) parcels.push_back({static_cast<int>(rank), own[rank].take()});
  return parcels;
}

/// The sums of this rank's cells: all quantities of a cell, then those of the next.
std::vector<std::int64_t> CoarseFields::collected(const std::vector<Parcel>& parcels) const {
  const std::size_t width = sums_.size();
  std::vector<std::int64_t> sums(block_.is_empty() ? 0 : static_cast<std::size_t>(block_.n_cells()) * width),
      cell(width);
  for (const Parcel& parcel : parcels)
    for (ParcelReader reader(parcel.bytes); !reader.at_end();) {
      const auto place = reader.get<std::int64_t>();
      reader.get_all(std::span(cell));
      const std::int64_t line = place / share_.n[0];
      const std::int64_t i = place % share_.n[0] - block_.low[0], j = line % share_.n[1] - block_.low[1],
                         k = line / share_.n[1] - block_.low[2];
      const std::int64_t number_here = (k * block_.size(1) + j) * block_.size(0) + i;
      std::int64_t* const own = sums.data() + static_cast<std::size_t>(number_here) * width;
      for (std::size_t q = 0; q < width; ++q) own[q] += cell[q];
    }
  return sums;
}

std::vector<double> CoarseFields::add(const FieldSample& sample) {
  const std::vector<Branch> branches = branches_of(sample);
  const std::vector<double> scales = scales_for(sample, branches);
  const std::vector<std::int64_t> cells = collected(world_.exchange(deposit(sample, branches, scales)));
  const std::size_t width = sums_.size();
  std::vector<std::int64_t> totals(width, 0);
  for (std::size_t n = 0; n < cells.size(); ++n) totals[n % width] += cells[n];
  world_.sum(std::span<std::int64_t>(totals));
  std::vector<double> on_grid(width);
  for (std::size_t q = 0; q < width; ++q) on_grid[q] = static_cast<double>(totals[q]) / scales[q];
  if (sample.time >= from_) {
    if (n_samples_++ == 0) first_time_ = sample.time;
    last_time_ = sample.time;
    for (std::size_t n = 0; n < cells.size(); ++n)  // without ghosts, the values of a block lie one after the other
      sums_[n % width].data()[n / width] += static_cast<double>(cells[n]) / scales[n % width];
  }
  return row_of(sample, on_grid);
}

std::vector<std::string> CoarseFields::columns() {
  std::vector<std::string> names = {"samples", "mass on the grid [kg]", "mass inside [kg]"};
  for (const char* what : {"momentum {} [kg m/s]", "force of walls {} [N]", "body force {} [N]"})
    for (const char* axis : axis_names) names.push_back(fmt::format(fmt::runtime(what), axis));
  names.emplace_back("contact pressure [Pa]");
  return names;
}

std::vector<double> CoarseFields::row_of(const FieldSample& sample, const std::vector<double>& totals) const {
  const Particles& p = sample.particles;
  ExactSum inside;
  for (std::int32_t i = 0; i < p.size(); ++i)
    if (p.is_here(i)) inside.add(1.0 / p.inverse_mass(i));
  SpeciesSums grains{};
  for (std::size_t q = 0; q < first_of_all(); ++q) grains[q % n_of_grains] += totals[q];
  const double* const all = totals.data() + first_of_all();
  std::vector<double> row = {static_cast<double>(n_samples_), grains[mass], total(world_, inside)};
  row.insert(row.end(), grains.begin() + momentum, grains.begin() + flux);
  row.insert(row.end(), all + wall, all + n_of_all);
  row.push_back((all[contact] + all[contact + 4] + all[contact + 8]) / (3.0 * box_.volume()));
  return row;
}

// ---- means

namespace {

/// The sums of a cell over samples, its volume times their number, and the number of dimensions.
struct CellMeans {
  SpeciesSums grains{};
  CommonSums all{};
  double volume = 1.0;  // [m3]
  double dimensions = 3.0;

  double velocity(int axis) const {
    const double m = grains[mass];
    return m > 0.0 ? grains[momentum + static_cast<std::size_t>(axis)] / m : 0.0;
  }
  /// m v' v' with v' relative to the velocity of the cell, [J]
  double fluctuation(std::size_t k) const {
    const auto [a, b] = flux_axes[k];
    return grains[flux + k] - grains[momentum + static_cast<std::size_t>(a)] * velocity(b);
  }
  double temperature() const {
    const double m = grains[mass], trace = fluctuation(0) + fluctuation(1) + fluctuation(2);
    return m > 0.0 ? std::max(0.0, trace / (m * dimensions)) : 0.0;
  }
};

struct Quantity {
  std::string name, unit;
  std::function<double(const CellMeans&)> value;
};

std::vector<Quantity> quantities_of_grains() {
  const auto over_volume = [](std::size_t q) { return [q](const CellMeans& c) { return c.grains[q] / c.volume; }; };
  std::vector<Quantity> all = {{"number_density", "1/m3", over_volume(number)},
                               {"density", "kg/m3", over_volume(mass)},
                               {"solid_fraction", "", over_volume(volume)}};
  for (int axis = 0; axis < 3; ++axis)
    all.push_back({std::string("momentum_") + axis_names[axis], "kg/(m2 s)",
                   over_volume(momentum + static_cast<std::size_t>(axis))});
  for (int axis = 0; axis < 3; ++axis)
    all.push_back(
        {std::string("velocity_") + axis_names[axis], "m/s", [axis](const CellMeans& c) { return c.velocity(axis); }});
  all.push_back({"granular_temperature", "m2/s2", [](const CellMeans& c) { return c.temperature(); }});
  for (std::size_t k = 0; k < flux_axes.size(); ++k)
    all.push_back({fmt::format("kinetic_stress_{}{}", axis_names[flux_axes[k][0]], axis_names[flux_axes[k][1]]), "Pa",
                   [k](const CellMeans& c) { return c.fluctuation(k) / c.volume; }});
  return all;
}

std::vector<Quantity> quantities_of_all() {
  std::vector<Quantity> all;
  const auto add = [&](const std::string& name, const char* unit, std::size_t q) {
    all.push_back({name, unit, [q](const CellMeans& c) { return c.all[q] / c.volume; }});
  };
  for (std::size_t k = 0; k < 9; ++k)
    add(fmt::format("contact_stress_{}{}", axis_names[k / 3], axis_names[k % 3]), "Pa", contact + k);
  for (std::size_t a = 0; a < 3; ++a) add(std::string("wall_force_") + axis_names[a], "N/m3", wall + a);
  for (std::size_t a = 0; a < 3; ++a) add(std::string("body_force_") + axis_names[a], "N/m3", body + a);
  return all;
}

}  // namespace

FieldImage CoarseFields::image() const {
  FieldImage image;
  image.name = name_;
  image.time = last_time_;
  image.from = first_time_;
  image.n_samples = n_samples_;
  image.box = box_;
  image.n = share_.n;
  const std::size_t n_cells = block_.is_empty() ? 0 : static_cast<std::size_t>(block_.n_cells());
  const auto gather = [&](const std::string& prefix, const Quantity& quantity, std::size_t first, std::size_t last) {
    GridField<> field(block_.is_empty() ? GridLayout() : GridLayout(block_, 0));
    CellMeans means;
    means.volume = cell_volume() * static_cast<double>(std::max<std::uint64_t>(n_samples_, 1));
    means.dimensions = dimensions_;
    for (std::size_t cell = 0; cell < n_cells; ++cell) {
      means.grains = {};
      for (std::size_t q = first; q < last; ++q) means.grains[q % n_of_grains] += sums_[q].data()[cell];
      for (std::size_t q = 0; q < n_of_all; ++q) means.all[q] = sums_[first_of_all() + q].data()[cell];
      field.data()[cell] = quantity.value(means);
    }
    GridArray array;
    array.name = prefix + quantity.name;
    array.unit = quantity.unit;
    gather_grid(world_, {share_, -1}, n_cells > 0 ? &field : nullptr, array);
    image.arrays.push_back(std::move(array));
  };
  for (const Quantity& quantity : quantities_of_grains()) gather("", quantity, 0, first_of_all());
  for (const Quantity& quantity : quantities_of_all()) gather("", quantity, 0, first_of_all());
  for (std::size_t s = 0; s < species_.size(); ++s)
    for (const Quantity& quantity : quantities_of_grains())
      if (!species_[s].empty()) gather(species_[s] + ".", quantity, s * n_of_grains, (s + 1) * n_of_grains);
  return image;
}

void CoarseFields::begin() {
  n_samples_ = 0;
  for (GridField<>& sum : sums_) sum.fill(0.0);
}

// ---- checkpoints

std::string CoarseFields::sum_name(std::size_t quantity) const {
  if (quantity >= first_of_all()) return fmt::format("{}.{}", name_, all_sum_names[quantity - first_of_all()]);
  const std::string& species = species_[quantity / n_of_grains];
  return fmt::format("{}.{}{}{}", name_, species, species.empty() ? "" : ".", grain_sum_names[quantity % n_of_grains]);
}

std::string CoarseFields::counts_name() const { return "fields_" + name_; }

void CoarseFields::keep(Image& image) const {
  if (n_samples_ == 0) return;
  image.accumulators[counts_name()] = {static_cast<double>(n_samples_), first_time_, last_time_};
  for (std::size_t q = 0; q < sums_.size(); ++q) {
    GridArray array;
    array.name = sum_name(q);
    array.unit = q < first_of_all() ? grain_sum_units[q % n_of_grains] : all_sum_units[q - first_of_all()];
    gather_grid(world_, {share_, -1}, block_.is_empty() ? nullptr : &sums_[q], array);
    image.sums.push_back(std::move(array));
  }
}

void CoarseFields::restore(const Image& image) {
  const auto counts = image.accumulators.find(counts_name());
  if (counts == image.accumulators.end() || counts->second.size() != 3) return;
  std::vector<const GridArray*> found;
  for (std::size_t q = 0; q < sums_.size(); ++q)
    for (const GridArray& array : image.sums)
      if (array.name == sum_name(q) && array.n == share_.n) found.push_back(&array);
  if (found.size() != sums_.size()) return;
  n_samples_ = kept_count(counts->second[0], counts->first);
  first_time_ = counts->second[1];
  last_time_ = counts->second[2];
  for (std::size_t q = 0; q < sums_.size(); ++q)
    put_grid(world_, {share_, -1}, *found[q], block_.is_empty() ? nullptr : &sums_[q]);
}

std::size_t CoarseFields::memory() const {
  std::size_t bytes = 0;
  for (const GridField<>& sum : sums_) bytes += sum.bytes();
  return bytes;
}

}  // namespace moraine
