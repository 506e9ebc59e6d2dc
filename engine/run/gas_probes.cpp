#include "engine/run/gas_probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <span>

#include "comm/totals.hpp"
#include "kernels/base/exact_sum.hpp"
#include "kernels/base/fixed_point.hpp"
#include "kernels/base/sphere.hpp"

namespace moraine {

namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};

// ---- grains in cells

/// Bits of one grain's contribution: 2^27 grains fit into a cell.
constexpr int grain_bits = 36;

/// What is summed over the grains of a cell.
enum GrainSum : std::size_t { volume, momentum_x, momentum_y, momentum_z, square, n_grain_sums };
using GrainSums = std::array<std::int64_t, n_grain_sums>;
using GrainScales = std::array<double, n_grain_sums>;

GrainScales scales_of(const World& world, const Particles& p) {
  std::array<double, 2> largest{};  // volume, speed
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i)) continue;
    largest[0] = std::max(largest[0], sphere_volume(p.radius(i)));
    largest[1] = std::max(largest[1], length(p.velocity(i)));
  }
  world.max(largest);
  const double momentum = scale_for(largest[0] * largest[1], grain_bits);
  return {scale_for(largest[0], grain_bits), momentum, momentum, momentum,
          scale_for(largest[0] * largest[1] * largest[1], grain_bits)};
}

/// The sums of one cell on their way to the rank that has the cell.
struct CellRecord {
  std::int64_t cell = 0;  // x fastest, of the whole grid
  GrainSums sums{};
};
static_assert(std::is_trivially_copyable_v<CellRecord>);

/// Sums of this rank's grains in the cells that they are in.
class LocalSums {
 public:
  LocalSums(const GasGrid& grid, const Particles& p, const GrainScales& scales) : grid_(grid) {
    find_box(p);
    if (box_.is_empty()) return;
    sums_.resize(static_cast<std::size_t>(box_.n_cells()));
    for (std::int32_t i = 0; i < p.size(); ++i)
      if (p.is_here(i)) add(p.position(i), p.velocity(i), sphere_volume(p.radius(i)), scales);
  }

  std::vector<Parcel> parcels(const GridShare& share) const {
    std::map<int, Parcel> by_rank;
    for (int k = box_.low[2]; k < box_.high[2]; ++k)
      for (int j = box_.low[1]; j < box_.high[1]; ++j) {
        const int owner = share.owner(j, k);
        for (int i = box_.low[0]; i < box_.high[0]; ++i) {
          const GrainSums& own = sums_[at(i, j, k)];
          if (own[volume] == 0) continue;
          const CellRecord record{(std::int64_t{k} * grid_.n[1] + j) * grid_.n[0] + i, own};
          std::vector<std::byte>& bytes = by_rank[owner].bytes;
          bytes.resize(bytes.size() + sizeof record);
          std::memcpy(bytes.data() + bytes.size() - sizeof record, &record, sizeof record);
        }
      }
    std::vector<Parcel> all;
    for (auto& [rank, parcel] : by_rank) {
      parcel.rank = rank;
      all.push_back(std::move(parcel));
    }
    return all;
  }

 private:
  void find_box(const Particles& p) {
    for (std::size_t axis = 0; axis < 3; ++axis) box_.low[axis] = grid_.n[axis], box_.high[axis] = 0;
    for (std::int32_t i = 0; i < p.size(); ++i) {
      if (!p.is_here(i)) continue;
      const std::array<int, 3> cell = cell_of(grid_, p.position(i));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box_.low[axis] = std::min(box_.low[axis], cell[axis]);
        box_.high[axis] = std::max(box_.high[axis], cell[axis] + 1);
      }
    }
  }
  std::size_t at(int i, int j, int k) const {
    return static_cast<std::size_t>((std::int64_t{k - box_.low[2]} * box_.size(1) + (j - box_.low[1])) * box_.size(0) +
                                    (i - box_.low[0]));
  }
  void add(Vec3 position, Vec3 velocity, double grain_volume, const GrainScales& scales) {
    const std::array<int, 3> cell = cell_of(grid_, position);
    GrainSums& own = sums_[at(cell[0], cell[1], cell[2])];
    own[volume] += fixed(grain_volume, scales[volume]);
    for (std::size_t axis = 0; axis < 3; ++axis)
      own[momentum_x + axis] += fixed(grain_volume * velocity[static_cast<int>(axis)], scales[momentum_x]);
    own[square] += fixed(grain_volume * squared_length(velocity), scales[square]);
  }

  const GasGrid& grid_;
  CellBlock box_;
  std::vector<GrainSums> sums_;
};

