// Outlets and inlets.
#include <algorithm>

#include "engine/scene/checks.hpp"
#include "engine/scene/lists.hpp"

namespace moraine::checks {

namespace {

/// A box somewhere in the domain.
void check_place(const Scene& scene, const Box& box, const std::string& key, Findings& found) {
  if (is_usable(scene.domain) && !meets(box, scene.domain.box()))
    found.error(key, "reaches from {} m, nowhere inside the domain, {} m", text(box), text(scene.domain.box()));
}

void check_outlet_place(const Scene& scene, const Outlet& outlet, const std::string& key, Findings& found) {
  const auto& where = outlet.where;
  if (const auto* box = std::get_if<Box>(&where)) {
    if (found.box(key + ".box", *box)) check_place(scene, *box, key + ".box", found);
  } else if (const auto* cylinder = std::get_if<CylinderRegion>(&where)) {
    found.finite(key + ".cylinder.base", cylinder->base, "m");
    const bool is_good = found.positive(key + ".cylinder.radius", cylinder->radius, "m") &&
                         found.positive(key + ".cylinder.length", cylinder->length, "m");
    if (is_good) check_place(scene, bounds(*cylinder), key + ".cylinder", found);
  } else if (const auto* sphere = std::get_if<SphereRegion>(&where)) {
    if (found.positive(key + ".sphere.radius", sphere->radius, "m"))
      check_place(scene, bounds(*sphere), key + ".sphere", found);
  } else if (const auto* plane = std::get_if<PlaneShape>(&where)) {
    check_plane(*plane, key, scene.domain, found);
  } else if (const auto* disc = std::get_if<DiscShape>(&where)) {
    check_disc(*disc, key, scene.domain, found);
  } else if (const auto* mesh = std::get_if<MeshShape>(&where)) {
    check_mesh(*mesh, key, scene.domain, found);
  } else {
    const int face = std::get<int>(where);
    if (face < 0 || face > 5)
      found.error(key + ".face", "is {}; expected 0 to 5 (x-low, x-high, y-low, y-high, z-low, z-high)", face);
    else if (scene.domain.periodic[static_cast<std::size_t>(face / 2)])
      found.error(key + ".face", "is \"{}\", but the domain is periodic along {}: nothing ever leaves there",
                  face_name(face), axis_names[face / 2]);
  }
}

void check_times(double from, double until, const std::string& key, Findings& found) {
  const bool has_from = found.finite(key + ".from", from, "s");
  if (std::isnan(until) || (has_from && until <= from))
    found.error(key + ".until", "is {}; expected more than from = {} [s]", until, from);
}

void check_recycling(const Scene& scene, const Outlet& outlet, const std::string& key, Findings& found) {
  if (outlet.recycles.empty()) return;
  std::vector<std::string> names;
  for (const Inlet& inlet : scene.inlets) names.push_back(inlet.name);
  const auto inlet = std::find_if(scene.inlets.begin(), scene.inlets.end(),
                                  [&](const Inlet& one) { return one.name == outlet.recycles; });
  if (inlet == scene.inlets.end())
    found.error(key, "\"{}\" is not an inlet{}{}", outlet.recycles, nearest(outlet.recycles, names),
                names.empty() ? "; the scene has none" : "; inlets: " + listing(names));
  else if (inlet->list)
    found.error(key,
                "\"{}\" gives a list of grains at their places; grains come back through an inlet with a region or "
                "an opening only",
                outlet.recycles);
}

double largest_of(const Inlet& inlet) {
  ParticleGroup group;
  group.diameter = inlet.diameter;
  return diameter_range(group).second;
}

void check_flat_opening(const Scene& scene, const Box& box, double narrowest, double largest, const std::string& key,
                        Findings& found) {
  check_place(scene, box, key, found);
  if (narrowest < largest)
    found.error(key, "is {:.6g} m wide: too narrow for the largest diameter, {:.6g} m", narrowest, largest);
}

void check_polygon(const Scene& scene, const PolygonShape& polygon, const std::string& key, Findings& found) {
  const std::vector<Vec3>& points = polygon.points;
  if (points.size() < 3) {
    found.error(key, "has {} corners; expected 3 or more", points.size());
    return;
  }
  Box box = Box::empty();
  Vec3 area;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!found.finite(fmt::format("{}[{}]", key, k), points[k], "m")) return;
    box.include(points[k]);
    if (k > 0 && k + 1 < points.size()) area += cross(points[k] - points[0], points[k + 1] - points[0]);
  }
  const double size = length(box.size());
  if (!(length(area) > 1e-12 * size * size)) {
    found.error(key, "has no area; expected the corners of a flat polygon, in order around it");
    return;
  }
  for (std::size_t k = 3; k < points.size(); ++k)
    if (std::abs(dot(normalized(area), points[k] - points[0])) > 1e-6 * size) {
      found.error(fmt::format("{}[{}]", key, k), "is {:.3g} m off the plane of the others; expected a flat polygon",
                  std::abs(dot(normalized(area), points[k] - points[0])));
      return;
    }
  check_place(scene, box, key, found);
}

