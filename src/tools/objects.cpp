#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include "commands.h"
#include "result_json.h"
#include "symmetry_text.h"
#include "tabletop_perception/database.h"
#include "tabletop_perception/object_folder.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

using nlohmann::ordered_json;
using Mode = ObjectDatabase::Mode;

struct ObjectsArguments {
  std::string database;
  bool json = false;
  std::string remove;         ///< name of the object to take out; empty: none
  std::string export_folder;  ///< empty: nothing is written
  std::string import_folder;  ///< empty: nothing is read
  bool grasps = false;
  std::vector<std::string> add_grasp, remove_grasp;  ///< an object's name and a grasp's, or none
  std::vector<double> position;                      ///< of the gripper in the object's frame [m]
  std::vector<double> orientation;                   ///< quaternion x y z w, or none
  std::vector<double> rpy_deg;                       ///< about the fixed axes x, y, z, or none
  double width = 0, preference = 0;
};

// --- what is said of an object

std::map<std::string, int> countDescriptors(const ObjectModel& model) {
  std::map<std::string, int> counts;
  for (const auto& view : model.views)
    for (const auto& descriptor : view.descriptors) ++counts[descriptor.kind];
  return counts;
}

/// Sides of the box about the surface along the axes of the object's frame [m].
Eigen::Vector3d sizeOf(const ObjectModel& model) {
  Eigen::AlignedBox3f box;
  for (const auto& p : model.surface.points) box.extend(p);
  return box.sizes().cast<double>();
}

std::string text(const char* format, double a, double b = 0, double c = 0) {
  char buffer[128];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

std::string descriptorWords(const ObjectModel& model) {
  std::string words;
  for (const auto& [kind, count] : countDescriptors(model))
    words += (words.empty() ? "" : ", ") + std::to_string(count) + " " + kind;
  return words.empty() ? "none" : words;
}

std::string oneLine(std::string words) {
  std::replace_if(
      words.begin(), words.end(), [](unsigned char c) { return std::iscntrl(c); }, ' ');
  return words;
}

// --- the listing

using Row = std::vector<std::string>;

Row rowOf(const ObjectModel& model) {
  const Eigen::Vector3d size = sizeOf(model) * 1000;
  return {model.name,
          text("%.0f", model.diameter * 1000),
          text("%.0f x %.0f x %.0f", size.x(), size.y(), size.z()),
          std::to_string(model.views.size()),
          std::to_string(model.grasps.size()),
          descriptorWords(model),
          symmetryWords(model.symmetry),
          oneLine(model.origin)};
}

void printRows(const std::vector<Row>& rows) {
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i];
      if (i + 1 < row.size()) line += std::string(widths[i] - row[i].size() + 2, ' ');
    }
    std::printf("%s\n", line.c_str());
  }
}

void printTable(const std::vector<ObjectModel>& models) {
  std::vector<Row> rows = {{"name", "diameter [mm]", "size x y z [mm]", "views", "grasps",
                            "descriptors", "symmetry", "origin"}};
  for (const auto& model : models) rows.push_back(rowOf(model));
  printRows(rows);
}

template <typename Vector>
std::vector<double> listOf(const Vector& values) {
  return {values.data(), values.data() + values.size()};
}

ordered_json symmetryJson(const Symmetry& symmetry) {
  ordered_json json;
  json["center"] = listOf(symmetry.center);
  if (symmetry.continuous())
    json["axis"] = listOf(symmetry.axis);
  else
    json["axis"] = nullptr;
  json["rotations"] = ordered_json::array();
  for (const auto& rotation : symmetry.rotations) {
    const Eigen::Matrix3d columns = rotation.transpose();  // Eigen's columns are JSON's rows
    json["rotations"].push_back(
        {listOf(columns.col(0)), listOf(columns.col(1)), listOf(columns.col(2))});
  }
  json["declared"] = symmetry.declared;
  return json;
}

ordered_json graspJson(const StoredGrasp& grasp) {
  return {{"name", grasp.name},
          {"pose", poseJson(grasp.T_object_gripper, Eigen::Vector3d::Zero())},
          {"width", grasp.width},
          {"preference", grasp.preference}};
}

ordered_json objectJson(const ObjectModel& model) {
  ordered_json json;
  json["name"] = model.name;
  json["origin"] = model.origin;
  json["diameter"] = model.diameter;
  json["size"] = listOf(sizeOf(model));
  json["points"] = model.surface.size();
  json["views"] = model.views.size();
  json["descriptors"] = countDescriptors(model);
  json["symmetry"] = symmetryJson(model.symmetry);
  json["grasps"] = ordered_json::array();
  for (const auto& grasp : model.grasps) json["grasps"].push_back(graspJson(grasp));
  auto options = model.options;
  options.visitFields([&](const std::string& name, const auto& field, const auto&...) {
    json["options"][name] = field;
  });
  return json;
}

