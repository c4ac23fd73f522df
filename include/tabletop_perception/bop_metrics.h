#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/pose_metrics.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception {

/// The pose errors of the BOP Challenge 2020 (Hodan et al.) that need the camera.
struct BopError {
  /// Visible surface discrepancy for misalignment tolerances of 5, 10, ... 50 % of the diameter.
  std::array<double, 10> vsd{};
  double mssd = 0;  ///< [m]
  /// Maximum symmetry-aware projection distance, of a picture 640 pixels wide [pixels].
  double mspd = 0;
};

/// Shares of the challenge's thresholds that errors stay below: VSD under 0.05, 0.1, ... 0.5 for
/// each tolerance, MSSD under 5, 10, ... 50 % of the diameter, MSPD under 5, 10, ... 50 pixels.
struct BopRecall {
  double vsd = 0, mssd = 0, mspd = 0;
  double average() const { return (vsd + mssd + mspd) / 3; }
};

/// The errors of a pose. `scene`: the cloud that the camera saw. Throws std::invalid_argument
/// unless it has the projection's size.
BopError measureBop(const ReferenceModel& model, const MeshRenderer& renderer, const Cloud& scene,
                    const Projection& projection, const Eigen::Isometry3d& T_camera_truth,
                    const Eigen::Isometry3d& T_camera_estimate);

BopRecall bopRecall(const BopError& error, double diameter);

/// Mean over objects, where one without an error (nothing found) has 0; none without objects.
std::optional<BopRecall> meanRecall(const std::vector<std::optional<BopRecall>>& objects);

}  // namespace tabletop_perception
