#include <catch2/catch.hpp>

#include "tests/unit/scene_text.hpp"

using namespace moraine;
using scene_text::complaint;
using scene_text::read;

TEST_CASE("an override replaces a value, by either way to write an index") {
  CHECK(read(scene_text::all, {"time.end=5"}).time.end == 5.0);
  CHECK(read(scene_text::all, {"particles[0].diameter=0.03"}).particles[0].diameter.value == 0.03);
  CHECK(read(scene_text::all, {"particles.0.diameter = 0.03"}).particles[0].diameter.value == 0.03);
  CHECK(read(scene_text::all, {"domain.high[2]=4"}).domain.high == Vec3{1, 1, 4});
  CHECK(read(scene_text::all, {"particles[0].fill.count=20"}).particles[0].diameter.value == 0.02);
}

TEST_CASE("the last of two overrides of one key holds") {
  CHECK(read(scene_text::all, {"time.end=5", "time.end=6"}).time.end == 6.0);
}

TEST_CASE("an override adds keys, tables and entries that are not there") {
  CHECK(read(scene_text::all, {"time.gravity=[0, 0, -1]"}).time.gravity == Vec3{0, 0, -1});
  CHECK(read(scene_text::all, {"run.layout=1x4"}).run.layout == "1x4");
  const Scene scene = read(scene_text::all, {"wall[0].name=floor", "wall[0].plane.point=[0, 0, 0]"});
  REQUIRE(scene.walls.size() == 1);
  CHECK(scene.walls[0].name == "floor");
}

TEST_CASE("values are TOML, and words and short numbers are taken as they are meant") {
  CHECK(read(scene_text::all, {"title=a title of several words"}).title == "a title of several words");
  CHECK(read(scene_text::all, {"title=\"1\""}).title == "1");
  CHECK(read(scene_text::all, {"time.damping=.5"}).time.damping == 0.5);
  CHECK(read(scene_text::all, {"time.end=1e1"}).time.end == 10.0);
  CHECK(read(scene_text::all, {"particles[0].fill={ lattice = \"cubic\" }"}).particles[0].fill.index() == 1);
  CHECK_FALSE(read(scene_text::all, {"contact.rotation=false"}).contact.rotation);
}

TEST_CASE("an override that does not fit is named by its number") {
  CHECK(complaint(scene_text::all, {"time.end=5", "time.edn=6"}) ==
        "--set 2: key \"time.edn\" = 6: unknown key; did you mean \"end\"?");
  CHECK(complaint(scene_text::all, {"time"}) == "--set 1: \"time\": expected key=value, such as time.end=2");
  CHECK(complaint(scene_text::all, {"particles.diameter=1"}) ==
        "--set 1: key \"particles.diameter\": \"particles\" is a list; say which entry: particles[0].diameter");
  CHECK(complaint(scene_text::all, {"particles[4].diameter=1"}) ==
        "--set 1: key \"particles[4].diameter\": \"particles\" has 1 entries; [4] does not exist");
  CHECK(complaint(scene_text::all, {"time.end.x=1"}) ==
        "--set 1: key \"time.end.x\": \"time.end\" is 2.0, not a table, so it has no \"x\"");
  CHECK(complaint(scene_text::all, {"time.end=[1"}) ==
        "--set 1: key \"time.end\" = [1: not a value; expected a number, a word, true, false, [list] or { table }");
  CHECK(complaint(scene_text::all, {"a..b=1"}) ==
        "--set 1: \"a..b\" is not a key; expected a path such as time.end or particles[0].diameter");
  CHECK(complaint(scene_text::all, {"time.end=-1"}) ==
        "--set 1: key \"time.end\": is -1; expected a number greater than 0 [s]");
}