void list(const ObjectsArguments& arguments) {
  const auto models = ObjectDatabase(arguments.database, Mode::READ).loadAll();
  if (arguments.json) {
    for (const auto& model : models) std::fputs(jsonLine(objectJson(model)).c_str(), stdout);
  } else if (models.empty()) {
    std::fprintf(stderr, "%s holds no objects\n", arguments.database.c_str());
  } else {
    printTable(models);
  }
}

void listGrasps(const ObjectsArguments& arguments) {
  std::vector<Row> rows = {{"object", "grasp", "position x y z [mm]", "orientation x y z w",
                            "width [mm]", "preference"}};
  for (const auto& model : ObjectDatabase(arguments.database, Mode::READ).loadAll())
    for (const auto& grasp : model.grasps) {
      const Eigen::Vector3d p = grasp.T_object_gripper.translation() * 1000;
      const Eigen::Quaterniond q(grasp.T_object_gripper.linear());
      rows.push_back({model.name, grasp.name, text("%.0f %.0f %.0f", p.x(), p.y(), p.z()),
                      text("%.3f %.3f %.3f", q.x(), q.y(), q.z()) + text(" %.3f", q.w()),
                      text("%.0f", grasp.width * 1000), text("%g", grasp.preference)});
    }
  if (rows.size() == 1)
    std::fprintf(stderr, "%s holds no grasps\n", arguments.database.c_str());
  else
    printRows(rows);
}

// --- changes

std::string namesIn(const ObjectDatabase& database) {
  std::string names;
  for (const auto& name : database.names()) names += (names.empty() ? "" : ", ") + name;
  return names.empty() ? "none" : names;
}

/// Opens a database that is there: WRITE alone would make one.
ObjectDatabase existing(const std::string& file) {
  ObjectDatabase(file, Mode::READ);
  return {file, Mode::WRITE};
}

void remove(const ObjectsArguments& arguments) {
  auto database = existing(arguments.database);
  if (!database.remove(arguments.remove))
    throw std::invalid_argument(arguments.database + " holds no object '" + arguments.remove +
                                "', its objects are: " + namesIn(database));
  std::fprintf(stderr, "removed %s from %s\n", arguments.remove.c_str(),
               arguments.database.c_str());
}

