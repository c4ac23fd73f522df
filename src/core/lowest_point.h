#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// Height of the lowest of an object's points above a table, below zero in it; infinite without a
/// point [m].
double lowestAbove(const Table& table, const Eigen::Isometry3d& T_camera_object,
                   const std::vector<Eigen::Vector3f>& points);

/// How deep an object reaches below a table [m].
double sinkOf(const Table& table, const Eigen::Isometry3d& T_camera_object,
              const std::vector<Eigen::Vector3f>& points);

}  // namespace tabletop_perception
