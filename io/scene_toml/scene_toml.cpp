#include "io/scene_toml/scene_toml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>

#include "io/scene_toml/as_run.hpp"
#include "io/scene_toml/document.hpp"
#include "io/scene_toml/growth.hpp"
#include "io/scene_toml/pareto.hpp"
#include "io/scene_toml/scene_keys.hpp"

namespace moraine {

std::string SceneMessage::text() const {
  std::string out = origin;
  if (line > 0) out += fmt::format(":{}", line);
  if (line > 0 && column > 0 && key.empty()) out += fmt::format(":{}", column);
  out += ": ";
  if (is_warning) out += "warning: ";
  if (!key.empty()) out += fmt::format("key \"{}\"", key);
  if (!key.empty() && !value.empty()) out += " = " + value;
  if (!key.empty()) out += ": ";
  return out + message;
}

namespace {

std::string all_texts(const std::vector<SceneMessage>& messages) {
  std::string out;
  for (const SceneMessage& message : messages) {
    if (!out.empty()) out += '\n';
    out += message.text();
  }
  return out;
}

}  // namespace

SceneFileError::SceneFileError(std::vector<SceneMessage> found)
    : std::runtime_error(all_texts(found)), problems(std::move(found)) {}

namespace scene_toml {

namespace {

std::string read_file(const std::filesystem::path& file) {
  const auto fail = [&](std::string message) {
    SceneMessage problem;
    problem.origin = file.string();
    problem.message = std::move(message);
    throw SceneFileError({problem});
  };
  std::error_code error;
  if (!std::filesystem::exists(file, error)) fail("no such file; expected a scene (TOML)");
  if (std::filesystem::is_directory(file, error)) fail("is a directory; expected a scene file (TOML)");
  std::ifstream in(file, std::ios::binary);
  if (!in) fail(fmt::format("cannot be read: {}", std::strerror(errno)));
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// The first rank reads, and all have the text or the error.
std::string read_file_for_all(const std::filesystem::path& file, const World& world) {
  std::string text;
  std::vector<SceneMessage> problems(1);
  try {
    if (world.is_root()) text = read_file(file);
  } catch (SceneFileError& error) {
    problems = std::move(error.problems);
  }
  world.broadcast(problems[0].message);
  problems[0].origin = file.string();
  if (!problems[0].message.empty()) throw SceneFileError(std::move(problems));
  world.broadcast(text);
  return text;
}

std::filesystem::path directory_of(const std::filesystem::path& file) {
  return std::filesystem::absolute(file).parent_path();
}

void apply_overrides(Node& root, const std::vector<std::string>& overrides, Reader& reader) {
  for (std::size_t i = 0; i < overrides.size(); ++i) {
    const int number = static_cast<int>(i) + 1;
    if (const std::string problem = apply_override(root, overrides[i], number); !problem.empty())
      reader.complain_override(number, problem);
  }
}

/// contact.pair[i] of the scene as contact.pair[j] of the file.
std::string renumbered(const std::string& text, const std::vector<std::size_t>& pair_origin) {
  static const std::string prefix = "contact.pair[";
  const std::size_t begin = text.find(prefix);
  if (begin == std::string::npos) return text;
  const std::size_t digits = begin + prefix.size();
  const std::size_t end = std::min(text.find_first_not_of("0123456789", digits), text.size());
  if (end == digits || end - digits > 9) return text;  // a name of the user's that looks like it
  const std::size_t index = std::stoul(text.substr(digits, end - digits));
  return index < pair_origin.size()
             ? fmt::format("{}{}{}", text.substr(0, digits), pair_origin[index], text.substr(end))
             : text;
}

/// True where a problem follows from another one that has been told.
bool is_consequence(const Reader& reader, const std::string& key) {
  const std::set<std::string>& doubtful = reader.doubtful();
  const auto any = [&](auto predicate) { return std::any_of(doubtful.begin(), doubtful.end(), predicate); };
  const auto starts = [](const std::string& text, const char* with) { return text.rfind(with, 0) == 0; };
  const auto ends = [](const std::string& text, const char* with) {
    const std::size_t n = std::strlen(with);
    return text.size() >= n && text.compare(text.size() - n, n, with) == 0;
  };
  // Names of materials that were not read cannot be referred to.
  const bool has_doubtful_material =
      any([&](const std::string& d) { return d == "material" || (starts(d, "material[") && ends(d, "name")); });
  const bool refers_to_material =
      ends(key, ".material") || key == "contact.pair" || key.find(".between") != std::string::npos;
  if (has_doubtful_material && refers_to_material) return true;
  if (ends(key, ".wall") &&
      any([&](const std::string& d) { return d == "wall" || (starts(d, "wall[") && ends(d, "].name")); }))
    return true;
  if (key == "contact.pair")
    return any([&](const std::string& d) {
      return d == "contact" || d == "contact.pair" ||
             (starts(d, "contact.pair[") && d.find(".between") != std::string::npos) || ends(d, ".material");
    });
  return reader.is_doubtful(key);
}

void validate_into(Reader& reader, const Scene& scene, const std::vector<std::size_t>& pair_origin,
                   const World& world) {
  std::vector<Problem> problems = validate(scene, world);
  // Judged by what was read, not by what the first of these problems makes of the others.
  std::erase_if(problems,
                [&](const Problem& problem) { return is_consequence(reader, renumbered(problem.key, pair_origin)); });
  for (const Problem& problem : problems)
    reader.complain_at(renumbered(problem.key, pair_origin), renumbered(problem.message, pair_origin),
                       problem.is_warning);
}

/// In order of the file, then of the overrides.
void sort_messages(std::vector<SceneMessage>& messages) {
  std::stable_sort(messages.begin(), messages.end(), [](const SceneMessage& a, const SceneMessage& b) {
    const auto rank = [](const SceneMessage& m) {
      return m.origin.rfind("--set ", 0) == 0 ? std::pair(1, std::atoi(m.origin.c_str() + 6)) : std::pair(0, m.line);
    };
    return rank(a) < rank(b);
  });
}

Scene read(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
           const std::filesystem::path& base, std::vector<SceneMessage>* warnings, const World& world) {
  Node root = parse_document(text, name);
  Reader reader(root, name);
  apply_overrides(root, overrides, reader);
  const SceneDraft draft = read_draft(reader);
  std::vector<std::size_t> pair_origin;
  Scene scene = assemble(draft, base, reader, pair_origin, world);
  validate_into(reader, scene, pair_origin, world);

  std::vector<SceneMessage> errors, doubts;
  for (SceneMessage& message : reader.messages()) (message.is_warning ? doubts : errors).push_back(std::move(message));
  sort_messages(errors);
  sort_messages(doubts);
  if (!errors.empty()) throw SceneFileError(std::move(errors));
  if (warnings) warnings->insert(warnings->end(), doubts.begin(), doubts.end());
  return scene;
}

std::string as_run(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
                   const std::filesystem::path& base) {
  Node root = parse_document(text, name);
  Reader reader(root, name);
  apply_overrides(root, overrides, reader);
  if (reader.has_errors()) throw SceneFileError(reader.messages());
  return write_as_run(text, overrides, std::filesystem::absolute(base.empty() ? "." : base));
}

/// The document that a file and its overrides make.
Node document_of(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  Node root = parse_document(read_file(file), file.string());
  Reader reader(root, file.string());
  apply_overrides(root, overrides, reader);
  if (reader.has_errors()) throw SceneFileError(reader.messages());
  return root;
}

/// All of them, or what is wrong.
std::vector<std::string> grown(const std::filesystem::path& file, const Node& root, int factor) {
  const Found rule = follow(root, parse_path("scale.weak"));
  const auto fail = [&](const std::string& message) {
    SceneMessage problem;
    problem.origin = file.string();
    problem.line = rule.n_steps == 2 && rule.place.source == 0 ? rule.place.line : 0;
    problem.key = "scale.weak";
    problem.message = message;
    throw SceneFileError({problem});
  };
  if (rule.n_steps < 2 || rule.node->items.empty())
    fail(
        "the scene does not say how to make it larger. Name the numbers that grow with the number of cores, such as\n"
        "[scale]\nweak = [\"domain.high.z\"]\n"
        "(or --set 'scale.weak=[\"domain.high.z\"]'); moraine keys says more");
  std::vector<std::string> overrides;
  for (const Node& key : rule.node->items) {
    const Growth growth = growth_of(root, key.text, factor);
    if (!growth.problem.empty()) fail(growth.problem);
    overrides.push_back(growth.assignment);
  }
  return overrides;
}

}  // namespace
}  // namespace scene_toml

Scene read_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                 std::vector<SceneMessage>* warnings, const World& world) {
  return scene_toml::read(scene_toml::read_file_for_all(file, world), file.string(), overrides,
                          scene_toml::directory_of(file), warnings, world);
}

Scene read_scene_text(const std::string& text, const std::string& name, const std::vector<std::string>& overrides,
                      const std::filesystem::path& base_directory, std::vector<SceneMessage>* warnings,
                      const World& world) {
  return scene_toml::read(text, name, overrides, base_directory, warnings, world);
}

std::vector<std::string> growth_overrides(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                          int factor) {
  const std::vector<std::string> all = scene_toml::grown(file, scene_toml::document_of(file, overrides), factor);
  return factor == 1 ? std::vector<std::string>() : all;
}

ParetoTable read_pareto(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  const scene_toml::Node root = scene_toml::document_of(file, overrides);
  scene_toml::Reader reader(root, file.string());
  ParetoTable table = scene_toml::read_draft(reader).pareto;
  if (reader.has_errors()) throw SceneFileError(reader.messages());
  return table;
}

std::string scene_without_studies(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  scene_toml::Node root = scene_toml::document_of(file, overrides);
  std::erase_if(root.members, [](const auto& member) { return member.name == "pareto" || member.name == "scale"; });
  return scene_toml::to_document(root);
}

std::vector<std::filesystem::path> files_of_scene(const std::filesystem::path& file,
                                                  const std::vector<std::string>& overrides) {
  const scene_toml::Node root = scene_toml::document_of(file, overrides);
  std::vector<std::filesystem::path> files;
  for (const scene_toml::Path& path : scene_toml::file_keys(root))
    files.push_back((scene_toml::directory_of(file) / scene_toml::follow(root, path).node->text).lexically_normal());
  return files;
}

std::string scene_as_run(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  return scene_toml::as_run(scene_toml::read_file(file), file.string(), overrides, scene_toml::directory_of(file));
}

std::string scene_text_as_run(const std::string& text, const std::string& name,
                              const std::vector<std::string>& overrides, const std::filesystem::path& base_directory) {
  return scene_toml::as_run(text, name, overrides, base_directory);
}

}  // namespace moraine
