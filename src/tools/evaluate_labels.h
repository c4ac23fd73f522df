#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tabletop_perception/label_metrics.h"
#include "tabletop_perception/pcd.h"

/// What the figures of labels and their report share.
namespace tabletop_perception::tools {

/// A scene of the truth, and how its result came out.
struct LabelledScene {
  std::string name;
  std::string category;
  std::filesystem::path truth;
  std::filesystem::path result;  ///< empty: there is none, which counts as nothing found
  LabelScore score;
};

/// Reads a .pcd; throws std::invalid_argument if it has no field `label`.
PcdContents readLabels(const std::filesystem::path& file);

/// The scenes of a folder of .pcd files, in the order of gt_summary.json, then by name. `option`:
/// the name that it was given under.
std::vector<LabelledScene> labelledScenes(const std::filesystem::path& truth,
                                          const std::string& option);

/// In the order of the scenes.
std::vector<std::string> categoriesOf(const std::vector<LabelledScene>& scenes);

/// Over the scenes of a category; of all with an empty name.
LabelSummary summaryOf(const std::vector<LabelledScene>& scenes, const std::string& category);

/// A table's head, and a row of it: a name and figures [%].
std::vector<std::string> figureHeads();
std::vector<std::string> figureRow(const std::string& name, const LabelSummary& summary);

}  // namespace tabletop_perception::tools
