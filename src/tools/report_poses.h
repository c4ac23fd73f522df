#pragma once

#include <filesystem>
#include <vector>

#include "evaluate_poses.h"
#include "report_page.h"

namespace tabletop_perception::tools {

/// An HTML page about results with poses: the figures, how far scores can be trusted, success by
/// visibility, and of every scene with a depth image a picture, NAME_poses.png beside the page.
class PoseReport {
 public:
  /// As ReportPage.
  explicit PoseReport(std::filesystem::path folder);

  /// Writes the page. Throws std::invalid_argument for a scene that cannot be read and
  /// std::runtime_error for a file that cannot be written.
  void write(const std::vector<PosedScene>& scenes, const TrueModels& models);

 private:
  ReportPage page_;
};

}  // namespace tabletop_perception::tools
