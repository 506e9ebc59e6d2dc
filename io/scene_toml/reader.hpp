// Reading tables by tables of keys. Private to io/scene_toml.
//
// A KeyTable has one row a key: its name, type, unit, default and meaning, and how its value gets into a struct.
// Unknown keys, missing keys, suggestions and the reference of all keys come from these rows and from nothing else.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/scene_toml/document.hpp"
#include "io/scene_toml/scene_toml.hpp"
#include "kernels/base/vec3.hpp"

namespace moraine::scene_toml {

/// A value that is being read, and the way to it; lives on the stack, so that paths are spelt out for messages only.
struct At {
  const Node& node;
  Place place;
  const At* parent = nullptr;
  std::string_view name = {};  // empty: an entry of a list
  std::size_t index = 0;

  std::string path() const;
};

/// One row of the reference of all keys.
struct KeyDoc {
  std::string section;  // "time", "particles.fill"
  std::string name, type, unit, preset, meaning;
  bool is_required = false;
};

/// What a key is measured in and means.
struct About {
  const char* unit;  // SI, "-" for pure numbers, "" where there is none
  const char* meaning;
};

class Reader {
 public:
  Reader(const Node& root, std::string file_name) : root_(root), file_name_(std::move(file_name)) {}

  // Problems, located.
  void complain(const At& at, std::string message);
  void complain_missing(const At& table, std::string_view key, const KeyDoc& doc);
  /// About a key that `section` of the reference has and the table at `table_path` lacks.
  void complain_missing_key(const std::string& table_path, std::string_view key, std::string_view section);
  /// For messages that name the value themselves.
  void complain_at(const std::string& path, std::string message, bool is_warning = false);
  /// For messages that do not.
  void complain_about(const std::string& path, std::string message);
  void complain_override(int number, std::string message);
  /// True where the key, a part of it, or what it is part of, was complained about before.
  bool is_doubtful(const std::string& path) const;
  /// Notes that nothing more should be said about a key.
  void doubt(std::string path) { doubtful_.insert(std::move(path)); }
  const std::set<std::string>& doubtful() const { return doubtful_; }
  bool has_errors() const;
  std::vector<SceneMessage>& messages() { return messages_; }
  const Node& root() const { return root_; }

  // Values. Each complains and returns false where the value is of another type. `unit` is the SI unit expected.
  bool read(const At& at, const char* unit, double& out);
  bool read(const At& at, const char* unit, int& out);
  bool read(const At& at, const char* unit, std::int64_t& out);
  bool read(const At& at, const char* unit, std::uint64_t& out);
  bool read(const At& at, const char* unit, bool& out);
  bool read(const At& at, const char* unit, std::string& out);
  bool read(const At& at, const char* unit, Vec3& out);
  bool read(const At& at, const char* unit, std::array<bool, 3>& out);
  bool read(const At& at, const char* unit, std::array<double, 2>& out);
  bool read(const At& at, const char* unit, std::array<std::string, 2>& out);
  bool read(const At& at, const char* unit, std::vector<double>& out);
  /// A curve: a list of [time, factor].
  bool read(const At& at, const char* unit, std::vector<std::array<double, 2>>& out);
  /// A course: a list of [time, x, y, z].
  bool read(const At& at, const char* unit, std::vector<std::array<double, 4>>& out);
  bool read(const At& at, const char* unit, std::vector<std::string>& out);
  template <class V>
  bool read(const At& at, const char* unit, std::optional<V>& out) {
    V value{};
    if (!read(at, unit, value)) return false;
    out = value;
    return true;
  }
  /// One of a few words; `out` is its index.
  bool read_choice(const At& at, const std::vector<std::string>& words, std::size_t& out);
  /// Three numbers, or x, y, z, -x, -y, -z.
  bool read_direction(const At& at, Vec3& out);
  /// x, y or z.
  bool read_axis(const At& at, int& out);
  /// A list of places, each of three numbers (or two: z is then left as it is).
  bool read_points(const At& at, std::vector<Vec3>& out, double z, bool may_lack_z);
  /// Complains unless the value is a table.
  bool expect_table(const At& at, const char* hint = "");
  bool expect_list(const At& at, const std::string& what);

  void unknown_key(const At& table, const Member& member, const std::vector<std::string>& known);

 private:
  bool read_integer(const At& at, std::int64_t lowest, std::int64_t& out);
  void wrong_type(const At& at, const std::string& expected, const char* unit);
  SceneMessage located(Place place, std::string key, const Node* value, std::string message) const;

  const Node& root_;
  std::string file_name_;
  std::vector<SceneMessage> messages_;
  std::set<std::string> doubtful_;
};

/// One key of a table that is read into a T.
template <class T>
struct Key {
  KeyDoc doc;
  std::function<void(Reader&, const At&, T&)> read;
  std::function<void(const std::string& section, std::vector<KeyDoc>&)> describe_inside = {};
};

template <class T>
struct KeyTable {
  std::vector<Key<T>> keys;

  void describe(const std::string& section, std::vector<KeyDoc>& out) const {
    for (const Key<T>& key : keys) {
      out.push_back(key.doc);
      out.back().section = section;
    }
    for (const Key<T>& key : keys)
      if (key.describe_inside) key.describe_inside(section.empty() ? key.doc.name : section + "." + key.doc.name, out);
  }

  void read(Reader& reader, const At& at, T& out) const {
    if (!reader.expect_table(at)) return;
    for (const Member& member : at.node.members) {
      const Key<T>* key = find(member.name);
      if (!key) {
        reader.unknown_key(at, member, names());
        continue;
      }
      key->read(reader, At{member.value, member.place, &at, member.name}, out);
    }
    for (const Key<T>& key : keys)
      if (key.doc.is_required && !at.node.find(key.doc.name)) reader.complain_missing(at, key.doc.name, key.doc);
  }

  const Key<T>* find(std::string_view name) const {
    for (const Key<T>& key : keys)
      if (key.doc.name == name) return &key;
    return nullptr;
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const Key<T>& key : keys) all.push_back(key.doc.name);
    return all;
  }
};

}  // namespace moraine::scene_toml
