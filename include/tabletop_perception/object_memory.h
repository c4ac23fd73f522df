#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/decide.h"

namespace tabletop_perception {

/// The named objects of the last frame, as decideObjects may expect them in the next one.
class ObjectMemory {
 public:
  /// Those that were decided less than `keep` [s] before `stamp`, where the camera is now. A stamp
  /// that lies before the last frame's forgets everything: a bag begins anew.
  std::vector<SceneObject> expected(double stamp, const Eigen::Isometry3d& T_world_camera,
                                    double keep);

  /// Puts the objects of a frame in place of the last one's. `T_world_camera`: in a frame in which
  /// things at rest do not move.
  void remember(double stamp, const Eigen::Isometry3d& T_world_camera,
                const std::vector<SceneObject>& objects);

 private:
  struct Entry {
    SceneObject object;  ///< its pose is in the world
    double decided;      ///< stamp [s]
  };
  std::vector<Entry> entries_;
  std::vector<double> decided_;  ///< of what was expected last [s]
  double stamp_ = 0;             ///< of the last frame [s]
};

}  // namespace tabletop_perception
