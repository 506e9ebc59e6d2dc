// Lists of start positions that no rank holds whole: the same grains with the same gids, and the same errors, as alone.
#include <fmt/format.h>
#include <hdf5.h>
#include <malloc.h>
#include <zlib.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <new>

#include "engine/particles/fill.hpp"
#include "engine/run/simulation.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "kernels/base/random.hpp"
#include "tests/ranks/ranks.hpp"

using namespace moraine;

namespace {

/// Bytes that new has given and not got back: now, and at most since the last start of counting.
std::atomic<std::size_t> live{0}, peak{0};

void* counted(std::size_t n) noexcept {
  void* const memory = std::malloc(n);
  if (!memory) return memory;
  const std::size_t now = live += malloc_usable_size(memory);
  for (std::size_t most = peak; now > most && !peak.compare_exchange_weak(most, now);) {}
  return memory;
}

void uncounted(void* memory) {
  if (memory) live -= malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace

void* operator new(std::size_t n) {
  void* const memory = counted(n);
  return memory ? memory : throw std::bad_alloc();
}
void* operator new[](std::size_t n) { return operator new(n); }
void* operator new(std::size_t n, const std::nothrow_t&) noexcept { return counted(n); }  // std::stable_sort asks so
void* operator new[](std::size_t n, const std::nothrow_t&) noexcept { return counted(n); }
void operator delete(void* memory) noexcept { uncounted(memory); }
void operator delete[](void* memory) noexcept { uncounted(memory); }
void operator delete(void* memory, std::size_t) noexcept { uncounted(memory); }
void operator delete[](void* memory, std::size_t) noexcept { uncounted(memory); }

namespace {

/// The most that f holds beyond what is there before [bytes].
template <typename Function>
std::size_t memory_of(Function f) {
  const std::size_t before = live;
  peak = before;
  f();
  return peak - before;
}

/// A directory that all ranks see; the first one writes.
class Directory {
 public:
  explicit Directory(const World& world) : world_(world) {
    std::string name = (std::filesystem::temp_directory_path() / "moraine-scatter-XXXXXX").string();
    if (world.is_root()) name = mkdtemp(name.data());
    world.broadcast(name);
    path_ = name;
  }
  ~Directory() {
    world_.wait_for_all();
    std::error_code ignored;
    if (world_.is_root()) std::filesystem::remove_all(path_, ignored);
  }
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  std::filesystem::path write(const std::string& name, const std::function<void(const std::string&)>& writer) const {
    if (world_.is_root()) writer((path_ / name).string());
    world_.wait_for_all();
    return path_ / name;
  }
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    return write(name, [&](const std::string& file) { std::ofstream(file, std::ios::binary) << text; });
  }

 private:
  World world_;
  std::filesystem::path path_;
};

/// A loose cloud; the first list has radii and velocities.
struct Cloud {
  std::vector<double> positions, radii, velocities;
  std::size_t size() const { return positions.size() / 3; }
};

Cloud make_cloud(std::uint64_t first, std::size_t n, double floor, bool is_full) {
  constexpr double spacing = 0.0106;
  Cloud cloud;
  for (std::uint64_t i = 0; i < n; ++i) {
    const double corner[3] = {0.006 + spacing * static_cast<double>(i % 25),
                              0.006 + spacing * static_cast<double>(i / 25 % 20),
                              floor + spacing * static_cast<double>(i / 500)};
    for (std::uint64_t k = 0; k < 3; ++k) {
      cloud.positions.push_back(corner[k] + 2e-4 * random_uniform(1, first + i, RandomPurpose::velocity, k));
      if (is_full) cloud.velocities.push_back(2.0 * random_uniform(2, first + i, RandomPurpose::velocity, k) - 1.0);
    }
    if (is_full) cloud.radii.push_back(0.004 + 0.001 * random_uniform(3, first + i, RandomPurpose::radius));
  }
  return cloud;
}

const Cloud& lower() {
  static const Cloud cloud = make_cloud(0, 5000, 0.006, true);
  return cloud;
}
const Cloud& upper() {
  static const Cloud cloud = make_cloud(5000, 4300, 0.115, false);
  return cloud;
}

std::string row_of(const Cloud& cloud, std::size_t i) {
  const auto three = [&](const std::vector<double>& v) {
    return fmt::format("{},{},{}", v[3 * i], v[3 * i + 1], v[3 * i + 2]);
  };
  std::string row = three(cloud.positions);
  if (!cloud.radii.empty()) row += fmt::format(",{},{}", cloud.radii[i], three(cloud.velocities));
  return row;
}

/// `change` may spoil the rows.
std::string table(const Cloud& cloud, const std::function<void(std::size_t, std::string&)>& change = {}) {
  std::string text = cloud.radii.empty() ? "# a comment\nx,y,z\n" : "x,y,z,r,vx,vy,vz\n";
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    std::string row = row_of(cloud, i);
    if (change) change(i, row);
    text += row + (i % 700 == 3 ? "\n# between\n\n" : "\n");
  }
  return text;
}

void pack(const std::string& text, const std::string& file) {
  gzFile out = gzopen(file.c_str(), "wb");
  gzwrite(out, text.data(), static_cast<unsigned>(text.size()));
  gzclose(out);
}

void put(hid_t group, const char* name, const std::vector<double>& values, hsize_t columns) {
  if (values.empty()) return;
  const hsize_t size[2] = {values.size() / columns, columns};
  const hid_t space = H5Screate_simple(columns > 1 ? 2 : 1, size, nullptr);
  const hid_t set = H5Dcreate2(group, name, H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(set);
  H5Sclose(space);
}

void save(const Cloud& cloud, const std::string& file, const std::vector<double>& materials = {}) {
  const hid_t out = H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t group = H5Gcreate2(out, "particles", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  put(group, "position", cloud.positions, 3);
  put(group, "radius", cloud.radii, 1);
  put(group, "velocity", cloud.velocities, 3);
  put(group, "material", materials, 1);
  H5Gclose(group);
  H5Fclose(out);
}

const std::string head = R"(
[domain]
low = [0, 0, 0]
high = [0.3, 0.25, 0.25]
periodic = [true, false, false]
[time]
end = 1.0
step = 4e-5
gravity = [0, 0, -9.81]
[[material]]
name = "glass"
density = 2500
[[material]]
name = "steel"
density = 7800
[[contact.pair]]
normal_stiffness = 4000
restitution = 0.7
friction = 0.4
[[wall]]
name = "box"
box = {}
material = "glass"
)";

std::string first_group(const std::string& file) {
  return "[[particles]]\nmaterial = \"steel\"\nfill = { file = \"" + file + "\" }\n";
}
/// Sizes and velocities are drawn, by number over all groups.
std::string second_group(const std::string& file) {
  return "[[particles]]\nmaterial = \"glass\"\ndiameter = { distribution = \"uniform\", low = 0.008, high = 0.0102 "
         "}\nvelocity_deviation = 0.4\n"
         "seed = 7\nfill = { file = \"" +
         file + "\" }\n";
}

std::vector<std::size_t> rows_held(const Scene& scene) {
  std::vector<std::size_t> held;
  for (const ParticleGroup& group : scene.particles)
    if (const auto* const list = std::get_if<ListedGrains>(&group.fill)) held.push_back(list->grains.size());
  return held;
}

Hash128 hash_after(Simulation& simulation, int n_steps) {
  for (int i = 0; i < n_steps; ++i) simulation.step();
  return simulation.state_hash();
}

std::string error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// What reading says on any numbers of ranks is what it says alone, on every rank.
std::string same_error(const std::filesystem::path& scene) {
  const World& all = ranks::world();
  const std::string alone = error_of([&] { read_scene(scene); });
  CHECK(alone != "");
  for (int n = 2; n <= all.size(); ++n)
    if (const std::optional<World> world = all.first(n))
      CHECK(error_of([&] { read_scene(scene, {}, nullptr, *world); }) == alone);
  return alone;
}

/// The list with one kind of bad row.
std::string error_with(const Directory& directory, const std::function<void(std::size_t, std::string&)>& change) {
  directory.write("bad.csv", table(lower(), change));
  directory.write("good.csv", table(upper()));
  return same_error(directory.write("bad.toml", head + second_group("good.csv") + first_group("bad.csv")));
}

std::size_t n_lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
}

}  // namespace

