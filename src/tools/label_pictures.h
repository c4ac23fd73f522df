#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "cloud_picture.h"
#include "label_findings.h"

/// Pictures of a scene's labels, BGR. What has no label is the scene itself, dimmed.
namespace tabletop_perception::tools {

using Labels = std::vector<std::uint32_t>;

/// How a scene is drawn.
struct SceneCanvas {
  PictureLayout layout;
  std::vector<cv::Vec3b> natural;  ///< per point
};

SceneCanvas sceneCanvas(const PcdContents& contents);

cv::Mat naturalPicture(const SceneCanvas& canvas);

/// The objects with their names, each in a colour of its own, and the table; an object without a
/// segment is striped.
cv::Mat truthPicture(const SceneCanvas& canvas, const Labels& truth, const LabelFindings& findings);

/// The segments with their labels, each in its object's colour, and the table; a segment without an
/// object is striped.
cv::Mat resultPicture(const SceneCanvas& canvas, const Labels& result,
                      const LabelFindings& findings);

/// The points that went wrong, in the colours of FaultColor.
cv::Mat faultPicture(const SceneCanvas& canvas, const Labels& truth, const Labels& result,
                     const LabelFindings& findings);

/// The segments of a result without truth, each in a colour of its own.
cv::Mat segmentPicture(const SceneCanvas& canvas, const Labels& result);

/// BGR.
struct FaultColor {
  static cv::Vec3b missed() { return {50, 50, 240}; }         ///< of an object, in no segment
  static cv::Vec3b otherSegment() { return {30, 160, 255}; }  ///< of an object, in a wrong one
  static cv::Vec3b noObject() { return {230, 60, 220}; }      ///< in a segment, of no object
  static cv::Vec3b tableMissed() { return {255, 150, 60}; }   ///< of the table, without a label
};

cv::Vec3b tableColor();

}  // namespace tabletop_perception::tools
