#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "io/cli/gas_text.hpp"
#include "tests/unit/scene_text.hpp"

using namespace moraine;
using scene_text::complaint;
using scene_text::read;

namespace {

const std::string gas = "[gas]\ncells = [4, 5, 6]\ndensity = 1.2\nviscosity = 1.8e-5\ndrag = \"gidaspow\"\n";
const std::string outlet = "[[gas.boundary]]\nface = \"z-high\"\ntype = \"pressure\"\n";

Gas gas_of(const std::string& more, const std::vector<std::string>& overrides = {}) {
  return *read(scene_text::all + gas + more, overrides).gas;
}

/// What the reader warns about; REQUIREs that it has nothing worse to say.
std::vector<std::string> warnings(const std::string& text, const std::vector<std::string>& overrides = {}) {
  std::vector<SceneMessage> found;
  REQUIRE(complaint(text, overrides).empty());
  read_scene_text(text, "scene.toml", overrides, "", &found);
  std::vector<std::string> out;
  for (const SceneMessage& message : found) out.push_back(message.text());
  return out;
}

bool has(const std::vector<std::string>& all, const std::string& part) {
  for (const std::string& text : all)
    if (text.find(part) != std::string::npos) return true;
  return false;
}

}  // namespace

TEST_CASE("a scene without [gas] has no gas") { CHECK_FALSE(read(scene_text::all).gas.has_value()); }

TEST_CASE("a gas that gives only what it must has the defaults of the struct for the rest") {
  const Gas read = gas_of("");
  const Gas preset;
  CHECK(read.cells == std::array<int, 3>{4, 5, 6});
  CHECK(read.density == 1.2);
  CHECK(read.viscosity == 1.8e-5);
  CHECK_FALSE(read.step.has_value());
  CHECK(read.drag == DragLaw::gidaspow);
  CHECK(read.model == preset.model);
  CHECK(read.weights == preset.weights);
  CHECK(read.smoothing == preset.smoothing);
  CHECK(read.least_void_fraction == preset.least_void_fraction);
  CHECK(read.moves_gas);
  CHECK(read.velocity == Vec3{});
  CHECK(read.pressure_gradient == Vec3{});
  CHECK(read.tolerance == preset.tolerance);
  CHECK(read.boundaries.empty());
}

TEST_CASE("every key of the gas is read") {
  const Gas read = gas_of(
      "step = 5e-4\nmodel = \"B\"\nweights = \"smoothed\"\nsmoothing = 0.05\nleast_void_fraction = 0.35\n"
      "coupling = \"one_way\"\nvelocity = [1, 2, 3]\ntolerance = 1e-8\n");
  CHECK(read.step == 5e-4);
  CHECK(read.model == GasModel::b);
  CHECK(read.weights == GasWeights::smoothed);
  CHECK(read.smoothing == 0.05);
  CHECK(read.least_void_fraction == 0.35);
  CHECK_FALSE(read.moves_gas);
  CHECK(read.velocity == Vec3{1, 2, 3});
  CHECK(read.tolerance == 1e-8);
  const Scene periodic = moraine::read_scene_text(scene_text::all + gas + "pressure_gradient = [0, -2, 0]\n",
                                                  "scene.toml", {"domain.periodic=[false,true,false]"});
  CHECK(periodic.gas->pressure_gradient == Vec3{0, -2, 0});
}

TEST_CASE("every drag law has its word") {
  const std::vector<std::pair<std::string, DragLaw>> laws = {
      {"gidaspow", DragLaw::gidaspow},   {"wen_yu", DragLaw::wen_yu},
      {"ergun", DragLaw::ergun},         {"syamlal_obrien", DragLaw::syamlal_obrien},
      {"di_felice", DragLaw::di_felice}, {"beetstra", DragLaw::beetstra},
      {"koch_hill", DragLaw::koch_hill}, {"schiller_naumann", DragLaw::schiller_naumann}};
  for (const auto& [word, law] : laws) CHECK(gas_of("", {"gas.drag=" + word}).drag == law);
  CHECK_FALSE(gas_of("", {"gas.drag=none"}).drag.has_value());
}

TEST_CASE("a gas step of \"auto\" leaves the choice to the engine") {
  CHECK_FALSE(gas_of("step = \"auto\"\n").step.has_value());
}

