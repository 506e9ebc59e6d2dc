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

/// What POV-Ray is to write.
enum class PictureKind { png, ppm };

/// Returns the picture's content.
std::string render_picture(const std::string& scene_text, const Size& size, PictureKind kind,
                           const fs::path& workshop) {
  write_file(workshop / "scene.pov", scene_text);
  const fs::path draft = workshop / (kind == PictureKind::png ? "picture.png" : "picture.ppm");
  fs::remove(draft);
  const std::vector<std::string> words = {"povray",
                                          "-D",
                                          "-P",
                                          kind == PictureKind::png ? "+FN8" : "+FP8",
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
  return read_file(draft);
}

/// The words that make ffmpeg write a kind of movie; empty where there is no such kind.
std::vector<std::string> movie_words(const std::string& ending) {
  // Players want even sides and colours at half the resolution.
  const std::string even = "pad=ceil(iw/2)*2:ceil(ih/2)*2";
  if (ending == ".mp4")
    return {"-vf",  even, "-c:v",     "libx264", "-preset",   "slow",
            "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart"};
  if (ending == ".webm") return {"-vf", even, "-c:v", "libvpx-vp9", "-crf", "28", "-b:v", "0", "-pix_fmt", "yuv420p"};
  if (ending == ".gif")  // its 256 colours are chosen for the whole movie
    return {"-filter_complex",
            "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=bayer:bayer_scale=4", "-loop", "0"};
  return {};
}

void expect_movie(const RenderRequest& request) {
  if (movie_words(request.movie->extension().string()).empty())
    throw ExportError("movie \"" + request.movie->string() + "\": expected a file that ends in .mp4, .webm or .gif");
  if (request.frame.value_or("all") != "all")
    throw ExportError("frame \"" + *request.frame + "\": a movie has all frames; leave --frame out");
  if (!(request.rate > 0.0 && request.rate <= 240.0))
    throw ExportError(fmt::format("rate {}: expected frames a second, above 0 and at most 240", request.rate));
  if (!is_on_path("ffmpeg"))
    throw ExportError(
        "ffmpeg is not installed, which makes movies of pictures; on Debian and Ubuntu: apt-get install ffmpeg (or "
        "take --frame all for the pictures alone)");
}

void make_movie(const RenderRequest& request, const fs::path& workshop) {
  const std::string ending = request.movie->extension().string();
  const fs::path draft = workshop / ("movie" + ending);
  std::vector<std::string> words = {"ffmpeg",       "-nostdin",
                                    "-hide_banner", "-loglevel",
                                    "error",        "-y",
                                    "-framerate",   fmt::format("{}", request.rate),
                                    "-i",           (workshop / "frame_%06d.png").string()};
  const std::vector<std::string> kind = movie_words(ending);
  words.insert(words.end(), kind.begin(), kind.end());
  words.push_back(draft.string());
  const int code = run_program(words, workshop / "ffmpeg.log");
  if (code != 0 || !fs::exists(draft))
    throw ExportError(fmt::format("ffmpeg failed (exit code {}):{}", code, last_words(workshop / "ffmpeg.log")));
  if (request.movie->has_parent_path()) make_directory(request.movie->parent_path());
  write_file(*request.movie, read_file(draft));
}

/// A picture (portable pixmap, eight bits a colour) as text for a terminal: two pixels a character, one above the other.
std::string terminal_text(const std::string& ppm) {
  std::size_t width = 0, height = 0, begin = 0;
  for (int word = 0; word < 4; ++word) {  // "P6", width, height, greatest value; remarks between them
    while (begin < ppm.size() && ppm[begin] == '#') begin = ppm.find('\n', begin) + 1;
    const std::size_t end = ppm.find_first_of(" \n", begin);
    if (end == std::string::npos) throw ExportError("povray has written a picture that cannot be read");
    if (word == 1) std::from_chars(ppm.data() + begin, ppm.data() + end, width);
    if (word == 2) std::from_chars(ppm.data() + begin, ppm.data() + end, height);
    begin = end + 1;
  }
  if (ppm.size() < begin + 3 * width * height) throw ExportError("povray has written a picture that cannot be read");
  const auto colour = [&](std::size_t x, std::size_t y) {
    const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(ppm[begin + 3 * (y * width + x) + k]); };
    return fmt::format("{};{};{}", byte(0), byte(1), byte(2));
  };
  std::string text;
  for (std::size_t y = 0; y + 1 < height; y += 2) {
    for (std::size_t x = 0; x < width; ++x)
      text += fmt::format("\033[38;2;{}m\033[48;2;{}m\u2580", colour(x, y), colour(x, y + 1));
    text += "\033[0m\n";
  }
  return text;
}

