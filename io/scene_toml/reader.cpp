#include "io/scene_toml/reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/scene_toml/scene_keys.hpp"
#include "io/scene_toml/words.hpp"

namespace moraine::scene_toml {

std::string At::path() const {
  const std::string before = parent ? parent->path() : "";
  if (!parent) return before;
  if (name.empty()) return fmt::format("{}[{}]", before, index);
  return before.empty() ? std::string(name) : fmt::format("{}.{}", before, name);
}

namespace {

std::string shortened(std::string text) {
  constexpr std::size_t most = 60;
  if (text.size() <= most) return text;
  std::size_t end = most - 4;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;  // not inside a character
  return text.substr(0, end) + " ...";
}

/// What a value is, in words.
std::string kind_text(const Node& node) {
  switch (node.kind) {
    case Node::Kind::table: return "a table";
    case Node::Kind::list: return fmt::format("a list of {}", node.items.size());
    case Node::Kind::text: return "text";
    case Node::Kind::integer:
    case Node::Kind::real: return "a number";
    case Node::Kind::boolean: return "true or false";
    case Node::Kind::date: break;
  }
  return "a date";
}

std::string bracketed(const char* unit) {
  const std::string_view name = unit ? unit : "";
  return name.empty() || name == "-" ? "" : fmt::format(" [{}]", name);
}

/// "a " where the name of a type is a noun that wants it.
const char* article(const std::string& type) {
  for (const char* noun : {"number", "whole number", "table", "list"})
    if (type.rfind(noun, 0) == 0) return "a ";
  return "";
}

/// What people call a quantity that goes by another name here.
constexpr std::pair<std::string_view, std::string_view> synonyms[] = {
    {"radius", "diameter"},
    {"size", "diameter"},
    {"dt", "step"},
    {"timestep", "step"},
    {"time_step", "step"},
    {"duration", "end"},
    {"youngs_modulus", "young"},
    {"E", "young"},
    {"nu", "poisson"},
    {"rho", "density"},
    {"mu", "friction"},
    {"kn", "normal_stiffness"},
    {"kt", "tangential_stiffness"},
    {"stiffness", "normal_stiffness"},
    {"center", "centre"},
    {"e", "restitution"},
    {"volume_fraction", "solid_fraction"},
    {"porosity", "solid_fraction"},
    {"min", "low"},
    {"max", "high"},
    {"number", "count"},
    {"n", "count"},
    {"std", "deviation"},
    {"sigma", "deviation"},
    {"stl", "mesh"},
    {"snapshot_interval", "snapshots"},
    {"checkpoint_interval", "checkpoints"},
    {"mu", "viscosity"},
    {"kind", "type"},
    {"type", "kind"},
    {"grid", "cells"},
    {"region", "part"},
    {"box", "part"},
};

std::optional<std::string> suggestion(const std::string& name, const std::vector<std::string>& known) {
  for (const auto& [used, meant] : synonyms)
    if (used == name && std::find(known.begin(), known.end(), meant) != known.end()) return std::string(meant);
  return nearest_word(name, known);
}

/// Tables, other than this one, that have a key of that name.
std::string elsewhere(const std::string& name, const std::string& section) {
  std::vector<std::string> places;
  for (const KeyDoc& doc : all_keys())
    if (doc.name == name && doc.section != section && !doc.section.empty()) places.push_back(doc.section);
  if (places.empty() || places.size() > 2) return "";
  return fmt::format("; it belongs in {}", places.size() == 1 ? places[0] : places[0] + " or " + places[1]);
}

/// A path without its indices: the section that the reference of keys names.
std::string section_of(const std::string& path) {
  std::string section;
  bool is_index = false;
  for (const char c : path) {
    if (c == '[') is_index = true;
    if (!is_index) section += c;
    if (c == ']') is_index = false;
  }
  return section;
}

}  // namespace

SceneMessage Reader::located(Place place, std::string key, const Node* value, std::string message) const {
  SceneMessage out;
  out.origin = place.source ? fmt::format("--set {}", place.source) : file_name_;
  out.line = place.source ? 0 : place.line;
  out.column = place.source ? 0 : place.column;
  out.key = std::move(key);
  if (value) out.value = shortened(to_text(*value));
  out.message = std::move(message);
  return out;
}

void Reader::complain(const At& at, std::string message) {
  messages_.push_back(located(at.place, at.path(), &at.node, std::move(message)));
  doubt(at.path());
}

void Reader::complain_missing_key(const std::string& table_path, std::string_view key, std::string_view section) {
  for (const KeyDoc& doc : all_keys()) {
    if (doc.section != section || doc.name != key) continue;
    const Found found = follow(root_, parse_path(table_path));
    const At top{root_, root_.begin};
    complain_missing(At{*found.node, found.place, &top, table_path}, key, doc);
  }
}

void Reader::complain_about(const std::string& path, std::string message) {
  const Found found = follow(root_, parse_path(path));
  messages_.push_back(located(found.place, path, found.node, std::move(message)));
  doubt(path);
}

void Reader::complain_missing(const At& table, std::string_view key, const KeyDoc& doc) {
  const std::string path = table.parent ? fmt::format("{}.{}", table.path(), key) : std::string(key);
  if (doubtful_.contains(path)) return;  // it is there, misspelt
  const std::string unit = bracketed(doc.unit.c_str());
  messages_.push_back(
      located(table.place, path, nullptr,
              fmt::format("missing; expected {}{}{}: {}", article(doc.type), doc.type, unit, doc.meaning)));
  doubt(path);
}

void Reader::complain_at(const std::string& path, std::string message, bool is_warning) {
  SceneMessage out = located(follow(root_, parse_path(path)).place, path, nullptr, std::move(message));
  out.is_warning = is_warning;
  const auto is_same = [&](const SceneMessage& m) { return m.key == out.key && m.message == out.message; };
  if (std::any_of(messages_.begin(), messages_.end(), is_same)) return;
  messages_.push_back(std::move(out));
  if (!is_warning) doubt(path);
}

void Reader::complain_override(int number, std::string message) {
  messages_.push_back(located(Place{number, 0, 0}, "", nullptr, std::move(message)));
}

bool Reader::is_doubtful(const std::string& path) const {
  const auto is_part = [](const std::string& whole, const std::string& part) {
    return part.size() >= whole.size() && part.compare(0, whole.size(), whole) == 0 &&
           (part.size() == whole.size() || part[whole.size()] == '.' || part[whole.size()] == '[');
  };
  return std::any_of(doubtful_.begin(), doubtful_.end(),
                     [&](const std::string& other) { return is_part(other, path) || is_part(path, other); });
}

bool Reader::has_errors() const {
  return std::any_of(messages_.begin(), messages_.end(), [](const SceneMessage& m) { return !m.is_warning; });
}

void Reader::wrong_type(const At& at, const std::string& expected, const char* unit) {
  const std::string_view kind = unit ? unit : "";
  if (at.node.kind == Node::Kind::text && !kind.empty()) {
    if (const auto value = expected == "a number" ? in_si(at.node.text, kind) : std::nullopt) {
      complain(at, fmt::format("expected {} in SI units{}; write {:.12g}", expected, bracketed(unit), *value));
      return;
    }
    complain(at, fmt::format("expected {} in SI units{}, found text", expected, bracketed(unit)));
    return;
  }
  complain(at, fmt::format("expected {}{}, found {}", expected, bracketed(unit), kind_text(at.node)));
}

bool Reader::read(const At& at, const char* unit, double& out) {
  if (!at.node.is_number()) {
    wrong_type(at, "a number", unit);
    return false;
  }
  out = at.node.kind == Node::Kind::integer ? static_cast<double>(at.node.integer) : at.node.real;
  return true;
}

bool Reader::read_integer(const At& at, std::int64_t lowest, std::int64_t& out) {
  std::int64_t value = at.node.integer;
  if (at.node.kind == Node::Kind::real && std::abs(at.node.real) < 9e15 && std::floor(at.node.real) == at.node.real)
    value = static_cast<std::int64_t>(at.node.real);  // 1e6 is a count too
  else if (at.node.kind != Node::Kind::integer) {
    if (at.node.kind == Node::Kind::real)
      complain(at, "expected a whole number");
    else
      wrong_type(at, "a whole number", "");
    return false;
  }
  if (value < lowest) {
    complain(at, fmt::format("expected {} or more", lowest));
    return false;
  }
  out = value;
  return true;
}

bool Reader::read(const At& at, const char*, std::int64_t& out) { return read_integer(at, INT64_MIN, out); }

bool Reader::read(const At& at, const char*, std::uint64_t& out) {
  std::int64_t value = 0;
  if (!read_integer(at, 0, value)) return false;
  out = static_cast<std::uint64_t>(value);
  return true;
}

bool Reader::read(const At& at, const char*, int& out) {
  std::int64_t value = 0;
  if (!read_integer(at, INT64_MIN, value)) return false;
  if (value > 1000000000 || value < -1000000000) {
    complain(at, "expected a number of at most 1e9");
    return false;
  }
  out = static_cast<int>(value);
  return true;
}

bool Reader::read(const At& at, const char*, bool& out) {
  if (at.node.kind != Node::Kind::boolean) {
    wrong_type(at, "true or false", "");
    return false;
  }
  out = at.node.boolean;
  return true;
}

bool Reader::read(const At& at, const char*, std::string& out) {
  if (at.node.kind != Node::Kind::text) {
    wrong_type(at, "text in quotes", "");
    return false;
  }
  out = at.node.text;
  return true;
}

bool Reader::read(const At& at, const char* unit, Vec3& out) {
  if (at.node.kind != Node::Kind::list || at.node.items.size() != 3) {
    wrong_type(at, "[x, y, z], three numbers", unit);
    return false;
  }
  bool is_good = true;
  for (std::size_t i = 0; i < 3; ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, unit, out[static_cast<int>(i)]) && is_good;
  return is_good;
}

bool Reader::read(const At& at, const char*, std::array<bool, 3>& out) {
  if (at.node.kind != Node::Kind::list || at.node.items.size() != 3) {
    wrong_type(at, "[x, y, z], each true or false", "");
    return false;
  }
  bool is_good = true;
  for (std::size_t i = 0; i < 3; ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, "", out[i]) && is_good;
  return is_good;
}

bool Reader::read(const At& at, const char* unit, std::array<double, 2>& out) {
  if (at.node.kind != Node::Kind::list || at.node.items.size() != 2) {
    wrong_type(at, "[low, high], two numbers", unit);
    return false;
  }
  bool is_good = true;
  for (std::size_t i = 0; i < 2; ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, unit, out[i]) && is_good;
  return is_good;
}

bool Reader::read(const At& at, const char* unit, std::vector<std::array<double, 2>>& out) {
  const std::string expected = "a list of [time, factor], such as [[0, 0], [1, 1]]";
  if (!expect_list(at, expected)) return false;
  out.assign(at.node.items.size(), {});
  bool is_good = true;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const At item{at.node.items[i], at.node.items[i].begin, &at, {}, i};
    if (item.node.kind != Node::Kind::list || item.node.items.size() != 2) {
      complain(at, fmt::format("expected {}", expected));
      return false;
    }
    for (std::size_t k = 0; k < 2; ++k)
      is_good = read(At{item.node.items[k], item.node.items[k].begin, &item, {}, k}, k == 0 ? unit : "-", out[i][k]) &&
                is_good;
  }
  return is_good;
}