TEST_CASE("lists shared by ranks that each read a part of the rows give the same run as on one rank") {
  const World& all = ranks::world();
  const Directory directory(all);
  directory.write("a.csv", table(lower()));
  directory.write("b.csv", table(upper()));
  directory.write("a.csv.gz", [](const std::string& file) { pack(table(lower()), file); });
  directory.write("b.csv.gz", [](const std::string& file) { pack(table(upper()), file); });
  directory.write("a.h5", [](const std::string& file) { save(lower(), file); });
  directory.write("b.h5", [](const std::string& file) { save(upper(), file); });
  std::optional<Hash128> expected, expected_later;
  for (const std::string kind : {"csv", "csv.gz", "h5"}) {
    const auto file = directory.write(kind + ".toml", head + first_group("a." + kind) + second_group("b." + kind));
    if (!expected) {
      Simulation alone(read_scene(file), 1);
      REQUIRE(alone.n_grains() == 9300);
      expected = hash_after(alone, 100);
      expected_later = hash_after(alone, 50);
      CHECK(alone.n_rebuilds() > 1);
    }
    for (int n = 1; n <= all.size(); ++n) {
      const std::optional<World> world = all.first(n);
      if (!world) continue;
      INFO(kind << " on " << n << " ranks");
      const Scene scene = read_scene(file, {}, nullptr, *world);
      const std::vector<std::size_t> held = rows_held(scene);
      REQUIRE(held.size() == 2);
      const std::size_t n_ranks = static_cast<std::size_t>(n), block = ListShare().block;
      CHECK(held[0] <= lower().size() / n_ranks + block);
      CHECK(held[1] <= upper().size() / n_ranks + block);
      CHECK(held[0] + held[1] > 0);
      std::uint64_t total = held[0] + held[1];
      world->sum(std::span(&total, 1));
      CHECK(total == 9300);

      Simulation simulation(scene, 1, *world);
      CHECK(simulation.plan().n_grains == 9300);
      CHECK(simulation.n_grains() == 9300);
      CHECK(hash_after(simulation, 100) == *expected);
      Simulation restored(scene, 1, simulation.checkpoint(), *world);
      CHECK(hash_after(restored, 50) == *expected_later);
    }
  }
}

