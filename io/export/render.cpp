#include "io/export/render.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include "io/checkpoint/durable_file.hpp"
#include "io/export/gas_slice.hpp"
#include "io/export/grain_values.hpp"
#include "io/snapshot/snapshot.hpp"

extern char** environ;

namespace moraine {

namespace fs = std::filesystem;

namespace {

struct Size {
  int width = 0, height = 0;
};

Size parse_size(const std::string& text) {
  Size size;
  const char* last = text.data() + text.size();
  const auto [middle, error] = std::from_chars(text.data(), last, size.width);
  bool is_good = error == std::errc() && middle < last && *middle == 'x';
  if (is_good) {
    const auto [end, second] = std::from_chars(middle + 1, last, size.height);
    is_good = second == std::errc() && end == last;
  }
  if (!is_good || std::min(size.width, size.height) < 16 || std::max(size.width, size.height) > 32768)
    throw ExportError("size \"" + text + "\": expected WIDTHxHEIGHT in pixels, 16 to 32768, such as \"1280x960\"");
  return size;
}

std::vector<fs::path> wanted_frames(const Frames& frames, const std::string& text) {
  if (text == "all") return frames.files;
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size())
    throw ExportError("frame \"" + text + "\": expected a number (negative: from the last) or \"all\"");
  return {frames.at(number)};
}

bool is_on_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::string rest = path == nullptr ? "/usr/bin:/bin" : path;
  for (std::size_t at = 0; at <= rest.size();) {
    const std::size_t end = std::min(rest.find(':', at), rest.size());
    const std::string folder = rest.substr(at, end - at);
    if (::access(((folder.empty() ? "." : folder) + '/' + program).c_str(), X_OK) == 0) return true;
    at = end + 1;
  }
  return false;
}

/// Runs a program without input, its output to a file. Returns its exit code. Throws ExportError where it cannot be started.
int run_program(const std::vector<std::string>& words, const fs::path& output) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t process = 0;
  const int error = posix_spawnp(&process, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw ExportError(words[0] + " cannot be started: " + std::strerror(error));
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {}
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// The lines of POV-Ray's output that say what is wrong, or else the last ones.
std::string last_words(const fs::path& output) {
  const std::string text = read_file(output);
  std::string errors, tail;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = text.substr(at, end - at);
    if (line.find("rror") != std::string::npos) errors += "\n  " + line;
    if (text.size() - at < 600) tail += "\n  " + line;
    at = end + 1;
  }
  return errors.empty() ? tail : errors;
}

/// A folder for what POV-Ray reads and says, gone at the end.
class Workshop {
 public:
  Workshop() {
    std::string name = (fs::temp_directory_path() / "moraine-render-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw StorageError(name, "cannot be made: " + explain_errno(errno));
    path_ = name;
  }
  ~Workshop() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

void render_picture(const std::string& scene_text, const Size& size, const fs::path& picture,
                    const fs::path& workshop) {
  write_file(workshop / "scene.pov", scene_text);
  const fs::path draft = workshop / "picture.png";
  const std::vector<std::string> words = {"povray",
                                          "-D",
                                          "-P",
                                          "+FN8",
                                          "+A0.1",
                                          "+AM2",
                                          "+R3",
                                          fmt::format("+W{}", size.width),
                                          fmt::format("+H{}", size.height),
                                          "+I" + (workshop / "scene.pov").string(),
                                          "+O" + draft.string()};
  const int code = run_program(words, workshop / "povray.log");
  if (code != 0 || !fs::exists(draft))
    throw ExportError(fmt::format("povray failed (exit code {}):{}", code, last_words(workshop / "povray.log")));
  write_file(picture, read_file(draft));
}

/// One frame and one range of colours for all pictures of a series, so that nothing jumps.
void settle_style(PictureStyle& style, const std::vector<fs::path>& all, const std::vector<fs::path>& wanted,
                  const Scene* scene) {
  Box frame = Box::empty();
  std::vector<fs::path> outer = wanted;
  outer.push_back(all.front());
  outer.push_back(all.back());
  double low = infinity, high = -infinity, gas_low = infinity, gas_high = -infinity;
  for (std::size_t i = 0; i < outer.size(); ++i) {
    const Image image = read_image_file(outer[i]).image;
    const Box box = frame_of(image, scene);
    frame.include(box.low);
    frame.include(box.high);
    if (i >= wanted.size()) continue;
    const auto range = usual_range(grain_values(image, style.field).values);
    low = std::min(low, range.first);
    high = std::max(high, range.second);
    if (style.gas.empty()) continue;
    const auto gas_range = usual_range(gas_slice(image, style.gas, 1).values);
    gas_low = std::min(gas_low, gas_range.first);
    gas_high = std::max(gas_high, gas_range.second);
  }
  style.frame = frame;
  if (style.range.empty()) style.range = {low, high};
  if (style.gas_range.empty() && gas_low <= gas_high) style.gas_range = {gas_low, gas_high};
}

}  // namespace

std::string render_run(const RenderRequest& request) {
  const Size size = parse_size(request.size);
  const Frames frames = find_frames(request.run);
  const std::vector<fs::path> wanted = wanted_frames(frames, request.frame);
  if (!is_on_path("povray"))
    throw ExportError(
        "povray is not installed; on Debian and Ubuntu: apt-get install povray (or take moraine export --povray)");
  std::string why_no_scene;
  const std::optional<Scene> scene = scene_of(frames, why_no_scene);
  PictureStyle style = request.style;
  style.aspect = static_cast<double>(size.width) / size.height;
  settle_style(style, frames.files, wanted, scene ? &*scene : nullptr);

  const fs::path folder = request.frame == "all" && request.out ? *request.out : frames.directory / "pictures";
  const bool has_own_name = request.out && request.frame != "all";
  if (!has_own_name) make_directory(folder);
  const Workshop workshop;
  std::string text;
  for (const fs::path& file : wanted) {
    const fs::path picture = has_own_name ? *request.out : folder / (frame_label(file) + ".png");
    render_picture(povray_text(read_image_file(file).image, scene ? &*scene : nullptr, style), size, picture,
                   workshop.path());
    text += picture.string() + '\n';
  }
  if (!scene) text += "without walls: " + why_no_scene + '\n';
  return text;
}

}  // namespace moraine
