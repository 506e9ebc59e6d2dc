#include "io/scene_toml/growth.hpp"

#include <fmt/format.h>

#include <cstdint>

namespace moraine::scene_toml {

namespace {

/// The path with x, y, z at its end as the index that they stand for in a list.
Path with_index(const Node& root, Path path) {
  const std::string name = path.back().name;
  if (path.size() < 2 || (name != "x" && name != "y" && name != "z")) return path;
  const Found list = follow(root, Path(path.begin(), path.end() - 1));
  if (list.n_steps == path.size() - 1 && list.node->kind == Node::Kind::list)
    path.back() = {"", static_cast<std::size_t>(name[0] - 'x')};
  return path;
}

double real_of(const Node& number) {
  return number.kind == Node::Kind::integer ? static_cast<double>(number.integer) : number.real;
}

/// Where what ends at a `high` begins; 0 for everything else.
double beginning_of(const Node& root, const Path& path) {
  if (path.size() < 2 || path[path.size() - 2].name != "high") return 0.0;
  Path low = path;
  low[low.size() - 2].name = "low";
  Found found = follow(root, low);
  if (found.n_steps < low.size()) {
    low = {{"domain", 0}, {"low", 0}, path.back()};
    found = follow(root, low);
  }
  return found.n_steps == low.size() && found.node->is_number() ? real_of(*found.node) : 0.0;
}

/// Numbers that count stay whole.
std::string grown_text(const Node& number, double begin, int factor) {
  if (number.kind == Node::Kind::integer && begin == 0.0) return fmt::format("{}", number.integer * factor);
  const double value = begin + factor * (real_of(number) - begin);
  const std::string text = fmt::format("{}", value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

}  // namespace

Growth growth_of(const Node& root, const std::string& key, int factor) {
  Path path = parse_path(key);
  if (path.empty()) return {"", fmt::format("\"{}\" is not a key; expected one such as domain.high.z", key)};
  path = with_index(root, std::move(path));
  const Found found = follow(root, path);
  if (found.n_steps < path.size())
    return {"", fmt::format("\"{}\" is not written in the scene, so it cannot be made larger", key)};
  if (!found.node->is_number())
    return {"", fmt::format("\"{}\" is {}; expected a number, such as domain.high.z", key, to_text(*found.node))};
  return {path_text(path) + '=' + grown_text(*found.node, beginning_of(root, path), factor), ""};
}

}  // namespace moraine::scene_toml