TEST_CASE("positions listed in the scene itself are shared too") {
  const World& all = ranks::world();
  std::string positions;
  for (std::size_t i = 0; i < 3000; ++i)
    positions += fmt::format("[{}, {}, {}],", lower().positions[3 * i], lower().positions[3 * i + 1],
                             lower().positions[3 * i + 2]);
  const std::string text =
      head + "[[particles]]\nmaterial = \"glass\"\ndiameter = 0.01\nfill = { positions = [" + positions + "] }\n";
  Simulation alone(read_scene_text(text, "scene.toml"), 1);
  const Scene scene = read_scene_text(text, "scene.toml", {}, {}, nullptr, all);
  CHECK(rows_held(scene)[0] <= (all.is_alone() ? 3000 : 2048));
  Simulation simulation(scene, 1, all);
  CHECK(hash_after(simulation, 100) == hash_after(alone, 100));
}

TEST_CASE("where space is filled around listed grains, the first rank alone has the list") {
  const World& all = ranks::world();
  const Directory directory(all);
  directory.write("a.csv", table(lower()));
  const auto file = directory.write(
      "mixed.toml", head + first_group("a.csv") +
                        "[[particles]]\nmaterial = \"glass\"\ndiameter = 0.01\nvelocity = [0, 0, -1]\n"
                        "fill = { lattice = \"cubic\", region = { box = { low = [0, 0, 0.1] } }, spacing = 0.0103 }\n");
  Simulation alone(read_scene(file), 1);
  CHECK(alone.n_grains() > 9000);
  const Scene scene = read_scene(file, {}, nullptr, all);
  CHECK(rows_held(scene)[0] == (all.is_root() ? lower().size() : 0));
  Simulation simulation(scene, 1, all);
  CHECK(simulation.n_grains() == alone.n_grains());
  CHECK(hash_after(simulation, 100) == hash_after(alone, 100));
}