/// The grasp that the arguments describe.
StoredGrasp statedGrasp(const ObjectsArguments& arguments) {
  StoredGrasp grasp;
  grasp.name = arguments.add_grasp[1];
  grasp.width = arguments.width;
  grasp.preference = arguments.preference;
  const auto& p = arguments.position;
  grasp.T_object_gripper.translation() << p[0], p[1], p[2];
  if (const auto& q = arguments.orientation; !q.empty()) {
    const Eigen::Quaterniond orientation(q[3], q[0], q[1], q[2]);
    if (!(std::abs(orientation.norm() - 1) <= 1e-3))
      throw std::invalid_argument("--orientation must be a unit quaternion x y z w, its norm is " +
                                  text("%g", orientation.norm()));
    grasp.T_object_gripper.linear() = orientation.normalized().toRotationMatrix();
  }
  if (const auto& a = arguments.rpy_deg; !a.empty())
    grasp.T_object_gripper.linear() =
        (Eigen::AngleAxisd(a[2] * M_PI / 180, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(a[1] * M_PI / 180, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(a[0] * M_PI / 180, Eigen::Vector3d::UnitX()))
            .toRotationMatrix();
  return grasp;
}

void addGrasp(const ObjectsArguments& arguments) {
  const auto grasp = statedGrasp(arguments);
  existing(arguments.database).storeGrasp(arguments.add_grasp[0], grasp);
  std::fprintf(stderr, "added grasp %s to %s\n", grasp.name.c_str(),
               arguments.add_grasp[0].c_str());
}

void removeGrasp(const ObjectsArguments& arguments) {
  const auto& object = arguments.remove_grasp[0];
  const auto& grasp = arguments.remove_grasp[1];
  if (!existing(arguments.database).removeGrasp(object, grasp))
    throw std::invalid_argument("'" + object + "' has no grasp '" + grasp + "'");
  std::fprintf(stderr, "removed grasp %s from %s\n", grasp.c_str(), object.c_str());
}

void exportAll(const ObjectsArguments& arguments) {
  const auto models = ObjectDatabase(arguments.database, Mode::READ).loadAll();
  for (const auto& model : models) {
    exportObject(fs::path(arguments.export_folder) / model.name, model);
    std::fprintf(stderr, "wrote %s: %zu views\n",
                 (fs::path(arguments.export_folder) / model.name).c_str(), model.views.size());
  }
}

/// The folders in a folder, sorted, without hidden ones.
std::vector<fs::path> foldersIn(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw std::invalid_argument(folder.string() + " is not a folder");
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_directory() && entry.path().filename().string()[0] != '.')
      folders.push_back(entry.path());
  if (folders.empty())
    throw std::invalid_argument(
        folder.string() + " holds no folders: there must be one per object, with object.yaml");
  std::sort(folders.begin(), folders.end());
  return folders;
}

void importAll(const ObjectsArguments& arguments) {
  std::vector<ObjectModel> models;
  std::map<std::string, fs::path> sources;
  for (const auto& folder : foldersIn(arguments.import_folder)) {
    models.push_back(importObject(folder));
    const auto& model = models.back();
    const auto [source, first] = sources.emplace(model.name, folder);
    if (!first)
      throw std::invalid_argument(folder.string() + " and " + source->second.string() +
                                  " hold an object of the same name, '" + model.name + "'");
    std::fprintf(stderr, "read %s: %s, %zu views\n", folder.c_str(), model.name.c_str(),
                 model.views.size());
  }
  ObjectDatabase(arguments.database, Mode::WRITE).store(models);
}

void run(const ObjectsArguments& arguments) {
  if (!arguments.remove.empty()) return remove(arguments);
  if (arguments.grasps) return listGrasps(arguments);
  if (!arguments.add_grasp.empty()) return addGrasp(arguments);
  if (!arguments.remove_grasp.empty()) return removeGrasp(arguments);
  if (!arguments.export_folder.empty()) return exportAll(arguments);
  if (!arguments.import_folder.empty()) return importAll(arguments);
  list(arguments);
}

std::string notEmpty(const std::string& argument) {
  return argument.empty() ? "must not be empty" : "";
}

void addGraspOptions(CLI::App& command, CLI::Option& add, ObjectsArguments& arguments) {
  auto* position = command.add_option("--position", arguments.position,
                                      "of the gripper in the object's frame [m]");
  position->type_size(3)->expected(1)->type_name("X Y Z")->needs(&add);
  auto* orientation = command.add_option("--orientation", arguments.orientation,
                                         "of the gripper in the object's frame, a quaternion");
  orientation->type_size(4)->expected(1)->type_name("X Y Z W")->needs(&add);
  command
      .add_option("--rpy-deg", arguments.rpy_deg,
                  "the same by roll, pitch and yaw about fixed axes [deg]")
      ->type_size(3)
      ->expected(1)
      ->type_name("R P Y")
      ->needs(&add)
      ->excludes(orientation);
  auto* width = command.add_option("--width", arguments.width, "of the open gripper [m]");
  width->type_name("M")->needs(&add);
  command
      .add_option("--preference", arguments.preference,
                  "the grasp with the largest is tried first (default: 0)")
      ->type_name("P")
      ->needs(&add);
  add.needs(position)->needs(width);
}

}  // namespace

void addObjects(CLI::App& app) {
  auto* command = app.add_subcommand(
      "objects", "list, remove, export and import known objects, and ways to grasp them");
  const auto arguments = std::make_shared<ObjectsArguments>();
  command->add_option("--database", arguments->database, "the file of known objects")
      ->required()
      ->check(notEmpty)
      ->type_name("DB");
  auto* action = command->add_option_group("action", "one of these; without any, a table");
  action->add_flag("--json", arguments->json, "list the objects as JSON, one per line");
  action->add_option("--remove", arguments->remove, "take an object out")
      ->check(notEmpty)
      ->type_name("NAME");
  action
      ->add_option("--export", arguments->export_folder,
                   "write a folder per object: object.yaml, model.pcd, view_0000.pcd and on")
      ->check(notEmpty)
      ->type_name("DIR");
  action
      ->add_option("--import", arguments->import_folder,
                   "add the objects of such folders, all of them or none")
      ->check(notEmpty)
      ->type_name("DIR");
  action->add_flag("--grasps", arguments->grasps, "list the stored grasps");
  auto* add = action->add_option("--add-grasp", arguments->add_grasp,
                                 "store a grasp, in the place of one of that name");
  add->type_size(2)->expected(1)->check(notEmpty)->type_name("OBJECT GRASP");
  action->add_option("--remove-grasp", arguments->remove_grasp, "take a grasp from an object")
      ->type_size(2)
      ->expected(1)
      ->check(notEmpty)
      ->type_name("OBJECT GRASP");
  action->require_option(0, 1);
  addGraspOptions(*command, *add, *arguments);
  command->footer(
      "An imported object takes the place of one with the same name; its views are described "
      "anew. A gripper's frame: z the direction in which it comes, y that in which it opens, the\n"
      "origin between the fingertips.\n"
      "Exit code: 0 done, 2 bad usage or unreadable input.\n"
      "Example: tabletop objects --database objects.db --export objects");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace tabletop_perception::tools
