#include "symmetry_text.h"

#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Geometry>

namespace tabletop_perception::tools {
namespace {

constexpr double DEG = 180 / M_PI;
constexpr double AXIS_TOLERANCE = 0.01;  ///< an axis this near to x, y or z is called so

std::string axisWords(const Eigen::Vector3d& axis) {
  for (int i = 0; i < 3; ++i)
    if (std::abs(axis[i]) > 1 - AXIS_TOLERANCE) return std::string(1, "xyz"[i]);
  char words[64];
  std::snprintf(words, sizeof words, "(%.2f %.2f %.2f)", axis.x(), axis.y(), axis.z());
  return words;
}

std::string rotationWords(const std::vector<Eigen::Matrix3d>& rotations) {
  constexpr std::size_t MAX_SPELLED_OUT = 3;
  if (rotations.size() > MAX_SPELLED_OUT) return std::to_string(rotations.size()) + " rotations";
  std::string words;
  for (const auto& rotation : rotations) {
    const Eigen::AngleAxisd turn(rotation);
    if (!words.empty()) words += ", ";
    words +=
        std::to_string(std::lround(turn.angle() * DEG)) + " deg about " + axisWords(turn.axis());
  }
  return words;
}

}  // namespace

std::string symmetryWords(const Symmetry& symmetry) {
  std::string words;
  if (symmetry.continuous()) {
    words = "any turn about " + axisWords(symmetry.axis);
    if (!symmetry.rotations.empty()) words += ", either end up";
  } else {
    words = symmetry.rotations.empty() ? "none" : rotationWords(symmetry.rotations);
  }
  return symmetry.declared ? words + " (declared)" : words;
}

}  // namespace tabletop_perception::tools
