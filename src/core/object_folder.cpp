#include "tabletop_perception/object_folder.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "tabletop_perception/options_yaml.h"
#include "tabletop_perception/pcd.h"

namespace tabletop_perception {
namespace {

namespace fs = std::filesystem;

const char* const MODEL_FILE = "model.pcd";
const char* const YAML_FILE = "object.yaml";

std::string viewFile(std::size_t number) {
  char name[32];
  std::snprintf(name, sizeof name, "view_%04zu.pcd", number);
  return name;
}

// --- out

PcdContents pcdOf(const Surface& surface) {
  PcdContents contents;
  contents.cloud = Cloud(static_cast<int>(surface.size()), 1, false);
  for (std::size_t i = 0; i < surface.size(); ++i) contents.cloud.setPoint(i, surface.points[i]);
  contents.normals = surface.normals;
  return contents;
}

void writeModel(const fs::path& folder, const ObjectModel& model) {
  auto contents = pcdOf(model.surface);
  contents.cloud.rgb = model.colors;
  writePcd(folder / MODEL_FILE, contents);
}

void writeView(const fs::path& file, const View& view) {
  const Eigen::Isometry3d T_object_view = view.T_view_object.inverse();
  auto contents = pcdOf(transformed(view.surface, T_object_view));
  contents.T_data_sensor = T_object_view;
  writePcd(file, contents);
}

template <typename Matrix>
std::vector<double> rowByRow(const Matrix& matrix) {
  std::vector<double> values;
  for (int row = 0; row < matrix.rows(); ++row)
    for (int column = 0; column < matrix.cols(); ++column) values.push_back(matrix(row, column));
  return values;
}

void writeGrasp(YAML::Emitter& yaml, const StoredGrasp& grasp) {
  const Eigen::Quaterniond orientation(grasp.T_object_gripper.linear());
  yaml << YAML::BeginMap;
  yaml << YAML::Key << "name" << YAML::Value << YAML::DoubleQuoted << grasp.name;
  yaml << YAML::Key << "position" << YAML::Value
       << rowByRow(Eigen::Vector3d(grasp.T_object_gripper.translation()))
       << YAML::Comment("of the gripper in the object's frame [m]");
  yaml << YAML::Key << "orientation" << YAML::Value << rowByRow(orientation.coeffs())
       << YAML::Comment("quaternion x y z w");
  yaml << YAML::Key << "width" << YAML::Value << grasp.width << YAML::Comment("[m]");
  yaml << YAML::Key << "preference" << YAML::Value << grasp.preference << YAML::EndMap;
}

std::string yamlOf(const ObjectModel& model) {
  YAML::Emitter yaml;
  yaml.SetDoublePrecision(17);
  yaml.SetSeqFormat(YAML::Flow);
  yaml << YAML::BeginMap;
  yaml << YAML::Key << "name" << YAML::Value << YAML::DoubleQuoted << model.name;
  yaml << YAML::Key << "origin" << YAML::Value << YAML::DoubleQuoted << model.origin;
  yaml << YAML::Key << "diameter" << YAML::Value << model.diameter << YAML::Comment("[m]");
  yaml << YAML::Key << "colored" << YAML::Value << !model.colors.empty();
  yaml << YAML::Key << "views" << YAML::Value << model.views.size();
  yaml << YAML::Key << "symmetry" << YAML::Value << YAML::BeginMap;
  yaml << YAML::Key << "center" << YAML::Value << rowByRow(model.symmetry.center)
       << YAML::Comment("[m]");
  yaml << YAML::Key << "axis" << YAML::Value << rowByRow(model.symmetry.axis)
       << YAML::Comment("unit, or zeros");
  yaml << YAML::Key << "rotations" << YAML::Value << YAML::BeginSeq;
  for (const auto& rotation : model.symmetry.rotations) yaml << rowByRow(rotation);
  yaml << YAML::EndSeq;
  yaml << YAML::Key << "declared" << YAML::Value << model.symmetry.declared << YAML::EndMap;
  yaml << YAML::Key << "descriptor" << YAML::Value << YAML::BeginMap;
  auto options = model.options;
  options.visitFields([&](const std::string& name, const auto& field, const auto&...) {
    yaml << YAML::Key << name << YAML::Value << field;
  });
  yaml << YAML::EndMap;
  yaml << YAML::Key << "grasps" << YAML::Value << YAML::Block << YAML::BeginSeq;
  for (const auto& grasp : model.grasps) writeGrasp(yaml, grasp);
  yaml << YAML::EndSeq << YAML::EndMap;
  return yaml.c_str();
}

// --- in

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw std::invalid_argument(file.string() + ": " + what);
}

Surface surfaceOf(const fs::path& file, const PcdContents& contents) {
  if (contents.normals.empty())
    refuse(file, "has no normals (fields normal_x, normal_y, normal_z)");
  Surface surface;
  for (std::size_t i = 0; i < contents.cloud.size(); ++i)
    surface.points.push_back(contents.cloud.point(i));
  surface.normals = contents.normals;
  return surface;
}

View readView(const fs::path& file, const DescriptorOptions& options) {
  const auto contents = readPcd(file);
  View view;
  view.T_view_object = contents.T_data_sensor.inverse();
  view.surface = transformed(surfaceOf(file, contents), view.T_view_object);
  view.descriptors = describeSurface(view.surface, Eigen::Vector3f::Zero(), options);
  return view;
}

template <typename Value>
Value valueOf(const YAML::Node& yaml, const std::string& key) {
  if (!yaml[key]) throw std::invalid_argument("has no " + key);
  return yaml[key].as<Value>();
}

template <int ROWS, int COLUMNS>
Eigen::Matrix<double, ROWS, COLUMNS> matrixOf(const std::vector<double>& values) {
  if (values.size() != ROWS * COLUMNS)
    throw std::invalid_argument("has " + std::to_string(values.size()) + " values instead of " +
                                std::to_string(ROWS * COLUMNS));
  Eigen::Matrix<double, ROWS, COLUMNS> matrix;
  for (int i = 0; i < ROWS * COLUMNS; ++i) matrix(i / COLUMNS, i % COLUMNS) = values[i];
  return matrix;
}

Symmetry symmetryOf(const YAML::Node& yaml) {
  using Values = std::vector<double>;
  Symmetry symmetry;
  symmetry.center = matrixOf<3, 1>(valueOf<Values>(yaml, "center"));
  symmetry.axis = matrixOf<3, 1>(valueOf<Values>(yaml, "axis"));
  for (const auto& rotation : valueOf<std::vector<Values>>(yaml, "rotations"))
    symmetry.rotations.push_back(matrixOf<3, 3>(rotation));
  symmetry.declared = valueOf<bool>(yaml, "declared");
  return symmetry;
}

StoredGrasp graspOf(const YAML::Node& yaml) {
  using Values = std::vector<double>;
  checkYamlKeys("grasps", yaml, {"name", "position", "orientation", "width", "preference"});
  StoredGrasp grasp;
  grasp.name = valueOf<std::string>(yaml, "name");
  const Eigen::Vector4d orientation = matrixOf<4, 1>(valueOf<Values>(yaml, "orientation"));
  if (std::abs(orientation.norm() - 1) > 1e-3)
    throw std::invalid_argument("grasp '" + grasp.name +
                                "' has an orientation that is no unit quaternion");
  grasp.T_object_gripper.linear() = Eigen::Quaterniond(orientation.normalized()).toRotationMatrix();
  grasp.T_object_gripper.translation() = matrixOf<3, 1>(valueOf<Values>(yaml, "position"));
  grasp.width = valueOf<double>(yaml, "width");
  grasp.preference = valueOf<double>(yaml, "preference");
  return grasp;
}

/// What object.yaml tells: all but the points.
struct Description {
  ObjectModel model;
  bool colored = false;
  std::size_t views = 0;
};

Description parseDescription(const YAML::Node& yaml) {
  checkYamlKeys(
      "object", yaml,
      {"name", "origin", "diameter", "colored", "views", "symmetry", "descriptor", "grasps"});
  Description description;
  auto& model = description.model;
  model.name = valueOf<std::string>(yaml, "name");
  model.origin = valueOf<std::string>(yaml, "origin");
  model.diameter = valueOf<double>(yaml, "diameter");
  model.symmetry = symmetryOf(valueOf<YAML::Node>(yaml, "symmetry"));
  readYaml("descriptor", valueOf<YAML::Node>(yaml, "descriptor"), model.options);
  if (yaml["grasps"])  // older folders have none
    for (const auto& grasp : yaml["grasps"]) model.grasps.push_back(graspOf(grasp));
  description.colored = valueOf<bool>(yaml, "colored");
  description.views = valueOf<std::size_t>(yaml, "views");
  return description;
}

Description readDescription(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) refuse(file, "cannot be opened: every object's folder has one");
  try {
    const auto yaml = YAML::Load(stream);
    if (!yaml.IsMap()) throw std::invalid_argument("holds no keys and values");
    return parseDescription(yaml);
  } catch (const std::exception& error) {  // yaml-cpp's and ours
    refuse(file, error.what());
  }
}

}  // namespace

void exportObject(const fs::path& folder, const ObjectModel& model) {
  fs::create_directories(folder);
  if (!fs::is_empty(folder))
    throw std::runtime_error(folder.string() + ": is not empty, object '" + model.name +
                             "' is not written there");
  writeModel(folder, model);
  for (std::size_t i = 0; i < model.views.size(); ++i)
    writeView(folder / viewFile(i), model.views[i]);
  std::ofstream yaml(folder / YAML_FILE);
  yaml << yamlOf(model) << '\n';
  yaml.close();
  if (!yaml) throw std::runtime_error((folder / YAML_FILE).string() + ": cannot be written");
}

ObjectModel importObject(const fs::path& folder) {
  const auto description = readDescription(folder / YAML_FILE);
  auto model = description.model;
  const auto whole = readPcd(folder / MODEL_FILE);
  model.surface = surfaceOf(folder / MODEL_FILE, whole);
  if (description.colored) model.colors = whole.cloud.rgb;
  for (std::size_t i = 0; i < description.views; ++i)
    model.views.push_back(readView(folder / viewFile(i), model.options));
  try {
    checkModel(model);
  } catch (const std::invalid_argument& error) {
    refuse(folder, error.what());
  }
  return model;
}

}  // namespace tabletop_perception
