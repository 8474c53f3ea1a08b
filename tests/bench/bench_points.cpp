// Points of recorded frames: our extractor beside cv::ORB on the same frames in the same run.
//   bench_points FOLDER [FRAMES [ROUNDS]]     a folder of images; by default 60 of them, 5 rounds
// Prints the time a frame takes, and how well the points of a frame are found and matched again in
// the frame turned, scaled, tilted, blurred and brightened by known amounts.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "base/hamming.h"
#include "capture/decode.h"
#include "features/orb_descriptor.h"
#include "features/point_extractor.h"

namespace {

using namespace loopd;

constexpr std::size_t kMaxPixels = 16'000'000;
constexpr double kRatio = 0.8;        // NNDR, as the detector's
constexpr double kTolerancePx = 2.5;  // of a right match, times the size of its level

struct Found {
  std::vector<Point> points;
  std::vector<Descriptor> descriptors;
};

struct Method {
  std::string name;
  std::function<void(const cv::Mat&, Found&)> extract;
};

Method opencv(int threshold) {
  auto orb = cv::ORB::create(1500, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, threshold);
  return {"cv::ORB, threshold " + std::to_string(threshold),
          [orb, keypoints = std::vector<cv::KeyPoint>(), table = cv::Mat()](const cv::Mat& image,
                                                                            Found& f) mutable {
            orb->detectAndCompute(image, cv::noArray(), keypoints, table);
            f.points.resize(keypoints.size());
            f.descriptors.resize(keypoints.size());
            for (std::size_t i = 0; i < keypoints.size(); ++i) {
              const cv::KeyPoint& k = keypoints[i];
              f.points[i] = {k.pt.x, k.pt.y, k.size, k.angle};
              std::memcpy(f.descriptors[i].words.data(), table.ptr(static_cast<int>(i)), 32);
            }
          }};
}

Method ours() {
  auto extractor = std::make_shared<PointExtractor>(FeaturesConfig{});
  return {"ours", [extractor](const cv::Mat& image, Found& f) {
            extractor->extract({image.data, image.cols, image.rows, static_cast<int>(image.step)},
                               f.points, f.descriptors);
          }};
}

std::vector<cv::Mat> read_images(const std::string& folder, std::size_t frames) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file()) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  ImageDecoder decoder(kMaxPixels);
  std::vector<cv::Mat> images;
  const std::size_t count = std::min(frames, paths.size());
  for (std::size_t i = 0; i < count; ++i) {
    std::ifstream file(paths[i * paths.size() / count], std::ios::binary);
    const std::vector<char> text{std::istreambuf_iterator<char>(file), {}};
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    const auto size = decoder.size(bytes);
    if (!size) continue;
    cv::Mat image(size.value().height_px, size.value().width_px, CV_8UC1);
    if (decoder.decode(bytes, {image.data, size.value().pixels()})) images.push_back(image);
  }
  return images;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void print_times(const std::vector<cv::Mat>& images, std::vector<Method>& methods, int rounds) {
  std::vector<std::vector<double>> best(methods.size(), std::vector<double>(images.size(), 1e9));
  std::vector<std::vector<double>> all(methods.size());
  std::vector<double> points(methods.size(), 0);
  Found found;
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < images.size(); ++i)
      for (std::size_t m = 0; m < methods.size(); ++m) {
        const auto start = std::chrono::steady_clock::now();
        methods[m].extract(images[i], found);
        const std::chrono::duration<double, std::milli> took =
            std::chrono::steady_clock::now() - start;
        best[m][i] = std::min(best[m][i], took.count());
        all[m].push_back(took.count());
        points[m] += static_cast<double>(found.points.size());
      }
  std::printf("%-24s %10s %18s %8s\n", "", "median ms", "mean of least ms", "points");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    double sum = 0;
    for (const double ms : best[m]) sum += ms;
    std::printf("%-24s %10.2f %18.2f %8.0f\n", methods[m].name.c_str(), median(all[m]),
                sum / static_cast<double>(images.size()),
                points[m] / static_cast<double>(all[m].size()));
  }
}

/// A view of the image from elsewhere: what `homography` makes of it, brightened and with noise.
struct View {
  cv::Mat image;
  cv::Matx33d homography;
};

