#include "tabletop_perception/object_memory.h"

namespace tabletop_perception {

std::vector<SceneObject> ObjectMemory::expected(double stamp,
                                                const Eigen::Isometry3d& T_world_camera,
                                                double keep) {
  if (stamp < stamp_) entries_.clear();
  std::vector<SceneObject> objects;
  decided_.clear();
  for (const auto& entry : entries_) {
    if (stamp - entry.decided >= keep) continue;
    objects.push_back(entry.object);
    objects.back().T_camera_object = T_world_camera.inverse() * entry.object.T_camera_object;
    decided_.push_back(entry.decided);
  }
  return objects;
}

void ObjectMemory::remember(double stamp, const Eigen::Isometry3d& T_world_camera,
                            const std::vector<SceneObject>& objects) {
  entries_.clear();
  stamp_ = stamp;
  for (const auto& object : objects) {
    if (object.name == "unknown") continue;
    entries_.push_back({object, object.followed ? decided_.at(*object.followed) : stamp});
    entries_.back().object.T_camera_object = T_world_camera * object.T_camera_object;
  }
}

}  // namespace tabletop_perception