TEST_CASE("bad rows of a shared list are the same error on all ranks, in the order of lines") {
  const Directory directory(ranks::world());
  const std::string one = error_with(directory, [](std::size_t i, std::string& row) {
    if (i == 2500) row = "1,two,3,4,5,6,7";
  });
  CHECK(one.find("bad.csv:2510: column 2 (\"y\"): \"two\" is not a number") != std::string::npos);
  CHECK(n_lines(one) == 1);
  // Spread over the shares of three ranks, and more than are told.
  const std::string many = error_with(directory, [](std::size_t i, std::string& row) {
    if (i % 300 == 299) row += ",8";
  });
  CHECK(n_lines(many) == 11);
  CHECK(many.find("and 6 more") != std::string::npos);
}

TEST_CASE("grains of a shared list that cannot be used are the same error on all ranks") {
  const Directory directory(ranks::world());
  // In the shares of two ranks; the place along y keeps them apart.
  const auto said = [&](const std::string& x, const std::string& others, const std::string& what) {
    const std::string error = error_with(directory, [&](std::size_t i, std::string& row) {
      if (i == 2100) row = x + ",0.05," + others;
      if (i == 4800) row = x + ",0.2," + others;
    });
    INFO(error);
    CHECK(error.find(what) != std::string::npos);
    CHECK(n_lines(error) == 1);
  };
  said("1", "0.1,0.005,0,0,0", "grain 2100 of bad.csv is at [1, 0.05, 0.1] m, outside the domain");
  said("1", "0.1,0.005,0,0,0", "(2 of 5000 grains)");
  said("0.285", "0.1,-1,0,0,0", "grain 2100 of bad.csv has a radius of -1 m");
  said("nan", "0.1,0.005,0,0,0", "grain 2100 of bad.csv has a position or velocity that is not finite");
  said("0.285", "0.001,0.005,0,0,0", "grain 2100 of bad.csv reaches 0.004 m, 80 % of its radius, into wall \"box\"");
  said("0.285", "0.001,0.005,0,0,0", "(2 grains beyond it)");
}

TEST_CASE("files that cannot be read are the same error on all ranks") {
  const Directory directory(ranks::world());
  const auto scene = directory.write("scene.toml", head + first_group("none.csv"));
  CHECK(same_error(scene).find("no such file") != std::string::npos);
  CHECK(same_error(directory / "none.toml").find("no such file") != std::string::npos);
  directory.write("none.csv", "x,y,q\n1,2,3\n");
  CHECK(same_error(scene).find("\"q\" is not a known column") != std::string::npos);

  directory.write("cut.csv.gz", [](const std::string& file) {
    pack(table(lower()), file);
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  });
  const auto cut = directory.write("cut.toml", head + first_group("cut.csv.gz"));
  CHECK(same_error(cut).find("cannot be unpacked") != std::string::npos);

  directory.write("odd.h5", [](const std::string& file) {
    std::vector<double> materials(lower().size(), 0.0);
    materials[4000] = materials[2000] = 5.0;
    save(lower(), file, materials);
  });
  const auto odd = directory.write("odd.toml", head + "[[particles]]\nfill = { file = \"odd.h5\" }\n");
  CHECK(same_error(odd).find("grain 2000 has material number 5") != std::string::npos);

  const auto mesh = directory.write(
      "mesh.toml", head + "[[particles]]\nmaterial = \"glass\"\ndiameter = 0.01\nfill = { count = 9 }\n" +
                       "[[wall]]\nname = \"m\"\nmaterial = \"glass\"\nmesh = { file = \"none.stl\" }\n");
  CHECK(same_error(mesh).find("none.stl") != std::string::npos);
}

