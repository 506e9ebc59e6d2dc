// From what a file says to a scene: defaults that depend on other keys, pairs without names, and the files it names.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <type_traits>

#include "engine/scene/lists.hpp"
#include "io/files/files.hpp"
#include "io/scene_toml/scene_keys.hpp"

namespace moraine::scene_toml {

namespace {

class Assembler {
 public:
  Assembler(const SceneDraft& draft, const std::filesystem::path& base, Reader& reader, const World& world)
      : draft_(draft), base_(base), reader_(reader), world_(world) {}

  Scene assemble(std::vector<std::size_t>& pair_origin) {
    scene_.title = draft_.title;
    scene_.domain = draft_.domain;
    scene_.time = draft_.time;
    scene_.materials = draft_.materials;
    scene_.run = draft_.run;
    scene_.output = draft_.output;
    // What was not read must not be judged by: a domain that is not a number judges nothing.
    if (reader_.is_doubtful("domain.low") || reader_.is_doubtful("domain.high") ||
        reader_.is_doubtful("domain.dimensions"))
      scene_.domain.low.x = std::numeric_limits<double>::quiet_NaN(), reader_.doubt("domain.low");
    for (std::size_t i = 0; i < draft_.particles.size(); ++i) add_particles(i);
    for (std::size_t i = 0; i < draft_.walls.size(); ++i) add_wall(i);
    for (std::size_t i = 0; i < draft_.outlets.size(); ++i) add_outlet(i);
    for (std::size_t i = 0; i < draft_.inlets.size(); ++i) add_inlet(i);
    if (draft_.gas) add_gas(*draft_.gas);
    for (std::size_t i = 0; i < draft_.probes.size(); ++i) add_probe(i);
    add_contact(pair_origin);
    return std::move(scene_);
  }

 private:
  Box box(const BoxDraft& box) const {
    return {box.low.value_or(scene_.domain.low), box.high.value_or(scene_.domain.high)};
  }

  std::string only_material() const { return scene_.materials.size() == 1 ? scene_.materials[0].name : ""; }

  /// Exactly one of several keys must be there.
  bool expect_one(const std::string& path, const std::vector<std::pair<std::string, bool>>& keys,
                  const std::string& what) {
    std::string found, expected;
    int count = 0;
    for (const auto& [key, is_there] : keys) {
      expected += (expected.empty() ? "" : ", ") + key;
      if (!is_there) continue;
      found += (count++ ? " and " : "") + key;
    }
    if (count == 1) return true;
    if (count > 1)
      reader_.complain_at(path, fmt::format("has {}; expected exactly one {} of: {}", found, what, expected));
    else if (!is_any_doubtful(path, keys))
      reader_.complain_at(path, fmt::format("has no {0}; expected exactly one {0} of: {1}", what, expected));
    return false;
  }

  /// One of the keys was there but could not be read, or was misspelt: nothing is missing then.
  bool is_any_doubtful(const std::string& path, const std::vector<std::pair<std::string, bool>>& keys) const {
    if (reader_.doubtful().contains(path)) return true;
    return std::any_of(keys.begin(), keys.end(),
                       [&](const auto& key) { return reader_.is_doubtful(path + "." + key.first); });
  }

  Region region(const std::optional<RegionDraft>& draft, const std::string& path) {
    if (!draft) return BoxRegion{scene_.domain.box()};
    expect_one(path,
               {{"box", draft->box.has_value()},
                {"cylinder", draft->cylinder.has_value()},
                {"sphere", draft->sphere.has_value()}},
               "shape");
    if (draft->cylinder) return *draft->cylinder;
    if (draft->sphere) return *draft->sphere;
    return BoxRegion{box(draft->box.value_or(BoxDraft{}))};
  }

  // ---- grains
  // ----------------------------------------------------------------------------------------------------------

