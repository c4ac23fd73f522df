#include "result_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "result_json.h"

namespace tabletop_perception::tools {

namespace {

constexpr double DEG_PER_RAD = 180 / M_PI;

void printTable(const Scene& scene, const Segmentation& segmentation,
                const std::optional<Eigen::Vector3d>& up) {
  std::printf("%s\n", scene.name.c_str());
  if (segmentation.table) {
    const auto& table = *segmentation.table;
    const Eigen::Vector3d normal = table.plane.head<3>();
    std::printf("  table: normal (%.3f, %.3f, %.3f), %.3f m from the sensor", normal.x(),
                normal.y(), normal.z(), std::abs(table.plane[3]));
    if (up)
      std::printf(", tilt %.1f deg from up",
                  std::acos(std::clamp(normal.dot(*up), -1.0, 1.0)) * DEG_PER_RAD);
    std::printf(", %zu points, rms %.1f mm\n", table.inliers.size(), table.rms * 1000);
  } else {
    std::printf("  no table\n");
  }
  if (!segmentation.reason.empty()) std::printf("  reason: %s\n", segmentation.reason.c_str());
}

void printTimes(const std::map<std::string, double>& times_ms) {
  std::printf("  times [ms]:");
  for (const auto& [stage, time] : times_ms)
    if (stage != "total") std::printf(" %s %.1f,", stage.c_str(), time);
  if (times_ms.count("total")) std::printf(" total %.1f", times_ms.at("total"));
  std::printf("\n");
}

/// Angles about the fixed axes x, then y, then z [deg].
Eigen::Vector3d rollPitchYawDeg(const Eigen::Matrix3d& r) {
  return DEG_PER_RAD * Eigen::Vector3d(std::atan2(r(2, 1), r(2, 2)),
                                       std::atan2(-r(2, 0), std::hypot(r(0, 0), r(1, 0))),
                                       std::atan2(r(1, 0), r(0, 0)));
}

void printVector(const Eigen::Vector3d& v, int digits) {
  std::printf("  %8.*f %8.*f %8.*f", digits, v.x(), digits, v.y(), digits, v.z());
}

}  // namespace

void printSegmentation(const Scene& scene, const Segmentation& segmentation,
                       const std::optional<Eigen::Vector3d>& up) {
  printTable(scene, segmentation, up);
  const auto objects = clusterObjects(segmentation);
  if (!objects.empty())
    std::printf("  id label  points  %-26s  %-26s\n", "box: centre x y z [m]", "sides [mm]");
  int id = 0;
  for (const auto& object : objects) {
    std::printf("  %2d %5u %7d", ++id, object.labels.front(), object.points);
    printVector(object.box.T_camera_box.translation() + scene.sensor, 3);
    printVector(object.box.size * 1000, 0);
    std::printf("\n");
  }
  printTimes(segmentation.times_ms);
}

void printRecognition(const Scene& scene, const Recognition& recognition,
                      const std::optional<Eigen::Vector3d>& up) {
  printTable(scene, recognition.segmentation, up);
  std::size_t width = 7;
  for (const auto& object : recognition.objects) width = std::max(width, object.name.size());
  const int column = static_cast<int>(width);
  if (!recognition.objects.empty())
    std::printf("  id  %-*s  score  points  %-26s  %-26s  seen  fitness\n", column, "name",
                "position x y z [m]", "roll pitch yaw [deg]");
  int id = 0;
  for (const auto& object : recognition.objects) {
    std::printf("  %2d  %-*s  %5.2f %7d", ++id, column, object.name.c_str(), object.score,
                object.points);
    printVector(object.T_camera_object.translation() + scene.sensor, 3);
    printVector(rollPitchYawDeg(object.T_camera_object.linear()), 1);
    if (object.name == "unknown")
      std::printf("  %s\n", object.reason.c_str());
    else
      std::printf("  %3.0f%%  %.1f mm\n", object.visible * 100, object.fitness * 1000);
  }
  printTimes(recognition.times_ms);
}

void printPick(const Scene& scene, const Found<Pick>& pick,
               const std::optional<SceneObject>& object, const std::vector<PlacedGrasp>& grasps) {
  std::printf("%s\n", scene.name.c_str());
  if (!pick) {
    std::printf("  reason: %s\n", pick.reason.c_str());
    return;
  }
  const auto printPose = [&](const char* name, const Eigen::Isometry3d& pose) {
    std::printf("  %-9s", name);
    printVector(pose.translation() + scene.sensor, 3);
    printVector(rollPitchYawDeg(pose.linear()), 1);
    std::printf("\n");
  };
  std::printf("  %-9s  %-26s  %-26s\n", "", "position x y z [m]", "roll pitch yaw [deg]");
  printPose("frame", pick->surface.T_camera_pick);
  printPose("pregrasp", pick->pregrasp.T_camera_gripper);
  const Eigen::Vector3d up = pick->table.plane.head<3>();
  std::printf("  against gravity (%.3f, %.3f, %.3f), %zu points, surface %.0f x %.0f mm\n", up.x(),
              up.y(), up.z(), pick->thing().size(), pick->surface.extents.x() * 1000,
              pick->surface.extents.y() * 1000);
  std::printf("  box %.0f x %.0f x %.0f mm, the gripper opens %.0f mm\n", pick->box.size.x() * 1000,
              pick->box.size.y() * 1000, pick->box.size.z() * 1000, pick->pregrasp.width * 1000);
  if (!object) return;
  if (object->name == "unknown") {
    std::printf("  unknown: %s\n", object->reason.c_str());
    return;
  }
  std::printf("  score %.2f, seen %.0f %%, fitness %.1f mm\n", object->score, object->visible * 100,
              object->fitness * 1000);
  printPose(object->name.c_str(), object->T_camera_object);
  for (const auto& placed : grasps) {
    printPose(placed.grasp.name.c_str(), placed.T_camera_gripper);
    std::printf("  %-9s %s\n", "",
                placed.reason.empty() ? "can be used" : ("left out: " + placed.reason).c_str());
  }
}

void printTimeTable(const std::map<std::string, double>& times_ms, std::FILE* to) {
  std::fprintf(to, "  %-9s %8s\n", "stage", "[ms]");
  for (const char* stage :
       {"decimate", "table", "window", "box", "cluster", "split", "color", "frame", "total"}) {
    const auto time = times_ms.find(stage);
    if (time != times_ms.end()) std::fprintf(to, "  %-9s %8.2f\n", stage, time->second);
  }
}

}  // namespace tabletop_perception::tools
