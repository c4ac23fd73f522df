#include "bag_file.h"

#include <stdexcept>
#include <string>

namespace tabletop_perception::tools {

void readBag(const std::filesystem::path& file, const std::function<void(rosbag::Bag&)>& read) {
  rosbag::Bag bag;
  try {
    bag.open(file.string(), rosbag::bagmode::Read);
    read(bag);
  } catch (const rosbag::BagUnindexedException&) {
    throw std::invalid_argument(
        file.string() + ": the bag is cut short or was not closed; `rosbag reindex` may repair it");
  } catch (const ros::Exception& error) {
    throw std::invalid_argument(file.string() + ": the bag cannot be read: " + error.what());
  }
}

}  // namespace tabletop_perception::tools