  void add_particles(std::size_t i) {
    const ParticleDraft& draft = draft_.particles[i];
    const std::string path = fmt::format("particles[{}]", i);
    ParticleGroup group = draft.group;
    group.diameter = draft.diameter;
    bool has_sizes = draft.has_diameter;
    if (draft.fill) {
      add_fill(*draft.fill, path + ".fill", group);
      if (const auto* listed = std::get_if<ListedGrains>(&group.fill)) has_sizes = has_sizes || listed->has_radius;
    }
    const auto* listed = std::get_if<ListedGrains>(&group.fill);
    if (group.material.empty() && !(listed && listed->has_material)) {
      group.material = only_material();
      if (group.material.empty()) reader_.complain_missing_key(path, "material", "particles");
    }
    // A file that could not be read might have given the sizes.
    if (!has_sizes && !reader_.is_doubtful(path + ".fill.file"))
      reader_.complain_missing_key(path, "diameter", "particles");
    if (!has_sizes) reader_.doubt(path + ".diameter");
    scene_.particles.push_back(std::move(group));
  }

  void add_fill(const FillDraft& fill, const std::string& path, ParticleGroup& group) {
    const bool is_misread =
        !fill.lattice && (reader_.is_doubtful(path + ".solid_fraction") || reader_.is_doubtful(path + ".count"));
    const bool is_random = fill.solid_fraction || (fill.count && !fill.lattice) || is_misread;
    const char* random = fill.solid_fraction ? "solid_fraction" : fill.count ? "count" : "solid_fraction or count";
    if (!expect_one(path,
                    {{random, is_random},
                     {"lattice", fill.lattice.has_value()},
                     {"file", fill.file.has_value()},
                     {"positions", fill.positions.has_value()}},
                    "kind of fill"))
      return;
    if (fill.solid_fraction && fill.count)
      reader_.complain_at(path, "has solid_fraction and count; expected exactly one of them");
    refuse_strays(fill, path);
    if (fill.positions) {
      group.fill = listed_in_scene(*fill.positions, group);
    } else if (fill.file) {
      group.fill = listed_in_file(*fill.file, path + ".file", group);
    } else if (fill.lattice) {
      group.fill =
          LatticeFill{*fill.lattice, region(fill.region, path + ".region"), fill.spacing, fill.jitter, fill.count};
    } else {
      group.fill = RandomFill{region(fill.region, path + ".region"), fill.solid_fraction, fill.count};
    }
  }

  /// Keys that do nothing with this kind of fill would mislead whoever wrote them.
  void refuse_strays(const FillDraft& fill, const std::string& path) {
    const Found found = follow(reader_.root(), parse_path(path));
    const auto refuse = [&](const char* key, const char* why) {
      if (found.node->find(key)) reader_.complain_about(path + "." + key, why);
    };
    if (!fill.lattice) {
      refuse("spacing", "goes with lattice only");
      refuse("jitter", "goes with lattice only");
    }
    if (fill.file || fill.positions)
      refuse("region", "goes with solid_fraction, count and lattice only: listed grains have their places");
  }

  /// The rows of lists that this rank keeps: some of all, where nothing but lists is to be born. To fill space around
  /// listed grains, the first rank must know them all; it then has them all to itself.
  ListShare share() const {
    const auto is_list = [](const ParticleDraft& group) {
      return group.fill && (group.fill->file || group.fill->positions);
    };
    ListShare share;
    share.rank = static_cast<std::uint64_t>(world_.rank());
    if (std::all_of(draft_.particles.begin(), draft_.particles.end(), is_list))
      share.n_ranks = static_cast<std::uint64_t>(world_.size());
    return share;
  }

  std::uint16_t material_number(const ParticleGroup& group) const {
    return static_cast<std::uint16_t>(std::max(0, scene_.material_index(group.material)));
  }
  double middle() const { return 0.5 * (scene_.domain.low.z + scene_.domain.high.z); }

  ListedGrains listed_in_scene(const std::vector<Vec3>& positions, const ParticleGroup& group) const {
    ListedGrains listed;
    listed.share = share();
    for (std::size_t row = 0; row < positions.size(); ++row) {
      if (!listed.share.has(row)) continue;
      Vec3 position = positions[row];
      if (std::isnan(position.z) && scene_.domain.dimensions == 2) position.z = middle();
      listed.grains.push_back({position, {}, group.angular_velocity, 0.0, material_number(group)});
    }
    share_facts(world_, listed);
    return listed;
  }

