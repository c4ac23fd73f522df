#include "result_json.h"

#include <map>

namespace tabletop_perception::tools {
using nlohmann::ordered_json;

namespace {

ordered_json arrayOf(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

ordered_json poseJson(const Eigen::Isometry3d& pose, const Eigen::Vector3d& sensor) {
  Eigen::Quaterniond q(pose.linear());
  if (q.w() < 0) q.coeffs() *= -1;
  return {{"position", arrayOf(pose.translation() + sensor)},
          {"orientation", {q.x(), q.y(), q.z(), q.w()}}};
}

namespace {

ordered_json orNull(const std::string& reason) {
  return reason.empty() ? ordered_json() : ordered_json(reason);
}

ordered_json planeJson(const Table& table, const Eigen::Vector3d& sensor) {
  const Eigen::Vector3d normal = table.plane.head<3>();
  return {normal.x(), normal.y(), normal.z(), table.plane[3] - normal.dot(sensor)};
}

ordered_json tableJson(const Table& table, const Eigen::Vector3d& sensor) {
  auto hull = ordered_json::array();
  for (const auto& corner : hullInCamera(table)) hull.push_back(arrayOf(corner + sensor));
  return {{"plane", planeJson(table, sensor)},
          {"pose", poseJson(table.T_camera_table, sensor)},
          {"hull", hull},
          {"inliers", table.inliers.size()},
          {"rms", table.rms}};
}

/// Of a known object; null for others.
ordered_json uncertaintyJson(const SceneObject& object) {
  if (object.name == "unknown") return {{"covariance", nullptr}, {"free_directions", nullptr}};
  auto rows = ordered_json::array();
  for (int r = 0; r < 6; ++r) {
    const Eigen::Matrix<double, 6, 1> row = object.uncertainty.covariance.row(r);
    rows.push_back(std::vector<double>(row.data(), row.data() + 6));
  }
  return {{"covariance", rows}, {"free_directions", object.uncertainty.free_directions}};
}

ordered_json objectJson(int id, const SceneObject& object, bool named,
                        const Eigen::Vector3d& sensor) {
  ordered_json json = {{"id", id}, {"labels", object.labels}};
  if (named) {
    json["name"] = object.name;
    json["score"] = object.score;
  }
  json["pose"] = poseJson(object.T_camera_object, sensor);
  if (named) json.update(uncertaintyJson(object));
  json["fitness"] = object.fitness;
  json["visible"] = object.visible;
  json["points"] = object.points;
  json["box"] = {{"pose", poseJson(object.box.T_camera_box, sensor)},
                 {"size", arrayOf(object.box.size)}};
  if (named)
    json["evidence"] = object.name == "unknown" ? ordered_json() : evidenceJson(object.evidence);
  json["reason"] = orNull(object.reason);
  return json;
}

ordered_json graspJson(const PlacedGrasp& placed, const Eigen::Vector3d& sensor) {
  return {{"name", placed.grasp.name},
          {"pose", poseJson(placed.T_camera_gripper, sensor)},
          {"pregrasp", poseJson(placed.T_camera_pregrasp, sensor)},
          {"width", placed.grasp.width},
          {"preference", placed.grasp.preference},
          {"reason", orNull(placed.reason)}};
}

ordered_json timesJson(const std::map<std::string, double>& times_ms) {
  auto json = ordered_json::object();
  for (const auto& [stage, time] : times_ms)
    if (stage != "total") json[stage] = time;
  if (times_ms.count("total")) json["total"] = times_ms.at("total");
  return json;
}

ordered_json sceneJson(const Scene& scene, const Segmentation& segmentation,
                       const std::vector<SceneObject>& objects, bool named,
                       const std::map<std::string, double>& times_ms) {
  auto objects_json = ordered_json::array();
  for (const auto& object : objects)
    objects_json.push_back(
        objectJson(static_cast<int>(objects_json.size()) + 1, object, named, scene.sensor));
  auto others_json = ordered_json::array();
  for (const auto& table : segmentation.other_tables)
    others_json.push_back(tableJson(table, scene.sensor));
  return {
      {"scene", scene.name},
      {"frame_id", scene.frame_id},
      {"stamp", scene.stamp},
      {"table", segmentation.table ? tableJson(*segmentation.table, scene.sensor) : ordered_json()},
      {"other_tables", others_json},
      {"objects", objects_json},
      {"times_ms", timesJson(times_ms)},
      {"reason", orNull(segmentation.reason)}};
}

}  // namespace

ordered_json evidenceJson(const Evidence& evidence) {
  const Agreement& agreement = evidence.agreement;
  return {{"explained", agreement.explained},
          {"fitness", agreement.fitness},
          {"visible", agreement.visible},
          {"hidden", agreement.hidden},
          {"violation", agreement.violation},
          {"color", agreement.color ? ordered_json(*agreement.color) : ordered_json()},
          {"rms", evidence.rms},
          {"area", evidence.area},
          {"margin", evidence.margin},
          {"lift", evidence.lift},
          {"turn", evidence.turn}};
}

Evidence evidenceFrom(const nlohmann::json& json) {
  const auto number = [&](const char* key) { return json.at(key).get<double>(); };
  // Results of before there were colours lack them.
  std::optional<double> color;
  if (json.contains("color") && !json.at("color").is_null()) color = number("color");
  return {{number("explained"), number("fitness"), number("visible"), number("hidden"),
           number("violation"), color},
          number("rms"),
          number("area"),
          number("margin"),
          number("lift"),
          json.value("turn", 1.0)};
}

ordered_json recognitionJson(const Scene& scene, const Recognition& recognition) {
  return sceneJson(scene, recognition.segmentation, recognition.objects, true,
                   recognition.times_ms);
}

ordered_json segmentationJson(const Scene& scene, const Segmentation& segmentation) {
  return sceneJson(scene, segmentation, clusterObjects(segmentation), false, segmentation.times_ms);
}

ordered_json pickJson(const Scene& scene, const Found<Pick>& pick,
                      const std::optional<SceneObject>& object,
                      const std::vector<PlacedGrasp>& grasps) {
  ordered_json json = {{"scene", scene.name}, {"frame_id", scene.frame_id}, {"stamp", scene.stamp}};
  if (!pick) {
    for (const char* key : {"plane", "frame", "pregrasp", "grasps", "object"}) json[key] = nullptr;
    json["reason"] = pick.reason;
    return json;
  }
  SceneObject thing = object.value_or(SceneObject());
  if (thing.name == "unknown") {
    thing.labels = {2};
    thing.points = static_cast<int>(pick->thing().size());
    thing.box = pick->box;
    thing.T_camera_object = pick->surface.T_camera_pick;
    if (!object) thing.reason = "no database was given";
  }
  json["plane"] = planeJson(pick->table, scene.sensor);
  json["frame"] = poseJson(pick->surface.T_camera_pick, scene.sensor);
  json["extents"] = {pick->surface.extents.x(), pick->surface.extents.y()};
  json["pregrasp"] = {{"pose", poseJson(pick->pregrasp.T_camera_gripper, scene.sensor)},
                      {"width", pick->pregrasp.width}};
  json["grasps"] = ordered_json::array();
  for (const auto& placed : grasps) json["grasps"].push_back(graspJson(placed, scene.sensor));
  json.update(objectJson(1, thing, true, scene.sensor));
  json["times_ms"] = timesJson(pick->times_ms);
  return json;
}

std::string jsonLine(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::vector<SceneObject> clusterObjects(const Segmentation& segmentation) {
  std::vector<SceneObject> objects;
  for (const auto& cluster : segmentation.clusters) {
    const auto label = static_cast<std::uint32_t>(objects.size()) + 2;
    objects.push_back(unknownObject(segmentation.filtered, cluster, label, segmentation.table));
  }
  return objects;
}

}  // namespace tabletop_perception::tools
