// Scenes that do not fit: refused with the estimate before they are tried, by every bound that there is on memory.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>

#include "io/cli/check_command.hpp"
#include "io/cli/memory.hpp"
#include "io/cli/run_command.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;
using moraine::testing::TemporaryDirectory;
namespace fs = std::filesystem;

namespace {

void put(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

constexpr double mebi = 1048576.0;

/// MORAINE_MEMORY, for as long as this lives.
class Memory {
 public:
  explicit Memory(const char* text) { setenv("MORAINE_MEMORY", text, 1); }
  ~Memory() { unsetenv("MORAINE_MEMORY"); }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
};

}  // namespace

TEST_CASE("the memory that is free is the least of machine, control groups and limits") {
  const TemporaryDirectory root;
  const fs::path& at = root.path();
  CHECK_FALSE(free_memory(at));
  put(at / "proc/meminfo", "MemTotal:       16000000 kB\nMemFree: 12 kB\nMemAvailable:    8192000 kB\n");
  CHECK(free_memory(at)->bytes == 8192000.0 * 1024.0);
  CHECK(free_memory(at)->source == "of this machine");

  put(at / "proc/self/cgroup", "0::/user/job\n");
  put(at / "sys/fs/cgroup/user/job/memory.max", "max\n");
  put(at / "sys/fs/cgroup/user/job/memory.current", "1048576\n");
  CHECK(free_memory(at)->source == "of this machine");
  put(at / "sys/fs/cgroup/user/memory.max", std::to_string(2000LL << 20) + "\n");
  put(at / "sys/fs/cgroup/user/memory.current", std::to_string(1500LL << 20) + "\n");
  put(at / "sys/fs/cgroup/user/memory.stat", "anon 5\nfile 7\ninactive_file " + std::to_string(100LL << 20) + "\n");
  CHECK(free_memory(at)->bytes == 600.0 * mebi);
  CHECK(free_memory(at)->source == "of the control group " + (at / "sys/fs/cgroup/user").string());

  put(at / "proc/self/cgroup", "12:cpu:/\n4:memory:/batch\n");
  put(at / "sys/fs/cgroup/memory/batch/memory.limit_in_bytes", std::to_string(512LL << 20) + "\n");
  put(at / "sys/fs/cgroup/memory/batch/memory.usage_in_bytes", std::to_string(12LL << 20) + "\n");
  CHECK(free_memory(at)->bytes == 500.0 * mebi);
  put(at / "sys/fs/cgroup/memory/batch/memory.limit_in_bytes", "9223372036854771712\n");  // none
  CHECK(free_memory(at)->source == "of this machine");
}

TEST_CASE("a scene that does not fit is refused by check and at the start, with what it needs and what there is") {
  const TemporaryDirectory directory;
  const fs::path scene = directory.path() / "large.toml";
  put(scene, R"(
[domain]
low = [0, 0, 0]
high = [1, 1, 1]
[time]
end = 0.1
[[material]]
name = "glass"
density = 2500.0
[[contact.pair]]
normal_stiffness = 1000.0
[[particles]]
diameter = 0.004
fill = { lattice = "cubic", count = 10000000 }
[[wall]]
name = "box"
box = {}
[gas]
cells = [100, 100, 200]
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
)");
  const Memory memory("2G");
  std::string refusal;
  CHECK_THAT(check_text(scene, {}, "1x1", &refusal), Catch::Contains("memory       about "));
  CHECK_THAT(refusal,
             Catch::Contains("the scene needs about ") && Catch::Contains("GB of memory here, and 2.15 GB are free "
                                                                          "(by MORAINE_MEMORY)"));
  RunRequest request;
  request.scene_file = scene;
  request.layout = "1x1";
  request.out = directory.path() / "run";
  Log log(true);
  CHECK_THROWS_WITH(run_scene(request, log), refusal);
  CHECK_FALSE(fs::exists(*request.out));
  request.layout = "3x1";  // before any rank is started
  CHECK_THROWS_WITH(run_scene(request, log), Catch::Contains("the scene needs about "));
  refusal.clear();
  static_cast<void>(check_text(scene, {"particles[0].fill.count=1000", "gas.cells=[10,10,10]"}, "1x1", &refusal));
  CHECK(refusal.empty());
  // An estimate is no more than that: near the bound there is a doubt and no refusal.
  std::string sound;
  for (const char* free : {"2000M", "1500M", "850M", "500M"}) {
    const Memory near(free);
    const std::string text =
        check_text(scene, {"particles[0].fill.count=1000", "gas.cells=[100,100,110]"}, "1x1", &refusal);
    const bool is_doubtful = text.find("memory may not suffice: the scene needs about ") != std::string::npos;
    sound += !refusal.empty() ? "refused " : is_doubtful ? "doubtful " : "fits ";
    CHECK_FALSE((is_doubtful && !refusal.empty()));
    refusal.clear();
  }
  CHECK(sound == "fits fits doubtful refused ");
}

TEST_CASE("a skin is as wide as the memory allows, and never narrower than the plan's") {
  Plan plan;
  plan.skin = 1e-4;  // a tenth of a diameter
  constexpr double arrays = 1e9, held = 1.2e9;
  const auto skin = [&](double free) { return widest_skin_within(free, held, arrays, plan); };
  CHECK(skin(0.0) == plan.skin);
  CHECK(skin(held) == plan.skin);
  double last = plan.skin;
  for (const double free : {2e9, 3e9, 5e9, 1e10}) {
    INFO(free);
    const double widest = skin(free);
    CHECK(widest > last);
    // so many more pairs, made anew while the rest is held, leave a tenth of what is free
    const double reach = (1e-3 + widest) / (1e-3 + plan.skin);
    CHECK(held + arrays * (1.3 * reach * reach * reach - 1.0) == Approx(0.9 * free));
    last = widest;
  }
}

TEST_CASE("an amount of memory that is none is named") {
  const Memory memory("plenty");
  CHECK_THROWS_WITH(free_memory(), "MORAINE_MEMORY=\"plenty\": expected a number with K, M, G or T, such as 16G");
}
