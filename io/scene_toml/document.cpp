#include "io/scene_toml/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

// toml++ 3.3 asserts in places where a text can be at fault (a header "[.a]"), and with NDEBUG takes the assertion for
// granted. A bad scene must not end the process: its assertions throw, in every build. So it is used as headers only,
// not as the library that comes with it, whose assertions are as they were compiled.
namespace moraine::scene_toml {
struct ParserGaveUp {};
[[noreturn]] inline void give_up() { throw ParserGaveUp{}; }
}  // namespace moraine::scene_toml
#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_HEADER_ONLY 1
#define TOML_ASSERT(expression) ((expression) ? void() : ::moraine::scene_toml::give_up())
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

#include "io/scene_toml/scene_toml.hpp"
#include "io/scene_toml/words.hpp"

namespace moraine::scene_toml {

const Node* Node::find(std::string_view name) const {
  for (const Member& member : members)
    if (member.name == name) return &member.value;
  return nullptr;
}
Node* Node::find(std::string_view name) { return const_cast<Node*>(static_cast<const Node*>(this)->find(name)); }

namespace {

Place to_place(const toml::source_position& position) {
  return {0, static_cast<int>(position.line), static_cast<int>(position.column)};
}

Node convert(const toml::node& from);

void convert_table(const toml::table& from, Node& to) {
  to.kind = Node::Kind::table;
  to.is_inline = from.is_inline();
  for (const auto& [key, value] : from)
    to.members.push_back({std::string(key.str()), to_place(key.source().begin), convert(value)});
  // toml++ sorts keys by name; people read them in the order in which they were written
  std::stable_sort(to.members.begin(), to.members.end(), [](const Member& a, const Member& b) {
    return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
  });
}

Node convert(const toml::node& from) {
  Node to;
  to.begin = to_place(from.source().begin);
  to.end = to_place(from.source().end);
  from.visit([&](const auto& value) {
    using Value = std::remove_cvref_t<decltype(value)>;
    if constexpr (toml::is_table<Value>) {
      convert_table(value, to);
    } else if constexpr (toml::is_array<Value>) {
      to.kind = Node::Kind::list;
      for (const toml::node& item : value) to.items.push_back(convert(item));
    } else if constexpr (toml::is_string<Value>) {
      to.kind = Node::Kind::text;
      to.text = value.get();
    } else if constexpr (toml::is_integer<Value>) {
      to.kind = Node::Kind::integer;
      to.integer = value.get();
    } else if constexpr (toml::is_floating_point<Value>) {
      to.kind = Node::Kind::real;
      to.real = value.get();
    } else if constexpr (toml::is_boolean<Value>) {
      to.kind = Node::Kind::boolean;
      to.boolean = value.get();
    } else {
      to.kind = Node::Kind::date;
      std::ostringstream text;
      text << value.get();
      to.text = text.str();
    }
  });
  return to;
}

}  // namespace

namespace {

[[noreturn]] void fail(const std::string& name, int line, int column, std::string_view what) {
  SceneMessage message;
  message.origin = name;
  message.line = line;
  message.column = column;
  message.message = fmt::format("not TOML: {}", what);
  throw SceneFileError({message});
}

bool gives_up(const std::string& text) {
  try {
    static_cast<void>(toml::parse(text));
  } catch (const toml::parse_error&) {
  } catch (const ParserGaveUp&) {
    return true;
  }
  return false;
}

/// The first line with which the parser gives up; slow, and hardly ever needed.
int line_of_giving_up(const std::string& text) {
  int line = 1;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', end + 1), ++line)
    if (gives_up(text.substr(0, end + 1))) break;
  return line;
}

}  // namespace

Node parse_document(const std::string& text, const std::string& name) {
  try {
    return convert(toml::parse(text, name));
  } catch (const toml::parse_error& error) {
    const Place place = to_place(error.source().begin);
    fail(name, place.line, place.column, error.description());
  } catch (const ParserGaveUp&) {
    fail(name, line_of_giving_up(text), 0, "expected a key; a key has letters, digits, _ and -, or stands in quotes");
  }
}

Path parse_path(std::string_view text) {
  Path path;
  const auto add = [&](std::string_view word) {
    const bool is_index =
        !word.empty() && std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (is_index && word.size() < 10)
      path.push_back({"", static_cast<std::size_t>(std::stoul(std::string(word)))});
    else
      path.push_back({std::string(word), 0});
  };
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    const char c = i < text.size() ? text[i] : '.';
    if (c != '.' && c != '[' && c != ']') continue;
    if (i > begin)
      add(text.substr(begin, i - begin));
    else if (c == ']' || i == 0 || text[i - 1] != ']')
      return {};
    // after "]" only ".", "[" or the end may follow; the dot is skipped with it
    if (c == ']' && i + 1 < text.size() && text[i + 1] == '.') ++i;
    begin = i + 1;
    if (c == ']' && begin == text.size()) break;
  }
  return path;
}

