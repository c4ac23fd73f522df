#pragma once

#include <cmath>
#include <cstdint>

#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/model.h"

namespace tabletop_perception {

/// An ellipsoid's surface, points about 4 mm apart.
inline Surface ellipsoid() {
  const Eigen::Vector3f half(0.05f, 0.035f, 0.08f);
  const int count = 2500;
  Surface surface;
  for (int i = 0; i < count; ++i) {  // a spiral from pole to pole
    const double z = 1 - (2 * i + 1.0) / count;
    const double angle = i * M_PI * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
    const Eigen::Vector3f p = Eigen::Vector3d(r * cos(angle), r * sin(angle), z).cast<float>();
    surface.points.push_back(p.cwiseProduct(half));
    surface.normals.push_back(p.cwiseQuotient(half).normalized());
  }
  return surface;
}

/// What a camera at a pose sees of a surface: the points that face it.
inline View viewFrom(const Surface& surface, const Eigen::Isometry3d& T_view_object,
                     const DescriptorOptions& options) {
  View view;
  view.T_view_object = T_view_object;
  const auto seen = transformed(surface, T_view_object);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen.normals[i].dot(seen.points[i]) >= 0) continue;
    view.surface.points.push_back(seen.points[i]);
    view.surface.normals.push_back(seen.normals[i]);
  }
  view.descriptors = describeSurface(view.surface, Eigen::Vector3f::Zero(), options);
  return view;
}

/// The ellipsoid seen from four places, with something in every field.
inline ObjectModel trainedModel() {
  ObjectModel model;
  model.name = "egg-1";
  model.origin = "a \"spiral\": #7\nof points";
  model.surface = ellipsoid();
  for (std::size_t i = 0; i < model.surface.size(); ++i)
    model.colors.push_back(static_cast<std::uint32_t>(i * 97 % 0x1000000));
  model.diameter = 0.16;
  model.symmetry.center = {0.001, 0.002, 1.0 / 3};
  model.symmetry.rotations.push_back(
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()).toRotationMatrix());
  model.symmetry.declared = true;
  model.options.leaf = 0.004;
  model.options.region_min_points = 20;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Isometry3d T_view_object(
        Eigen::Translation3d(0.05 * i, -0.02, 0.7 + 0.1 * i) *
        Eigen::AngleAxisd(1.3 * i, Eigen::Vector3d(1, 2, -i).normalized()));
    model.views.push_back(viewFrom(model.surface, T_view_object, model.options));
  }
  return model;
}

}  // namespace tabletop_perception
