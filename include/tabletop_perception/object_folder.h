#pragma once

#include <filesystem>

#include "tabletop_perception/model.h"

namespace tabletop_perception {

/// Writes an object as files that people and other programs read: model.pcd (the whole surface),
/// view_0000.pcd and on (points in the object's frame, VIEWPOINT the camera's pose in it), all with
/// normals, and object.yaml (what else is known of it, but the descriptors). Makes the folder.
/// Throws std::runtime_error when it is there and not empty, or a file cannot be written.
void exportObject(const std::filesystem::path& folder, const ObjectModel& model);

/// Reads such a folder. The views are described anew, as object.yaml's options say; points and
/// poses come back up to the rounding of float32 and of VIEWPOINT's six digits. Throws
/// std::invalid_argument with the file and what is wrong with it.
ObjectModel importObject(const std::filesystem::path& folder);

}  // namespace tabletop_perception
