#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "tabletop_perception/pipeline.h"

/// The parts of `tabletop evaluate`, and what they share. All throw std::invalid_argument for
/// input that is missing or not as it should be.
namespace tabletop_perception::tools {

/// Compares results as `segment --output` writes them with PCDs that have a truth in `label`.
/// `report`: the folder of an HTML page with pictures; empty: none.
void evaluateLabels(const std::filesystem::path& truth, const std::filesystem::path& results,
                    bool json, const std::filesystem::path& report);

struct PoseEvaluation {
  std::filesystem::path truth;        ///< of folders that have a gt.json
  std::filesystem::path models;       ///< the objects' meshes
  std::filesystem::path results;      ///< as `recognize --output` writes them
  std::vector<std::string> unknown;   ///< names of the truth that were not taught
  std::vector<std::string> by_add_s;  ///< SCENE/OBJECT, which ADD-S is to judge instead of MSSD
  double min_visible = 0;  ///< objects of which less is visible need not be found, but may be
  bool json = false;
  bool fit = false;              ///< print what the terms of the score should weigh instead
  std::filesystem::path report;  ///< as above
};

/// Compares results with the truth in poses.
void evaluatePoses(const PoseEvaluation& evaluation);

struct PickEvaluation {
  /// Of .pcd files with labels, or of folders with gt.json and label.png.
  std::filesystem::path truth;
  std::filesystem::path models;  ///< the objects' meshes, to render what has no label.png; or empty
  std::string database;          ///< file of known objects that picks are recognised with; or empty
  PipelineOptions options;
  bool json = false;
};

/// Picks every object of labelled scenes at five pixels and prints how many picks took it and how
/// many frames lie right; with a database also how many are recognised at their innermost pixel.
void evaluatePicks(const PickEvaluation& evaluation);

/// Prints how poses of things that stand still move over frames. `results`: a folder of
/// SCENE_FRAME.json as `recognize --output` writes them. `database`: of the objects, whose
/// symmetries the tracker then knows; or empty.
void evaluateJitter(const std::filesystem::path& results, const std::string& database, bool json);

/// Throws unless it is a folder. `option`: the name that it was given under.
void checkFolder(const std::filesystem::path& folder, const std::string& option);

/// Reads a file and hands its content to `visit`; a file that is no JSON, or in which `visit` finds
/// something missing or of another type, throws with the file's name.
void visitJson(const std::filesystem::path& file,
               const std::function<void(const nlohmann::json& content)>& visit);

/// The result of each scene, results/NAME + `extension`; a scene without one is named on stderr.
/// So are results without a truth. Throws if no scene has a result.
std::map<std::string, std::filesystem::path> findResults(const std::filesystem::path& results,
                                                         const std::vector<std::string>& scenes,
                                                         const std::string& extension);

/// Prints rows of as many cells each as columns on stdout; the first column to the left, the others
/// to the right. A row without cells is an empty line.
void printColumns(const std::vector<std::vector<std::string>>& rows);

/// A value with so many digits behind the point, times `scale`; "-" for none.
std::string formatted(std::optional<double> value, double scale, int digits);

/// A value, null for none.
nlohmann::ordered_json orNull(std::optional<double> value);

}  // namespace tabletop_perception::tools
