// A TOML document as a tree that knows where each of its parts was written. Private to io/scene_toml.
//
// Own nodes instead of toml++'s, because a document here is the file and the overrides together: parts of it come from
// the file, at a line, and parts from the command line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace moraine::scene_toml {

/// A place in the file (source 0) or in override number `source`. Lines and columns from 1; columns count code points.
struct Place {
  int source = 0;
  int line = 0;
  int column = 0;
};

struct Member;

struct Node {
  enum class Kind { table, list, text, integer, real, boolean, date };
  Kind kind = Kind::table;
  Place begin, end;        // of the value as written; end is one past
  bool is_inline = false;  // tables: written as { ... } ; others stand under a [header] or come from dotted keys
  std::string text;        // text, date
  std::int64_t integer = 0;
  double real = 0.0;
  bool boolean = false;
  std::vector<Member> members;  // table, in order of the file
  std::vector<Node> items;      // list

  const Node* find(std::string_view name) const;
  Node* find(std::string_view name);
  bool is_number() const { return kind == Kind::integer || kind == Kind::real; }
};

struct Member {
  std::string name;
  Place place;  // of the key
  Node value;
};

/// Parses a text. Throws SceneFileError (line, column, what the parser says) with `name` as the file.
Node parse_document(const std::string& text, const std::string& name);

/// A step of a path: a key, or an index in a list.
struct Step {
  std::string name;  // empty: an index
  std::size_t index = 0;
};
using Path = std::vector<Step>;
/// Reads particles[0].diameter or particles.0.diameter. An empty path stands for one that cannot be read.
Path parse_path(std::string_view text);
/// Written with brackets: particles[0].diameter
std::string path_text(const Path& path);

/// The deepest part of a path that exists: its node, the place of its key, and how many steps were found.
struct Found {
  const Node* node = nullptr;
  Place place;
  std::size_t n_steps = 0;
};
Found follow(const Node& root, const Path& path);

/// Same content; places and order of keys do not matter.
bool same_content(const Node& a, const Node& b);

/// The value on one line, as TOML.
std::string to_text(const Node& value);
/// A whole document as TOML, in order.
std::string to_document(const Node& root);

/// Changes the document as "key=value" says. Returns what is wrong, or an empty text. `number` counts overrides from 1.
std::string apply_override(Node& root, const std::string& assignment, int number);

}  // namespace moraine::scene_toml