std::vector<GrainSums> received(const std::vector<Parcel>& parcels, const GasGrid& grid, const CellBlock& block) {
  std::vector<GrainSums> sums(block.is_empty() ? 0 : static_cast<std::size_t>(block.n_cells()));
  for (const Parcel& parcel : parcels)
    for (std::size_t at = 0; at + sizeof(CellRecord) <= parcel.bytes.size(); at += sizeof(CellRecord)) {
      CellRecord record;
      std::memcpy(&record, parcel.bytes.data() + at, sizeof record);
      const std::int64_t line = record.cell / grid.n[0];
      const std::int64_t i = record.cell % grid.n[0] - block.low[0], j = line % grid.n[1] - block.low[1],
                         k = line / grid.n[1] - block.low[2];
      GrainSums& own = sums[static_cast<std::size_t>((k * block.size(1) + j) * block.size(0) + i)];
      for (std::size_t q = 0; q < n_grain_sums; ++q) own[q] += record.sums[q];
    }
  return sums;
}

}  // namespace

std::array<int, 3> cell_of(const GasGrid& grid, Vec3 position) {
  std::array<int, 3> cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int a = static_cast<int>(axis);
    const double place = std::floor((position[a] - grid.low[a]) / grid.spacing[a]);
    cell[axis] = static_cast<int>(std::clamp(place, 0.0, static_cast<double>(grid.n[axis] - 1)));
  }
  return cell;
}

GrainCells grains_by_cell(const World& world, const GasGrid& grid, const GridShare& share, const Particles& particles) {
  const GrainScales scales = scales_of(world, particles);
  GrainCells out;
  if (world.rank() < share.n_ranks()) out.block = share.block(world.rank());
  const std::vector<GrainSums> sums =
      received(world.exchange(LocalSums(grid, particles, scales).parcels(share)), grid, out.block);
  out.volume.resize(sums.size());
  for (std::vector<double>& values : out.momentum) values.resize(sums.size());
  out.fluctuation.resize(sums.size());
  const double dimensions = grid.is_flat ? 2.0 : 3.0;
  for (std::size_t c = 0; c < sums.size(); ++c) {
    const double v = static_cast<double>(sums[c][volume]) / scales[volume];
    double mean_square = 0.0;  // times volume
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double m = static_cast<double>(sums[c][momentum_x + axis]) / scales[momentum_x];
      out.momentum[axis][c] = m;
      if (v > 0.0) mean_square += m * m / v;
    }
    out.volume[c] = v;
    const double all = static_cast<double>(sums[c][square]) / scales[square];
    out.fluctuation[c] = std::max(0.0, all - mean_square) / dimensions;
  }
  return out;
}

// ---- averages over time

GasMeans::GasMeans(const Scene& scene, const CellBlock& block) : block_(block) {
  const GridLayout layout = block.is_empty() ? GridLayout() : GridLayout(block, gas_ghosts);
  for (std::size_t i = 0; i < scene.output.probes.size(); ++i) {
    const Probe& probe = scene.output.probes[i];
    if (probe.kind != Probe::Kind::gas_mean) continue;
    OfProbe own;
    own.probe = i;
    own.name = probe.name;
    for (GridField<>& sum : own.sums) sum = GridField<>(layout);
    probes_.push_back(std::move(own));
  }
}