std::string path_text(const Path& path) {
  std::string text;
  for (const Step& step : path)
    text += step.name.empty() ? fmt::format("[{}]", step.index) : text.empty() ? step.name : "." + step.name;
  return text;
}

Found follow(const Node& root, const Path& path) {
  Found found{&root, root.begin, 0};
  for (const Step& step : path) {
    if (step.name.empty()) {
      if (found.node->kind != Node::Kind::list || step.index >= found.node->items.size()) return found;
      found.node = &found.node->items[step.index];
      found.place = found.node->begin;
    } else {
      const auto& members = found.node->members;
      const auto member =
          std::find_if(members.begin(), members.end(), [&](const Member& m) { return m.name == step.name; });
      if (member == members.end()) return found;
      found.node = &member->value;
      found.place = member->place;
    }
    ++found.n_steps;
  }
  return found;
}

bool same_content(const Node& a, const Node& b) {
  if (a.kind != b.kind) return false;
  switch (a.kind) {
    case Node::Kind::text:
    case Node::Kind::date: return a.text == b.text;
    case Node::Kind::integer: return a.integer == b.integer;
    case Node::Kind::real: return a.real == b.real || (a.real != a.real && b.real != b.real);
    case Node::Kind::boolean: return a.boolean == b.boolean;
    case Node::Kind::list:
      return std::equal(a.items.begin(), a.items.end(), b.items.begin(), b.items.end(), same_content);
    case Node::Kind::table: break;
  }
  return a.members.size() == b.members.size() &&
         std::all_of(a.members.begin(), a.members.end(), [&](const Member& member) {
           const Node* other = b.find(member.name);
           return other && same_content(member.value, *other);
         });
}

namespace {

std::string key_text(const std::string& name) {
  const auto is_bare = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  return !name.empty() && std::all_of(name.begin(), name.end(), is_bare) ? name : toml_string(name);
}

bool is_list_of_tables(const Node& node) {
  return node.kind == Node::Kind::list && !node.items.empty() &&
         std::all_of(node.items.begin(), node.items.end(),
                     [](const Node& n) { return n.kind == Node::Kind::table && !n.is_inline; });
}

/// Values first, then tables under their own headers: a header ends the table above it.
void write_table(const Node& table, const std::string& path, std::string& out) {
  const auto stands_apart = [](const Node& node) {
    return (node.kind == Node::Kind::table && !node.is_inline) || is_list_of_tables(node);
  };
  for (const Member& member : table.members)
    if (!stands_apart(member.value)) out += fmt::format("{} = {}\n", key_text(member.name), to_text(member.value));
  for (const Member& member : table.members) {
    if (!stands_apart(member.value)) continue;
    const std::string full = path.empty() ? key_text(member.name) : path + "." + key_text(member.name);
    if (member.value.kind == Node::Kind::table) {
      const auto& members = member.value.members;
      const bool is_implied = !members.empty() && std::all_of(members.begin(), members.end(),
                                                              [&](const Member& m) { return stands_apart(m.value); });
      if (!is_implied) out += fmt::format("\n[{}]\n", full);
      write_table(member.value, full, out);
    }
    for (const Node& item : member.value.items) {
      out += fmt::format("\n[[{}]]\n", full);
      write_table(item, full, out);
    }
  }
}

}  // namespace

std::string to_text(const Node& value) {
  switch (value.kind) {
    case Node::Kind::text: return toml_string(value.text);
    case Node::Kind::date: return value.text;
    case Node::Kind::integer: return fmt::format("{}", value.integer);
    case Node::Kind::real: return toml_number(value.real);
    case Node::Kind::boolean: return value.boolean ? "true" : "false";
    case Node::Kind::list: {
      std::string out = "[";
      for (const Node& item : value.items) out += (out.size() > 1 ? ", " : "") + to_text(item);
      return out + "]";
    }
    case Node::Kind::table: break;
  }
  std::string out = "{";
  for (const Member& member : value.members)
    out += fmt::format("{}{} = {}", out.size() > 1 ? ", " : " ", key_text(member.name), to_text(member.value));
  return out + (out.size() > 1 ? " }" : "}");
}

std::string to_document(const Node& root) {
  std::string out;
  write_table(root, "", out);
  return out;
}

}  // namespace moraine::scene_toml