bool Reader::read(const At& at, const char* unit, std::vector<std::array<double, 4>>& out) {
  const std::string expected = "a list of [time, x, y, z], such as [[0, 0, 0, 0], [1, 0, 0, 0.1]]";
  if (!expect_list(at, expected)) return false;
  out.assign(at.node.items.size(), {});
  bool is_good = true;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const At item{at.node.items[i], at.node.items[i].begin, &at, {}, i};
    if (item.node.kind != Node::Kind::list || item.node.items.size() != 4) {
      complain(at, fmt::format("expected {}", expected));
      return false;
    }
    for (std::size_t k = 0; k < 4; ++k)
      is_good = read(At{item.node.items[k], item.node.items[k].begin, &item, {}, k}, k == 0 ? "s" : unit, out[i][k]) &&
                is_good;
  }
  return is_good;
}

bool Reader::read(const At& at, const char*, std::array<std::string, 2>& out) {
  if (at.node.kind != Node::Kind::list || at.node.items.size() != 2) {
    wrong_type(at, "two names, such as [\"glass\", \"steel\"]", "");
    return false;
  }
  bool is_good = true;
  for (std::size_t i = 0; i < 2; ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, "", out[i]) && is_good;
  return is_good;
}

bool Reader::read(const At& at, const char* unit, std::vector<double>& out) {
  if (!expect_list(at, "a list of numbers")) return false;
  out.assign(at.node.items.size(), 0.0);
  bool is_good = true;
  for (std::size_t i = 0; i < out.size(); ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, unit, out[i]) && is_good;
  return is_good;
}