void GasMeans::add(std::size_t probe, const GasView& gas, const GrainCells& grains) {
  const auto found = std::find_if(probes_.begin(), probes_.end(), [&](const OfProbe& p) { return p.probe == probe; });
  if (found == probes_.end()) return;
  found->n_samples += 1.0;
  if (block_.is_empty()) return;
  auto& sums = found->sums;
  std::size_t c = 0;
  for (int k = 0; k < block_.size(2); ++k)
    for (int j = 0; j < block_.size(1); ++j)
      for (int i = 0; i < block_.size(0); ++i, ++c) {
        sums[void_fraction](i, j, k) += (*gas.void_fraction)(i, j, k);
        sums[volume](i, j, k) += grains.volume[c];
        for (std::size_t axis = 0; axis < 3; ++axis) sums[momentum_x + axis](i, j, k) += grains.momentum[axis][c];
        sums[fluctuation](i, j, k) += grains.fluctuation[c];
        sums[pressure](i, j, k) += (*gas.pressure)(i, j, k);
      }
}

std::vector<GasMeans::Sum> GasMeans::sums() {
  static constexpr std::array<std::pair<const char*, const char*>, n_quantities> names = {{{"void_fraction_sum", "-"},
                                                                                           {"volume_sum", "m3"},
                                                                                           {"momentum_x_sum", "m4/s"},
                                                                                           {"momentum_y_sum", "m4/s"},
                                                                                           {"momentum_z_sum", "m4/s"},
                                                                                           {"fluctuation_sum", "m5/s2"},
                                                                                           {"pressure_sum", "Pa"}}};
  std::vector<Sum> all;
  for (OfProbe& own : probes_)
    for (std::size_t q = 0; q < n_quantities; ++q)
      all.push_back({own.name + "." + names[q].first, names[q].second, &own.sums[q]});
  return all;
}

std::vector<GasMeans::Mean> GasMeans::means() const {
  std::vector<Mean> all;
  for (const OfProbe& own : probes_) {
    if (own.n_samples == 0.0) continue;
    const auto add = [&](const char* name, const char* unit, auto&& value) {
      Mean mean{own.name + "." + name, unit, {}};
      for (int k = 0; k < block_.size(2); ++k)
        for (int j = 0; j < block_.size(1); ++j)
          for (int i = 0; i < block_.size(0); ++i) mean.values.push_back(value(i, j, k));
      all.push_back(std::move(mean));
    };
    const auto over_time = [&](Quantity q) {
      return [&own, q](int i, int j, int k) { return own.sums[q](i, j, k) / own.n_samples; };
    };
    const auto over_grains = [&](Quantity q) {
      return [&own, q](int i, int j, int k) {
        const double grains = own.sums[volume](i, j, k);
        return grains > 0.0 ? own.sums[q](i, j, k) / grains : 0.0;
      };
    };
    add("void_fraction", "-", over_time(void_fraction));
    add("pressure", "Pa", over_time(pressure));
    add("solids_velocity_x", "m/s", over_grains(momentum_x));
    add("solids_velocity_y", "m/s", over_grains(momentum_y));
    add("solids_velocity_z", "m/s", over_grains(momentum_z));
    add("granular_temperature", "m2/s2", over_grains(fluctuation));
  }
  return all;
}

std::vector<double> GasMeans::counts() const {
  std::vector<double> all;
  for (const OfProbe& own : probes_) all.push_back(own.n_samples);
  return all;
}

void GasMeans::restore(const std::vector<double>& counts) {
  for (std::size_t i = 0; i < std::min(counts.size(), probes_.size()); ++i) probes_[i].n_samples = counts[i];
}

double GasMeans::count(std::size_t probe) const {
  for (const OfProbe& own : probes_)
    if (own.probe == probe) return own.n_samples;
  return 0.0;
}

// ---- rows

