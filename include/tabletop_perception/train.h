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

/// How a mesh is looked at.
struct MeshViewOptions {
  std::vector<double> distances = {0.7};  ///< of the camera from the mesh's middle [m]
  bool noise = false;                     ///< views as a DepthSensor sees them, not as they are
};

/// Throws std::invalid_argument unless every distance is 0.4 to 3 m, and there is one.
void checkMeshViews(const MeshViewOptions& options);

/// An object from its mesh: rendered for the camera of a Kinect from the directions of a subdivided
/// icosphere (80 views) at every distance, or farther where it is large. The model's surface is
/// what the views would see without noise, so nothing inside a shape is in it; views too small to
/// describe are left out; the symmetry is detected. The same arguments give the same model. Throws
/// std::invalid_argument for a bad name, bad options, as checkObjectMesh and checkMeshViews, and
/// when no view can be described.
ObjectModel trainFromMesh(const std::string& name, const Mesh& mesh,
                          const DescriptorOptions& options, const Progress& progress,
                          const MeshViewOptions& view_options = {});

/// An object from views of it; its surface is all that they saw, views too small to describe are
/// left out. A symmetry is looked for only if they show it from all around. Throws
/// std::invalid_argument for a bad name, bad options, no view, a view without points, and when no
/// view can be described.
ObjectModel trainFromViews(const std::string& name, const std::vector<TrainingView>& views,
                           const DescriptorOptions& options, const Progress& progress);

/// The same object with one more view, in the frame that its other views are in. Throws
/// std::invalid_argument when the view has no points or cannot be described.
ObjectModel withView(ObjectModel model, const TrainingView& view);

}  // namespace tabletop_perception
