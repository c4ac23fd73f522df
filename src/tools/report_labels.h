#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "evaluate_labels.h"
#include "report_page.h"

namespace tabletop_perception::tools {

/// An HTML page about results with labels: the figures, and pictures of every scene, NAME_kind.png
/// beside the page.
class LabelReport {
 public:
  /// As ReportPage.
  explicit LabelReport(std::filesystem::path folder);

  /// Writes the page. `without_truth`: results to be shown by themselves. Throws
  /// std::invalid_argument for a file that cannot be read and std::runtime_error for one that
  /// cannot be written.
  void write(const std::vector<LabelledScene>& scenes,
             const std::map<std::string, std::filesystem::path>& without_truth);

 private:
  ReportPage page_;
};

}  // namespace tabletop_perception::tools