namespace {

/// The cells of this rank: what they are called in the whole grid and in the block.
template <class Visit>
void for_each_cell(const GasView& gas, const CellBlock& block, const Visit& visit) {
  if (!gas.pressure || block.is_empty()) return;
  for (int k = block.low[2]; k < block.high[2]; ++k)
    for (int j = block.low[1]; j < block.high[1]; ++j)
      for (int i = block.low[0]; i < block.high[0]; ++i)
        visit(std::array<int, 3>{i, j, k}, i - block.low[0], j - block.low[1], k - block.low[2]);
}

CellBlock block_of(const World& world, const GasView& gas) {
  return world.rank() < gas.share.n_ranks() ? gas.share.block(world.rank()) : CellBlock{};
}

/// Linear between the centres of two cells of a line, and beyond the last centres: their numbers and weights.
struct Between {
  std::array<int, 2> cell{};
  std::array<double, 2> weight{};
};
Between between_centres(const GasGrid& grid, int axis, double place) {
  const auto a = static_cast<std::size_t>(axis);
  const int n = grid.n[a];
  if (n == 1) return {{0, 0}, {1.0, 0.0}};
  const double s = (place - grid.low[axis]) / grid.spacing[axis] - 0.5;
  double first = std::floor(s);
  if (!grid.periodic[a]) first = std::clamp(first, 0.0, n - 2.0);
  const double t = s - first;
  const int i = static_cast<int>(first);
  return {{(i + n) % n, (i + 1 + n) % n}, {1.0 - t, t}};
}

std::vector<double> pressures(const World& world, const Probe& probe, const GasView& gas) {
  const CellBlock block = block_of(world, gas);
  std::vector<ExactSum> sums(probe.points.size());
  for (std::size_t p = 0; p < probe.points.size(); ++p) {
    if (!gas.pressure) break;
    std::array<Between, 3> line;
    for (int axis = 0; axis < 3; ++axis)
      line[static_cast<std::size_t>(axis)] = between_centres(gas.grid, axis, probe.points[p][axis]);
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const std::size_t a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
      const int i = line[0].cell[a], j = line[1].cell[b], k = line[2].cell[c];
      if (!block.contains(i, j, k)) continue;
      sums[p].add(line[0].weight[a] * line[1].weight[b] * line[2].weight[c] *
                  (*gas.pressure)(i - block.low[0], j - block.low[1], k - block.low[2]));
    }
  }
  total(world, sums);
  std::vector<double> row;
  for (const ExactSum& sum : sums) row.push_back(sum.value());
  return row;
}

/// Mean pressures in two planes, from those of the layers of cells beside them, and their difference.
std::vector<double> pressure_drop(const World& world, const Probe& probe, const GasView& gas) {
  const GasGrid& grid = gas.grid;
  const auto axis = static_cast<std::size_t>(probe.axis);
  const double low = grid.low[probe.axis], high = low + grid.n[axis] * grid.spacing[probe.axis];
  const std::array<double, 2> planes = probe.between.value_or(std::array<double, 2>{low, high});
  std::array<Between, 2> beside;
  for (std::size_t plane = 0; plane < 2; ++plane) beside[plane] = between_centres(grid, probe.axis, planes[plane]);
  std::array<ExactSum, 4> sums;
  for_each_cell(gas, block_of(world, gas), [&](const std::array<int, 3>& cell, int i, int j, int k) {
    for (std::size_t plane = 0; plane < 2; ++plane)
      for (std::size_t side = 0; side < 2; ++side)
        if (cell[axis] == beside[plane].cell[side]) sums[2 * plane + side].add((*gas.pressure)(i, j, k));
  });
  total(world, sums);
  const double n_cells = static_cast<double>(grid.n[0]) * grid.n[1] * grid.n[2] / grid.n[axis];
  std::array<double, 2> means{};
  for (std::size_t plane = 0; plane < 2; ++plane)
    for (std::size_t side = 0; side < 2; ++side)
      means[plane] += beside[plane].weight[side] * (sums[2 * plane + side].value() / n_cells);
  return {means[0], means[1], means[0] - means[1]};
}

