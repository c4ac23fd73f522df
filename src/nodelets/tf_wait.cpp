#include "tf_wait.h"

#include <thread>

#include <tf2_eigen/tf2_eigen.h>

namespace tabletop_perception {

Eigen::Isometry3d lookupTransformBy(std::chrono::steady_clock::time_point deadline,
                                    const tf2_ros::Buffer& tf, const std::string& target,
                                    const std::string& source, const ros::Time& stamp) {
  using namespace std::chrono_literals;
  while (!tf.tf2::BufferCore::canTransform(target, source, stamp) &&
         std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(5ms);
  return tf2::transformToEigen(tf.tf2::BufferCore::lookupTransform(target, source, stamp));
}

}  // namespace tabletop_perception
