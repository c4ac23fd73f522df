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

/// Compares results as `recognize --output` writes them with folders that have a gt.json.
/// `unknown`: names of the truth that were not taught. `report`: as above.
void evaluatePoses(const std::filesystem::path& truth, const std::filesystem::path& models,
                   const std::filesystem::path& results, const std::vector<std::string>& unknown,
                   bool json, const std::filesystem::path& report);

/// Picks every object of labelled scenes at five pixels and prints how many picks took it and how
/// many frames lie right. `truth`: a folder of .pcd files with labels, or of folders with label.png
/// and gt.json.
void evaluatePicks(const std::filesystem::path& truth, const PipelineOptions& options, bool json);

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
