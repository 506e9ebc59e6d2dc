// Writes checkpoints one after the other until it is killed; kill_rank_test.py does that. All ranks:
//   checkpoint_writer RUN shared|distributed     says "rank R pid P" once, then writes steps 1, 2, ... and keeps two
//   checkpoint_writer RUN check                  says "step S", the newest one, whose content must be that of its step
#include <unistd.h>

#include <cstdio>
#include <cstring>

#include "io/checkpoint/checkpoint.hpp"
#include "tests/unit/io_images.hpp"

using namespace moraine;

namespace {

constexpr std::uint64_t n_grains = 6000;

/// This rank's grains of an image that differs from step to step.
Image image_of(std::uint64_t step, const World& world) {
  Image image = moraine::testing::make_image(n_grains, step, step);
  const RowRange grains = share_of(n_grains, world);
  const auto cut = [&](auto& rows, std::size_t width) {
    if (rows.empty()) return;
    const auto begin = rows.begin() + static_cast<std::ptrdiff_t>(grains.first * width);
    rows = {begin, begin + static_cast<std::ptrdiff_t>(grains.n * width)};
  };
  for (FieldArray& array : image.fields) {
    const auto width = static_cast<std::size_t>(info(array.field).components);
    cut(array.reals, width);
    cut(array.gids, width);
    cut(array.indices, width);
  }
  if (!world.is_root()) {  // the root has all histories
    image.pairs.clear();
    image.further.clear();
    image.walls.clear();
  }
  return image;
}

[[noreturn]] void write_on(const std::filesystem::path& run, bool distributed, const World& world) {
  for (std::uint64_t step = 1;; ++step) {
    write_checkpoint(checkpoint_directory(run) / checkpoint_name(step), image_of(step, world), {"", "", ""}, world,
                     distributed);
    if (world.is_root()) remove_old_checkpoints(run, 2);
    world.wait_for_all();
  }
}

/// The newest checkpoint must be there, sound, the first that is looked at, and that of its step.
int check(const std::filesystem::path& run) {
  const auto latest = find_latest_checkpoint(run);
  if (!latest) return 1;
  for (const std::string& warning : latest->warnings) std::printf("%s\n", warning.c_str());
  const Image& image = latest->checkpoint.image;
  std::printf("step %llu\n", static_cast<unsigned long long>(image.step));
  const bool is_right =
      moraine::testing::is_same(image, moraine::testing::make_image(n_grains, image.step, image.step));
  return is_right && latest->warnings.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::filesystem::path run = argv[1];
  if (std::strcmp(argv[2], "check") == 0) return check(run);
  const World world = World::join();
  std::printf("rank %d pid %d\n", world.rank(), static_cast<int>(::getpid()));
  std::fflush(stdout);
  write_on(run, std::strcmp(argv[2], "distributed") == 0, world);
}