TEST_CASE("boundaries of the gas are read in their order, with their parts") {
  const Gas read = gas_of(
      "[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, 2]\nramp = [[0, 0], [0.5, 1]]\n" +
      outlet +
      "pressure = 12\n[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, 4]\nprofile = "
      "\"parabolic\"\npart = { low = [0.25, 0.2, 0], high = [0.75, 0.8, 0] }\n[[gas.boundary]]\nface = "
      "\"x-high\"\ntype = "
      "\"no_slip\"\nvelocity = [0, 1, 0]\n[[gas.boundary]]\nface = \"y-low\"\ntype = \"free_slip\"\n");
  using Kind = GasBoundary::Kind;
  REQUIRE(read.boundaries.size() == 5);
  const GasBoundary &inlet = read.boundaries[0], &top = read.boundaries[1], &jet = read.boundaries[2];
  CHECK(inlet.kind == Kind::velocity);
  CHECK(inlet.face == 4);
  CHECK(inlet.velocity == Vec3{0, 0, 2});
  CHECK(inlet.profile == GasBoundary::Profile::uniform);
  CHECK(inlet.ramp == std::vector<std::array<double, 2>>{{0, 0}, {0.5, 1}});
  CHECK_FALSE(inlet.part.has_value());
  CHECK(top.kind == Kind::pressure);
  CHECK(top.face == 5);
  CHECK(top.pressure == 12);
  CHECK(jet.profile == GasBoundary::Profile::parabolic);
  CHECK(jet.part == Box{{0.25, 0.2, 0}, {0.75, 0.8, 0}});
  CHECK(read.boundaries[3].kind == Kind::no_slip);
  CHECK(read.boundaries[3].face == 1);
  CHECK(read.boundaries[3].velocity == Vec3{0, 1, 0});
  CHECK(read.boundaries[4].kind == Kind::free_slip);
  CHECK(read.boundaries[4].face == 2);
}

TEST_CASE("a part of a face that lacks a corner takes the domain's") {
  const Gas read = gas_of(
      "[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, 2]\npart = { high = [0.5, 1, 1] }\n" +
      outlet);
  CHECK(read.boundaries[0].part == Box{{0, 0, 0}, {0.5, 1, 1}});
}

TEST_CASE("overrides reach the gas and its boundaries, and what is run is written with them") {
  const std::string text = scene_text::all + gas + outlet;
  const std::vector<std::string> overrides = {"gas.cells=[16,16,50]", "gas.boundary[0].pressure=3",
                                              "gas.boundary[1].face=z-low", "gas.boundary[1].type=velocity",
                                              "gas.boundary[1].velocity=[0,0,1.5]"};
  const auto check = [](const Gas& read) {
    CHECK(read.cells == std::array<int, 3>{16, 16, 50});
    REQUIRE(read.boundaries.size() == 2);
    CHECK(read.boundaries[0].pressure == 3);
    CHECK(read.boundaries[1].velocity == Vec3{0, 0, 1.5});
  };
  check(*read(text, overrides).gas);
  check(*read(scene_text_as_run(text, "scene.toml", overrides, ".")).gas);
}

TEST_CASE("in two dimensions cells along x and y will do, and points too") {
  const std::string flat = "[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 0.1]\ndimensions = 2\n" + scene_text::time +
                           scene_text::material + scene_text::pair + scene_text::particles + gas +
                           "[[probe]]\nkind = \"pressure\"\ninterval = 1\npoints = [[0.5, 0.25]]\n";
  const Scene scene = read(flat, {"gas.cells=[15,90]"});
  CHECK(scene.gas->cells == std::array<int, 3>{15, 90, 1});
  REQUIRE(scene.output.probes.size() == 1);
  CHECK(scene.output.probes[0].points == std::vector<Vec3>{{0.5, 0.25, 0.05}});
}

TEST_CASE("probes of the gas are read with their keys, and are named after their kind") {
  const Scene scene = read(scene_text::all + gas +
                           "[[probe]]\nkind = \"pressure_drop\"\naxis = \"y\"\nbetween = [0.1, 0.4]\ninterval = 0.1\n"
                           "[[probe]]\nkind = \"bed_height\"\nshare = 0.5\ninterval = 0.1\n"
                           "[[probe]]\nkind = \"gas_profile\"\naxis = \"x\"\nfrom = 0.5\ninterval = 0.1\n"
                           "[[probe]]\nkind = \"gas_mean\"\nname = \"means\"\ninterval = 0.1\n");
  const std::vector<Probe>& probes = scene.output.probes;
  REQUIRE(probes.size() == 4);
  CHECK(probes[0].kind == Probe::Kind::pressure_drop);
  CHECK(probes[0].axis == 1);
  CHECK(probes[0].between == std::array<double, 2>{0.1, 0.4});
  CHECK(probes[1].kind == Probe::Kind::bed_height);
  CHECK(probes[1].share == 0.5);
  CHECK(probes[1].name == "bed_height");
  CHECK_FALSE(probes[1].between.has_value());
  CHECK(probes[2].kind == Probe::Kind::gas_profile);
  CHECK(probes[2].from == 0.5);
  CHECK(probes[2].name == "gas_profile");
  CHECK(probes[3].kind == Probe::Kind::gas_mean);
  CHECK(probes[3].name == "means");
}

TEST_CASE("gas can be alone, with a time step of its own") {
  const std::string alone =
      scene_text::domain + scene_text::time + "[gas]\ncells = [4, 4, 4]\ndensity = 1\nviscosity = 1e-3\n";
  const Scene scene = read(alone, {"time.step=0.01"});
  CHECK(scene.particles.empty());
  CHECK_FALSE(scene.gas->drag.has_value());
  CHECK(complaint(alone) ==
        "scene.toml:4: key \"time.step\": is \"auto\", and there are no grains to choose it by; give it a number [s]");
}