/// Heights of grains above the low face, with masses as integers, so that shares of the whole are the same in any
/// order.
struct WeighedGrains {
  std::vector<double> height;      // [m]
  std::vector<std::int64_t> mass;  // in units that the ranks agree on
  double mean = 0.0, highest = 0.0;
  std::int64_t total = 0;
};

WeighedGrains weigh(const World& world, const Domain& domain, int axis, const Particles& p) {
  WeighedGrains out;
  std::vector<double> masses;
  std::array<double, 2> largest{};  // mass, height
  std::array<ExactSum, 2> sums;     // mass, mass times height
  for (std::int32_t i = 0; i < p.size(); ++i) {
    if (!p.is_here(i)) continue;
    const double mass = 1.0 / p.inverse_mass(i), height = p.position(i)[axis] - domain.low[axis];
    masses.push_back(mass);
    out.height.push_back(height);
    largest = {std::max(largest[0], mass), std::max(largest[1], height)};
    sums[0].add(mass);
    sums[1].add(mass * height);
  }
  world.max(largest);
  total(world, sums);
  const double all = sums[0].value();
  out.mean = all > 0.0 ? sums[1].value() / all : 0.0;
  out.highest = largest[1];
  const double scale = scale_for(all, 60);
  for (const double mass : masses) out.mass.push_back(fixed(mass, scale));
  for (const std::int64_t mass : out.mass) out.total += mass;
  world.sum(std::span(&out.total, 1));
  return out;
}

/// The height below which a share of the mass lies, to 2^-40 of the domain's size: by halving the range of heights 8
/// times at once.
double height_of(const World& world, const WeighedGrains& grains, double share, double size) {
  constexpr std::size_t n_bins = 256;
  constexpr int n_rounds = 5;
  double low = 0.0, width = size;
  std::int64_t below = 0;  // mass under `low`
  const double wanted = share * static_cast<double>(grains.total);
  for (int round = 0; round < n_rounds; ++round) {
    std::array<std::int64_t, n_bins> bins{};
    const double bin_width = width / n_bins;
    for (std::size_t i = 0; i < grains.height.size(); ++i) {
      const double place = std::floor((grains.height[i] - low) / bin_width);
      const bool is_last = place == n_bins && low + width >= size;
      if (place >= 0.0 && (place < n_bins || is_last))
        bins[std::min(static_cast<std::size_t>(place), n_bins - 1)] += grains.mass[i];
    }
    world.sum(bins);
    std::size_t bin = 0;
    while (bin + 1 < n_bins && static_cast<double>(below + bins[bin]) < wanted) below += bins[bin++];
    low += static_cast<double>(bin) * bin_width;
    width = bin_width;
  }
  return low + width;
}

std::vector<double> bed_height(const World& world, const Scene& scene, const Probe& probe, const Particles& p) {
  const WeighedGrains grains = weigh(world, scene.domain, probe.axis, p);
  if (grains.total == 0) return {0.0, 0.0, 0.0};
  const double size = scene.domain.high[probe.axis] - scene.domain.low[probe.axis];
  return {height_of(world, grains, probe.share, size), grains.mean, grains.highest};
}

/// The layers of cells along the axis of a probe that its region has a part of, and how much of a cell lies in it along
/// each axis.
struct Layers {
  int first = 0, last = 0;                     // the last not among them
  std::array<std::vector<double>, 3> overlap;  // [-] by cell; along the axis: 1
};

Layers layers_of(const GasGrid& grid, const Probe& probe) {
  Layers out;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const double h = grid.spacing[axis];
    const double low = (probe.region.low[axis] - grid.low[axis]) / h,
                 high = (probe.region.high[axis] - grid.low[axis]) / h;
    out.overlap[a].resize(static_cast<std::size_t>(grid.n[a]));
    for (int i = 0; i < grid.n[a]; ++i)
      out.overlap[a][static_cast<std::size_t>(i)] =
          std::clamp(std::min(high, i + 1.0) - std::max(low, double(i)), 0.0, 1.0);
  }
  std::vector<double>& along = out.overlap[static_cast<std::size_t>(probe.axis)];
  constexpr double least = 1e-6;  // edges of cells are not exact numbers
  const auto is_in = [](double share) { return share > least; };
  out.first = static_cast<int>(std::find_if(along.begin(), along.end(), is_in) - along.begin());
  out.last = static_cast<int>(along.rend() - std::find_if(along.rbegin(), along.rend(), is_in));
  std::fill(along.begin(), along.end(), 1.0);
  return out;
}