  ListedGrains listed_in_file(const std::string& file, const std::string& path, const ParticleGroup& group) {
    GrainFileContext context;
    for (const Material& material : scene_.materials) context.materials.push_back(material.name);
    if (!group.material.empty()) context.material = material_number(group);
    context.velocity = group.velocity;
    context.angular_velocity = group.angular_velocity;
    if (scene_.domain.dimensions == 2) context.z = middle();
    context.share = share();
    try {
      return load_grains(base_ / file, context, world_);
    } catch (const FileError& error) {
      complain_about_file(path, error);
      ListedGrains none;
      none.source = file;
      return none;
    }
  }

  void complain_about_file(const std::string& path, const FileError& error) {
    std::istringstream lines(error.what());  // a table may have several bad lines
    for (std::string line; std::getline(lines, line);) reader_.complain_about(path, line);
  }

  // ---- walls, outlets, probes
  // ------------------------------------------------------------------------------------------

  void add_wall(std::size_t i) {
    const WallDraft& draft = draft_.walls[i];
    const std::string path = fmt::format("wall[{}]", i);
    WallDefinition wall = draft.wall;
    if (wall.material.empty()) wall.material = only_material();
    // A mirror has no material of its own; the engine's tables want one for every wall.
    if (wall.material.empty() && wall.symmetry && !scene_.particles.empty())
      wall.material = scene_.particles[0].material;
    if (wall.material.empty()) reader_.complain_missing_key(path, "material", "wall");
    for (std::size_t m = 0; m < wall.motion.size(); ++m)
      refuse_stray_motion_keys(wall.motion[m], fmt::format("{}.motion[{}]", path, m));
    const bool has_one = expect_one(path,
                                    {{"plane", draft.plane.has_value()},
                                     {"box", draft.box.has_value()},
                                     {"cylinder", draft.cylinder.has_value()},
                                     {"cone", draft.cone.has_value()},
                                     {"disc", draft.disc.has_value()},
                                     {"mesh", draft.mesh.has_value()}},
                                    "shape");
    if (has_one) set_shape(draft, path, wall);
    scene_.walls.push_back(std::move(wall));
  }

  /// Keys that do nothing with this type of motion would mislead whoever wrote them.
  void refuse_stray_motion_keys(const WallMotion& motion, const std::string& path) {
    using Kind = WallMotion::Kind;
    if (reader_.is_doubtful(path + ".type")) return;
    const Found found = follow(reader_.root(), parse_path(path));
    const auto goes_with = [&](const char* key, std::initializer_list<Kind> kinds, const char* words) {
      if (found.node->find(key) && std::find(kinds.begin(), kinds.end(), motion.kind) == kinds.end())
        reader_.complain_about(path + "." + key, fmt::format("goes with type {} only", words));
    };
    goes_with("velocity", {Kind::translate}, "translate");
    goes_with("places", {Kind::translate}, "translate");
    goes_with("speed", {Kind::rotate}, "rotate");
    goes_with("angles", {Kind::rotate}, "rotate");
    goes_with("ramp", {Kind::translate, Kind::rotate}, "translate and rotate");
    goes_with("axis", {Kind::rotate, Kind::vibrate, Kind::swing, Kind::servo}, "rotate, vibrate, swing and servo");
    goes_with("origin", {Kind::rotate, Kind::swing, Kind::servo, Kind::script}, "rotate, swing, servo and script");
    for (const char* key : {"amplitude", "frequency", "phase"})
      goes_with(key, {Kind::vibrate, Kind::swing}, "vibrate and swing");
    goes_with("max_speed", {Kind::servo, Kind::script}, "servo and script");
    for (const char* key : {"force", "torque", "gain", "mass"}) goes_with(key, {Kind::servo}, "servo");
  }

