#include "pose_picture.h"

#include <opencv2/imgproc.hpp>

#include "cloud_picture.h"

namespace tabletop_perception::tools {
namespace {

constexpr double DIMMED = 0.6;  // of the scene's brightness

/// 255 where the model would be seen.
cv::Mat1b silhouette(const Outline& outline, const Projection& projection) {
  const Cloud seen = outline.renderer->render(outline.T_camera_object, projection);
  cv::Mat1b mask(seen.height, seen.width, std::uint8_t{0});
  for (std::size_t i = 0; i < seen.size(); ++i)
    if (seen.valid(i)) mask(static_cast<int>(i)) = 255;
  return mask;
}

}  // namespace

cv::Mat outlinePicture(const Scene& scene, const Projection& projection,
                       const std::vector<Outline>& outlines) {
  PcdContents contents;
  contents.cloud = scene.cloud;
  const auto layout = pictureLayout(contents);
  const auto natural = naturalColors(contents);
  cv::Mat picture =
      paintPicture(layout, [&](std::size_t point, int, int) { return natural[point] * DIMMED; });
  std::vector<int> region(scene.cloud.size(), -1);
  std::vector<std::string> texts;
  for (const auto& outline : outlines) {
    const cv::Mat1b mask = silhouette(outline, projection);
    for (std::size_t i = 0; i < region.size(); ++i)
      if (mask(static_cast<int>(i)) > 0 && !outline.text.empty())
        region[i] = static_cast<int>(texts.size());
    texts.push_back(outline.text);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    cv::drawContours(picture, contours, -1, outline.color, 2);
  }
  writeTexts(layout, region, texts, picture);
  return picture;
}

}  // namespace tabletop_perception::tools
