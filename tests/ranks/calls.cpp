// Which calls of MPI a step makes, counted through its profiling interface: the functions below stand before the library's own.
#define OMPI_SKIP_MPICXX 1  // the C++ bindings that were removed from the standard
#include <mpi.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include "engine/coupling/coupling.hpp"
#include "engine/particles/fill.hpp"
#include "engine/run/gas_projection.hpp"
#include "engine/run/simulation.hpp"
#include "tests/ranks/ranks.hpp"
#include "tests/support/flow_scenes.hpp"

using namespace moraine;

namespace {

struct Calls {
  int collectives = 0;  // none of them blocking, barriers too
  int messages = 0;     // sent by persistent requests
  int others = 0;       // sent otherwise
  int waits = 0;
};
Calls calls;

}  // namespace

extern "C" {
int MPI_Iallreduce(const void* s, void* r, int n, MPI_Datatype t, MPI_Op op, MPI_Comm c, MPI_Request* q) {
  ++calls.collectives;
  return PMPI_Iallreduce(s, r, n, t, op, c, q);
}
int MPI_Iallgather(const void* s, int n, MPI_Datatype t, void* r, int m, MPI_Datatype u, MPI_Comm c, MPI_Request* q) {
  ++calls.collectives;
  return PMPI_Iallgather(s, n, t, r, m, u, c, q);
}
int MPI_Iexscan(const void* s, void* r, int n, MPI_Datatype t, MPI_Op op, MPI_Comm c, MPI_Request* q) {
  ++calls.collectives;
  return PMPI_Iexscan(s, r, n, t, op, c, q);
}
int MPI_Ibcast(void* b, int n, MPI_Datatype t, int root, MPI_Comm c, MPI_Request* q) {
  ++calls.collectives;
  return PMPI_Ibcast(b, n, t, root, c, q);
}
int MPI_Ibarrier(MPI_Comm c, MPI_Request* q) {
  ++calls.collectives;
  return PMPI_Ibarrier(c, q);
}
int MPI_Send(const void* b, int n, MPI_Datatype t, int to, int tag, MPI_Comm c) {
  ++calls.others;
  return PMPI_Send(b, n, t, to, tag, c);
}
int MPI_Isend(const void* b, int n, MPI_Datatype t, int to, int tag, MPI_Comm c, MPI_Request* q) {
  ++calls.others;
  return PMPI_Isend(b, n, t, to, tag, c, q);
}
int MPI_Issend(const void* b, int n, MPI_Datatype t, int to, int tag, MPI_Comm c, MPI_Request* q) {
  ++calls.others;
  return PMPI_Issend(b, n, t, to, tag, c, q);
}
int MPI_Startall(int n, MPI_Request* q) {
  calls.messages += n;
  return PMPI_Startall(n, q);
}
int MPI_Testall(int n, MPI_Request* q, int* is_done, MPI_Status* s) {
  const int code = PMPI_Testall(n, q, is_done, s);
  if (*is_done) ++calls.waits;  // asked until then
  return code;
}
}