  void set_shape(const WallDraft& draft, const std::string& path, WallDefinition& wall) {
    if (draft.plane) wall.shape = *draft.plane;
    if (draft.box) wall.shape = BoxShape{box(*draft.box)};
    if (draft.cylinder) wall.shape = *draft.cylinder;
    if (draft.cone) wall.shape = *draft.cone;
    if (draft.disc) wall.shape = *draft.disc;
    if (draft.mesh) wall.shape = mesh(*draft.mesh, path + ".mesh");
  }

  MeshShape mesh(const MeshDraft& draft, const std::string& path) {
    MeshShape shape{draft.file, {}};
    if (draft.file.empty()) {
      if (!reader_.is_doubtful(path + ".file"))
        reader_.complain_at(path + ".file", "is empty; expected the name of an STL or OBJ file");
      return shape;
    }
    if (!std::isfinite(draft.scale) || draft.scale == 0.0)
      reader_.complain_at(
          path + ".scale",
          fmt::format("is {}; expected a number other than 0, such as 0.001 for millimetres", draft.scale));
    try {
      shape.mesh = load_mesh_for_all(draft);
    } catch (const FileError& error) {
      complain_about_file(path + ".file", error);
      reader_.doubt(path);
    }
    return shape;
  }

  /// The first rank reads, and all have the mesh or the error.
  TriangleMesh load_mesh_for_all(const MeshDraft& draft) const {
    TriangleMesh mesh;
    std::string failure;
    try {
      if (world_.is_root()) mesh = load_mesh(base_ / draft.file, draft.scale, draft.translate);
    } catch (const FileError& error) {
      failure = error.what();
    }
    world_.broadcast(failure);
    if (!failure.empty()) throw FileError(failure);
    broadcast(mesh.vertices);
    broadcast(mesh.triangles);
    return mesh;
  }

  template <typename T>
  void broadcast(std::vector<T>& values) const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (world_.is_alone()) return;
    std::vector<std::byte> bytes(values.size() * sizeof(T));
    if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
    world_.broadcast(bytes);
    values.resize(bytes.size() / sizeof(T));
    if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  }

  void add_outlet(std::size_t i) {
    const OutletDraft& draft = draft_.outlets[i];
    const std::string path = fmt::format("outlet[{}]", i);
    expect_one(path,
               {{"face", draft.face.has_value()},
                {"box", draft.box.has_value()},
                {"cylinder", draft.cylinder.has_value()},
                {"sphere", draft.sphere.has_value()},
                {"plane", draft.plane.has_value()},
                {"disc", draft.disc.has_value()},
                {"mesh", draft.mesh.has_value()}},
               "place");
    Outlet outlet = draft.outlet;
    outlet.where = draft.face.value_or(0);
    if (draft.box) outlet.where = box(*draft.box);
    if (draft.cylinder) outlet.where = *draft.cylinder;
    if (draft.sphere) outlet.where = *draft.sphere;
    if (draft.plane) outlet.where = *draft.plane;
    if (draft.disc) outlet.where = *draft.disc;
    if (draft.mesh) outlet.where = mesh(*draft.mesh, path + ".mesh");
    if (draft.at) {
      const Found found = follow(reader_.root(), parse_path(path));
      for (const char* key : {"from", "until"})
        if (found.node->find(key)) reader_.complain_about(path + "." + key, "does not go with at");
      outlet.from = *draft.at;
      outlet.is_once = true;
    }
    scene_.outlets.push_back(std::move(outlet));
  }