bool Reader::read(const At& at, const char*, std::vector<std::string>& out) {
  if (!expect_list(at, "a list of names")) return false;
  out.assign(at.node.items.size(), "");
  bool is_good = true;
  for (std::size_t i = 0; i < out.size(); ++i)
    is_good = read(At{at.node.items[i], at.node.items[i].begin, &at, {}, i}, "", out[i]) && is_good;
  return is_good;
}

bool Reader::read_choice(const At& at, const std::vector<std::string>& words, std::size_t& out) {
  const std::string listing = "one of " + quoted_list(words, "or");
  if (at.node.kind != Node::Kind::text) {
    wrong_type(at, listing, "");
    return false;
  }
  const auto found = std::find(words.begin(), words.end(), at.node.text);
  if (found == words.end()) {
    const std::optional<std::string> near = nearest_word(at.node.text, words);
    complain(at, fmt::format("expected {}{}", listing, near ? fmt::format("; did you mean \"{}\"?", *near) : ""));
    return false;
  }
  out = static_cast<std::size_t>(found - words.begin());
  return true;
}

bool Reader::read_direction(const At& at, Vec3& out) {
  if (at.node.kind != Node::Kind::text) {
    if (at.node.kind == Node::Kind::list && at.node.items.size() == 3) return read(at, "-", out);
    wrong_type(at, "a direction: [x, y, z], or \"x\", \"-x\", \"y\", \"-y\", \"z\" or \"-z\"", "");
    return false;
  }
  std::size_t index = 0;
  if (!read_choice(at, {"x", "-x", "y", "-y", "z", "-z"}, index)) return false;
  out = Vec3{};
  out[static_cast<int>(index / 2)] = index % 2 ? -1.0 : 1.0;
  return true;
}

