#include "engine/run/gas_phase.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "engine/particles/parcel.hpp"

namespace moraine {

namespace {

constexpr const char* counts_name = "gas_mean";  // of samples
constexpr const char* numbers_name = "gas";      // of what GasFlow keeps in numbers, among an image's accumulators

const GridArray* look_for(const Image& image, const std::string& name) {
  const auto found =
      std::find_if(image.grids.begin(), image.grids.end(), [&](const GridArray& array) { return array.name == name; });
  return found == image.grids.end() ? nullptr : &*found;
}

const GridArray& find(const Image& image, const std::string& name) {
  if (const GridArray* const found = look_for(image, name)) return *found;
  throw SceneError(
      {{"", fmt::format("the checkpoint holds no \"{}\" of the gas, which the scene needs", name), false}});
}

}  // namespace

GasPhase::GasPhase(const Scene& scene, const Plan& plan, const World& world, int n_threads)
    : world_(world),
      step_(static_cast<double>(plan.gas_steps) * plan.time_step.step),
      grain_steps_(plan.gas_steps),
      weights_(scene.gas->weights),
      coupling_(scene, gas_grid(scene.domain, *scene.gas), world, n_threads),
      means_(scene, coupling_.share().block(world.rank())) {}

GasView GasPhase::view() {
  GasView view{coupling_.grid(), coupling_.share()};
  view.means = &means_;
  if (GasFlow* const flow = coupling_.flow()) {
    find_cell_velocity();
    view.void_fraction = &flow->void_fraction();
    view.pressure = &flow->pressure();
    for (std::size_t axis = 0; axis < 3; ++axis) view.cell_velocity[axis] = &cell_velocity_[axis];
  }
  return view;
}

void GasPhase::find_cell_velocity() {
  for (int axis = 0; axis < 3; ++axis) {
    const GridField<>& faces = coupling_.flow()->velocity(axis);
    const GridLayout& layout = faces.layout();
    GridField<>& cells = cell_velocity_[static_cast<std::size_t>(axis)];
    if (!(cells.layout() == layout)) cells = GridField<>(layout);
    const std::int64_t to_high = layout.stride(axis);
    for (int k = 0; k < layout.size[2]; ++k)
      for (int j = 0; j < layout.size[1]; ++j) {
        const double* const u = faces.data() + layout.at(0, j, k);
        double* const mean = cells.data() + layout.at(0, j, k);
        for (int i = 0; i < layout.size[0]; ++i) mean[i] = 0.5 * (u[i] + u[i + to_high]);
      }
  }
}

ConcernedCells GasPhase::find_concerned() {
  GasFlow* const flow = coupling_.flow();
  return flow ? moraine::find_concerned(view(), coupling_.share().block(world_.rank()), flow->worst_cell()) : no_cells;
}

std::vector<ConcernedCells> GasPhase::find_concerned_of_all() {
  const ConcernedCells own = find_concerned();
  std::vector<double> numbers;
  for (const auto& cell : own) numbers.insert(numbers.end(), cell.begin(), cell.end());
  const std::vector<double> all = world_.gather(std::span<const double>(numbers));
  std::vector<ConcernedCells> cells(all.size() / numbers.size(), no_cells);
  for (std::size_t n = 0; n < all.size(); ++n)
    cells[n / numbers.size()][n % numbers.size() / 3][n % 3] = static_cast<int>(all[n]);
  return cells;
}

std::string GasPhase::rows_of_cells(const ConcernedCells& cells, double time) {
  GasFlow* const flow = coupling_.flow();
  if (!flow) return {};
  return moraine::rows_of_cells(view(), coupling_.share().block(world_.rank()), cells, flow->worst_cell(), time);
}

void GasPhase::advance(Particles& particles, double time) {
  const CouplingReport report = [&] {
    try {
      return coupling_.advance(particles, time, step_);
    } catch (const GasError& error) {
      throw RunError(fmt::format("at {:.6g} s: {}", time, error.what()));
    }
  }();
  steps_.note(time, report);
  ++totals_.n_steps;
  totals_.n_parts += static_cast<std::uint64_t>(report.gas.n_parts);
  totals_.n_iterations += static_cast<std::uint64_t>(report.gas.iterations);
  totals_.imbalance = std::max(totals_.imbalance, report.gas.imbalance);
  totals_.n_floored += report.n_floored;
  totals_.least_void_fraction = std::min(totals_.least_void_fraction, report.least_void_fraction);
  totals_.momentum_error = std::max(totals_.momentum_error, report.momentum_error);
  look_at_void_fraction(report.least_void_fraction, time);
  // Solved to gas.tolerance, a cell loses or gains a millionth of its gas; where it is much more the solver has given up.
  constexpr double most_imbalance = 0.01;
  if (!(report.gas.imbalance <= most_imbalance))
    throw RunError(fmt::format(
        "at {:.6g} s: the gas does not balance: a cell has gained or lost {:.2g} of its gas in one gas step, "
        "for the pressure equation could not be solved; set gas.step to {:.2g} s or less",
        time, report.gas.imbalance, 0.5 * step_));
  if (report.fastest_exchange > longest_push)
    throw RunError(fmt::format(
        "at {:.6g} s: the gas step of {:.4g} s is {:.1f} times as long as the gas takes to drag a grain along, and the "
        "drag would swing ever further; set gas.step to {:.2g} s or less",
        time, step_, report.fastest_exchange, 0.5 * step_ / report.fastest_exchange));
}

/// A floor is for cells that grains squeeze by. More grains than there is room for are none: cells too small for the weights.
void GasPhase::look_at_void_fraction(double least, double time) const {
  if (least >= 0.0) return;
  const Vec3 spacing = coupling_.grid().spacing;
  throw RunError(
      fmt::format("at {:.6g} s: grains take up {:.3g} times the volume of a gas cell ({:.3g} x {:.3g} x {:.3g} m), for "
                  "the cells are too small for gas.weights = \"{}\"; use {}, or larger cells",
                  time, 1.0 - least, spacing.x, spacing.y, spacing.z, name_of(weights_),
                  weights_ == GasWeights::smoothed ? "a longer gas.smoothing"
                                                   : "\"smoothed\" with a smoothing of about a diameter"));
}

std::vector<GasPhase::Quantity> GasPhase::kept() {
  // The first rank always has gas; those without learn from it what there is.
  std::vector<GasFlow::Kept> own;
  if (GasFlow* const flow = coupling_.flow()) own = flow->kept();
  ParcelWriter writer;
  for (const GasFlow::Kept& one : own) {
    for (const std::string_view text : {one.name, one.unit}) {
      writer.put(text.size());
      writer.put_all(std::span(text));
    }
    writer.put(one.face_axis);
  }
  std::vector<std::byte> bytes = writer.take();
  world_.broadcast(bytes);
  std::vector<Quantity> all;
  const auto text = [](ParcelReader& reader) {
    std::string value(reader.get<std::size_t>(), ' ');
    reader.get_all(std::span(value));
    return value;
  };
  for (ParcelReader reader(bytes); !reader.at_end();) {
    Quantity one;
    one.name = text(reader);
    one.unit = text(reader);
    one.face_axis = reader.get<int>();
    one.values = own.empty() ? nullptr : own[all.size()].values;
    all.push_back(std::move(one));
  }
  return all;
}

void GasPhase::gather(const std::string& name, const std::string& unit, int face_axis, const GridField<>* field,
                      Image& image) const {
  GridArray array;
  array.name = name;
  array.unit = unit;
  gather_grid(world_, {coupling_.share(), face_axis}, field, array);
  image.grids.push_back(std::move(array));
}

void GasPhase::gather_kept(Image& image) {
  std::vector<double> numbers;
  GasFlow* const flow = coupling_.flow();
  if (flow) numbers = flow->kept_numbers();
  ParcelWriter writer;
  writer.put_all(std::span<const double>(numbers));
  std::vector<std::byte> bytes = writer.take();
  world_.broadcast(bytes);
  numbers.resize(bytes.size() / sizeof(double));
  ParcelReader(bytes).get_all(std::span(numbers));
  image.accumulators[numbers_name] = numbers;
  image.accumulators[counts_name] = means_.counts();
  for (GasMeans::Sum& sum : means_.sums()) gather(sum.name, sum.unit, -1, flow ? sum.values : nullptr, image);
  for (const Quantity& one : kept()) gather(one.name, one.unit, one.face_axis, one.values, image);
}

void GasPhase::gather_shown(Image& image) {
  GasFlow* const flow = coupling_.flow();
  gather("void_fraction", "", -1, flow ? &flow->void_fraction() : nullptr, image);
  gather("pressure", "Pa", -1, flow ? &flow->pressure() : nullptr, image);
  static constexpr const char* names[] = {"gas_velocity_x", "gas_velocity_y", "gas_velocity_z"};
  if (flow) find_cell_velocity();
  for (std::size_t axis = 0; axis < 3; ++axis)
    gather(names[axis], "m/s", -1, flow ? &cell_velocity_[axis] : nullptr, image);
  for (const GasMeans::Mean& mean : means_.means()) {
    const GridLayout layout(coupling_.share().block(world_.rank()), 0);
    GridField<> field(layout);
    std::copy(mean.values.begin(), mean.values.end(), field.data());
    gather(mean.name, mean.unit, -1, flow ? &field : nullptr, image);
  }
}

void GasPhase::restore(const Image& image) {
  const auto numbers = image.accumulators.find(numbers_name);
  if (numbers == image.accumulators.end() || numbers->second.size() < 3)
    throw SceneError({{"gas", "the checkpoint was written without gas, which the scene now has", false}});
  restore_means(image);
  for (const Quantity& quantity : kept())
    put_grid(world_, {coupling_.share(), quantity.face_axis}, find(image, quantity.name), quantity.values);
  if (GasFlow* const flow = coupling_.flow()) flow->restore(numbers->second);
}

/// Averages go on where the checkpoint has all of them; else they begin anew.
void GasPhase::restore_means(const Image& image) {
  const std::vector<GasMeans::Sum> sums = means_.sums();
  const auto counts = image.accumulators.find(counts_name);
  const bool has_all = std::all_of(sums.begin(), sums.end(),
                                   [&](const GasMeans::Sum& sum) { return look_for(image, sum.name) != nullptr; });
  if (counts == image.accumulators.end() || !has_all) return;
  means_.restore(counts->second);
  for (const GasMeans::Sum& sum : sums)
    put_grid(world_, {coupling_.share(), -1}, find(image, sum.name), coupling_.flow() ? sum.values : nullptr);
}

void GasPhase::each_part(const std::function<void(std::span<const std::uint64_t>)>& use) {
  GasFlow* const flow = coupling_.flow();
  if (!flow) return;
  std::vector<std::uint64_t> words;
  const std::vector<GasFlow::Kept> all = flow->kept();
  for (std::size_t q = 0; q < all.size(); ++q) {
    const GridPlaces places{coupling_.share(), all[q].face_axis};
    const CellBlock block = places.block(world_.rank());
    const GridField<>& field = *all[q].values;
    words.resize(3 + static_cast<std::size_t>(block.size(0)));
    for (int k = 0; k < block.size(2); ++k)
      for (int j = 0; j < block.size(1); ++j) {  // lines along x are whole on any layout
        words[0] = q;
        words[1] = static_cast<std::uint64_t>(block.low[1] + j);
        words[2] = static_cast<std::uint64_t>(block.low[2] + k);
        std::memcpy(words.data() + 3, field.data() + field.layout().at(0, j, k),
                    static_cast<std::size_t>(block.size(0)) * sizeof(double));
        use(words);
      }
  }
}

}  // namespace moraine