/// Sums of a layer, over cells and time.
enum LayerSum : std::size_t {
  share,  // of cells in the region
  void_fraction,
  grain_volume,
  grain_momentum_x,
  grain_momentum_y,
  grain_momentum_z,
  grain_fluctuation,
  gas_velocity_x,
  gas_velocity_y,
  gas_velocity_z,
  gas_pressure,
  n_layer_sums
};

std::vector<double> layer_sums(const World& world, const Probe& probe, const GasView& gas, const GrainCells& grains,
                               const Layers& layers) {
  const auto n_layers = static_cast<std::size_t>(std::max(0, layers.last - layers.first));
  std::vector<ExactSum> sums(n_layers * n_layer_sums);
  std::size_t c = 0;
  for_each_cell(gas, grains.block, [&](const std::array<int, 3>& cell, int i, int j, int k) {
    const std::size_t at = c++;
    const int layer = cell[static_cast<std::size_t>(probe.axis)];
    if (layer < layers.first || layer >= layers.last) return;
    double w = 1.0;
    for (std::size_t axis = 0; axis < 3; ++axis) w *= layers.overlap[axis][static_cast<std::size_t>(cell[axis])];
    if (w == 0.0) return;
    ExactSum* const own = &sums[static_cast<std::size_t>(layer - layers.first) * n_layer_sums];
    own[share].add(w);
    own[void_fraction].add(w * (*gas.void_fraction)(i, j, k));
    own[grain_volume].add(w * grains.volume[at]);
    own[grain_fluctuation].add(w * grains.fluctuation[at]);
    own[gas_pressure].add(w * (*gas.pressure)(i, j, k));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      own[grain_momentum_x + axis].add(w * grains.momentum[axis][at]);
      own[gas_velocity_x + axis].add(w * (*gas.cell_velocity[axis])(i, j, k));
    }
  });
  total(world, sums);
  std::vector<double> values;
  for (const ExactSum& sum : sums) values.push_back(sum.value());
  return values;
}

/// `memory`: the number of samples, then the sums of the layers.
std::vector<double> gas_profile(const World& world, const Probe& probe, const Particles& particles, const GasView& gas,
                                double time, std::vector<double>& memory) {
  const Layers layers = layers_of(gas.grid, probe);
  const auto n_layers = static_cast<std::size_t>(std::max(0, layers.last - layers.first));
  memory.resize(1 + n_layers * n_layer_sums);
  if (time >= probe.from) {
    const GrainCells grains = grains_by_cell(world, gas.grid, gas.share, particles);
    const std::vector<double> now = layer_sums(world, probe, gas, grains, layers);
    memory[0] += 1.0;
    for (std::size_t i = 0; i < now.size(); ++i) memory[1 + i] += now[i];
  }
  std::vector<double> row = {memory[0]};
  for (std::size_t layer = 0; layer < n_layers; ++layer) {
    const double* const own = &memory[1 + layer * n_layer_sums];
    const auto mean = [&](std::size_t q, std::size_t of) { return own[of] > 0.0 ? own[q] / own[of] : 0.0; };
    row.push_back(mean(void_fraction, share));
    for (std::size_t axis = 0; axis < 3; ++axis) row.push_back(mean(grain_momentum_x + axis, grain_volume));
    row.push_back(mean(grain_fluctuation, grain_volume));
    for (std::size_t axis = 0; axis < 3; ++axis) row.push_back(mean(gas_velocity_x + axis, share));
    row.push_back(mean(gas_pressure, share));
  }
  return row;
}

