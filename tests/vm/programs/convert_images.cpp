// convert_images FROM TO: every image of FROM as raw luma and as JPEG, in its size and in half of
// it: TO/WIDTHxHEIGHT/pgm/NAME.pgm and TO/WIDTHxHEIGHT/jpeg/NAME.jpg.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <string>

#include "image/image_write.h"
#include "images.h"

namespace {

using namespace loopd;
using namespace loopd::vm;
namespace fs = std::filesystem;

constexpr int kJpegQuality = 92;

Status write_pgm(const fs::path& path, const LumaImage& image) {
  std::string bytes =
      "P5\n" + std::to_string(image.width_px) + " " + std::to_string(image.height_px) + "\n255\n";
  bytes.append(image.data.begin(), image.data.end());
  return image::write_file(path, bytes.data(), bytes.size());
}

Status write_both(const fs::path& to, const std::string& name, const LumaImage& image) {
  const fs::path folder =
      to / (std::to_string(image.width_px) + "x" + std::to_string(image.height_px));
  fs::create_directories(folder / "pgm");
  fs::create_directories(folder / "jpeg");
  const Status raw = write_pgm(folder / "pgm" / (name + ".pgm"), image);
  if (!raw) return raw;
  return image::write_jpeg(folder / "jpeg" / (name + ".jpg"), image.view(), kJpegQuality);
}

Status convert(const fs::path& from, const fs::path& to) {
  const auto files = list_files(from, ".png");
  if (!files) return files.error();
  for (const fs::path& file : files.value()) {
    const auto image = read_image(file);
    if (!image) return image.error();
    const std::string name = file.stem().string();
    for (const LumaImage& size : {image.value(), halved(image.value())}) {
      const Status written = write_both(to, name, size);
      if (!written) return written;
    }
  }
  return Nothing{};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Converts a folder of PNG images to raw luma and JPEG, whole and half size.");
  std::string from;
  std::string to;
  app.add_option("FROM", from, "folder of *.png")->required();
  app.add_option("TO", to, "folder to write")->required();
  CLI11_PARSE(app, argc, argv);
  const Status status = convert(from, to);
  if (status) return 0;
  std::cerr << "convert_images: " << status.error().message << "\n";
  return 1;
}