TEST_CASE("a probe of the gas in a scene without gas is refused") {
  CHECK(complaint(scene_text::all + "[[probe]]\nkind = \"pressure_drop\"\ninterval = 0.1\n") ==
        "scene.toml:15: key \"probe[0].kind\": \"pressure_drop\" looks at the gas, but the scene has none; add [gas]");
}

TEST_CASE("what comes in may go out by another velocity, part by part") {
  const std::string text =
      scene_text::all + gas +
      "[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, 1]\npart = { high = "
      "[0.5, 1, 1] }\n[[gas.boundary]]\nface = \"z-high\"\ntype = \"velocity\"\nvelocity = [0, 0, 0.5]\n";
  CHECK(complaint(text).empty());
  CHECK_FALSE(complaint(text, {"gas.boundary[1].velocity=[0,0,0.6]"}).empty());
}

TEST_CASE("cells too small for their weights are warned about") {
  const std::string text = scene_text::all + gas;
  CHECK(warnings(text).empty());  // cells of 8 to 12 diameters
  // Cells of 0.05 m: 2.5 diameters.
  CHECK(warnings(text, {"gas.cells=[20,20,20]"}).empty());
  CHECK(has(warnings(text, {"gas.cells=[20,20,20]", "gas.weights=cell"}),
            "key \"gas.cells\": are 0.05 m wide along x, 2.5 times the largest grain: with weights = \"cell\" void "
            "fractions jump as grains pass from cell to cell; use \"trilinear\" or \"smoothed\", or cells of at least "
            "0.06 m"));
  CHECK(has(warnings(text, {"gas.cells=[20,20,64]"}),
            "along z, 0.781 times the largest grain: with weights = \"trilinear\""));
  CHECK(warnings(text, {"gas.cells=[64,64,64]", "gas.weights=smoothed", "gas.smoothing=0.02"}).empty());
}

TEST_CASE("a gas step shorter than a grain step is warned about") {
  CHECK(has(
      warnings(scene_text::all + gas, {"time.step=1e-4", "gas.step=1e-5"}),
      "key \"gas.step\": is 1e-05 s, shorter than the grain step, time.step = 0.0001 s: the gas step will be as long "
      "as that"));
}

TEST_CASE("a boundary that others cover is warned about") {
  CHECK(has(
      warnings(scene_text::all + gas + outlet + "[[gas.boundary]]\nface = \"z-high\"\ntype = \"no_slip\"\n"),
      "key \"gas.boundary[0]\": (type = \"pressure\") does nothing: later entries cover all of it, and they go before "
      "it"));
}

TEST_CASE("what is checked of the gas is said in words") {
  const std::string text = scene_text::all + gas +
                           "step = 1e-3\n[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, "
                           "2]\nramp = [[0, 0], [0.5, 1]]\n" +
                           outlet + "[[gas.boundary]]\nface = \"x-low\"\ntype = \"no_slip\"\nvelocity = [0, 1, 0]\n";
  CHECK(gas_lines(read(text), 3e-4, 3) ==
        std::vector<std::string>{
            "4 x 5 x 6 cells of 0.25 x 0.2 x 0.1667 m, 12.5 x 10 x 8.33 grain diameters", "1.2 kg/m3, 1.8e-05 Pa s",
            "gas step 0.0009 s, 3 grain steps (at most 0.001 s was asked for)",
            "drag of Gidaspow, model A, grains spread over the eight nearest cells",
            "z-low: gas comes in at (0, 0, 2) m/s, times 0 at 0 s, 1 at 0.5 s", "z-high: outlet at 0 Pa",
            "x-low: wall that moves at (0, 1, 0) m/s", "x-high, y-low, y-high: walls",
            "void fraction taken as at least 0.3, mass imbalance of a cell at most 1.0e-06 of its gas; the fastest "
            "boundary "
            "crosses a cell in 0.0833 s"});
  CHECK(gas_lines(read(scene_text::all), 3e-4, 3).empty());
}

TEST_CASE("walls that the gas does not see are warned about") {
  const std::string text = scene_text::all + gas;
  CHECK(
      has(warnings(text + "[[wall]]\nname = \"tube\"\ncylinder = { base = [0.5, 0.5, 0], radius = 0.5, length = 1 }\n"),
          "key \"wall[0]\": (\"tube\") stands inside the domain, and the gas does not see it"));
  CHECK(warnings(text + "[[wall]]\nname = \"box\"\nbox = {}\n").empty());
  CHECK(warnings(text + "[[wall]]\nname = \"floor\"\nplane = { point = [0, 0, 0], normal = \"z\" }\n").empty());
  CHECK(has(warnings(text + "[[wall]]\nname = \"shelf\"\nplane = { point = [0, 0, 0.1], normal = \"z\" }\n"),
            "\"shelf\""));
}
