// All keys of a scene file, and what they are read into. Private to io/scene_toml.
//
// Drafts hold what the file says, before defaults that depend on other keys are filled in (a region is the whole domain
// where none is given) and before the files it names are loaded; assemble() does both.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "io/scene_toml/pareto.hpp"
#include "io/scene_toml/reader.hpp"

namespace moraine::scene_toml {

struct BoxDraft {
  std::optional<Vec3> low, high;  // none: the domain's
};

struct RegionDraft {
  std::optional<BoxDraft> box;
  std::optional<CylinderRegion> cylinder;
  std::optional<SphereRegion> sphere;
};

struct FillDraft {
  std::optional<RegionDraft> region;
  std::optional<double> solid_fraction;
  std::optional<std::int64_t> count;
  std::optional<LatticeFill::Kind> lattice;
  double spacing = 0.0;
  double jitter = 0.0;
  std::optional<std::string> file;
  std::optional<std::vector<Vec3>> positions;
};

struct ParticleDraft {
  ParticleGroup group;  // all but the fill
  bool has_diameter = false;
  std::optional<FillDraft> fill;
};

struct PairDraft {
  std::optional<std::array<std::string, 2>> between;
  PairLaw law;
};

struct ContactDraft {
  ContactLaws laws;  // all but the pairs
  std::vector<PairDraft> pairs;
};

struct MeshDraft {
  std::string file;
  double scale = 1.0;
  Vec3 translate;
};

struct WallDraft {
  WallDefinition wall;  // all but the shape
  std::optional<PlaneShape> plane;
  std::optional<BoxDraft> box;
  std::optional<CylinderShape> cylinder;
  std::optional<ConeShape> cone;
  std::optional<DiscShape> disc;
  std::optional<MeshDraft> mesh;
};

struct OutletDraft {
  std::string name;
  std::optional<int> face;
  std::optional<BoxDraft> box;
};

struct ProbeDraft {
  Probe probe;  // all but the region
  std::optional<BoxDraft> region;
};

struct GasBoundaryDraft {
  GasBoundary boundary;  // all but the part
  std::optional<BoxDraft> part;
};

struct GasDraft {
  Gas gas;  // all but the boundaries
  std::vector<GasBoundaryDraft> boundaries;
};

/// For `moraine scale`; a run has no use for it.
struct ScaleDraft {
  std::vector<std::string> weak;
};

struct SceneDraft {
  std::string title;
  Domain domain;
  TimeControl time;
  std::vector<Material> materials;
  ContactDraft contact;
  std::vector<ParticleDraft> particles;
  std::vector<WallDraft> walls;
  std::vector<OutletDraft> outlets;
  std::optional<GasDraft> gas;
  Output output;
  std::optional<bool> energy;  // output.energy; none: on where a probe needs it
  std::vector<ProbeDraft> probes;
  RunControl run;
  ScaleDraft scale;
  ParetoTable pareto;
};

/// Reads the whole document; complains to the reader.
SceneDraft read_draft(Reader& reader);

/// Fills in what depends on other keys, and loads the files. `pair_origin` gives for each pair of the scene the number
/// of its [[contact.pair]] in the file. The ranks of `world` share the lists of grains; all of them call it.
Scene assemble(const SceneDraft& draft, const std::filesystem::path& base_directory, Reader& reader,
               std::vector<std::size_t>& pair_origin, const World& world);

/// Every key of every section, in the order of the reference.
const std::vector<KeyDoc>& all_keys();

}  // namespace moraine::scene_toml
