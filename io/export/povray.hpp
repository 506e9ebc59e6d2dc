// A snapshot as a POV-Ray scene.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/run/image.hpp"
#include "engine/scene/scene.hpp"

namespace moraine {

struct PictureStyle {
  std::string field = "speed";    // see grain_values()
  std::string gas;                // what a slice of the gas in the middle is coloured by, see gas_slice(); empty: none
  std::vector<double> gas_range;  // least and greatest value of its colours; empty: those of the slice
  std::vector<double> range;      // least and greatest value of the colours; empty: those of most grains
  std::vector<double> view;       // azimuth, elevation [degrees]; empty: from the front, a little from above
  double aspect = 4.0 / 3.0;      // width over height
  std::optional<Box> frame;       // what the picture shows [m]; none: frame_of() of this snapshot
};

/// What a picture of a snapshot should show: the grains and the walls of finite size, within the domain.
Box frame_of(const Image& image, const Scene* scene);

/// Across which axis the slice of the gas lies: it shows most of itself to the viewer, and stands upright.
int slice_axis(const Image& image, const Scene* scene, const PictureStyle& style);

/// The text of a POV-Ray scene: grains coloured by a field, walls translucent, soft light, a bar with the scale and the time. With a slice of
/// the gas those grains are left out that lie before it. `scene`: its walls that exist at the snapshot's time are drawn; may be null. Throws ExportError for an unknown field.
std::string povray_text(const Image& image, const Scene* scene, const PictureStyle& style);

}  // namespace moraine
