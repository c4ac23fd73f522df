#pragma once

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/found.h"

namespace tabletop_perception {

/// A pinhole camera without distortion: column = fx x/z + cx, row = fy y/z + cy. The signs follow
/// the cloud's convention: fx < 0 where the camera looks along negative z.
struct Projection {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [pixels]
  int width = 0, height = 0;              ///< of the image [pixels]
  int forward = 1;                        ///< sign of z before the camera

  /// Column and row of a point; it must not lie in the plane of the camera.
  Eigen::Vector2d pixel(const Eigen::Vector3d& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
};

/// The projection of an organised cloud, fitted to its points by least squares; none when the
/// cloud is unorganised or its points miss their own pixels by more than one (RMS).
Found<Projection> fitProjection(const Cloud& cloud);

}  // namespace tabletop_perception
