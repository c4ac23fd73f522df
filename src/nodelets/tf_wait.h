#pragma once

#include <chrono>
#include <string>

#include <ros/time.h>
#include <tf2_ros/buffer.h>
#include <Eigen/Geometry>

namespace tabletop_perception {

/// Maps coordinates of `source` into `target` at `stamp`; waits until `deadline` for tf to know it.
/// On the wall clock: tf2's own waiting stands still while the simulated clock does. Throws
/// tf2::TransformException with the reason.
Eigen::Isometry3d lookupTransformBy(std::chrono::steady_clock::time_point deadline,
                                    const tf2_ros::Buffer& tf, const std::string& target,
                                    const std::string& source, const ros::Time& stamp);

}  // namespace tabletop_perception
