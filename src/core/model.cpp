#include "tabletop_perception/model.h"

#include <cctype>
#include <cmath>
#include <set>
#include <stdexcept>

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_NAME_LENGTH = 100;
constexpr double MIN_WIDTH = 0.001, MAX_WIDTH = 1;  ///< of a gripper [m]
constexpr float UNIT_TOLERANCE = 0.01f;             ///< normals went through files of few digits

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument(what); }

bool finite(const std::vector<Eigen::Vector3f>& points) {
  for (const auto& p : points)
    if (!p.allFinite()) return false;
  return true;
}

bool unit(const std::vector<Eigen::Vector3f>& normals) {
  for (const auto& n : normals)  // false for NaN
    if (!(std::abs(n.norm() - 1) <= UNIT_TOLERANCE)) return false;
  return true;
}

void checkSurface(const std::string& what, const Surface& surface) {
  if (surface.empty()) refuse(what + " has no points");
  if (surface.normals.size() != surface.points.size())
    refuse(what + " has " + std::to_string(surface.normals.size()) + " normals for " +
           std::to_string(surface.points.size()) + " points");
  if (!finite(surface.points)) refuse(what + " has points that are not finite");
  if (!unit(surface.normals)) refuse(what + " has normals that are not of unit length");
}

void checkSymmetry(const std::string& what, const Symmetry& symmetry) {
  bool finite = symmetry.center.allFinite() && symmetry.axis.allFinite();
  for (const auto& rotation : symmetry.rotations) finite = finite && rotation.allFinite();
  if (!finite) refuse(what + " has a symmetry that is not finite");
}

void checkDescriptor(const std::string& what, const Descriptor& descriptor) {
  if (descriptor.kind.empty() || descriptor.values.empty())
    refuse(what + " has an empty descriptor");
  bool finite = descriptor.centroid.allFinite();
  for (const float value : descriptor.values) finite = finite && std::isfinite(value);
  if (!finite) refuse(what + " has a descriptor that is not finite");
}

void checkView(const std::string& what, const View& view) {
  checkSurface(what, view.surface);
  if (!view.T_view_object.matrix().allFinite()) refuse(what + " has a pose that is not finite");
  for (const auto& descriptor : view.descriptors) checkDescriptor(what, descriptor);
}

}  // namespace

namespace {

/// What may name an object or a grasp.
void checkName(const std::string& name, const std::string& of_what) {
  const auto allowed = [](unsigned char c) {
    return c < 128 && (std::isalnum(c) || c == '_' || c == '-');
  };
  bool good = !name.empty() && name.size() <= MAX_NAME_LENGTH && name != "unknown";
  for (const char c : name) good = good && allowed(static_cast<unsigned char>(c));
  if (good) return;
  refuse("'" + name + "' cannot name " + of_what + ": 1 to " + std::to_string(MAX_NAME_LENGTH) +
         " letters, digits, '_' and '-', and not \"unknown\"");
}

}  // namespace

void checkObjectName(const std::string& name) { checkName(name, "an object"); }

void checkGrasp(const StoredGrasp& grasp) {
  checkName(grasp.name, "a grasp");
  const std::string what = "grasp '" + grasp.name + "'";
  const Eigen::Matrix3d rotation = grasp.T_object_gripper.linear();
  if (!grasp.T_object_gripper.matrix().allFinite()) refuse(what + " has a pose that is not finite");
  if (!(rotation * rotation.transpose()).isIdentity(1e-6) || rotation.determinant() < 0)
    refuse(what + " has a pose that is no rotation and translation");
  if (!(grasp.width >= MIN_WIDTH && grasp.width <= MAX_WIDTH))  // not so for NaN
    refuse(what + " has the width " + std::to_string(grasp.width) + " m, must be 0.001 to 1");
  if (!std::isfinite(grasp.preference)) refuse(what + " has a preference that is not finite");
}

namespace {

void checkGrasps(const std::string& what, const std::vector<StoredGrasp>& grasps) {
  std::set<std::string> names;
  for (const auto& grasp : grasps) {
    checkGrasp(grasp);
    if (!names.insert(grasp.name).second) refuse(what + " has two grasps '" + grasp.name + "'");
  }
}

}  // namespace

void checkModel(const ObjectModel& model) {
  checkObjectName(model.name);
  const std::string what = "object '" + model.name + "'";
  checkSurface(what, model.surface);
  if (!model.colors.empty() && model.colors.size() != model.surface.size())
    refuse(what + " has " + std::to_string(model.colors.size()) + " colours for " +
           std::to_string(model.surface.size()) + " points");
  if (!std::isfinite(model.diameter) || model.diameter <= 0)
    refuse(what + " has the diameter " + std::to_string(model.diameter) + ", must be positive");
  checkSymmetry(what, model.symmetry);
  checkOptions("descriptor", model.options);
  if (model.views.empty()) refuse(what + " has no view");
  for (std::size_t i = 0; i < model.views.size(); ++i)
    checkView(what + ", view " + std::to_string(i) + ",", model.views[i]);
  checkGrasps(what, model.grasps);
}

}  // namespace tabletop_perception
