// Broken scenes with gas, each with exactly what the reader says about it.
#include <catch2/catch.hpp>

#include "tests/unit/scene_text.hpp"

using scene_text::complaint;

namespace {

/// A sound scene of which one line at a time is broken. Line numbers in the messages are those below.
const std::string sound = R"([domain]
low = [0, 0, 0]
high = [1, 1, 1]
[time]
end = 2.0
[[material]]
name = "glass"
density = 2500
young = 1e7
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
between = ["glass", "glass"]
normal_stiffness = 1000
restitution = 0.9
friction = 0.3
[[particles]]
material = "glass"
diameter = 0.02
fill = { count = 10 }
[[wall]]
name = "floor"
material = "glass"
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
[[probe]]
kind = "wall_force"
wall = "floor"
interval = 0.1
[gas]
cells = [10, 10, 20]
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
[[gas.boundary]]
face = "z-low"
type = "velocity"
velocity = [0, 0, 0.5]
[[gas.boundary]]
face = "z-high"
type = "pressure"
)";

struct Broken {
  const char* what;
  std::string line;  // of the sound scene; empty: the new text is added at the end
  std::string becomes;
  std::string message;  // without "scene.toml:"
};

std::string broken(const Broken& scene) {
  if (scene.line.empty()) return sound + scene.becomes + "\n";
  const std::size_t at = ("\n" + sound).find("\n" + scene.line + "\n");
  REQUIRE(at != std::string::npos);
  return sound.substr(0, at) + scene.becomes + sound.substr(at + scene.line.size());
}