namespace {

void check_same(const Scene& a, const Scene& b) {
  CHECK(a.title == b.title);
  CHECK(a.time.end == b.time.end);
  CHECK(a.time.step == b.time.step);
  CHECK(a.time.gravity == b.time.gravity);
  CHECK(a.domain.box() == b.domain.box());
  CHECK(a.contact.rotation == b.contact.rotation);
  CHECK(a.contact.pairs.size() == b.contact.pairs.size());
  CHECK(a.run.layout == b.run.layout);
  REQUIRE(a.particles.size() == b.particles.size());
  for (std::size_t i = 0; i < a.particles.size(); ++i) {
    CHECK(a.particles[i].seed == b.particles[i].seed);
    CHECK(a.particles[i].diameter.value == b.particles[i].diameter.value);
    CHECK(a.particles[i].fill.index() == b.particles[i].fill.index());
  }
  CHECK(a.walls.size() == b.walls.size());
  CHECK(a.output.probes.size() == b.output.probes.size());
}

}  // namespace

TEST_CASE("the text as run reads back to the scene that was read with the overrides") {
  const std::string text = "# first\ntitle = \"µ-test\" # with a comment\n" + scene_text::all +
                           "[[probe]]\nkind = \"mass\"\ninterval = 0.1\n";
  const std::vector<std::vector<std::string>> cases = {
      {},
      {"time.end=7"},
      {"title=other"},
      {"time.step=0.0001234567890123", "time.gravity=[0, 0, -9.81]"},
      {"particles[0].diameter=0.05", "particles[0].seed=9"},
      {"domain.high[1]=3", "domain.periodic=[true, true, false]"},
      {"particles[0].fill.count=77", "particles[0].fill={ lattice = \"cubic\" }"},
      {"contact.rotation=false", "run.layout=1x2"},
      {"probe[1].kind=contacts", "probe[1].interval=0.5", "probe[1].name=second"},
      {"wall[0].name=floor", "wall[0].plane.point=[0, 0, 0]", "wall[1]={ name = \"box\", box = {} }"},
      {"material={ name = \"glass\" }", "material=[{ name = \"glass\", density = 1 }]"},
  };
  for (const auto& overrides : cases) {
    CAPTURE(overrides);
    const std::string as_run = scene_text_as_run(text, "scene.toml", overrides);
    CAPTURE(as_run);
    check_same(read(as_run), read(text, overrides));
  }
}

TEST_CASE("the text as run keeps comments and names its overrides") {
  const std::string text = "# first\n" + scene_text::domain + "[time] # clock\nend = 2 # seconds\n" +
                           scene_text::material + scene_text::pair + scene_text::particles;
  const std::string as_run = scene_text_as_run(text, "scene.toml", {"time.end=3.5"});
  CHECK(as_run == "# run with --set time.end=3.5\n# first\n" + scene_text::domain +
                      "[time] # clock\nend = 3.5 # seconds\n" + scene_text::material + scene_text::pair +
                      scene_text::particles);
}

TEST_CASE("files in the text as run are found from anywhere") {
  const scene_text::Directory directory;
  directory.write("grains/list.csv", "x,y,z,r\n0.5,0.5,0.5,0.1\n");
  directory.write("scene.toml", scene_text::domain + scene_text::time + scene_text::material + scene_text::pair +
                                    "[[particles]]\nfill = { file = \"grains/list.csv\" } # mine\n");
  const std::string as_run = scene_as_run(directory.path() / "scene.toml");
  CHECK(as_run.find("file = \"" + (directory.path() / "grains/list.csv").string() + "\" } # mine") !=
        std::string::npos);
  const Scene scene = read_scene_text(as_run, "as run", {}, "/");
  CHECK(std::get<ListedGrains>(scene.particles[0].fill).grains.size() == 1);
}

TEST_CASE("an override that does not apply stops the text as run") {
  CHECK_THROWS_WITH(scene_text_as_run(scene_text::all, "scene.toml", {"particles[4].seed=1"}),
                    "--set 1: key \"particles[4].seed\": \"particles\" has 1 entries; [4] does not exist");
}
