#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model_index.h"
#include "voxel_key.h"

namespace tabletop_perception {

/// The pixels in which the outline of a model is not the one that is seen.
struct OffOutline {
  int pixels = 0;
  std::unordered_map<VoxelKey, int, VoxelKeyHash> by_patch;  ///< the same, patch by patch
};

/// The pixels that show a thing, to hold the outlines of a model against.
class SeenOutline {
 public:
  /// All that is seen above the table within 3 cm of a model at a pose is the thing, whatever
  /// cluster it went to: the handle of a mug may be none. `observation`: with a projection; must
  /// outlive this, as must the index. The patches are cubes of 2 cm in the model's frame.
  SeenOutline(const Observation& observation, const ModelIndex& index, int model,
              const Eigen::Isometry3d& T_camera_model);

  /// Where a model at a pose covers what is seen beside or behind the thing, or leaves the thing
  /// uncovered. Pixels without depth, and those of something nearer, say nothing.
  OffOutline offAt(const Eigen::Isometry3d& T_camera_model) const;

 private:
  std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row) * width_ + static_cast<std::size_t>(column);
  }

  /// Of the scene.
  std::size_t pixelAt(int column, int row) const {
    return static_cast<std::size_t>(row + top_) * observation_.scene.width +
           static_cast<std::size_t>(column + left_);
  }

  /// Of the model in each pixel of the window, infinite where it is not [m].
  std::vector<float> rangesAt(const Eigen::Isometry3d& T_camera_model) const;

  const Observation& observation_;
  const Surface& model_;
  Eigen::Isometry3f T_patches_camera_;
  int left_ = 0, top_ = 0;           ///< of the window about the thing [pixels]
  int width_ = 0, height_ = 0;       ///< of it [pixels]
  std::vector<std::uint8_t> thing_;  ///< 1 where it shows the thing
};

/// How much less likely one outline is than another, as a negative log likelihood: how many
/// standard deviations, beyond what chance makes, the sum of what each patch has against it is off
/// zero (Vuong 1989). Halved, because a whole edge may be off alike.
double outlineCost(const OffOutline& outline, const OffOutline& other);

}  // namespace tabletop_perception
