// Broken scenes, each with exactly what the reader says about it.
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
    // keys
    {"unknown key", "diameter = 0.02", "diametr = 0.02",
     "20: key \"particles[0].diametr\" = 0.02: unknown key; did you mean \"diameter\"?"},
    {"unknown key with its usual other name", "diameter = 0.02", "diameter = 0.02\nradius = 0.01",
     "21: key \"particles[0].radius\" = 0.01: unknown key; did you mean \"diameter\"?"},
    {"key of another table", "end = 2.0", "end = 2.0\nfriction = 0.3",
     "6: key \"time.friction\" = 0.3: unknown key; it belongs in contact.pair"},
    {"key like no other", "end = 2.0", "end = 2.0\nqqqqqq = 1",
     "6: key \"time.qqqqqq\" = 1: unknown key; known keys of time: end, step, steps_per_contact, max_speed, gravity, "
     "damping"},
    {"unknown table", "", "[[partikles]]\na = 1",
     "30: key \"partikles\" = [{ a = 1 }]: unknown key; did you mean \"particles\"?"},
    {"missing key", "end = 2.0", "",
     "4: key \"time.end\": missing; expected a number [s]: simulated time at which the run ends"},
    {"missing name", "name = \"floor\"", "",
     "22: key \"wall[0].name\": missing; expected text: name by which probes refer to it"},
    {"one table where a list belongs", "[[particles]]", "[particles]",
     "18: key \"particles\" = { material = \"glass\", diameter = 0.02, fill = { count =  ...: expected a list of "
     "tables, found one table; write "
     "[[particles]] with two brackets"},
    {"precision that is not", "", "[run]\nprecision = \"single\"",
     "31: key \"run.precision\" = \"single\": expected one of \"double\" or \"mixed\""},
    {"balance that is not", "", "[run]\nbalance = \"ranks\"",
     "31: key \"run.balance\" = \"ranks\": expected one of \"auto\", \"threads\", \"cuts\" or \"off\""},
    {"a sweep over nothing that can be stepped", "", "[pareto]\nsteps_per_contact = [20, 1.5]",
     "31: key \"pareto.steps_per_contact\" = [20, 1.5]: expected numbers from 2, found 1.5"},
    {"an acceptable error of nothing", "", "[pareto]\naccept = 0",
     "31: key \"pareto.accept\" = 0: expected a number above 0"},
    {"a variant without a name", "", "[[pareto.variant]]\nset = [\"run.skin=0.001\"]",
     "30: key \"pareto.variant[0].name\": missing; expected text: name in tables and plots"},
    // types and units
    {"text for a number, with a unit", "diameter = 0.02", "diameter = \"4 mm\"",
     "20: key \"particles[0].diameter\" = \"4 mm\": expected a number in SI units [m]; write 0.004"},
    {"stiffness in other units", "normal_stiffness = 1000", "normal_stiffness = \"2.5 kN/m\"",
     "15: key \"contact.pair[0].normal_stiffness\" = \"2.5 kN/m\": expected a number in SI units [N/m]; write 2500"},
    {"a unit of another kind", "end = 2.0", "end = \"2 m\"",
     "5: key \"time.end\" = \"2 m\": expected a number in SI units [s], found text"},
    {"true for a number", "end = 2.0", "end = true",
     "5: key \"time.end\" = true: expected a number [s], found true or false"},
    {"number for a word", "tangential = \"spring\"", "tangential = 1",
     "12: key \"contact.tangential\" = 1: expected one of \"none\", \"viscous\", \"spring\", \"mindlin\" or \"power\", "
     "found a number"},
    {"number for text", "name = \"floor\"", "name = 1",
     "23: key \"wall[0].name\" = 1: expected text in quotes, found a number"},
    {"misspelt word", "tangential = \"spring\"", "tangential = \"sprnig\"",
     "12: key \"contact.tangential\" = \"sprnig\": expected one of \"none\", \"viscous\", \"spring\", \"mindlin\" or "
     "\"power\"; did you mean "
     "\"spring\"?"},
    {"two numbers for a vector", "low = [0, 0, 0]", "low = [0, 0]",
     "2: key \"domain.low\" = [0, 0]: expected [x, y, z], three numbers [m], found a list of 2"},
    {"text in a vector", "low = [0, 0, 0]", "low = [0, \"1 cm\", 0]",
     "2: key \"domain.low[1]\" = \"1 cm\": expected a number in SI units [m]; write 0.01"},
    {"half a grain", "fill = { count = 10 }", "fill = { count = 10.5 }",
     "21: key \"particles[0].fill.count\" = 10.5: expected a whole number"},
    // domain and time
    {"domain inside out", "high = [1, 1, 1]", "high = [1, -1, 1]",
     "3: key \"domain.high[1]\": is -1; expected more than low[1] = 0 [m]"},
    {"four dimensions", "high = [1, 1, 1]", "high = [1, 1, 1]\ndimensions = 4",
     "4: key \"domain.dimensions\": is 4; expected 2 or 3"},
    {"zero step", "end = 2.0", "end = 2.0\nstep = 0",
     "6: key \"time.step\": is 0; expected a number greater than 0 [s]"},
    {"negative step", "end = 2.0", "end = 2.0\nstep = -1e-5",
     "6: key \"time.step\": is -1e-05; expected a number greater than 0 [s]"},
    {"step longer than the run", "end = 2.0", "end = 2.0\nstep = 3",
     "6: key \"time.step\": is 3 s, longer than the whole run (time.end = 2 s)"},
    {"a step that is no number", "end = 2.0", "end = 2.0\nstep = \"fast\"",
     "6: key \"time.step\" = \"fast\": expected \"auto\" or a number [s]"},
    {"too few steps in a contact", "end = 2.0", "end = 2.0\nsteps_per_contact = 2",
     "6: key \"time.steps_per_contact\": is 2; a contact cannot be followed in fewer than 5 steps, 50 are usual"},
    {"an end that is not finite", "end = 2.0", "end = nan",
     "5: key \"time.end\": is nan; expected a number greater than 0 [s]"},
    // materials and contact
    {"no density", "density = 2500", "density = 0",
     "8: key \"material[0].density\": is 0; expected a number greater than 0 [kg/m3]"},
    {"impossible poisson", "young = 1e7", "poisson = 0.6",
     "9: key \"material[0].poisson\": is 0.6; expected more than -1 and at most 0.5"},
    {"two of one name", "young = 1e7", "[[material]]\nname = \"glass\"",
     "10: key \"material[1].name\": \"glass\" is the name of material[0] too; names must differ"},
    {"unlisted combination", "tangential = \"spring\"", "tangential = \"mindlin\"",
     "12: key \"contact.tangential\": \"mindlin\" cannot be combined with normal = \"linear\"; nearest: normal = "
     "\"linear\" with tangential = "
     "\"spring\", or normal = \"hertz\" with \"mindlin\"; with \"linear\" there are \"none\", \"viscous\", \"spring\", "
     "\"power\""},
    {"rolling without rotation", "tangential = \"spring\"",
     "tangential = \"spring\"\nrolling = \"spring\"\nrotation = false",
     "13: key \"contact.rolling\": \"spring\" needs rotation = true: grains that do not rotate do not roll"},
    {"rolling with another tangential law", "tangential = \"spring\"", "tangential = \"power\"\nrolling = \"constant\"",
     "13: key \"contact.rolling\": \"constant\" cannot be combined with tangential = \"power\"; nearest: tangential = "
     "\"spring\" with normal = \"linear\" (friction = 0 leaves tangential forces out)"},
    {"cohesion that needs Hertz", "tangential = \"spring\"", "tangential = \"spring\"\ncohesion = \"jkr\"",
     "13: key \"contact.cohesion\": \"jkr\" cannot be combined with normal = \"linear\"; nearest: normal = \"hertz\" "
     "with "
     "tangential = \"mindlin\", or cohesion = \"linear\" or \"sjkr\" with normal = \"linear\""},
    {"a bridge without a liquid", "[[contact.pair]]",
     "cohesion = \"liquid_bridge\"\n[[contact.pair]]\nsurface_tension = 0.07",
     "14: key \"contact.pair[0].liquid_volume\": missing: a liquid bridge needs both surface_tension [N/m] and "
     "liquid_volume "
     "[m3]; a pair without either has no bridges"},
    {"unknown material of a pair", "between = [\"glass\", \"glass\"]", "between = [\"glass\", \"glas\"]",
     "14: key \"contact.pair[0].between[1]\": \"glas\" is not a material; did you mean \"glass\"?"},
    {"missing pair", "young = 1e7",
     "[[material]]\nname = \"steel\"\n[[wall]]\nname = \"lid\"\nmaterial = \"steel\"\nbox = {}",
     "18: key \"contact.pair\": missing for \"glass\" and \"steel\", which can meet; add [[contact.pair]] with between "
     "= [\"glass\", "
     "\"steel\"], or one without `between` for all pairs not named"},
    {"pair given twice", "", "[[contact.pair]]\nbetween = [\"glass\", \"glass\"]\nnormal_stiffness = 1",
     "31: key \"contact.pair[1].between\": [\"glass\", \"glass\"] was given before, by contact.pair[0]"},
    {"no stiffness", "normal_stiffness = 1000", "",
     "13: key \"contact.pair[0].normal_stiffness\": is 0; expected a number greater than 0 [N/m]"},
    {"restitution of nothing", "restitution = 0.9", "restitution = 0",
     "16: key \"contact.pair[0].restitution\": is 0; expected more than 0 and at most 1"},
    {"restitution above one", "restitution = 0.9", "restitution = 1.1",
     "16: key \"contact.pair[0].restitution\": is 1.1; expected more than 0 and at most 1"},
    {"negative friction", "friction = 0.3", "friction = -0.3",
     "17: key \"contact.pair[0].friction\": is -0.3; expected 0 or more [-]"},
    // grains
    {"negative diameter", "diameter = 0.02", "diameter = -0.02",
     "20: key \"particles[0].diameter\": is -0.02; expected a number greater than 0 [m]"},
    {"range the wrong way round", "diameter = 0.02", "diameter = [0.03, 0.02]",
     "20: key \"particles[0].diameter.high\": is 0.02; expected at least low = 0.03 [m]"},
    {"weights of other number than values", "diameter = 0.02",
     "diameter = { distribution = \"list\", values = [0.01, 0.02], weights = [1] }",
     "20: key \"particles[0].diameter.weights\": has 1 entries for 2 values; expected one each"},
    {"mean for a uniform distribution", "diameter = 0.02",
     "diameter = { distribution = \"uniform\", low = 0.01, high = 0.02, mean = 0.015 }",
     "20: key \"particles[0].diameter.mean\" = 0.015: does not go with distribution = \"uniform\""},
    {"no diameter", "diameter = 0.02", "",
     "18: key \"particles[0].diameter\": missing; expected a number, [low, high] or table [m]: diameter of the grains: "
     "one, uniform between two, "
     "or a distribution; not needed where a file gives sizes"},
    {"unknown material", "material = \"glass\"\ndiameter = 0.02", "material = \"galss\"\ndiameter = 0.02",
     "19: key \"particles[0].material\": \"galss\" is not a material; did you mean \"glass\"?"},
    {"denser than spheres can be", "fill = { count = 10 }", "fill = { solid_fraction = 0.8 }",
     "21: key \"particles[0].fill.solid_fraction\": is 0.8; expected more than 0 and less than 0.74 (random packings "
     "reach about 0.6)"},
    {"count and fraction", "fill = { count = 10 }", "fill = { count = 10, solid_fraction = 0.3 }",
     "21: key \"particles[0].fill\": has solid_fraction and count; expected exactly one of them"},
    {"two kinds of fill", "fill = { count = 10 }", "fill = { lattice = \"cubic\", positions = [[0.5, 0.5, 0.5]] }",
     "21: key \"particles[0].fill\": has lattice and positions; expected exactly one kind of fill of: solid_fraction "
     "or count, lattice, file, positions"},
    {"no kind of fill", "fill = { count = 10 }", "fill = {}",
     "21: key \"particles[0].fill\": has no kind of fill; expected exactly one kind of fill of: solid_fraction or "
     "count, lattice, file, positions"},
    {"spacing without lattice", "fill = { count = 10 }", "fill = { count = 10, spacing = 0.1 }",
     "21: key \"particles[0].fill.spacing\" = 0.1: goes with lattice only"},
    {"region outside the domain", "fill = { count = 10 }",
     "fill = { count = 10, region = { box = { high = [1, 1, 2] } } }",
     "21: key \"particles[0].fill.region\": reaches from [0, 0, 0] to [1, 1, 2] m; outside the domain, [0, 0, 0] to "
     "[1, 1, 1] m"},
    {"region of two shapes", "fill = { count = 10 }",
     "fill = { count = 1, region = { box = {}, sphere = { centre = [0.5, 0.5, 0.5], radius = 0.1 } } }",
     "21: key \"particles[0].fill.region\": has box and sphere; expected exactly one shape of: box, cylinder, sphere"},
    {"lattice closer than the grains", "fill = { count = 10 }", "fill = { lattice = \"cubic\", spacing = 0.01 }",
     "21: key \"particles[0].fill.spacing\": is 0.01 m, less than the largest diameter, 0.02 m: grains would overlap"},
    {"more grains than can be counted", "fill = { count = 10 }", "fill = { lattice = \"cubic\", count = 5000000000 }",
     "21: key \"particles[0].fill.count\": is 5000000000; a group cannot hold more than 2147483648 grains"},
    {"a lattice of dust", "diameter = 0.02\nfill = { count = 10 }", "diameter = 1e-5\nfill = { lattice = \"cubic\" }",
     "21: key \"particles[0].fill.lattice\": has about 1e+15 sites 1e-05 m apart in its region; at most 2147483648 are "
     "possible"},
    {"a fill of dust", "diameter = 0.02\nfill = { count = 10 }", "diameter = 1e-5\nfill = { solid_fraction = 0.5 }",
     "21: key \"particles[0].fill.solid_fraction\": is 0.5: that takes about 9.55e+14 grains; a group cannot hold more "
     "than "
     "2147483648"},
    {"grain outside the domain", "fill = { count = 10 }",
     "fill = { positions = [[0.5, 0.5, 0.5], [0.5, 0.5, 1.5], [2, 0, 0]] }",
     "21: key \"particles[0].fill.positions\": grain 1 is at [0.5, 0.5, 1.5] m, outside the domain, [0, 0, 0] to [1, "
     "1, 1] m (2 of 3 grains)"},
    {"overlap at the start", "fill = { count = 10 }",
     "fill = { positions = [[0.5, 0.5, 0.5], [0.5, 0.5, 0.517], [0.5, 0.5, 0.507]] }",
     "21: key \"particles[0].fill.positions\": grain 0 of particles[0] and grain 2 of particles[0] overlap by 0.013 m, "
     "130 % of the smaller "
     "radius; at most 20 % is allowed at the start (3 pairs beyond it)"},
    {"no grains at all", "fill = { count = 10 }", "fill = { positions = [] }",
     "21: key \"particles[0].fill.positions\": lists no grains"},
    {"missing list of grains", "fill = { count = 10 }", "fill = { file = \"none.csv\" }",
     "21: key \"particles[0].fill.file\" = \"none.csv\": no such file: FILES/none.csv"},
    {"list of grains with a word in it", "fill = { count = 10 }", "fill = { file = \"bad.csv\" }",
     "21: key \"particles[0].fill.file\" = \"bad.csv\": FILES/bad.csv:3: column 2 (\"y\"): \"two\" is not a number"},
    {"negative radius in a list of grains", "fill = { count = 10 }", "fill = { file = \"negative.csv\" }",
     "21: key \"particles[0].fill.file\": grain 1 of negative.csv has a radius of -0.01 m; expected more than 0 (1 of "
     "2 grains)"},
    // walls
    {"wall without shape", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "",
     "22: key \"wall[0]\": has no shape; expected exactly one shape of: plane, box, cylinder, cone, disc, mesh"},
    {"wall of two shapes", "name = \"floor\"", "name = \"floor\"\nbox = {}",
     "22: key \"wall[0]\": has plane and box; expected exactly one shape of: plane, box, cylinder, cone, disc, mesh"},
    {"normal without length", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }",
     "plane = { point = [0, 0, 0], normal = [0, 0, 0] }",
     "25: key \"wall[0].plane.normal\": is [0, 0, 0]; expected a direction, which has a length"},
    {"mirror that is not flat", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "box = {}\nsymmetry = true",
     "26: key \"wall[0].symmetry\": is true; only a plane can be a symmetry plane"},
    {"wall that ends before it begins", "name = \"floor\"", "name = \"floor\"\nfrom = 2\nuntil = 1",
     "25: key \"wall[0].until\": is 1; expected more than from = 2 [s]"},
    {"missing mesh", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "mesh = { file = \"none.stl\" }",
     "25: key \"wall[0].mesh.file\" = \"none.stl\": no such file: FILES/none.stl"},
    {"empty mesh", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "mesh = { file = \"empty.stl\" }",
     "25: key \"wall[0].mesh.file\" = \"empty.stl\": the file is empty: FILES/empty.stl"},
    {"mesh of another kind", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "mesh = { file = \"bad.csv\" }",
     "25: key \"wall[0].mesh.file\" = \"bad.csv\": \".csv\" is not a kind of mesh file that can be read; expected .stl "
     "or .obj: FILES/bad.csv"},
    {"mesh cut short", "plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "mesh = { file = \"cut.stl\" }",
     "25: key \"wall[0].mesh.file\" = \"cut.stl\": the file was cut short: 538976288 triangles need 26948814484 bytes, "
     "it has 100: FILES/cut.stl"},
    {"motion of no type", "name = \"floor\"", "name = \"floor\"\nmotion = [{ velocity = [0, 0, 1] }]",
     "24: key \"wall[0].motion[0].type\": missing; expected \"translate\", \"rotate\", \"vibrate\", \"swing\", "
     "\"servo\" or \"script\": translate with a velocity or through places; rotate about an axis; vibrate: amplitude "
     "sin(2 pi "
     "frequency "
     "t + phase) along the axis; swing: the same about the axis; servo: driven until the grains push as given; script: "
     "as a function of the Python script that runs the scene says"},
    {"speed of a translation", "name = \"floor\"", "name = \"floor\"\nmotion = [{ type = \"translate\", speed = 1 }]",
     "24: key \"wall[0].motion[0].speed\" = 1: goes with type rotate only"},
    {"times in no order", "name = \"floor\"",
     "name = \"floor\"\nmotion = [{ type = \"rotate\", speed = 1, ramp = [[1, 0], [0, 1]] }]",
     "24: key \"wall[0].motion[0].ramp[1][0]\": is 0; expected at least 1, the time before [s]"},
    {"servo without gain", "name = \"floor\"",
     "name = \"floor\"\nmotion = [{ type = \"servo\", force = 1, max_speed = 0.1 }]",
     "24: key \"wall[0].motion[0].gain\": is 0; expected a number greater than 0 [m/(s N)]"},
    {"servo of two aims", "name = \"floor\"",
     "name = \"floor\"\nmotion = [{ type = \"servo\", force = 1, torque = 1, gain = 1, max_speed = 0.1 }]",
     "24: key \"wall[0].motion[0]\": has force and torque; a servo needs exactly one of force and torque"},
    {"script without a limit", "name = \"floor\"", "name = \"floor\"\nmotion = [{ type = \"script\" }]",
     "24: key \"wall[0].motion[0].max_speed\": is 0; a wall that a script moves needs a speed > 0 that no point of it "
     "in "
     "the domain ever exceeds [m/s]"},
    {"script and another motion", "name = \"floor\"",
     "name = \"floor\"\nmotion = [{ type = \"script\", max_speed = 1 }, { type = \"rotate\", speed = 1 }]",
     "24: key \"wall[0].motion[0]\": is not the only motion of its wall; what a script moves is moved by it alone"},
    {"axis of a script", "name = \"floor\"",
     "name = \"floor\"\nmotion = [{ type = \"script\", max_speed = 1, speed = 1 }]",
     "24: key \"wall[0].motion[0].speed\" = 1: goes with type rotate only"},
    {"mirror that moves", "name = \"floor\"",
     "name = \"floor\"\nsymmetry = true\nmotion = [{ type = \"translate\", velocity = [0, 0, 1] }]",
     "25: key \"wall[0].motion\": does not go with symmetry: a mirror stays where it is"},
    // inlets
    {"inlet that gives nothing", "", "[[inlet]]\nname = \"in\"\ndiameter = 0.02\nregion = { box = {} }",
     "30: key \"inlet[0]\": has nothing to give; expected one of number_rate, mass_rate, fill (count, mass or "
     "solid_fraction) and file, or an [[outlet]] with recycle = \"in\""},
    {"inlet of two rates", "",
     "[[inlet]]\nname = \"in\"\ndiameter = 0.02\nregion = { box = {} }\nnumber_rate = 1\nmass_rate = 1",
     "30: key \"inlet[0]\": has number_rate and mass_rate; expected one of number_rate, mass_rate, fill (count, mass "
     "or "
     "solid_fraction) and file"},
    {"inlet without a place", "", "[[inlet]]\nname = \"in\"\ndiameter = 0.02\nnumber_rate = 1",
     "30: key \"inlet[0]\": has no place; expected exactly one place of: region, face, disc, polygon"},
    {"inlet narrower than its grains", "",
     "[[inlet]]\nname = \"in\"\ndiameter = 0.02\nnumber_rate = 1\ndisc = { centre = [0.5, 0.5, 0.5], radius = 0.005 }",
     "34: key \"inlet[0].disc\": is 0.01 m wide: too narrow for the largest diameter, 0.02 m"},
    {"polygon that is not flat", "",
     "[[inlet]]\nname = \"in\"\ndiameter = 0.02\nnumber_rate = 1\npolygon = [[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], "
     "[0, 1, 0.6]]",
     "34: key \"inlet[0].polygon[3]\": is 0.0499 m off the plane of the others; expected a flat polygon"},
    {"outlet into no inlet", "", "[[outlet]]\nname = \"o\"\nface = \"z-low\"\nrecycle = \"in\"",
     "33: key \"outlet[0].recycle\": \"in\" is not an inlet; the scene has none"},
    // outlets, probes, output, run
    {"outlet on a periodic face", "high = [1, 1, 1]",
     "high = [1, 1, 1]\nperiodic = [false, false, true]\n[[outlet]]\nname = \"o\"\nface = \"z-low\"",
     "7: key \"outlet[0].face\": is \"z-low\", but the domain is periodic along z: nothing ever leaves there"},
    {"misspelt face", "", "[[outlet]]\nname = \"o\"\nface = \"z-lo\"",
     "32: key \"outlet[0].face\" = \"z-lo\": expected one of \"x-low\", \"x-high\", \"y-low\", \"y-high\", \"z-low\" "
     "or \"z-high\"; did you "
     "mean \"z-low\"?"},
    {"probe of no wall", "wall = \"floor\"", "wall = \"flor\"",
     "28: key \"probe[0].wall\": \"flor\" is not a wall; did you mean \"floor\"?; walls: \"floor\""},
    {"probe all the time", "interval = 0.1", "interval = 0",
     "29: key \"probe[0].interval\": is 0; expected a number greater than 0 [s]"},
    {"unknown field", "", "[output]\nfields = [\"position\", \"velocty\"]",
     "31: key \"output.fields[1]\": \"velocty\" is not a field; did you mean \"velocity\"?; fields: \"position\", "
     "\"radius\", "
     "\"velocity\", \"inverse_mass\", \"angular_velocity\", \"inverse_inertia\", \"gid\", \"material\", "
     "\"dissipated\", \"force\", "
     "\"torque\", \"gas_acceleration\""},
    {"field of a gas that is not there", "", "[output]\nfields = [\"gas_acceleration\"]",
     "31: key \"output.fields[0]\": \"gas_acceleration\" exists only in a scene with [gas] and a drag law"},
    {"unknown layout", "", "[run]\nlayout = \"4 threads\"",
     "31: key \"run.layout\": is \"4 threads\"; expected \"auto\" or ranks x threads such as \"2x4\""},
    {"a warning to stop on that nobody gives", "", "[run]\nstop_on = [\"enrgy\"]",
     "31: key \"run.stop_on[0]\": \"enrgy\" is no warning of a run; did you mean \"energy\"?; there are: \"energy\", "
     "\"gas_balance\", \"void_fraction\""},
    {"a warning to stop on of what is not watched", "", "[run]\nstop_on = [\"energy\", \"gas_balance\"]",
     "31: key \"run.stop_on[0]\": \"energy\" is watched only in a scene with output.energy = true\n"
     "scene.toml:31: key \"run.stop_on[1]\": \"gas_balance\" is watched only in a scene with [gas]"},
    // the text itself
    {"not TOML, with a letter outside ASCII that the parser would take for nothing", "end = 2.0", "end = 2.0 \xc3\xa9",
     "5:11: not TOML: Error while parsing key-value pair: expected a comment or whitespace, saw '\xc3\xa9'"},
    {"not TOML", "end = 2.0", "end = ", "5:7: not TOML: Error while parsing key-value pair: expected value, saw '\\n'"},
    {"header without a key", "[contact]", "[.contact]",
     "10: not TOML: expected a key; a key has letters, digits, _ and -, or stands in quotes"},
    {"key given twice", "end = 2.0", "end = 2.0\nend = 3.0",
     "6:7: not TOML: Error while parsing key-value pair: cannot redefine existing floating-point 'end'"},
    // fields and maps
    {"fields without cells", "", "[[probe]]\nkind = \"fields\"\ninterval = 0.1",
     "30: key \"probe[1].cells\": missing: kind = \"fields\" needs the numbers of cells along x, y and z"},
    {"fields on half a cell", "", "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 0, 4]",
     "33: key \"probe[1].cells[1]\": is 0; expected 1 or more"},
    {"fields on two numbers of cells", "", "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 4]",
     "33: key \"probe[1].cells\" = [4, 4]: expected [x, y, z], three whole numbers, such as [20, 20, 40]"},
    {"fields too wide", "", "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 4, 4]\nwidth = 9",
     "34: key \"probe[1].width\": is 9; expected 1 to 8 [cells]"},
    {"fields with less than no margin", "",
     "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 4, 4]\nmargin = -1",
     "34: key \"probe[1].margin\": is -1; expected 0 to 16 [cells]"},
    {"fields averaged over less than a sample", "",
     "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 4, 4]\naverage = 0.05",
     "34: key \"probe[1].average\": is 0.05, shorter than interval = 0.1 [s]; expected a multiple of it, or 0"},
    {"fields named as the series of grains", "",
     "[[probe]]\nkind = \"fields\"\ninterval = 0.1\ncells = [4, 4, 4]\nname = \"snapshots\"",
     "34: key \"probe[1].name\": \"snapshots\" is the series of the grains themselves; choose another name"},
    {"a wall by material", "wall = \"floor\"", "wall = \"floor\"\nby_material = true",
     "29: key \"probe[0].by_material\": is true; it goes with kind \"region\", \"profile\" and \"fields\""},
    {"a map of a plane", "name = \"floor\"", "name = \"floor\"\nforce_map = true",
     "24: key \"wall[0].force_map\": is true; only the triangles of a mesh can be told apart"},
};

}  // namespace

