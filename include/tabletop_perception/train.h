#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/model.h"

namespace tabletop_perception {

/// Told on the caller's thread about the share of a training that is done, 0 to 1; may be empty.
using Progress = std::function<void(double done)>;

/// A cloud of an object and where it was taken from.
struct TrainingView {
  Cloud cloud;  ///< points in the camera's frame, the object alone [m]
  Eigen::Isometry3d T_view_object = Eigen::Isometry3d::Identity();  ///< object in the camera
};

/// An object from its mesh: rendered as a Kinect would see it from the directions of a subdivided
/// icosphere (80 views) at 0.7 m, or farther where it is large. The model's surface is what the
/// views saw, so nothing inside a shape is in it; views too small to describe are left out; the
/// symmetry is detected. Throws std::invalid_argument for a bad name, bad options, as
/// checkObjectMesh, and when no view can be described.
ObjectModel trainFromMesh(const std::string& name, const Mesh& mesh,
                          const DescriptorOptions& options, const Progress& progress);

/// An object from views of it; its surface is all that they saw, views too small to describe are
/// left out. A symmetry is looked for only if they show it from all around. Throws
/// std::invalid_argument for a bad name, bad options, no view, a view without points, and when no
/// view can be described.
ObjectModel trainFromViews(const std::string& name, const std::vector<TrainingView>& views,
                           const DescriptorOptions& options, const Progress& progress);

}  // namespace tabletop_perception
