#include "tabletop_perception/train.h"

#include <algorithm>
#include <stdexcept>

#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception {
namespace {

constexpr double MODEL_LEAF = 0.003;           // spacing of the whole model's points [m]
constexpr double MODEL_NORMAL_RADIUS = 0.008;  // neighbourhood of its normals [m]
constexpr double VIEW_DISTANCE = 0.7;          // of the camera from a small object [m]
constexpr double MIN_DISTANCE_RATIO = 1.5;     // of the camera to the diameter of a large one

/// The camera that meshes are rendered for: that of a Kinect.
Projection kinectProjection() {
  Projection projection;
  projection.fx = projection.fy = 525;
  projection.cx = 319.5;
  projection.cy = 239.5;
  projection.width = 640;
  projection.height = 480;
  return projection;
}

std::vector<Eigen::Vector3f> pointsOf(const Cloud& cloud) {
  std::vector<Eigen::Vector3f> points;
  for (const int i : validIndices(cloud)) points.push_back(cloud.point(i));
  return points;
}

void append(Surface& surface, const Surface& more) {
  surface.points.insert(surface.points.end(), more.points.begin(), more.points.end());
  surface.normals.insert(surface.normals.end(), more.normals.begin(), more.normals.end());
}

View describeView(const std::vector<Eigen::Vector3f>& points,
                  const Eigen::Isometry3d& T_view_object, const DescriptorOptions& options) {
  View view;
  view.T_view_object = T_view_object;
  view.surface =
      sampleSurface(points, options.leaf, options.normal_radius, Eigen::Vector3f::Zero());
  view.descriptors = describeSurface(view.surface, Eigen::Vector3f::Zero(), options);
  return view;
}

/// Adds what a view shows: to the views if it can be described, to the whole surface in any case.
void addView(ObjectModel& model, const std::vector<Eigen::Vector3f>& points,
             const Eigen::Isometry3d& T_view_object) {
  const Surface fine =
      sampleSurface(points, MODEL_LEAF, MODEL_NORMAL_RADIUS, Eigen::Vector3f::Zero());
  append(model.surface, transformed(fine, T_view_object.inverse()));
  View view = describeView(points, T_view_object, model.options);
  if (!view.descriptors.empty()) model.views.push_back(std::move(view));
}

/// The colour of the nearest of `points` for each point of a surface; none without colours.
std::vector<std::uint32_t> nearestColors(const Surface& surface,
                                         const std::vector<Eigen::Vector3f>& points,
                                         const std::vector<std::uint32_t>& colors) {
  std::vector<std::uint32_t> nearest;
  if (colors.empty()) return nearest;
  const KdTree tree(points);
  for (const auto& p : surface.points) nearest.push_back(colors[tree.nearest(p).index]);
  return nearest;
}

Eigen::Vector3d middleOf(const std::vector<Eigen::Vector3f>& points) {
  Eigen::Vector3f low = points.front(), high = low;
  for (const auto& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return ((low + high) / 2).cast<double>();
}

void requireViews(const ObjectModel& model) {
  if (model.views.empty())
    throw std::invalid_argument("object '" + model.name + "': no view shows more than " +
                                std::to_string(model.options.min_points) +
                                " sampled points; move the camera nearer or lower "
                                "descriptor.leaf");
}

}  // namespace

ObjectModel trainFromMesh(const std::string& name, const Mesh& mesh,
                          const DescriptorOptions& options, const Progress& progress) {
  checkObjectName(name);
  checkObjectMesh(mesh);
  ObjectModel model;
  model.name = name;
  model.options = options;
  model.diameter = diameterOf(mesh.vertices);

  const MeshRenderer renderer(mesh);
  const Projection projection = kinectProjection();
  const Eigen::Vector3d middle = middleOf(mesh.vertices);
  const double distance = std::max(VIEW_DISTANCE, MIN_DISTANCE_RATIO * model.diameter);
  const auto directions = icosphereDirections();
  for (std::size_t i = 0; i < directions.size(); ++i) {
    Eigen::Isometry3d T_view_object = Eigen::Isometry3d::Identity();
    T_view_object.linear() = rotationBetween(-directions[i], Eigen::Vector3d::UnitZ());
    T_view_object.translation() =
        distance * Eigen::Vector3d::UnitZ() - T_view_object.linear() * middle;
    addView(model, pointsOf(renderer.render(T_view_object, projection)), T_view_object);
    if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(directions.size()));
  }
  requireViews(model);
  model.surface = downsampled(model.surface, MODEL_LEAF);
  model.colors = nearestColors(model.surface, mesh.vertices, mesh.colors);
  model.symmetry = detectSymmetry(model.surface);
  model.origin = "mesh of " + std::to_string(mesh.faces.size()) + " faces";
  return model;
}

ObjectModel trainFromViews(const std::string& name, const std::vector<TrainingView>& views,
                           const DescriptorOptions& options, const Progress& progress) {
  checkObjectName(name);
  if (views.empty()) throw std::invalid_argument("object '" + name + "': no view to train from");
  ObjectModel model;
  model.name = name;
  model.options = options;
  std::vector<Eigen::Vector3f> all_points;  // in the object's frame
  std::vector<std::uint32_t> all_colors;
  const bool colored = std::all_of(views.begin(), views.end(),
                                   [](const TrainingView& view) { return view.cloud.colored(); });
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Cloud& cloud = views[i].cloud;
    const Indices valid = validIndices(cloud);
    if (valid.empty())
      throw std::invalid_argument("object '" + name + "': view " + std::to_string(i + 1) + " of " +
                                  std::to_string(views.size()) + " has no points");
    addView(model, pointsOf(cloud), views[i].T_view_object);
    const Eigen::Isometry3f T_object_view = views[i].T_view_object.inverse().cast<float>();
    for (const int p : valid) {
      all_points.push_back(T_object_view * cloud.point(p));
      if (colored) all_colors.push_back(cloud.rgb[p]);
    }
    if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(views.size()));
  }
  requireViews(model);
  model.surface = downsampled(model.surface, MODEL_LEAF);
  model.diameter = diameterOf(model.surface.points);
  model.colors = nearestColors(model.surface, all_points, all_colors);
  // A few views show a part of the surface, and a part has symmetries that the whole has not.
  model.origin = std::to_string(views.size()) + (views.size() == 1 ? " view" : " views");
  return model;
}

}  // namespace tabletop_perception
