#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// What a .pcd file holds.
struct PcdContents {
  Cloud cloud;                           ///< as stored: in the frame of the data
  std::vector<std::uint32_t> labels;     ///< its `label` field; empty if it has none
  std::vector<Eigen::Vector3f> normals;  ///< normal_x, _y, _z, one per point; empty if it has none
  /// The pose of the sensor in the frame of the data (VIEWPOINT).
  Eigen::Isometry3d T_data_sensor = Eigen::Isometry3d::Identity();
};

/// Reads ascii, binary and compressed files. Throws std::invalid_argument with the file and what is
/// wrong: missing, not a PCD, cut short, no points, no x/y/z. (An ascii file that ends within its
/// last number cannot be told from a whole one.)
PcdContents readPcd(const std::filesystem::path& file);

/// Writes x y z rgb, and normals and label if `contents` has them, as compressed binary. The grid
/// and the order of the points stay; pixels without a point are NaN; no colour: rgb 0. VIEWPOINT
/// has six digits. Throws std::invalid_argument for a cloud without pixels or with another number
/// of labels or normals, std::runtime_error when the file cannot be written.
void writePcd(const std::filesystem::path& file, const PcdContents& contents);

}  // namespace tabletop_perception
