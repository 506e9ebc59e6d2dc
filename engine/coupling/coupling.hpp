// What grains and gas do to each other, once a gas step.
#pragma once

#include <cstdint>
#include <memory>

#include "comm/world.hpp"
#include "engine/gas/gas_flow.hpp"
#include "engine/particles/particles.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

/// How the cells of the gas are shared out over the first of so many ranks.
GridShare gas_share(const GasGrid& grid, int n_ranks);
/// How often all ranks agree on a sum or a maximum in a gas step, besides those of the gas.
int coupling_reductions(const Gas& gas);

struct CouplingReport {
  GasReport gas;
  double flow_seconds = 0.0;         // [s] wall-clock time of this rank for the gas alone
  std::uint64_t n_floored = 0;       // cells that were taken as less dense than they are
  double least_void_fraction = 1.0;  // [-] before the floor
  double momentum_error = 0.0;       // |what the gas lost - what the grains got| over the sum of what each grain got
  double fastest_exchange = 0.0;     // [-] largest of gas step times drag rate of a grain, among its neighbours
};
/// Of `fastest_exchange`: with more, what the gas does to grains may swing ever further (README.md, "Long gas steps").
inline constexpr double longest_push = 1.5;

class Coupling {
 public:
  /// `world`: all ranks, which have grains; the first of them also have gas cells. All ranks of it make the same calls. Throws SceneError
  /// on all of them where the boundaries of the gas cannot be.
  Coupling(const Scene& scene, const GasGrid& grid, const World& world, int n_threads);
  ~Coupling();
  Coupling(Coupling&&) noexcept;
  Coupling& operator=(Coupling&&) noexcept;

  /// What is to be done for grains is done by so many threads from now on, what for cells by those of the start.
  void set_grain_threads(int n_threads);

  /// Advances the gas from `time` by `step` [s] to the grains as they are now, and sets what each owned grain feels until the next
  /// call: Field::gas_acceleration, drag, pressure gradient and buoyancy over its mass [m/s2].
  CouplingReport advance(Particles& particles, double time, double step);

  /// The gas of this rank; nullptr where it has no cells.
  GasFlow* flow();
  const GasGrid& grid() const;
  const GridShare& share() const;
  std::size_t memory() const;  // [bytes]

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace moraine
