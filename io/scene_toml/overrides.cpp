// Overrides: "key=value" from the command line.
#include <fmt/format.h>

#include <charconv>

#include "io/scene_toml/document.hpp"
#include "io/scene_toml/scene_toml.hpp"

namespace moraine::scene_toml {

namespace {

/// Everything below comes from the override, not from the file.
void mark(Node& node, int number) {
  const Place place{number, 0, 0};
  node.begin = node.end = place;
  for (Member& member : node.members) {
    member.place = place;
    mark(member.value, number);
  }
  for (Node& item : node.items) mark(item, number);
}

/// A value as TOML; numbers such as .5 and words without quotes are taken as they are meant.
bool parse_value(const std::string& text, Node& value) {
  try {
    Node document = parse_document("value = " + text, "");
    if (document.members.size() != 1) return false;
    value = std::move(document.members[0].value);
    return true;
  } catch (const SceneFileError&) {
    if (text.empty() || text.find_first_of("\"'[]{}\n") != std::string::npos) return false;
  }
  const char* begin = text.data() + (text[0] == '+' ? 1 : 0);
  const char* end = text.data() + text.size();
  if (const auto [last, error] = std::from_chars(begin, end, value.real); error == std::errc() && last == end) {
    value.kind = Node::Kind::real;
    return true;
  }
  value.kind = Node::Kind::text;
  value.text = text;
  return true;
}

std::string trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return std::string(text);
}

/// The node that a step leads to, made where it is not there yet. Sets `problem` where it cannot be.
Node* enter(Node& node, const Path& path, std::size_t depth, int number, std::string& problem) {
  const Step& step = path[depth];
  const std::string here = path_text(Path(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(depth)));
  if (step.name.empty()) {
    if (node.kind != Node::Kind::list) {
      problem = fmt::format("\"{}\" is not a list, so it has no [{}]", here, step.index);
      return nullptr;
    }
    if (step.index == node.items.size()) {
      node.items.emplace_back();
      node.items.back().begin = node.items.back().end = Place{number, 0, 0};
    }
    if (step.index >= node.items.size()) {
      problem = fmt::format("\"{}\" has {} entries; [{}] does not exist", here, node.items.size(), step.index);
      return nullptr;
    }
    return &node.items[step.index];
  }
  if (node.kind == Node::Kind::list) {
    problem = fmt::format("\"{0}\" is a list; say which entry: {0}[0].{1}", here, step.name);
    return nullptr;
  }
  if (node.kind != Node::Kind::table) {
    problem = fmt::format("\"{}\" is {}, not a table, so it has no \"{}\"", here, to_text(node), step.name);
    return nullptr;
  }
  if (Node* found = node.find(step.name)) return found;
  node.members.push_back({step.name, Place{number, 0, 0}, Node{}});
  Node& made = node.members.back().value;
  made.begin = made.end = Place{number, 0, 0};
  if (depth + 1 < path.size() && path[depth + 1].name.empty()) made.kind = Node::Kind::list;
  return &made;
}

}  // namespace

std::string apply_override(Node& root, const std::string& assignment, int number) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) return fmt::format("\"{}\": expected key=value, such as time.end=2", assignment);
  const std::string key = trimmed(std::string_view(assignment).substr(0, equals));
  const std::string value_text = trimmed(std::string_view(assignment).substr(equals + 1));
  const Path path = parse_path(key);
  if (path.empty() || path.front().name.empty())
    return fmt::format("\"{}\" is not a key; expected a path such as time.end or particles[0].diameter", key);
  Node value;
  if (!parse_value(value_text, value))
    return fmt::format("key \"{}\" = {}: not a value; expected a number, a word, true, false, [list] or {{ table }}",
                       key, value_text);
  mark(value, number);
  std::string problem;
  Node changed = root;  // an override that fails halfway leaves nothing behind
  Node* node = &changed;
  for (std::size_t depth = 0; depth < path.size(); ++depth) {
    node = enter(*node, path, depth, number, problem);
    if (!node) return fmt::format("key \"{}\": {}", key, problem);
  }
  *node = std::move(value);
  // Messages about the value point to the override, even where the key stands in the file.
  Node* parent = &changed;
  for (std::size_t depth = 0; depth + 1 < path.size(); ++depth)
    parent = path[depth].name.empty() ? &parent->items[path[depth].index] : parent->find(path[depth].name);
  for (Member& member : parent->members)
    if (member.name == path.back().name) member.place = Place{number, 0, 0};
  root = std::move(changed);
  return "";
}

}  // namespace moraine::scene_toml