  void add_inlet(std::size_t i) {
    const InletDraft& draft = draft_.inlets[i];
    const std::string path = fmt::format("inlet[{}]", i);
    Inlet inlet = draft.inlet;
    inlet.diameter = draft.diameter;
    if (draft.fill) {
      inlet.fill_count = draft.fill->count;
      inlet.fill_mass = draft.fill->mass;
      inlet.fill_solid_fraction = draft.fill->solid_fraction;
    }
    if (draft.file) {
      inlet.list = inlet_list(*draft.file, path + ".file", inlet);
      if (draft.region || draft.face || draft.disc || draft.polygon)
        reader_.complain_at(path, "has file and a place; grains of a file have their places");
    } else {
      set_inlet_place(draft, path, inlet);
    }
    if (inlet.material.empty() && !(inlet.list && inlet.list->has_material)) inlet.material = only_material();
    if (inlet.material.empty() && !(inlet.list && inlet.list->has_material))
      reader_.complain_missing_key(path, "material", "inlet");
    const bool has_sizes = draft.has_diameter || (inlet.list && inlet.list->has_radius);
    if (!has_sizes && !reader_.is_doubtful(path + ".file")) reader_.complain_missing_key(path, "diameter", "inlet");
    if (!has_sizes) reader_.doubt(path + ".diameter");
    scene_.inlets.push_back(std::move(inlet));
  }

  void set_inlet_place(const InletDraft& draft, const std::string& path, Inlet& inlet) {
    const bool has_one = expect_one(path,
                                    {{"region", draft.region.has_value()},
                                     {"face", draft.face.has_value()},
                                     {"disc", draft.disc.has_value()},
                                     {"polygon", draft.polygon.has_value()}},
                                    "place");
    if (draft.part && !draft.face) reader_.complain_about(path + ".part", "goes with face only");
    if (!has_one) return reader_.doubt(path + ".region");
    if (draft.region)
      std::visit([&](const auto& shape) { inlet.where = shape; }, region(draft.region, path + ".region"));
    if (draft.disc) inlet.where = *draft.disc;
    if (draft.polygon) inlet.where = PolygonShape{*draft.polygon};
    if (draft.face) inlet.where = slab_at(*draft.face, draft.part, draft.diameter);
  }

  /// Room for one layer of grains against a face of the domain, or a part of it.
  BoxRegion slab_at(int face, const std::optional<BoxDraft>& part, const SizeDistribution& sizes) const {
    const Box domain = scene_.domain.box();
    Box slab = part ? box(*part) : domain;
    for (int axis = 0; axis < 3; ++axis) {
      slab.low[axis] = std::max(slab.low[axis], domain.low[axis]);
      slab.high[axis] = std::min(slab.high[axis], domain.high[axis]);
    }
    const double largest =
        sizes.kind == SizeDistribution::Kind::single ? sizes.value
        : sizes.kind == SizeDistribution::Kind::list
            ? (sizes.values.empty() ? 0.0 : *std::max_element(sizes.values.begin(), sizes.values.end()))
            : sizes.high;
    const int axis = face / 2;
    slab.low[axis] = face % 2 == 0 ? domain.low[axis] : domain.high[axis] - largest;
    slab.high[axis] = face % 2 == 0 ? domain.low[axis] + largest : domain.high[axis];
    return {slab};
  }

  /// Every rank has all of it: any of them may have to give birth to any of its grains.
  ListedGrains inlet_list(const std::string& file, const std::string& path, const Inlet& inlet) {
    GrainFileContext context;
    for (const Material& material : scene_.materials) context.materials.push_back(material.name);
    if (!inlet.material.empty())
      context.material = static_cast<std::uint16_t>(std::max(0, scene_.material_index(inlet.material)));
    context.velocity = inlet.velocity;
    context.angular_velocity = inlet.angular_velocity;
    if (scene_.domain.dimensions == 2) context.z = middle();
    try {
      return load_grains(base_ / file, context);
    } catch (const FileError& error) {
      complain_about_file(path, error);
      ListedGrains none;
      none.source = file;
      return none;
    }
  }

  void add_gas(const GasDraft& draft) {
    Gas gas = draft.gas;
    for (std::size_t i = 0; i < draft.boundaries.size(); ++i) {
      const GasBoundaryDraft& entry = draft.boundaries[i];
      const std::string path = fmt::format("gas.boundary[{}]", i);
      refuse_stray_boundary_keys(entry.boundary, path);
      // What lies on a face that was not read cannot be judged.
      if (reader_.is_doubtful(path + ".face"))
        for (const char* key : {".velocity", ".part"}) reader_.doubt(path + key);
      gas.boundaries.push_back(entry.boundary);
      if (entry.part) gas.boundaries.back().part = box(*entry.part);
    }
    const Node* table = reader_.root().find("gas");
    if (!draft_.particles.empty() && table && !table->find("drag")) reader_.complain_missing_key("gas", "drag", "gas");
    scene_.gas = std::move(gas);
  }

