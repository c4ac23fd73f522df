#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "scene.h"
#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/normals.h"

/// Surfaces of meshes: whole, and as a camera sees them.
namespace tabletop_perception::views {

/// Points of the faces about `spacing` apart [m], with the faces' own normals.
inline Surface surfaceOf(const Mesh& mesh, double spacing) {
  Surface surface;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f a = mesh.vertices[face[0]], b = mesh.vertices[face[1]] - a,
                          c = mesh.vertices[face[2]] - a;
    const Eigen::Vector3f normal = b.cross(c).normalized();
    const int nb = static_cast<int>(std::ceil(b.norm() / spacing));
    const int nc = static_cast<int>(std::ceil(c.norm() / spacing));
    for (int i = 0; i < nb; ++i)
      for (int j = 0; j < nc; ++j) {
        const float u = (i + 0.5f) / nb, v = (j + 0.5f) / nc;
        if (u + v > 1) continue;
        surface.points.push_back(a + u * b + v * c);
        surface.normals.push_back(normal);
      }
  }
  return surface;
}

/// An object in the camera that looks at its middle from a direction (object to camera).
inline Eigen::Isometry3d lookAt(const Mesh& mesh, const Eigen::Vector3d& direction,
                                double distance) {
  const Eigen::Vector3d middle = centroidOf(mesh.vertices).cast<double>();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotationBetween(direction.normalized(), -Eigen::Vector3d::UnitZ());
  T.translation() = Eigen::Vector3d(0, 0, distance) - T.linear() * middle;
  return T;
}

/// What a VGA camera sees of a mesh.
inline Cloud imageOf(const Mesh& mesh, const Eigen::Isometry3d& T_camera_object) {
  return MeshRenderer(mesh).render(T_camera_object, scene::SceneOptions().projection);
}

/// All points of an image, sampled as clusters are.
inline Surface sampled(const Cloud& image, const DescriptorOptions& options = {}) {
  std::vector<Eigen::Vector3f> points;
  for (const int i : validIndices(image)) points.push_back(image.point(i));
  return sampleSurface(points, options.leaf, options.normal_radius, Eigen::Vector3f::Zero());
}

inline Surface seen(const Mesh& mesh, const Eigen::Isometry3d& T_camera_object,
                    const DescriptorOptions& options = {}) {
  return sampled(imageOf(mesh, T_camera_object), options);
}

/// A model of the mesh with a view from each direction, 0.8 m away.
inline ObjectModel modelOf(const std::string& name, const Mesh& mesh,
                           const std::vector<Eigen::Vector3d>& directions) {
  ObjectModel model;
  model.name = name;
  model.surface = surfaceOf(mesh, 0.003);
  model.diameter = diameterOf(mesh.vertices);
  for (const auto& direction : directions) {
    View view;
    view.T_view_object = lookAt(mesh, direction, 0.8);
    view.surface = seen(mesh, view.T_view_object);
    view.descriptors = describeSurface(view.surface, Eigen::Vector3f::Zero(), model.options);
    model.views.push_back(std::move(view));
  }
  return model;
}

}  // namespace tabletop_perception::views
