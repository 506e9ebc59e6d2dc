#include "io/cli/network_file.hpp"

#include <fmt/format.h>

#include <cmath>

#include "io/checkpoint/durable_file.hpp"
#include "io/cli/layout.hpp"
#include "io/scene_toml/document.hpp"

namespace moraine {

namespace {

using scene_toml::Node;

UsageError problem(const std::filesystem::path& file, int line, const std::string& text) {
  return UsageError(line > 0 ? fmt::format("{}:{}: {}", file.string(), line, text)
                             : fmt::format("{}: {}", file.string(), text));
}

double number(const std::filesystem::path& file, const Node& root, const char* key, const char* unit) {
  const Node* const node = root.find(key);
  if (node == nullptr)
    throw problem(
        file, 0,
        fmt::format("\"{}\" [{}] is missing; a network has name, latency [s], bandwidth [bytes/s]", key, unit));
  const double value = node->kind == Node::Kind::integer ? static_cast<double>(node->integer) : node->real;
  if (!node->is_number() || !std::isfinite(value) || value <= 0.0)
    throw problem(file, node->begin.line,
                  fmt::format("{}: expected a number above 0 [{}], found {}", key, unit, to_text(*node)));
  return value;
}

}  // namespace

Network default_network() { return {"InfiniBand QDR, 40 Gb/s", 1.5e-6, 3.2e9}; }

Network read_network(const std::filesystem::path& file) {
  const Node root = scene_toml::parse_document(read_file(file), file.string());
  for (const auto& member : root.members)
    if (member.name != "name" && member.name != "latency" && member.name != "bandwidth")
      throw problem(
          file, member.place.line,
          fmt::format("unknown key \"{}\"; a network has name, latency [s], bandwidth [bytes/s]", member.name));
  Network network;
  const Node* const name = root.find("name");
  if (name != nullptr && name->kind != Node::Kind::text)
    throw problem(file, name->begin.line, "name: expected a text, found " + to_text(*name));
  network.name = name != nullptr ? name->text : file.stem().string();
  network.latency = number(file, root, "latency", "s");
  network.bandwidth = number(file, root, "bandwidth", "bytes/s");
  return network;
}

}  // namespace moraine