  /// Keys that do nothing with this kind of boundary would mislead whoever wrote them.
  void refuse_stray_boundary_keys(const GasBoundary& boundary, const std::string& path) {
    using Kind = GasBoundary::Kind;
    if (reader_.is_doubtful(path + ".type")) return;
    const Found found = follow(reader_.root(), parse_path(path));
    const auto refuse = [&](const char* key, const char* why) {
      if (found.node->find(key)) reader_.complain_about(path + "." + key, why);
    };
    const bool has_velocity = boundary.kind == Kind::velocity || boundary.kind == Kind::no_slip;
    if (!has_velocity) {
      refuse("velocity", "goes with type velocity and no_slip only");
      refuse("ramp", "goes with type velocity and no_slip only");
    }
    if (boundary.kind != Kind::velocity) refuse("profile", "goes with type velocity only");
    if (boundary.kind != Kind::pressure) refuse("pressure", "goes with type pressure only");
  }

  void add_probe(std::size_t i) {
    Probe probe = draft_.probes[i].probe;
    if (probe.name.empty()) probe.name = name_of(probe.kind);
    for (Vec3& point : probe.points)
      if (std::isnan(point.z) && scene_.domain.dimensions == 2) point.z = middle();
    probe.region = box(draft_.probes[i].region.value_or(BoxDraft{}));
    if (probe.kind == Probe::Kind::energy && !draft_.energy) scene_.output.energy = true;
    scene_.output.probes.push_back(std::move(probe));
  }

  // ---- contact
  // ---------------------------------------------------------------------------------------------------------

  void add_contact(std::vector<std::size_t>& pair_origin) {
    scene_.contact = draft_.contact.laws;
    const std::vector<PairDraft>& pairs = draft_.contact.pairs;
    std::optional<std::size_t> general;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (pairs[i].between) {
        scene_.contact.pairs.push_back(pairs[i].law);
        scene_.contact.pairs.back().between = *pairs[i].between;
        pair_origin.push_back(i);
      } else if (reader_.is_doubtful(fmt::format("contact.pair[{}].between", i))) {
        reader_.doubt("contact.pair");  // which pair it was meant for is not known
      } else if (general) {
        reader_.complain_at(
            fmt::format("contact.pair[{}]", i),
            fmt::format("has no between, as contact.pair[{}] has none; only one entry can stand for all other pairs",
                        *general));
      } else {
        general = i;
      }
    }
    if (general) add_all_other_pairs(pairs[*general].law, *general, pair_origin);
  }

  /// One entry for each pair that can meet and has none: grains among each other, and grains with walls.
  void add_all_other_pairs(const PairLaw& law, std::size_t origin, std::vector<std::size_t>& pair_origin) {
    const std::vector<bool> is_grain = grain_materials(scene_);
    for (std::size_t a = 0; a < is_grain.size(); ++a)
      for (std::size_t b = a; b < is_grain.size(); ++b) {
        const std::string &first = scene_.materials[a].name, &second = scene_.materials[b].name;
        if ((!is_grain[a] && !is_grain[b]) || scene_.pair_law(first, second)) continue;
        scene_.contact.pairs.push_back(law);
        scene_.contact.pairs.back().between = {first, second};
        pair_origin.push_back(origin);
      }
  }

  const SceneDraft& draft_;
  const std::filesystem::path& base_;
  Reader& reader_;
  const World& world_;
  Scene scene_;
};

}  // namespace

Scene assemble(const SceneDraft& draft, const std::filesystem::path& base_directory, Reader& reader,
               std::vector<std::size_t>& pair_origin, const World& world) {
  return Assembler(draft, base_directory, reader, world).assemble(pair_origin);
}

}  // namespace moraine::scene_toml
