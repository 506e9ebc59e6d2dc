// scale.weak: how a scene becomes larger.
#include <catch2/catch.hpp>

#include "tests/unit/scene_text.hpp"

using namespace moraine;
using scene_text::all;
using scene_text::complaint;

namespace {

std::string with_rule(const std::string& keys) { return all + "[scale]\nweak = [" + keys + "]\n"; }

std::vector<std::string> grown(const std::string& text, int factor, const std::vector<std::string>& overrides = {}) {
  const scene_text::Directory directory;
  return growth_overrides(directory.write("scene.toml", text), overrides, factor);
}

}  // namespace

TEST_CASE("numbers that a scene names for weak scaling are multiplied, and counts stay whole") {
  const std::string text = with_rule(R"("domain.high.z", "particles[0].fill.count", "time.end")");
  CHECK(grown(text, 4) == std::vector<std::string>{"domain.high[2]=4", "particles[0].fill.count=40", "time.end=8.0"});
  const scene_text::Directory directory;
  const auto file = directory.write("scene.toml", text);
  const Scene scene = read_scene(file, growth_overrides(file, {}, 4));
  CHECK(scene.domain.high == Vec3{1, 1, 4});
  CHECK(std::get<RandomFill>(scene.particles[0].fill).count == 40);
}

TEST_CASE("on one core a scene is as it stands") { CHECK(grown(with_rule("\"domain.high.x\""), 1).empty()); }

TEST_CASE("a box that does not begin at zero becomes as many times as long") {
  const std::vector<std::string> moved = {"domain.low=[-0.5, 0, 0.25]"};
  CHECK(grown(with_rule("\"domain.high.x\", \"domain.high[2]\""), 3, moved) ==
        std::vector<std::string>{"domain.high[0]=4.0", "domain.high[2]=2.5"});
  // A region that has no low of its own has the domain's.
  const std::vector<std::string> region = {"domain.low=[-0.5, 0, 0]",
                                           "particles[0].fill.region.box.high=[0.5, 0.5, 0.5]"};
  CHECK(grown(with_rule("\"particles[0].fill.region.box.high.x\""), 2, region) ==
        std::vector<std::string>{"particles[0].fill.region.box.high[0]=1.5"});
}

TEST_CASE("a scene grows from what the overrides have made of it, and the rule may be one of them") {
  CHECK(grown(all, 2, {"domain.high=[1, 2, 3]", "scale.weak=[\"domain.high.z\"]"}) ==
        std::vector<std::string>{"domain.high[2]=6"});
}

TEST_CASE("a scene without a rule for weak scaling is refused with what to add to it") {
  for (const std::string& text : {all, with_rule("")})
    CHECK_THROWS_WITH(grown(text, 2), Catch::Contains("[scale]\nweak = [\"domain.high.z\"]"));
}

TEST_CASE("a key of the rule that is not in the scene, or not a number, is an error of the scene with its line") {
  CHECK(complaint(with_rule("\"domain.high.w\"")).find("scene.toml:15: key \"scale.weak\"") == 0);
  CHECK(complaint(with_rule("\"domain.high.w\"")).find("\"domain.high.w\" is not written in the scene") !=
        std::string::npos);
  CHECK(complaint(with_rule("\"material[0].name\"")).find("is \"glass\"; expected a number") != std::string::npos);
  CHECK(complaint(with_rule("\"domain.high\"")).find("expected a number") != std::string::npos);
  CHECK(complaint(with_rule("1")).find("scale.weak") != std::string::npos);
  CHECK(complaint(with_rule("\"domain.high.z\"")).empty());
}

TEST_CASE("the files that a scene names are found from the folder of the scene") {
  const scene_text::Directory directory;
  const auto file = directory.write("scene.toml", all);
  CHECK(files_of_scene(file).empty());
  CHECK(files_of_scene(file, {"particles[0].fill={ file = \"../lists/a.csv\" }"}) ==
        std::vector<std::filesystem::path>{(directory.path().parent_path() / "lists" / "a.csv").lexically_normal()});
}