TEST_CASE("the scene that the table breaks is sound") { CHECK(complaint(sound).empty()); }

TEST_CASE("every broken scene is refused with exactly its message") {
  const scene_text::Directory directory;
  directory.write("bad.csv", "x,y,z\n0.1,0.1,0.1\n0.2,two,0.2\n");
  directory.write("negative.csv", "x,y,z,r\n0.1,0.1,0.1,0.01\n0.2,0.2,0.2,-0.01\n");
  directory.write("empty.stl", "");
  directory.write("cut.stl", std::string(100, ' '));
  for (const Broken& scene : table) {
    DYNAMIC_SECTION(scene.what) {
      std::string said = complaint(broken(scene), {}, directory.path());
      const std::string base = directory.path().string();
      for (std::size_t at; (at = said.find(base)) != std::string::npos;) said.replace(at, base.size(), "FILES");
      CHECK(said == "scene.toml:" + scene.message);
    }
  }
}

TEST_CASE("all problems of a scene are told at once, in the order of the file, those of overrides last") {
  std::string text = sound;
  const auto replace = [&](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  replace("low = [0, 0, 0]", "low = [0, 0, 0]\nperodic = [true, true, true]");
  replace("density = 2500", "density = -1");
  replace("friction = 0.3", "friction = \"0.3\"");
  replace("diameter = 0.02", "diameter = \"4 mm\"");
  replace("normal = [0, 0, 1]", "normal = \"up\"");
  CHECK(complaint(text, {"time.end=0", "run.layuot=1x2"}) ==
        "scene.toml:3: key \"domain.perodic\" = [true, true, true]: unknown key; did you mean \"periodic\"?\n"
        "scene.toml:9: key \"material[0].density\": is -1; expected a number greater than 0 [kg/m3]\n"
        "scene.toml:18: key \"contact.pair[0].friction\" = \"0.3\": expected a number in SI units; write 0.3\n"
        "scene.toml:21: key \"particles[0].diameter\" = \"4 mm\": expected a number in SI units [m]; write 0.004\n"
        "scene.toml:26: key \"wall[0].plane.normal\" = \"up\": expected one of \"x\", \"-x\", \"y\", \"-y\", \"z\" or "
        "\"-z\"\n"
        "--set 1: key \"time.end\": is 0; expected a number greater than 0 [s]\n"
        "--set 2: key \"run.layuot\" = \"1x2\": unknown key; did you mean \"layout\"?");
}

TEST_CASE("a scene without anything names what it needs") {
  CHECK(
      complaint("") ==
      "scene.toml:1: key \"domain\": missing; expected a table: the space of the scene\n"
      "scene.toml:1: key \"time\": missing; expected a table: how long, in which steps, and what acts on every grain\n"
      "scene.toml:1: key \"material\": missing; expected a list of tables, [[material]]: materials of grains and "
      "walls\n"
      "scene.toml:1: key \"particles\": missing; expected a list of tables, [[particles]]: groups of grains");
}

TEST_CASE("a scene file that is not there is refused by name") {
  const scene_text::Directory directory;
  const std::string file = (directory.path() / "none.toml").string();
  CHECK_THROWS_WITH(moraine::read_scene(file), file + ": no such file; expected a scene (TOML)");
  CHECK_THROWS_WITH(moraine::read_scene(directory.path()),
                    directory.path().string() + ": is a directory; expected a scene file (TOML)");
}