void check_inlet_place(const Scene& scene, const Inlet& inlet, const std::string& key, Findings& found) {
  const double largest = inlet.list ? 0.0 : largest_of(inlet);
  const auto check_as_region = [&](const Region& region) {
    if (check_region(scene, region, key + ".region", found) && largest > 0.0)
      check_room(bounds(region), largest * (1.0 - 1e-9), key + ".region", scene.domain, found);
  };
  if (inlet.list) return;
  if (const auto* box = std::get_if<BoxRegion>(&inlet.where)) check_as_region(*box);
  if (const auto* cylinder = std::get_if<CylinderRegion>(&inlet.where)) check_as_region(*cylinder);
  if (const auto* sphere = std::get_if<SphereRegion>(&inlet.where)) check_as_region(*sphere);
  if (const auto* disc = std::get_if<DiscShape>(&inlet.where)) {
    check_disc(*disc, key, scene.domain, found);
    const double across = disc->hole_radius > 0.0 ? disc->radius - disc->hole_radius : 2.0 * disc->radius;
    check_flat_opening(scene, Box{disc->centre, disc->centre}.grown(disc->radius), across, largest, key + ".disc",
                       found);
  }
  if (const auto* polygon = std::get_if<PolygonShape>(&inlet.where))
    check_polygon(scene, *polygon, key + ".polygon", found);
}

/// What the inlet gives: one rule, or none where grains come back through it.
void check_amount(const Scene& scene, const Inlet& inlet, const std::string& key, Findings& found) {
  std::string given;
  int n_given = 0;
  const auto count = [&](bool is_there, const char* name) {
    if (!is_there) return;
    given += (n_given++ ? " and " : "") + std::string(name);
  };
  count(inlet.number_rate.has_value(), "number_rate");
  count(inlet.mass_rate.has_value(), "mass_rate");
  count(inlet.fill_count.has_value(), "fill.count");
  count(inlet.fill_mass.has_value(), "fill.mass");
  count(inlet.fill_solid_fraction.has_value(), "fill.solid_fraction");
  count(inlet.list.has_value(), "file");
  const bool is_recycling = std::any_of(scene.outlets.begin(), scene.outlets.end(),
                                        [&](const Outlet& outlet) { return outlet.recycles == inlet.name; });
  if (n_given > 1 || (n_given == 0 && !is_recycling))
    found.error(key, "has {}; expected one of number_rate, mass_rate, fill (count, mass or solid_fraction) and file{}",
                n_given ? given : "nothing to give",
                n_given ? "" : ", or an [[outlet]] with recycle = \"" + inlet.name + "\"");
  if (inlet.number_rate) found.positive(key + ".number_rate", *inlet.number_rate, "1/s");
  if (inlet.mass_rate) found.positive(key + ".mass_rate", *inlet.mass_rate, "kg/s");
  if (inlet.fill_count && *inlet.fill_count < 1)
    found.error(key + ".fill.count", "is {}; expected 1 or more", *inlet.fill_count);
  if (inlet.fill_mass) found.positive(key + ".fill.mass", *inlet.fill_mass, "kg");
  constexpr double most = 0.5;  // of what random places reach: 0.38, and more as grains settle
  if (inlet.fill_solid_fraction && !(*inlet.fill_solid_fraction > 0.0 && *inlet.fill_solid_fraction <= most))
    found.error(key + ".fill.solid_fraction",
                "is {}; expected more than 0 and at most {}: grains are put in one by one", *inlet.fill_solid_fraction,
                most);
  const bool is_flat =
      std::holds_alternative<DiscShape>(inlet.where) || std::holds_alternative<PolygonShape>(inlet.where);
  if (is_flat && (inlet.fill_count || inlet.fill_mass || inlet.fill_solid_fraction))
    found.error(key + ".fill", "needs a region: nothing is ever inside a disc or polygon");
  if (inlet.total_count && *inlet.total_count < 1)
    found.error(key + ".total_count", "is {}; expected 1 or more", *inlet.total_count);
  if (inlet.total_mass) found.positive(key + ".total_mass", *inlet.total_mass, "kg");
}

}  // namespace

void check_outlets(const Scene& scene, Findings& found) {
  for (std::size_t i = 0; i < scene.outlets.size(); ++i) {
    const Outlet& outlet = scene.outlets[i];
    const std::string key = fmt::format("outlet[{}]", i);
    check_name(scene.outlets, i, "outlet", found);
    check_outlet_place(scene, outlet, key, found);
    if (outlet.is_once)
      found.positive(key + ".at", outlet.from, "s");
    else
      check_times(outlet.from, outlet.until, key, found);
    check_recycling(scene, outlet, key + ".recycle", found);
  }
}

void check_inlets(const Scene& scene, Findings& found) {
  std::vector<std::string> materials;
  for (const Material& material : scene.materials) materials.push_back(material.name);
  for (std::size_t i = 0; i < scene.inlets.size(); ++i) {
    const Inlet& inlet = scene.inlets[i];
    const std::string key = fmt::format("inlet[{}]", i);
    check_name(scene.inlets, i, "inlet", found);
    const bool has_materials = inlet.list && inlet.material.empty();
    if (!has_materials && scene.material_index(inlet.material) < 0)
      found.error(key + ".material", "\"{}\" is not a material{}", inlet.material, nearest(inlet.material, materials));
    if (!inlet.list || !inlet.list->has_radius) check_sizes(inlet.diameter, key + ".diameter", found);
    check_inlet_place(scene, inlet, key, found);
    check_amount(scene, inlet, key, found);
    check_times(inlet.from, inlet.until, key, found);
    found.not_negative(key + ".interval", inlet.interval, "s");
    found.finite(key + ".velocity", inlet.velocity, "m/s");
    found.not_negative(key + ".velocity_deviation", inlet.velocity_deviation, "m/s");
    found.finite(key + ".angular_velocity", inlet.angular_velocity, "rad/s");
  }
}

}  // namespace moraine::checks