const std::vector<Broken> table = {
    {"no cells", "cells = [10, 10, 20]", "",
     "30: key \"gas.cells\": missing; expected [x, y, z], whole numbers: cells of the gas along each side of the "
     "domain; in two dimensions [x, y] will do"},
    {"two cells in three dimensions", "cells = [10, 10, 20]", "cells = [10, 10]",
     "31: key \"gas.cells\" = [10, 10]: expected [x, y, z], three whole numbers, such as [20, 20, 40]"},
    {"half a cell", "cells = [10, 10, 20]", "cells = [10, 10, 20.5]",
     "31: key \"gas.cells[2]\" = 20.5: expected a whole number"},
    {"no cells along y", "cells = [10, 10, 20]", "cells = [10, 0, 20]",
     "31: key \"gas.cells[1]\": is 0; expected 1 or more"},
    {"cells without end", "cells = [10, 10, 20]", "cells = [100000, 100000, 100000]",
     "31: key \"gas.cells\": is [100000, 100000, 100000]: 1e+15 cells; at most 1e+10 are possible"},
    {"two dimensions, many cells thick", "high = [1, 1, 1]", "high = [1, 1, 1]\ndimensions = 2",
     "32: key \"gas.cells[2]\": is 20; expected 1: in two dimensions the grid is one cell thick\n37: key "
     "\"gas.boundary[0].face\": is \"z-low\", but in two dimensions the gas does not move along z\n41: key "
     "\"gas.boundary[1].face\": is \"z-high\", but in two dimensions the gas does not move along z"},
    {"no density", "density = 1.2", "", "30: key \"gas.density\": missing; expected a number [kg/m3]: density"},
    {"negative density", "density = 1.2", "density = -1.2",
     "32: key \"gas.density\": is -1.2; expected a number greater than 0 [kg/m3]"},
    {"negative viscosity", "viscosity = 1.8e-5", "viscosity = -1",
     "33: key \"gas.viscosity\": is -1; expected 0 or more [Pa s]"},
    {"drag without viscosity", "viscosity = 1.8e-5", "viscosity = 0",
     "33: key \"gas.viscosity\": is 0; expected more than 0 [Pa s]: drag laws go by Reynolds' number, and without "
     "viscosity there is none"},
    {"viscosity by its letter", "viscosity = 1.8e-5", "viscosity = 1.8e-5\nmu = 1",
     "34: key \"gas.mu\" = 1: unknown key; did you mean \"viscosity\"?"},
    {"no drag law", "drag = \"gidaspow\"", "",
     "30: key \"gas.drag\": missing; expected \"gidaspow\", \"wen_yu\", \"ergun\", \"syamlal_obrien\", \"di_felice\", "
     "\"beetstra\", \"koch_hill\", \"schiller_naumann\" or \"none\": drag law between gas and grains; needed where "
     "there are grains"},
    {"unknown drag law", "drag = \"gidaspow\"", "drag = \"gidaspov\"",
     "34: key \"gas.drag\" = \"gidaspov\": expected one of \"gidaspow\", \"wen_yu\", \"ergun\", \"syamlal_obrien\", "
     "\"di_felice\", \"beetstra\", \"koch_hill\", \"schiller_naumann\" or \"none\"; did you mean \"gidaspow\"?"},
    {"unknown model", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nmodel = \"C\"",
     "35: key \"gas.model\" = \"C\": expected one of \"A\" or \"B\""},
    {"unknown coupling", "drag = \"gidaspow\"", "drag = \"gidaspow\"\ncoupling = \"both\"",
     "35: key \"gas.coupling\" = \"both\": expected one of \"two_way\" or \"one_way\""},
    {"gas step of nothing", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nstep = 0",
     "35: key \"gas.step\": is 0; expected a number greater than 0 [s]"},
    {"gas step that is no number", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nstep = \"fast\"",
     "35: key \"gas.step\" = \"fast\": expected \"auto\" or a number [s]"},
    {"smoothed over nothing", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nweights = \"smoothed\"",
     "30: key \"gas.smoothing\": is 0; weights = \"smoothed\" needs a length greater than 0 [m]"},
    {"smoothing that does nothing", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nsmoothing = 0.01",
     "35: key \"gas.smoothing\": is 0.01 m; it goes with weights = \"smoothed\" only"},
    {"no least void fraction", "drag = \"gidaspow\"", "drag = \"gidaspow\"\nleast_void_fraction = 0",
     "35: key \"gas.least_void_fraction\": is 0; expected more than 0 and less than 1"},
    {"no tolerance", "drag = \"gidaspow\"", "drag = \"gidaspow\"\ntolerance = 0",
     "35: key \"gas.tolerance\": is 0; expected more than 0 and less than 1, 1e-6 is usual"},
    {"mean gradient between walls", "drag = \"gidaspow\"", "drag = \"gidaspow\"\npressure_gradient = [1, 0, 0]",
     "35: key \"gas.pressure_gradient\": is 1 Pa/m along x, which is not periodic: there the boundaries drive the gas; "
     "expected 0"},
    {"one boundary where a list belongs",
     "[[gas.boundary]]\nface = \"z-low\"\ntype = \"velocity\"\nvelocity = [0, 0, 0.5]\n[[gas.boundary]]\nface = "
     "\"z-high\"\ntype = \"pressure\"",
     "[gas.boundary]\nface = \"z-high\"\ntype = \"pressure\"",
     "35: key \"gas.boundary\" = { face = \"z-high\", type = \"pressure\" }: expected a list of tables, found one "
     "table; write [[gas.boundary]] with two brackets"},
    {"boundary without face", "face = \"z-low\"", "",
     "35: key \"gas.boundary[0].face\": missing; expected \"x-low\", \"x-high\", \"y-low\", \"y-high\", \"z-low\" or "
     "\"z-high\": the face of the domain"},
    {"boundary of an unknown face", "face = \"z-low\"", "face = \"bottom\"",
     "36: key \"gas.boundary[0].face\" = \"bottom\": expected one of \"x-low\", \"x-high\", \"y-low\", \"y-high\", "
     "\"z-low\" or \"z-high\""},
    {"boundary without type", "type = \"pressure\"", "",
     "39: key \"gas.boundary[1].type\": missing; expected \"velocity\", \"pressure\", \"no_slip\" or \"free_slip\": "
     "velocity: gas comes in (or is drawn off) as given; pressure: it goes as it likes; no_slip: a wall that it sticks "
     "to; free_slip: a smooth wall"},
    {"boundary of an unknown type", "type = \"pressure\"", "type = \"presure\"",
     "41: key \"gas.boundary[1].type\" = \"presure\": expected one of \"velocity\", \"pressure\", \"no_slip\" or "
     "\"free_slip\"; did you mean \"pressure\"?"},
    {"boundary on a periodic face", "high = [1, 1, 1]", "high = [1, 1, 1]\nperiodic = [false, false, true]",
     "37: key \"gas.boundary[0].face\": is \"z-low\", but the domain is periodic along z: the gas has no boundary "
     "there\n41: key \"gas.boundary[1].face\": is \"z-high\", but the domain is periodic along z: the gas has no "
     "boundary there"},
    {"inlet along its face", "velocity = [0, 0, 0.5]", "velocity = [0.5, 0, 0]",
     "38: key \"gas.boundary[0].velocity\": is [0.5, 0, 0]: nothing comes in along z; give it a component along z, or "
     "use type = \"no_slip\" for a wall that moves"},
    {"wall through itself", "type = \"velocity\"", "type = \"no_slip\"",
     "38: key \"gas.boundary[0].velocity\": has a component of 0.5 m/s along z, through the wall; a wall moves along "
     "itself only: use type = \"velocity\" for gas that comes in"},
    {"velocity of an outlet", "type = \"pressure\"", "type = \"pressure\"\nvelocity = [0, 0, 1]",
     "42: key \"gas.boundary[1].velocity\" = [0, 0, 1]: goes with type velocity and no_slip only"},
    {"ramp of a smooth wall", "type = \"pressure\"", "type = \"free_slip\"\nramp = [[0, 0], [1, 1]]",
     "42: key \"gas.boundary[1].ramp\" = [[0, 0], [1, 1]]: goes with type velocity and no_slip only"},
    {"pressure of an inlet", "type = \"velocity\"", "type = \"velocity\"\npressure = 3",
     "38: key \"gas.boundary[0].pressure\" = 3: goes with type pressure only"},
    {"profile of a wall", "type = \"pressure\"", "type = \"no_slip\"\nprofile = \"parabolic\"",
     "42: key \"gas.boundary[1].profile\" = \"parabolic\": goes with type velocity only"},
    {"unknown profile", "type = \"velocity\"", "type = \"velocity\"\nprofile = \"round\"",
     "38: key \"gas.boundary[0].profile\" = \"round\": expected one of \"uniform\" or \"parabolic\""},
    {"ramp back in time", "type = \"velocity\"", "type = \"velocity\"\nramp = [[0, 0], [1, 0.5], [0.5, 1]]",
     "38: key \"gas.boundary[0].ramp[2][0]\": is 0.5; expected more than 1, the time before it [s]"},
    {"ramp of one number", "type = \"velocity\"", "type = \"velocity\"\nramp = [0, 1]",
     "38: key \"gas.boundary[0].ramp\" = [0, 1]: expected a list of [time, factor], such as [[0, 0], [1, 1]]"},
    {"ramp with a word", "type = \"velocity\"", "type = \"velocity\"\nramp = [[0, 0], [\"1 s\", 1]]",
     "38: key \"gas.boundary[0].ramp[1][0]\" = \"1 s\": expected a number in SI units [s]; write 1"},
    {"ramp to infinity", "type = \"velocity\"", "type = \"velocity\"\nramp = [[0, 0], [1, inf]]",
     "38: key \"gas.boundary[0].ramp[1][1]\": is inf; expected a finite number [-]"},
    {"part between two centres", "type = \"velocity\"",
     "type = \"velocity\"\npart = { low = [0.46, 0.4, 0], high = [0.54, 0.6, 1] }",
     "38: key \"gas.boundary[0].part\": covers no cell: no centre of a cell of 0.1 x 0.1 m lies in it; make it larger, "
     "or the cells smaller"},
    {"part inside out", "type = \"velocity\"",
     "type = \"velocity\"\npart = { low = [0.6, 0.4, 0], high = [0.4, 0.6, 1] }",
     "38: key \"gas.boundary[0].part.high[0]\": is 0.4; expected more than low[0] = 0.6 [m]"},
    {"part away from its face", "type = \"velocity\"",
     "type = \"velocity\"\npart = { low = [0.4, 0.4, 0.5], high = [0.6, 0.6, 1] }",
     "38: key \"gas.boundary[0].part\": reaches from 0.5 to 1 m along z, not to the face \"z-low\" at 0 m"},
    {"no outlet", "type = \"pressure\"", "type = \"no_slip\"",
     "35: key \"gas.boundary\": lets 0.5 m3/s in and 0 m3/s out at 0 s, and the gas cannot be pressed together; add "
     "[[gas.boundary]] with type = \"pressure\" where it can leave"},
    {"outlet under a wall", "", "[[gas.boundary]]\nface = \"z-high\"\ntype = \"free_slip\"",
     "35: key \"gas.boundary\": lets 0.5 m3/s in and 0 m3/s out at 0 s, and the gas cannot be pressed together; add "
     "[[gas.boundary]] with type = \"pressure\" where it can leave"},
    {"out and in out of step", "type = \"pressure\"",
     "type = \"velocity\"\nvelocity = [0, 0, 0.5]\nramp = [[0, 0], [1, 1]]",
     "35: key \"gas.boundary\": lets 0.5 m3/s in and 0 m3/s out at 0 s, and the gas cannot be pressed together; add "
     "[[gas.boundary]] with type = \"pressure\" where it can leave"},
    {"probe of pressure nowhere", "", "[[probe]]\nkind = \"pressure\"\ninterval = 0.1",
     "42: key \"probe[1].points\": missing: kind = \"pressure\" needs at least one point [m]"},
    {"probe of pressure outside", "",
     "[[probe]]\nkind = \"pressure\"\ninterval = 0.1\npoints = [[0.5, 0.5, 0.5], [0.5, 0.5, 1.5]]",
     "45: key \"probe[1].points[1]\": is [0.5, 0.5, 1.5] m, outside the domain, [0, 0, 0] to [1, 1, 1] m"},
    {"probe of pressure at text", "", "[[probe]]\nkind = \"pressure\"\ninterval = 0.1\npoints = \"middle\"",
     "45: key \"probe[1].points\" = \"middle\": expected a list of places, such as [[0.1, 0.2, 0.3]], found text"},
    {"pressure drop upside down", "", "[[probe]]\nkind = \"pressure_drop\"\ninterval = 0.1\nbetween = [0.5, 0.1]",
     "45: key \"probe[1].between[1]\": is 0.1; expected more than between[0] = 0.5 [m]"},
    {"pressure drop beyond the domain", "", "[[probe]]\nkind = \"pressure_drop\"\ninterval = 0.1\nbetween = [0.5, 1.1]",
     "45: key \"probe[1].between\": reaches from 0.5 to 1.1 m, beyond the domain, 0 to 1 m along z"},
    {"pressure drop with one plane", "", "[[probe]]\nkind = \"pressure_drop\"\ninterval = 0.1\nbetween = 0.5",
     "45: key \"probe[1].between\" = 0.5: expected [low, high], two numbers [m], found a number"},
    {"pressure drop around", "high = [1, 1, 1]",
     "high = [1, 1, 1]\nperiodic = [true, false, false]\n[[probe]]\nkind = \"pressure_drop\"\naxis = \"x\"\ninterval = "
     "0.1",
     "5: key \"probe[0].between\": missing: the domain is periodic along x, so that it has no faces there"},
    {"bed height of all and more", "", "[[probe]]\nkind = \"bed_height\"\ninterval = 0.1\nshare = 1.5",
     "45: key \"probe[1].share\": is 1.5; expected more than 0 and at most 1"},
    {"profile of nowhere", "",
     "[[probe]]\nkind = \"gas_profile\"\ninterval = 0.1\nregion = { low = [2, 2, 2], high = [3, 3, 3] }",
     "45: key \"probe[1].region\": reaches from [2, 2, 2] to [3, 3, 3] m, nowhere inside the domain, [0, 0, 0] to [1, "
     "1, 1] m"},
    {"averages before the start", "", "[[probe]]\nkind = \"gas_mean\"\ninterval = 0.1\nfrom = -1",
     "45: key \"probe[1].from\": is -1; expected 0 or more [s]"},
    {"misspelt key of a boundary", "type = \"velocity\"", "type = \"velocity\"\nprofil = \"parabolic\"",
     "38: key \"gas.boundary[0].profil\" = \"parabolic\": unknown key; did you mean \"profile\"?"},
};

}  // namespace

TEST_CASE("the scene with gas that the table breaks is sound") { CHECK(complaint(sound).empty()); }

TEST_CASE("every broken scene with gas is refused with exactly its message") {
  for (const Broken& scene : table) {
    DYNAMIC_SECTION(scene.what) {
      std::string said = complaint(broken(scene));
      const std::string origin = "scene.toml:";
      for (std::size_t at; (at = said.find(origin)) != std::string::npos;) said.erase(at, origin.size());
      CHECK(said == scene.message);
    }
  }
}