/// Adds to the averages of the cells; says how many samples they have, and what the whole domain is like now.
std::vector<double> gas_mean(const World& world, const Probe& probe, std::size_t number, const Particles& particles,
                             const GasView& gas, double time) {
  const GrainCells grains = grains_by_cell(world, gas.grid, gas.share, particles);
  if (time >= probe.from && gas.means) gas.means->add(number, gas, grains);
  enum { cells, voids, volumes, fluctuations, n_sums };
  std::array<ExactSum, n_sums> sums;
  std::size_t c = 0;
  for_each_cell(gas, grains.block, [&](const std::array<int, 3>&, int i, int j, int k) {
    sums[cells].add(1.0);
    sums[voids].add((*gas.void_fraction)(i, j, k));
    sums[volumes].add(grains.volume[c]);
    sums[fluctuations].add(grains.fluctuation[c]);
    ++c;
  });
  total(world, sums);
  const double solids = sums[volumes].value();
  return {gas.means ? gas.means->count(number) : 0.0, sums[voids].value() / std::max(1.0, sums[cells].value()),
          solids > 0.0 ? sums[fluctuations].value() / solids : 0.0};
}

std::vector<std::string> profile_columns(const Scene& scene, const Probe& probe) {
  std::vector<std::string> names = {"samples"};
  if (!scene.gas) return names;
  const GasGrid grid = gas_grid(scene.domain, *scene.gas);
  const Layers layers = layers_of(grid, probe);
  for (int layer = layers.first; layer < layers.last; ++layer) {
    const double place = grid.low[probe.axis] + (layer + 0.5) * grid.spacing[probe.axis];
    const std::string at = fmt::format("at {} {:.6g} m", axis_names[probe.axis], place);
    names.push_back("void fraction " + at);
    for (const char* axis : axis_names) names.push_back(fmt::format("solids velocity {} {} [m/s]", axis, at));
    names.push_back(fmt::format("granular temperature {} [m2/s2]", at));
    for (const char* axis : axis_names) names.push_back(fmt::format("gas velocity {} {} [m/s]", axis, at));
    names.push_back(fmt::format("pressure {} [Pa]", at));
  }
  return names;
}

}  // namespace

std::vector<std::string> gas_probe_columns(const Scene& scene, const Probe& probe) {
  std::vector<std::string> names;
  switch (probe.kind) {
    case Probe::Kind::pressure:
      for (const Vec3 p : probe.points)
        names.push_back(fmt::format("pressure at ({:.6g} {:.6g} {:.6g}) m [Pa]", p.x, p.y, p.z));
      return names;
    case Probe::Kind::pressure_drop: return {"pressure low [Pa]", "pressure high [Pa]", "pressure drop [Pa]"};
    case Probe::Kind::bed_height:
      return {fmt::format("height of {:.6g} % [m]", 100.0 * probe.share), "mean height [m]", "highest [m]"};
    case Probe::Kind::gas_profile: return profile_columns(scene, probe);
    case Probe::Kind::gas_mean: return {"samples", "void fraction", "granular temperature [m2/s2]"};
    default: return names;
  }
}

std::vector<double> gas_probe_row(const World& world, const Scene& scene, const Probe& probe, std::size_t number,
                                  const Particles& particles, const GasView* gas, double time,
                                  std::vector<double>& memory) {
  if (probe.kind == Probe::Kind::bed_height) return bed_height(world, scene, probe, particles);
  if (!gas) return {};
  switch (probe.kind) {
    case Probe::Kind::pressure: return pressures(world, probe, *gas);
    case Probe::Kind::pressure_drop: return pressure_drop(world, probe, *gas);
    case Probe::Kind::gas_profile: return gas_profile(world, probe, particles, *gas, time, memory);
    case Probe::Kind::gas_mean: return gas_mean(world, probe, number, particles, *gas, time);
    default: return {};
  }
}

}  // namespace moraine
