// The impact benchmark of Dosta et al. (2024), Comput. Phys. Commun. 296, 109066, case 3 with 25,000 grains: a steel ball hits a
// bed. Positions and results of other codes: data/dosta_impact_25k.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "tests/physics/laboratory.hpp"

using namespace moraine;
using namespace moraine::physics;

namespace {

Scene impact_scene() {
  Scene scene = empty_scene({-0.051, -0.032, -0.0925}, {0.051, 0.032, 0.11}, 5e-7);
  scene.output.fields = {"position", "velocity"};
  scene.time.gravity = {0, 0, -9.81};
  scene.materials = {{"M1", 2500, 1e9, 0.2}, {"steel", 7200, 210e9, 0.2}};
  scene.contact.normal = NormalLaw::hertz;
  scene.contact.tangential = TangentialLaw::mindlin;
  scene.contact.pairs = {pair_law("M1", "M1", 0.5, 0.3), pair_law("M1", "steel", 0.4, 0.2),
                         pair_law("steel", "steel", 0.4, 0.2)};
  // the inner faces of the box, whose walls are of steel; open above
  add_plane(scene, "floor", "steel", {0, 0, -0.0902431}, {0, 0, 1});
  add_plane(scene, "left", "steel", {-0.049, 0, 0}, {1, 0, 0});
  add_plane(scene, "right", "steel", {0.049, 0, 0}, {-1, 0, 0});
  add_plane(scene, "front", "steel", {0, -0.03, 0}, {0, 1, 0});
  add_plane(scene, "back", "steel", {0, 0.03, 0}, {0, -1, 0});
  for (const std::vector<double>& row : read_numbers(data_file("dosta_impact_25k/particles.txt")))
    if (row.size() == 4) add_grain(scene, "M1", row[0], {row[1], row[2], row[3]});
  add_grain(scene, "steel", 0.01, {0, 0, 0.06}, {0, 0, -5});
  return scene;
}

}  // namespace

TEST_CASE("a steel ball enters a bed of 25,000 grains as deep as in other codes", "[.long][dosta]") {
  Simulation run(impact_scene(), std::min(4, n_cores()));
  REQUIRE(run.n_grains() == 25001);
  double at_10 = 0.0, at_20 = 0.0, deepest = 0.0, last = 0.0;
  for (int i = 1; i <= 200000; ++i) {
    run.step();
    if (i % 500 != 0) continue;
    last = state_of(run).position.back().z - 0.06;
    deepest = std::min(deepest, last);
    if (i == 20000) at_10 = last;
    if (i == 40000) at_20 = last;
    if (i % 10000 == 0) report("t = %.3f s: ball at %.5f m", run.time(), last);
  }
  report(
      "ball: %.5f m at 0.01 s (-0.0505 to -0.0507), %.5f m at 0.02 s (-0.1020 to -0.1022), deepest %.5f m (-0.1380 to "
      "-0.1389), at the end %.5f m",
      at_10, at_20, deepest, last);
  CHECK(std::abs(at_10 + 0.0506) < 1.5e-4);
  CHECK(std::abs(at_20 + 0.1021) < 1.5e-4);
  CHECK(deepest > -0.1389 - 5e-5);
  CHECK(deepest < -0.1380 + 5e-5);
}