TEST_CASE("grains of different shares that overlap are told of on all ranks") {
  const World& all = ranks::world();
  const Directory directory(all);
  directory.write("twins.csv", table(lower(), [](std::size_t i, std::string& row) {
                    if (i == 4500) row = row_of(lower(), 100);
                  }));
  const auto file = directory.write("twins.toml", head + first_group("twins.csv"));
  const std::string own = error_of([&] {
    const Scene scene = read_scene(file, {}, nullptr, all);
    Simulation(scene, 1, all);
  });
  std::string roots = own;
  all.broadcast(roots);
  CHECK(own == roots);
  INFO(own);
  CHECK(own.find("overlap") != std::string::npos);
  CHECK(own.find("4500") != std::string::npos);
}

namespace {

/// Of glass and steel grains, without any.
Scene empty_scene() {
  std::string groups;
  for (const char* const material : {"glass", "steel"})
    groups += fmt::format("[[particles]]\nmaterial = \"{}\"\ndiameter = 0.01\nfill = {{ count = 1 }}\n", material);
  Scene scene = read_scene_text(head + groups, "scene.toml");
  scene.particles.clear();
  return scene;
}

ParticleGroup filled(decltype(ParticleGroup::fill) fill, double low, double high, std::uint64_t seed) {
  ParticleGroup group;
  group.material = seed % 2 ? "glass" : "steel";
  group.diameter.kind = SizeDistribution::Kind::uniform;
  group.diameter.low = low;
  group.diameter.high = high;
  group.velocity_deviation = 0.3;
  group.seed = seed;
  group.fill = std::move(fill);
  return group;
}

LatticeFill lattice(Box box, double spacing, LatticeFill::Kind kind = LatticeFill::Kind::cubic) {
  LatticeFill fill;
  fill.kind = kind;
  fill.region = BoxRegion{box};
  fill.spacing = spacing;
  fill.jitter = 0.8;
  return fill;
}

RandomFill random_fill(Box box, double fraction) {
  RandomFill fill;
  fill.region = BoxRegion{box};
  fill.solid_fraction = fraction;
  return fill;
}

/// What the ranks of `world` hold together is what one makes alone; returns this rank's number of grains.
std::size_t check_dealt(const Scene& scene, const std::vector<GrainSeed>& whole, const World& world) {
  const DealtGrains dealt = deal_grains(scene, 1, world);
  REQUIRE(dealt.gids.size() == dealt.seeds.size());
  for (std::size_t i = 0; i < dealt.gids.size(); ++i) {
    REQUIRE(dealt.gids[i] < whole.size());
    if (i > 0) REQUIRE(dealt.gids[i] > dealt.gids[i - 1]);
    const GrainSeed &own = dealt.seeds[i], &expected = whole[dealt.gids[i]];
    REQUIRE(own.position == expected.position);
    REQUIRE(own.velocity == expected.velocity);
    REQUIRE(own.radius == expected.radius);
    REQUIRE(own.material == expected.material);
  }
  std::uint64_t n_all = dealt.seeds.size();
  world.sum(std::span(&n_all, 1));
  CHECK(n_all == whole.size());
  return dealt.seeds.size();
}

}  // namespace

