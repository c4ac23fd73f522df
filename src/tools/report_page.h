#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core.hpp>

namespace tabletop_perception::tools {

/// A folder with a page, index.html, and the pictures that it shows.
class ReportPage {
 public:
  /// Makes the folder where there is none; a page that is there stays until the new one is written.
  /// Throws std::invalid_argument if the folder or the page cannot be written.
  explicit ReportPage(std::filesystem::path folder);

  /// Writes NAME.png and gives back its figure as HTML. Throws std::runtime_error for a file that
  /// cannot be written.
  std::string picture(const std::string& name, const cv::Mat& picture, const std::string& caption);

  /// Writes the page; `body` is HTML. Throws like picture().
  void write(const std::string& title, const std::string& body);

 private:
  std::filesystem::path folder_;
};

/// Figures side by side.
std::string figureRow(const std::string& figures);

/// The heading of a scene, where the links of `sceneLink` lead.
std::string sceneHeading(const std::string& scene, const std::string& remark);
std::string sceneLink(const std::string& scene);

/// "97.6 %"
std::string percentText(double share);

}  // namespace tabletop_perception::tools