TEST_CASE(
    "a plain step has no collective call: one message to and from each neighbour that has grains for it, and one "
    "wait; a gas step has few, and those of its pressure equation") {
  const World& all = ranks::world();
  for (auto& [name, scene, n_steps] : scenes::all()) {
    INFO(name);
    // Walls that are driven to a force go by what all grains do to them, once a step; inlets ask all ranks for room, when they owe.
    const bool has_servo = std::any_of(scene.walls.begin(), scene.walls.end(), [](const WallDefinition& wall) {
      return std::any_of(wall.motion.begin(), wall.motion.end(),
                         [](const WallMotion& motion) { return motion.kind == WallMotion::Kind::servo; });
    });
    const int of_servo = has_servo ? 1 : 0, of_inlets = scene.inlets.empty() ? 0 : 16;
    Simulation simulation(scene, 1, all);
    simulation.step();  // its ghosts are fresh from the start
    int n_plain = 0, n_looks = 0, n_rebuilds = 0, n_gas = 0;
    for (int i = 0; i < n_steps / 2; ++i) {
      const std::uint64_t rebuilds = simulation.n_rebuilds(), looks = simulation.n_looks();
      const GasTotals gas = simulation.gas_totals().value_or(GasTotals{});
      calls = {};
      simulation.step();
      const GasTotals gas_now = simulation.gas_totals().value_or(GasTotals{});
      const bool is_gas_step = gas_now.n_steps != gas.n_steps;
      const auto of_gas = [&](std::uint64_t steps, std::uint64_t a_part, std::uint64_t an_iteration) {
        return static_cast<int>(steps * (gas_now.n_steps - gas.n_steps) + a_part * (gas_now.n_parts - gas.n_parts) +
                                an_iteration * (gas_now.n_iterations - gas.n_iterations));
      };
      if (simulation.n_rebuilds() != rebuilds) {
        ++n_rebuilds;
        REQUIRE(calls.collectives <= 16 + of_servo + of_inlets + of_gas(20, 8, 4));
        continue;
      }
      if (is_gas_step) {  // the ranks look in it too
        ++n_gas;
        REQUIRE(calls.collectives <= 1 + of_servo + of_inlets + of_gas(20, 8, 4));
        continue;
      }
      const bool is_look = simulation.n_looks() != looks;
      if (of_inlets > 0 && calls.collectives > (is_look ? 1 : 0) + of_servo) {  // no room for what an inlet owes
        REQUIRE(calls.collectives <= 1 + of_servo + of_inlets);
        continue;
      }
      ++(is_look ? n_looks : n_plain);
      REQUIRE(calls.collectives == (is_look ? 1 : 0) + of_servo);
      REQUIRE(calls.others == 0);
      // Requests of both directions are started together, where the ghosts are not fresh from a rebuild.
      const HaloCounts counts = simulation.halo_counts();
      const std::uint64_t n_messages = counts.n_messages + counts.n_received + counts.n_news;
      const bool has_messages = n_messages > 0;
      REQUIRE(calls.messages == static_cast<int>(n_messages));
      REQUIRE(calls.waits == (has_messages ? 1 : 0));
    }
    // Most steps are plain ones, even in flows as fast as these.
    CHECK(n_plain > 2 * (n_looks + n_rebuilds));
    CHECK(n_looks + n_rebuilds > 0);
    CHECK((n_gas > 0) == scene.gas.has_value());
  }
}

TEST_CASE("a gas step sends the messages, and makes the reductions, that a projection counts") {
  const World& all = ranks::world();
  enum class Kind { bed, beside_itself, closed };
  for (const Kind kind : {Kind::bed, Kind::beside_itself, Kind::closed}) {
    INFO(static_cast<int>(kind));
    Scene scene = scenes::fluidised_bed();
    scene.gas->cells = {24, 24, 96};
    if (kind == Kind::beside_itself) {
      scene.domain.periodic = {false, true, false};
      scene.gas->cells = {20, 44, 72};
    }
    if (kind == Kind::closed) {  // no outlet: the pressure is free by a constant
      scene.domain.periodic = {true, true, true};
      scene.gas->cells = {24, 36, 48};
      scene.gas->boundaries.clear();
    }
    const std::vector<GrainSeed> grains = make_grains(scene, 1);
    std::vector<GrainSeed> own;
    std::vector<Vec3> positions;
    std::vector<std::int32_t> owners;
    for (const GrainSeed& grain : grains) {  // in layers from left to right, while the gas is cut otherwise
      positions.push_back(grain.position);
      owners.push_back(std::min(static_cast<int>(grain.position.x / scene.domain.high.x * all.size()), all.size() - 1));
      if (owners.back() == all.rank()) own.push_back(grain);
    }
    FieldNeeds needs;
    needs.gas = true;
    Particles particles(needs);
    put_grains(scene, own, particles);
    const GasLayout layout = lay_out_gas(scene, positions, owners, all.size());
    REQUIRE(layout.n_gas_ranks == all.size());
    CHECK(layout.cells_of_root > 0);
    const GasRank& rank = layout.ranks[static_cast<std::size_t>(all.rank())];
    constexpr double step = 1e-3;
    Coupling coupling(scene, gas_grid(scene.domain, *scene.gas), all, 1);
    coupling.advance(particles, 0.0, step);  // opens windows, starts the gas
    for (int i = 1; i < 4; ++i) {
      calls = {};
      const CouplingReport report = coupling.advance(particles, i * step, step);
      const auto of_gas = [&](auto count) {
        return count(rank.flow.step) + report.gas.n_parts * count(rank.flow.part) +
               report.gas.iterations * count(rank.flow.iteration);
      };
      const auto both_ways = [](const GridTraffic& traffic) { return traffic.n_sent + traffic.n_received; };
      // Requests of both directions are started together.
      REQUIRE(calls.messages ==
              both_ways(rank.exchange) + of_gas([&](const Talk& talk) { return both_ways(talk.messages); }));
      REQUIRE(calls.collectives == layout.n_reductions + of_gas([](const Talk& talk) { return talk.n_reductions; }));
      REQUIRE(calls.others == 0);
      CHECK(report.gas.iterations > 0);
    }
  }
}
