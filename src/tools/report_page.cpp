#include "report_page.h"

#include <fstream>
#include <stdexcept>
#include <utility>

#include <opencv2/imgcodecs.hpp>

#include "evaluate.h"
#include "html.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

constexpr const char* PAGE = "index.html";
constexpr const char* STYLE =
    "body { font-family: sans-serif; margin: 1em; color: #222; }\n"
    "table { border-collapse: collapse; margin: 0.5em 0; }\n"
    "th, td { padding: 0.15em 0.6em; text-align: right; border-bottom: 1px solid #ddd; }\n"
    "th:first-child, td:first-child, .words td, .words th { text-align: left; }\n"
    "h2 { margin-top: 2em; border-top: 2px solid #888; padding-top: 0.3em; }\n"
    ".pictures { display: flex; flex-wrap: wrap; gap: 0.5em; }\n"
    "figure { margin: 0; flex: 1 1 300px; max-width: 640px; }\n"
    "img { width: 100%; height: auto; }\n"
    ".fault td { background: #fbe3e0; }\n"
    ".sample { display: inline-block; width: 1em; height: 1em; vertical-align: -0.1em; }\n";

}  // namespace

ReportPage::ReportPage(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (!fs::is_directory(folder_))
    throw std::invalid_argument("--report " + folder_.string() + " cannot be made a folder" +
                                (error ? ": " + error.message() : ""));
  if (!std::ofstream(folder_ / PAGE, std::ios::app))  // leaves what is there
    throw std::invalid_argument("--report: " + (folder_ / PAGE).string() + " cannot be written");
}

std::string ReportPage::picture(const std::string& name, const cv::Mat& picture,
                                const std::string& caption) {
  const std::string file = (folder_ / (name + ".png")).string();
  bool written = false;
  try {
    written = cv::imwrite(file, picture);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw std::runtime_error(file + ": cannot be written");
  return figure(name + ".png", caption);
}

void ReportPage::write(const std::string& title, const std::string& body) {
  std::ofstream page(folder_ / PAGE);
  page << htmlPage(title, STYLE, textElement("h1", title) + body);
  page.close();
  if (!page) throw std::runtime_error((folder_ / PAGE).string() + ": cannot be written");
}

std::string figureRow(const std::string& figures) {
  return element("div", figures, "class=\"pictures\"");
}

std::string sceneHeading(const std::string& scene, const std::string& remark) {
  return element("h2", escapeHtml(scene + remark), "id=\"" + escapeHtml(scene) + "\"");
}

std::string sceneLink(const std::string& scene) {
  return element("a", escapeHtml(scene), "href=\"#" + fileUrl(scene) + "\"");
}

std::string percentText(double share) { return formatted(share, 100, 1) + " %"; }

}  // namespace tabletop_perception::tools
