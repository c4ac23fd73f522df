#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "scene_source.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception::tools {

/// A model at a pose, as it is drawn over a scene.
struct Outline {
  const MeshRenderer* renderer = nullptr;
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  cv::Scalar color;  ///< BGR
  std::string text;  ///< in its middle
};

/// The scene, dimmed, with outlines of models where their whole silhouettes would be; BGR.
cv::Mat outlinePicture(const Scene& scene, const Projection& projection,
                       const std::vector<Outline>& outlines);

}  // namespace tabletop_perception::tools
