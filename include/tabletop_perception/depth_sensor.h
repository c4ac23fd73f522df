#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/random.h"

namespace tabletop_perception {

/// A camera of structured light as the first Kinect.
struct DepthSensor {
  double baseline = 0.075;          ///< the projector is so far to the camera's right [m]
  double disparity_step = 1.0 / 8;  ///< depths are those of whole multiples of it [pixels]
  double min_range = 0.4;           ///< nearer points have no depth [m]
  double max_range = 5.0;           ///< farther points have none either [m]
  double edge_dropout = 0.5;        ///< share of the pixels beside a step in depth without depth
  double edge_jitter = 0.5;         ///< standard deviation of outlines across themselves [pixels]
  double grazing_from_deg = 70;     ///< surfaces begin to lose points at this angle [deg]
  double grazing_to_deg = 85;       ///< from here on they have none; 0 is seen at a right angle
};

/// Standard deviation of the depth z [m] before it is quantised [m]: 0.0012 + 0.0019 (z - 0.4)^2
/// (Nguyen, Izadi, Lovell 2012).
double axialNoise(double z);

/// Where the projector of a sensor is: camera coordinates into those of a camera in its place.
Eigen::Isometry3d projectorPose(const DepthSensor& sensor);

/// The cosine of the angle between the surface and the ray that sees it, per pixel, from the
/// neighbours on the same surface; 0 where there is no point.
std::vector<float> incidence(const Cloud& cloud);

/// What the sensor makes of a scene: along the rays, noise and quantised disparities; outlines
/// that tremble by up to a pixel; no depth in the projector's shadow, beside steps in depth, on
/// surfaces seen at grazing angles and out of range. Colours stay. `ideal`: the scene as it is,
/// seen from the camera; `projected`: seen from the projector, with the same projection, z forward.
Cloud senseDepth(const Cloud& ideal, const Cloud& projected, const Projection& projection,
                 const DepthSensor& sensor, Random& random);

}  // namespace tabletop_perception
