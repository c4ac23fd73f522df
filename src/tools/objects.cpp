#include <algorithm>
#include <cctype>
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
  std::vector<Row> rows = {
      {"name", "diameter [mm]", "size x y z [mm]", "views", "descriptors", "symmetry", "origin"}};
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

// --- changes

std::string namesIn(const ObjectDatabase& database) {
  std::string names;
  for (const auto& name : database.names()) names += (names.empty() ? "" : ", ") + name;
  return names.empty() ? "none" : names;
}

void remove(const ObjectsArguments& arguments) {
  ObjectDatabase(arguments.database, Mode::READ);  // refuses a missing file, which WRITE would make
  ObjectDatabase database(arguments.database, Mode::WRITE);
  if (!database.remove(arguments.remove))
    throw std::invalid_argument(arguments.database + " holds no object '" + arguments.remove +
                                "', its objects are: " + namesIn(database));
  std::fprintf(stderr, "removed %s from %s\n", arguments.remove.c_str(),
               arguments.database.c_str());
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
  if (!arguments.export_folder.empty()) return exportAll(arguments);
  if (!arguments.import_folder.empty()) return importAll(arguments);
  list(arguments);
}

std::string notEmpty(const std::string& argument) {
  return argument.empty() ? "must not be empty" : "";
}

}  // namespace

void addObjects(CLI::App& app) {
  auto* command = app.add_subcommand("objects", "list, remove, export and import known objects");
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
  action->require_option(0, 1);
  command->footer(
      "An imported object takes the place of one with the same name; its views are described "
      "anew.\n"
      "Exit code: 0 done, 2 bad usage or unreadable input.\n"
      "Example: tabletop objects --database objects.db --export objects");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace tabletop_perception::tools
