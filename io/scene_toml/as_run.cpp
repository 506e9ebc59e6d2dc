#include "io/scene_toml/as_run.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "io/scene_toml/document.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "io/scene_toml/words.hpp"

namespace moraine::scene_toml {

namespace {

/// Byte at which a place begins; columns count code points.
std::size_t offset_of(const std::string& text, const Place& place) {
  std::size_t at = text.rfind("\xef\xbb\xbf", 0) == 0 ? 3 : 0;
  for (int line = 1; line < place.line && at < text.size(); ++at)
    if (text[at] == '\n') ++line;
  const auto is_inside_character = [&](std::size_t i) { return (static_cast<unsigned char>(text[i]) & 0xc0) == 0x80; };
  for (int column = 1; column < place.column && at < text.size(); ++column) {
    ++at;
    while (at < text.size() && is_inside_character(at)) ++at;
  }
  return at;
}

/// The name of a table relative to one of its ancestors, as a dotted key.
std::string dotted(const Path& path, std::size_t from) {
  std::string out;
  for (std::size_t i = from; i < path.size(); ++i) out += (out.empty() ? "" : ".") + path[i].name;
  return out;
}

/// First line after the header of a table; the first line of the file for the root.
std::size_t insertion_point(const std::string& text, const Node& table, bool is_root) {
  if (is_root) {
    int first = 1 << 30;
    for (const Member& member : table.members) {
      first = std::min(first, member.place.line);
      if (member.value.kind == Node::Kind::list && !member.value.items.empty())
        first = std::min(first, member.value.items[0].begin.line);
    }
    return offset_of(text, {0, first, 1});
  }
  return offset_of(text, {0, table.begin.line + 1, 1});
}

/// True where the path leads into an entry that a list of [[tables]] does not have yet.
bool is_new_entry(const Found& found, const Path& path) {
  return found.node->kind == Node::Kind::list && found.n_steps + 1 < path.size() && !found.node->items.empty() &&
         found.node->items[0].kind == Node::Kind::table && !found.node->items[0].is_inline;
}

/// The text with the value at `path` changed to that of `wanted`, the whole document as it must become. Tries to touch
/// as little as possible; whether it succeeded is for the caller to see.
std::string edited(const std::string& text, const Path& path, const Node& wanted) {
  const Node document = parse_document(text, "");
  // The deepest part that is written as a value of its own can be replaced; a table under a header can be added to.
  const Found found = follow(document, path);
  const bool is_whole = found.n_steps == path.size();
  const bool is_open_table = found.node->kind == Node::Kind::table && !found.node->is_inline;
  if (is_new_entry(found, path)) {
    const Path list(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(found.n_steps));
    return fmt::format("{}{}\n[[{}]]\n{} = {}\n", text, text.empty() || text.back() == '\n' ? "" : "\n",
                       path_text(list), dotted(path, found.n_steps + 1), to_text(*follow(wanted, path).node));
  }
  if (is_whole || !is_open_table) {
    const Node& value =
        *follow(wanted, Path(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(found.n_steps))).node;
    const std::size_t begin = offset_of(text, found.node->begin), end = offset_of(text, found.node->end);
    return text.substr(0, begin) + to_text(value) + text.substr(end);
  }
  std::string line = fmt::format("{} = {}\n", dotted(path, found.n_steps), to_text(*follow(wanted, path).node));
  const std::size_t at = insertion_point(text, *found.node, found.n_steps == 0);
  if (at > 0 && text[at - 1] != '\n') line = "\n" + line;
  return text.substr(0, at) + line + text.substr(at);
}

Node& at(Node& root, const Path& path) { return const_cast<Node&>(*follow(root, path).node); }

/// All edits, or an empty text where one of them did not do what it should.
std::string edit_all(const std::string& text, const std::vector<std::string>& overrides, const std::vector<Path>& files,
                     const Node& wanted) {
  try {
    std::string out = text;
    Node so_far = parse_document(text, "");
    for (const std::string& assignment : overrides) {
      apply_override(so_far, assignment, 1);
      const std::string key = assignment.substr(0, assignment.find('='));
      const std::size_t begin = key.find_first_not_of(' ');
      out = edited(out, parse_path(key.substr(begin, key.find_last_not_of(' ') - begin + 1)), so_far);
      if (!same_content(parse_document(out, ""), so_far)) return "";
    }
    for (const Path& path : files) out = edited(out, path, wanted);
    return same_content(parse_document(out, ""), wanted) ? out : "";
  } catch (const SceneFileError&) {
    return "";
  }
}

}  // namespace

std::vector<Path> file_keys(const Node& root) {
  std::vector<Path> keys;
  const auto add = [&](const char* list, const char* table) {  // table: empty where the entry itself names the file
    const Node* node = root.find(list);
    for (std::size_t i = 0; node && i < node->items.size(); ++i) {
      Path path = {{list, 0}, {"", i}};
      if (*table) path.push_back({table, 0});
      path.push_back({"file", 0});
      if (const Found found = follow(root, path); found.n_steps == path.size() && found.node->kind == Node::Kind::text)
        keys.push_back(path);
    }
  };
  add("particles", "fill");
  add("wall", "mesh");
  add("outlet", "mesh");
  add("inlet", "");
  return keys;
}

std::string write_as_run(const std::string& text, const std::vector<std::string>& overrides,
                         const std::filesystem::path& base) {
  Node wanted = parse_document(text, "");
  for (const std::string& assignment : overrides) apply_override(wanted, assignment, 1);
  std::vector<Path> files;
  for (const Path& path : file_keys(wanted)) {
    Node& name = at(wanted, path);
    const std::string absolute = (base / name.text).lexically_normal().string();
    if (absolute == name.text) continue;
    name.text = absolute;
    files.push_back(path);
  }
  std::string note;
  for (const std::string& assignment : overrides) {
    std::string line = "# run with --set " + assignment;
    std::replace(line.begin(), line.end(), '\n', ' ');
    note += line + "\n";
  }
  if (std::string out = edit_all(text, overrides, files, wanted); !out.empty()) return note + out;
  return note + to_document(wanted);  // comments are lost, content is not
}

}  // namespace moraine::scene_toml