View view_of(const cv::Mat& image, unsigned seed) {
  std::mt19937 random(seed);
  const auto within = [&random](double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
  };
  const double angle = within(-0.5, 0.5), scale = within(0.7, 1.3);
  const double c = scale * std::cos(angle), s = scale * std::sin(angle);
  const double x = image.cols / 2.0, y = image.rows / 2.0;
  const cv::Matx33d centre(1, 0, -x, 0, 1, -y, 0, 0, 1), back(1, 0, x, 0, 1, y, 0, 0, 1);
  const cv::Matx33d turn(c, -s * within(0.8, 1.2), within(-30, 30), s, c * within(0.8, 1.2),
                         within(-30, 30), within(-4e-4, 4e-4), within(-4e-4, 4e-4), 1);
  View view;
  view.homography = back * turn * centre;
  cv::warpPerspective(image, view.image, view.homography, image.size(), cv::INTER_LINEAR,
                      cv::BORDER_CONSTANT, 127);
  view.image.convertTo(view.image, -1, within(0.7, 1.2), within(-20, 20));
  cv::Mat noise(image.size(), CV_16SC1);
  for (int row = 0; row < noise.rows; ++row)
    for (int column = 0; column < noise.cols; ++column)
      noise.at<short>(row, column) = static_cast<short>(std::lround(within(-3, 3) + within(-3, 3)));
  cv::add(view.image, noise, view.image, cv::noArray(), CV_8UC1);
  return view;
}

struct Quality {
  double visible = 0, repeated = 0, accepted = 0, right = 0;
};

bool agrees(const Point& from, const Point& to, const cv::Matx33d& h) {
  const cv::Vec3d p = h * cv::Vec3d(from.x_px, from.y_px, 1);
  return std::hypot(p[0] / p[2] - to.x_px, p[1] / p[2] - to.y_px) <=
         kTolerancePx * std::max(to.size_px, from.size_px) / kPatchPx;
}

bool visible(const Point& from, const View& view) {
  const cv::Vec3d p = view.homography * cv::Vec3d(from.x_px, from.y_px, 1);
  const double x = p[0] / p[2], y = p[1] / p[2];
  return x >= 31 && y >= 31 && x < view.image.cols - 31 && y < view.image.rows - 31;
}

void judge(const Found& a, const Found& b, const View& view, Quality& quality) {
  std::vector<std::uint16_t> distances(b.points.size());
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    if (!visible(a.points[i], view) || b.points.size() < 2) continue;
    ++quality.visible;
    quality.repeated += std::any_of(b.points.begin(), b.points.end(), [&](const Point& p) {
      const float step = p.size_px / a.points[i].size_px;
      return step < 1.5F && step > 0.66F && agrees(a.points[i], p, view.homography);
    });
    hamming_distances(a.descriptors[i], b.descriptors, distances);
    const auto best = std::min_element(distances.begin(), distances.end());
    const std::size_t index = static_cast<std::size_t>(best - distances.begin());
    const int first = *best;
    *best = 1000;
    const int second = *std::min_element(distances.begin(), distances.end());
    if (first > kRatio * second) continue;
    ++quality.accepted;
    quality.right += agrees(a.points[i], b.points[index], view.homography);
  }
}

void print_quality(const std::vector<cv::Mat>& images, std::vector<Method>& methods) {
  std::vector<Quality> quality(methods.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    const View view = view_of(images[i], static_cast<unsigned>(i));
    for (std::size_t m = 0; m < methods.size(); ++m) {
      Found a, b;
      methods[m].extract(images[i], a);
      methods[m].extract(view.image, b);
      judge(a, b, view, quality[m]);
    }
  }
  std::printf("\n%-24s %10s %10s %10s %12s %12s\n", "seen again in a warp", "visible", "repeated",
              "accepted", "right a frame", "precision");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Quality& q = quality[m];
    const auto frames = static_cast<double>(images.size());
    std::printf("%-24s %10.0f %9.1f%% %10.0f %12.1f %11.2f%%\n", methods[m].name.c_str(),
                q.visible / frames, 100 * q.repeated / q.visible, q.accepted / frames,
                q.right / frames, 100 * q.right / q.accepted);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: bench_points FOLDER [FRAMES [ROUNDS]]\n");
    return 2;
  }
  cv::setNumThreads(1);
  const auto images = read_images(argv[1], argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 60);
  if (images.empty()) {
    std::fprintf(stderr, "bench_points: no image in %s\n", argv[1]);
    return 2;
  }
  const int rounds = argc > 3 ? std::atoi(argv[3]) : 5;
  std::vector<Method> methods{opencv(20), opencv(7), ours()};
  if (rounds > 0) print_times(images, methods, rounds);
  print_quality(images, methods);
}