TEST_CASE("fills of every kind, one into another, are dealt out as one rank makes them") {
  Scene scene = empty_scene();
  const Box box = scene.domain.box();
  const Box lower{box.low, {0.3, 0.25, 0.1}}, middle{{0.05, 0.0, 0.06}, {0.3, 0.2, 0.16}};
  ListedGrains boulders;
  boulders.grains = {{{0.1, 0.1, 0.08}, {}, {}, 0.04, 0}, {{0.25, 0.1, 0.15}, {}, {}, 0.03, 1}};
  boulders.has_radius = true;
  ParticleGroup listed;
  listed.fill = boulders;
  LatticeFill few = lattice({{0.0, 0.0, 0.17}, {0.3, 0.25, 0.25}}, 0.011);
  few.count = 700;
  scene.particles = {
      listed,
      filled(lattice(lower, 0.0105), 0.008, 0.01, 1),
      filled(random_fill(middle, 0.1), 0.004, 0.006, 2),
      filled(random_fill(middle, 0.05), 0.002, 0.004, 3),
      filled(lattice({box.low, {0.3, 0.25, 0.16}}, 0.009, LatticeFill::Kind::hexagonal), 0.004, 0.0085, 4),
      filled(few, 0.005, 0.006, 5),
      filled(random_fill({{0.0, 0.0, 0.2}, {0.3, 0.25, 0.25}}, 0.02), 0.003, 0.004, 6)};
  const std::vector<GrainSeed> whole = make_grains(scene, 1);
  CHECK(whole.size() > 5000);
  const World& all = ranks::world();
  for (int n = 1; n <= all.size(); ++n)
    if (const std::optional<World> world = all.first(n)) {
      INFO(n << " ranks");
      const std::size_t n_own = check_dealt(scene, whole, *world);
      CHECK(n_own < whole.size() / static_cast<std::size_t>(n) * 13 / 10 + 10);
    }
  Simulation alone(scene, 1), simulation(scene, 1, all);
  CHECK(simulation.n_grains() == whole.size());
  CHECK(hash_after(simulation, 50) == hash_after(alone, 50));
}

TEST_CASE(
    "no rank holds more than its part of a lattice while it is made, and of a random fill only the first one does, as "
    "bare spheres") {
  const World& all = ranks::world();
  const auto n_ranks = static_cast<std::size_t>(all.size());
  Scene scene = empty_scene();
  std::vector<GrainSeed> whole;
  const auto made_alone = memory_of([&] { whole = make_grains(scene, 1); });
  CHECK(whole.empty());
  CHECK(made_alone < 10000);

  scene.particles = {filled(lattice(scene.domain.box(), 0.0044), 0.003, 0.004, 1)};
  const std::size_t of_lattice = memory_of([&] { whole = make_grains(scene, 1); });
  REQUIRE(whole.size() > 100000);
  CHECK(of_lattice > whole.size() * sizeof(GrainSeed));
  const std::size_t dealt = memory_of([&] { deal_grains(scene, 1, all); });
  CHECK(dealt < of_lattice / n_ranks * 11 / 10 + 20000);
  check_dealt(scene, whole, all);

  scene.particles = {filled(random_fill(scene.domain.box(), 0.1), 0.003, 0.004, 1)};
  const std::size_t of_fill = memory_of([&] { whole = make_grains(scene, 1); });
  REQUIRE(whole.size() > 60000);
  const std::size_t dealt_fill = memory_of([&] { deal_grains(scene, 1, all); });
  if (!all.is_root()) CHECK(dealt_fill < of_fill / n_ranks * 11 / 10 + 20000);
  if (!all.is_alone()) CHECK(dealt_fill < of_fill);
  check_dealt(scene, whole, all);
}

TEST_CASE("a fill that cannot be made is the same error on all ranks") {
  const World& all = ranks::world();
  Scene scene = empty_scene();
  const auto said = [&](ParticleGroup group, const std::string& what) {
    scene.particles = {filled(lattice({{0, 0, 0}, {0.3, 0.25, 0.05}}, 0.011), 0.005, 0.01, 1), std::move(group)};
    const std::string error = error_of([&] { deal_grains(scene, 1, all); });
    INFO(error);
    CHECK(error.find(what) != std::string::npos);
    CHECK(ranks::is_same_on_all(all, error));
  };
  LatticeFill many = lattice({{0, 0, 0}, {0.3, 0.25, 0.05}}, 0.011);
  many.count = 1000;
  said(filled(many, 0.005, 0.01, 2), "free sites");
  said(filled(random_fill({{0, 0, 0}, {0.1, 0.1, 0.1}}, 0.72), 0.02, 0.02, 2), "do not fit into");
  said(filled(random_fill({{0, 0, 0}, {0.1, 0.1, 0.1}}, 1.5), 0.02, 0.02, 2), "must lie between 0 and 1");
}
