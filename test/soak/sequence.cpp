#include "sequence.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "evaluate.h"
#include "tabletop_perception/depth_image.h"

namespace tabletop_perception::soak {
namespace fs = std::filesystem;

namespace {

constexpr char FIRST_SCENE[] = "000000_";

template <typename T>
std::vector<T> pixelsOf(const fs::path& file, int type, const Projection& camera) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  if (image.type() != type || image.cols != camera.width || image.rows != camera.height)
    throw std::invalid_argument(file.string() + ": is not the image that gt.json describes");
  const auto* data = image.ptr<T>();
  return {data, data + image.total() * image.channels()};
}

}  // namespace

Sequence::Sequence(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw std::invalid_argument(folder.string() + ": no such folder; tabletop simulate makes one");
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().filename().string().rfind(FIRST_SCENE, 0) == 0)
      folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  if (folders.size() < 2)
    throw std::invalid_argument(folder.string() + ": holds no sequence, two pictures at least");
  for (const auto& one : folders) pictures_.push_back(read(one));
}

Sequence::Picture Sequence::read(const fs::path& folder) {
  Picture picture;
  tools::visitJson(folder / "gt.json", [&](const nlohmann::json& content) {
    const auto& camera = content.at("camera");
    camera_ = {camera.at("fx"),
               camera.at("fy"),
               camera.at("cx"),
               camera.at("cy"),
               camera.at("width"),
               camera.at("height"),
               1};
    depth_unit_ = content.at("depth_unit_m");
    for (const auto& object : content.at("objects"))
      picture.truth.push_back(tools::trueObjectFrom(object));
  });
  picture.depth = pixelsOf<std::uint16_t>(folder / "depth.png", CV_16UC1, camera_);
  picture.color = pixelsOf<std::uint8_t>(folder / "color.png", CV_8UC3, camera_);
  return picture;
}

Cloud Sequence::cloud(std::size_t picture) const {
  const auto& shown = pictures_[picture];
  const auto width = static_cast<std::uint32_t>(camera_.width),
             height = static_cast<std::uint32_t>(camera_.height);
  const PackedImage depth{"16UC1",
                          width,
                          height,
                          2 * width,
                          false,
                          reinterpret_cast<const std::uint8_t*>(shown.depth.data()),
                          2 * shown.depth.size()};
  const PackedImage color{
      "bgr8", width, height, 3 * width, false, shown.color.data(), shown.color.size()};
  return cloudFromDepth(depth, &color, camera_, DepthImageOptions(), nullptr, depth_unit_);
}

std::set<std::string> Sequence::names() const {
  std::set<std::string> names;
  for (const auto& picture : pictures_)
    for (const auto& object : picture.truth) names.insert(object.name);
  return names;
}

std::size_t toAndFro(std::size_t i, std::size_t size) {
  const std::size_t step = i % (2 * size - 2);
  return step < size ? step : 2 * size - 2 - step;
}

}  // namespace tabletop_perception::soak
