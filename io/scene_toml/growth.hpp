// How a scene becomes larger, for weak scaling: one key of scale.weak. Private to io/scene_toml.
#pragma once

#include <string>

#include "io/scene_toml/document.hpp"

namespace moraine::scene_toml {

struct Growth {
  std::string assignment;  // "key=value"
  std::string problem;     // what is wrong; empty where nothing is
};

/// A number made `factor` times as large. `key` is a path such as particles[0].fill.count; components of places may be
/// called x, y, z (domain.high.z). A component of `high` grows so that its distance from the `low` beside it does, or
/// from the domain's where there is none.
Growth growth_of(const Node& root, const std::string& key, int factor);

}  // namespace moraine::scene_toml