/// One frame and one range of colours for all pictures of a series, so that nothing jumps.
void settle_style(PictureStyle& style, const std::vector<fs::path>& all, const std::vector<fs::path>& wanted,
                  const Scene* scene) {
  Box frame = Box::empty();
  std::vector<fs::path> outer = wanted;
  if (wanted.size() > 1) outer.insert(outer.end(), {all.front(), all.back()});
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
    const auto gas_range = usual_range(gas_slice(image, style.gas, slice_axis(image, scene, style)).values);
    gas_low = std::min(gas_low, gas_range.first);
    gas_high = std::max(gas_high, gas_range.second);
  }
  style.frame = frame;
  if (style.range.empty()) style.range = {low, high};
  if (style.gas_range.empty() && gas_low <= gas_high) style.gas_range = {gas_low, gas_high};
}

}  // namespace

std::string render_run(const RenderRequest& request) {
  const Size size =
      request.preview > 0 ? Size{request.preview, request.preview * 3 / 4 / 2 * 2} : parse_size(request.size);
  const Frames frames = find_frames(request.run);
  if (request.movie) expect_movie(request);
  const bool has_all = request.movie || request.frame == "all";
  const std::vector<fs::path> wanted = wanted_frames(frames, has_all ? "all" : request.frame.value_or("-1"));
  if (!is_on_path("povray"))
    throw ExportError(
        "povray is not installed; on Debian and Ubuntu: apt-get install povray (or take moraine export --povray)");
  std::string why_no_scene;
  const std::optional<Scene> scene = scene_of(frames, why_no_scene);
  PictureStyle style = request.style;
  style.aspect = static_cast<double>(size.width) / size.height;
  settle_style(style, frames.files, wanted, scene ? &*scene : nullptr);

  const fs::path folder = has_all && request.out ? *request.out : frames.directory / "pictures";
  const bool has_own_name = request.out && !has_all, is_kept = !request.movie && request.preview <= 0;
  if (is_kept && !has_own_name) make_directory(folder);
  const Workshop workshop;
  std::string text;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted.size() > 1) request.progress(fmt::format("picture {} of {}", i + 1, wanted.size()));
    const std::string content =
        render_picture(povray_text(read_image_file(wanted[i]).image, scene ? &*scene : nullptr, style), size,
                       request.preview > 0 ? PictureKind::ppm : PictureKind::png, workshop.path());
    if (request.preview > 0) {
      text += terminal_text(content);
      continue;
    }
    const fs::path picture = request.movie  ? workshop.path() / fmt::format("frame_{:06}.png", i)
                             : has_own_name ? *request.out
                                            : folder / (frame_label(wanted[i]) + ".png");
    write_file(picture, content);
    if (is_kept) text += picture.string() + '\n';
  }
  if (request.movie) {
    make_movie(request, workshop.path());
    text += fmt::format("{}: {} frames, {:g} s\n", request.movie->string(), wanted.size(),
                        static_cast<double>(wanted.size()) / request.rate);
  }
  if (!scene) text += "without walls: " + why_no_scene + '\n';
  return text;
}

}  // namespace moraine