bool Reader::read_axis(const At& at, int& out) {
  std::size_t index = 0;
  if (!read_choice(at, {"x", "y", "z"}, index)) return false;
  out = static_cast<int>(index);
  return true;
}

bool Reader::read_points(const At& at, std::vector<Vec3>& out, double z, bool may_lack_z) {
  if (!expect_list(at, "a list of places, such as [[0.1, 0.2, 0.3]]")) return false;
  bool is_good = true;
  out.clear();
  out.reserve(at.node.items.size());
  for (std::size_t i = 0; i < at.node.items.size(); ++i) {
    const At item{at.node.items[i], at.node.items[i].begin, &at, {}, i};
    Vec3 place{0.0, 0.0, z};
    if (may_lack_z && item.node.kind == Node::Kind::list && item.node.items.size() == 2) {
      for (std::size_t axis = 0; axis < 2; ++axis)
        is_good =
            read(At{item.node.items[axis], item.place, &item, {}, axis}, "m", place[static_cast<int>(axis)]) && is_good;
    } else {
      is_good = read(item, "m", place) && is_good;
    }
    out.push_back(place);
  }
  return is_good;
}

bool Reader::expect_table(const At& at, const char* hint) {
  if (at.node.kind == Node::Kind::table) return true;
  complain(at, fmt::format("expected a table{}, found {}", hint, kind_text(at.node)));
  return false;
}

bool Reader::expect_list(const At& at, const std::string& what) {
  if (at.node.kind == Node::Kind::list) return true;
  complain(at, fmt::format("expected {}, found {}", what, kind_text(at.node)));
  return false;
}

void Reader::unknown_key(const At& table, const Member& member, const std::vector<std::string>& known) {
  const At at{member.value, member.place, &table, member.name};
  const std::string section = section_of(table.path());
  std::string hint = elsewhere(member.name, section);
  if (const auto near = suggestion(member.name, known); near && (hint.empty() || !table.node.find(*near))) {
    hint = fmt::format("; did you mean \"{}\"?", *near);
    doubt(table.parent ? table.path() + "." + *near : *near);
  } else if (hint.empty()) {
    hint = fmt::format("; known keys{}: {}", section.empty() ? " at the top" : " of " + section, comma_list(known));
  }
  messages_.push_back(located(at.place, at.path(), member.value.kind == Node::Kind::table ? nullptr : &member.value,
                              "unknown key" + hint));
}

}  // namespace moraine::scene_toml
