#include "tests/physics/laboratory.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace moraine::physics {

namespace {

std::vector<Vec3> vectors(const Image& image, Field field) {
  std::vector<Vec3> list;
  if (const FieldArray* array = image.find(field))
    for (std::size_t k = 0; k + 2 < array->reals.size(); k += 3)
      list.push_back({array->reals[k], array->reals[k + 1], array->reals[k + 2]});
  return list;
}

}  // namespace

Scene empty_scene(Vec3 low, Vec3 high, double step) {
  Scene scene;
  scene.domain.low = low;
  scene.domain.high = high;
  scene.time.end = 1e6;
  scene.time.step = step;
  scene.output.fields = {"position", "velocity", "force"};
  return scene;
}

PairLaw pair_law(const std::string& a, const std::string& b, double restitution, double friction) {
  PairLaw law;
  law.between = {a, b};
  law.restitution = restitution;
  law.friction = friction;
  return law;
}

void add_grain(Scene& scene, const std::string& material, double radius, Vec3 position, Vec3 velocity, Vec3 spin) {
  ParticleGroup* group = nullptr;
  for (ParticleGroup& g : scene.particles)
    if (g.material == material) group = &g;
  if (!group) {
    group = &scene.particles.emplace_back();
    group->material = material;
    group->diameter.value = 2.0 * radius;
    ListedGrains list;
    list.has_radius = list.has_velocity = true;
    group->fill = list;
  }
  GrainSeed seed;
  seed.position = position;
  seed.velocity = velocity;
  seed.angular_velocity = spin;
  seed.radius = radius;
  seed.material = static_cast<std::uint16_t>(scene.material_index(material));
  std::get<ListedGrains>(group->fill).grains.push_back(seed);
}

void add_plane(Scene& scene, const std::string& name, const std::string& material, Vec3 point, Vec3 normal) {
  WallDefinition wall;
  wall.name = name;
  wall.material = material;
  wall.shape = PlaneShape{point, normal};
  scene.walls.push_back(wall);
}

State state_of(const Simulation& run) {
  std::vector<std::string> fields = {"position", "velocity"};
  const std::vector<std::string>& asked = run.scene().output.fields;
  if (run.scene().contact.rotation) fields.push_back("angular_velocity");
  if (std::find(asked.begin(), asked.end(), "force") != asked.end()) fields.push_back("force");
  const Image image = run.snapshot(fields);
  return {vectors(image, Field::position), vectors(image, Field::velocity), vectors(image, Field::angular_velocity),
          vectors(image, Field::force)};
}

double mass_of(double density, double radius) { return density * 4.0 / 3.0 * pi * radius * radius * radius; }

std::vector<std::vector<double>> read_numbers(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot open " + file);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(in, line);) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::vector<double> row;
    for (double value = 0.0; words >> value;) row.push_back(value);
    if (!row.empty()) rows.push_back(row);
  }
  return rows;
}

std::string data_file(const std::string& name) { return std::string(MORAINE_PHYSICS_DATA) + "/" + name; }

double interpolate(const std::vector<std::vector<double>>& table, double x, std::size_t column) {
  std::size_t i = 1;
  while (i + 1 < table.size() && table[i][0] < x) ++i;
  const std::vector<double>&a = table[i - 1], &b = table[i];
  return a[column] + (b[column] - a[column]) * (x - a[0]) / (b[0] - a[0]);
}

Slope fit_slope(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0.0, mean_y = 0.0, xx = 0.0, xy = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  Slope slope;
  slope.value = xy / xx;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double rest = y[i] - mean_y - slope.value * (x[i] - mean_x);
    squares += rest * rest;
  }
  slope.error = std::sqrt(squares / (n - 2.0) / xx);
  return slope;
}

int n_cores() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

}  // namespace moraine::physics
