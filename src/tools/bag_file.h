#pragma once

#include <filesystem>
#include <functional>

#include <rosbag/bag.h>

namespace tabletop_perception::tools {

/// Opens a bag for `read`. What rosbag has against the file, then or while it is read, becomes a
/// std::invalid_argument with the file and the reason.
void readBag(const std::filesystem::path& file, const std::function<void(rosbag::Bag&)>& read);

}  // namespace tabletop_perception::tools
