// A small sound scene as text, to which a test adds what it is about.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "io/scene_toml/scene_toml.hpp"

namespace scene_text {

inline const std::string domain = "[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n";
inline const std::string time = "[time]\nend = 2.0\n";
inline const std::string material = "[[material]]\nname = \"glass\"\ndensity = 2500\n";
inline const std::string pair = "[[contact.pair]]\nnormal_stiffness = 1e3\n";
inline const std::string particles = "[[particles]]\ndiameter = 0.02\nfill = { count = 10 }\n";
inline const std::string all = domain + time + material + pair + particles;

inline moraine::Scene read(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return moraine::read_scene_text(text, "scene.toml", overrides);
}

/// What the reader says about a text; empty where it says nothing.
inline std::string complaint(const std::string& text, const std::vector<std::string>& overrides = {},
                             const std::filesystem::path& base = {}) {
  try {
    moraine::read_scene_text(text, "scene.toml", overrides, base);
  } catch (const moraine::SceneFileError& error) {
    return error.what();
  }
  return "";
}

/// A directory of its own for a test, removed with what is in it.
class Directory {
 public:
  Directory() {
    std::string name = (std::filesystem::temp_directory_path() / "moraine-test-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~Directory() { std::filesystem::remove_all(path_); }
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary) << content;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace scene_text
