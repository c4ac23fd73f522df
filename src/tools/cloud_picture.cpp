#include "cloud_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <opencv2/imgproc.hpp>

namespace tabletop_perception::tools {
namespace {

constexpr int SCATTER_SIZE = 640;   // longer side of a drawn picture [pixels]
constexpr float MAX_SLOPE = 2;      // |x/z| and |y/z| that a camera sees
constexpr double OUTLIERS = 0.002;  // share of the points cut off at each side of a picture

/// Where a point comes to lie before scaling: right, down, and away from the eye.
struct ViewPoint {
  int point;
  Eigen::Vector3f at;
};

/// The value that a share of the others lies below; reorders `values`, which are not empty.
float quantile(std::vector<float>& values, double share) {
  const auto rank = static_cast<std::size_t>(std::lround(share * (values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[rank];
}

bool isAhead(const Eigen::Vector3f& p, bool forward) {
  return forward == (p.z() > 0) && std::abs(p.x()) <= MAX_SLOPE * std::abs(p.z()) &&
         std::abs(p.y()) <= MAX_SLOPE * std::abs(p.z());
}

std::vector<ViewPoint> viewPoints(const PcdContents& contents) {
  const auto indices = validIndices(contents.cloud);
  const Eigen::Isometry3f T_sensor_data = contents.T_data_sensor.inverse().cast<float>();
  std::vector<ViewPoint> view;
  view.reserve(indices.size());
  for (const int i : indices) view.push_back({i, T_sensor_data * contents.cloud.point(i)});
  if (view.empty()) return view;

  const bool forward = view.front().at.z() > 0;
  const bool ahead =
      std::all_of(view.begin(), view.end(), [&](const auto& p) { return isAhead(p.at, forward); });
  for (auto& [i, at] : view) {
    const Eigen::Vector3f p = contents.cloud.point(i);
    if (ahead)  // with z backwards, y is up
      at = {at.x() / std::abs(at.z()), at.y() / at.z(), std::abs(at.z())};
    else
      at = {p.x(), -p.y(), -p.z()};
  }
  return view;
}

/// The range of a coordinate without its outliers.
struct Extent {
  float low, high;
  float length() const { return high - low; }
};

Extent extentOf(const std::vector<ViewPoint>& view, int axis) {
  std::vector<float> values;
  for (const auto& p : view) values.push_back(p.at[axis]);
  return {quantile(values, OUTLIERS), quantile(values, 1 - OUTLIERS)};
}

PictureLayout scatter(const std::vector<ViewPoint>& view) {
  PictureLayout layout{SCATTER_SIZE, SCATTER_SIZE, {}};
  if (view.empty()) {
    layout.point.assign(std::size_t{SCATTER_SIZE} * SCATTER_SIZE, -1);
    return layout;
  }
  const Extent x = extentOf(view, 0), y = extentOf(view, 1);
  const float longest = std::max({x.length(), y.length(), std::numeric_limits<float>::min()});
  const float scale = (SCATTER_SIZE - 1) / longest;
  layout.width = 1 + static_cast<int>(x.length() * scale);
  layout.height = 1 + static_cast<int>(y.length() * scale);
  const std::size_t pixels = static_cast<std::size_t>(layout.width) * layout.height;
  layout.point.assign(pixels, -1);

  // Dots of twice the mean spacing: they cover the picture also where points are sparser.
  const double spacing = std::sqrt(static_cast<double>(pixels) / view.size());
  const int reach = std::clamp(static_cast<int>(std::lround(spacing)), 0, 4);
  std::vector<float> nearest(pixels, std::numeric_limits<float>::infinity());
  for (const auto& [i, at] : view) {
    const auto column = static_cast<int>(std::floor((at.x() - x.low) * scale));
    const auto row = static_cast<int>(std::floor((at.y() - y.low) * scale));
    for (int r = std::max(0, row - reach); r <= std::min(layout.height - 1, row + reach); ++r) {
      for (int c = std::max(0, column - reach); c <= std::min(layout.width - 1, column + reach);
           ++c) {
        const std::size_t pixel = static_cast<std::size_t>(r) * layout.width + c;
        if (at.z() >= nearest[pixel]) continue;
        nearest[pixel] = at.z();
        layout.point[pixel] = i;
      }
    }
  }
  return layout;
}

std::vector<cv::Vec3b> greysByDistance(const PcdContents& contents) {
  const auto& cloud = contents.cloud;
  const Eigen::Vector3f sensor = contents.T_data_sensor.translation().cast<float>();
  const auto distance = [&](int i) { return (cloud.point(i) - sensor).norm(); };
  std::vector<cv::Vec3b> greys(cloud.size(), cv::Vec3b(0, 0, 0));
  const auto indices = validIndices(cloud);
  if (indices.empty()) return greys;

  std::vector<float> distances;
  for (const int i : indices) distances.push_back(distance(i));
  const float near = quantile(distances, 0.02), far = quantile(distances, 0.98);
  for (const int i : indices) {
    const float depth = far > near ? (distance(i) - near) / (far - near) : 0.5f;
    const float grey = 230 - 170 * std::clamp(depth, 0.f, 1.f);
    greys[i] = cv::Vec3b::all(static_cast<std::uint8_t>(grey));
  }
  return greys;
}

int middleOf(std::vector<int>& values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

/// White on a black rim, centred.
void writeText(const std::string& text, cv::Point middle, cv::Mat& picture) {
  constexpr int FONT = cv::FONT_HERSHEY_SIMPLEX;
  constexpr double SIZE = 0.5;
  int baseline = 0;
  const auto extent = cv::getTextSize(text, FONT, SIZE, 1, &baseline);
  const cv::Point corner(middle.x - extent.width / 2, middle.y + extent.height / 2);
  cv::putText(picture, text, corner, FONT, SIZE, cv::Scalar::all(0), 3, cv::LINE_AA);
  cv::putText(picture, text, corner, FONT, SIZE, cv::Scalar::all(255), 1, cv::LINE_AA);
}

}  // namespace

PictureLayout pictureLayout(const PcdContents& contents) {
  const auto& cloud = contents.cloud;
  if (!cloud.organized()) return scatter(viewPoints(contents));
  PictureLayout layout{cloud.width, cloud.height, std::vector<int>(cloud.size())};
  for (std::size_t i = 0; i < cloud.size(); ++i) layout.point[i] = static_cast<int>(i);
  return layout;
}

std::vector<cv::Vec3b> naturalColors(const PcdContents& contents) {
  const auto& rgb = contents.cloud.rgb;
  if (std::all_of(rgb.begin(), rgb.end(), [](std::uint32_t color) { return color == 0; }))
    return greysByDistance(contents);
  std::vector<cv::Vec3b> colors;
  colors.reserve(rgb.size());
  for (const auto color : rgb) colors.emplace_back(color, color >> 8, color >> 16);
  return colors;
}

cv::Mat paintPicture(
    const PictureLayout& layout,
    const std::function<cv::Vec3b(std::size_t point, int column, int row)>& color) {
  cv::Mat picture(layout.height, layout.width, CV_8UC3, cv::Scalar::all(0));
  for (int row = 0, pixel = 0; row < layout.height; ++row)
    for (int column = 0; column < layout.width; ++column, ++pixel)
      if (layout.point[pixel] >= 0)
        picture.at<cv::Vec3b>(row, column) = color(layout.point[pixel], column, row);
  return picture;
}

void writeTexts(const PictureLayout& layout, const std::vector<int>& region,
                const std::vector<std::string>& texts, cv::Mat& picture) {
  std::vector<std::vector<int>> columns(texts.size()), rows(texts.size());
  for (std::size_t pixel = 0; pixel < layout.point.size(); ++pixel) {
    const int point = layout.point[pixel];
    if (point < 0 || region[point] < 0) continue;
    columns[region[point]].push_back(static_cast<int>(pixel % layout.width));
    rows[region[point]].push_back(static_cast<int>(pixel / layout.width));
  }
  for (std::size_t i = 0; i < texts.size(); ++i)
    if (!columns[i].empty())
      writeText(texts[i], {middleOf(columns[i]), middleOf(rows[i])}, picture);
}

}  // namespace tabletop_perception::tools
