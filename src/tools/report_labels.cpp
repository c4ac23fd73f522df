#include "report_labels.h"

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include <opencv2/imgcodecs.hpp>

#include "evaluate.h"
#include "html.h"
#include "label_pictures.h"

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

/// Writes a scene's pictures, and tells the page of them.
class Pictures {
 public:
  Pictures(fs::path folder, std::string scene)
      : folder_(std::move(folder)), scene_(std::move(scene)) {}

  void add(const std::string& kind, const cv::Mat& picture, const std::string& caption) {
    const std::string name = scene_ + "_" + kind + ".png";
    const std::string file = (folder_ / name).string();
    bool written = false;
    try {
      written = cv::imwrite(file, picture);
    } catch (const cv::Exception&) {
      written = false;
    }
    if (!written) throw std::runtime_error(file + ": cannot be written");
    figures_ += figure(name, caption);
  }

  std::string html() const { return element("div", figures_, "class=\"pictures\""); }

 private:
  fs::path folder_;
  std::string scene_, figures_;
};

std::string percent(double share) { return formatted(share, 100, 1) + " %"; }

std::string heading(const std::string& name, const std::string& remark) {
  return element("h2", escapeHtml(name + remark), "id=\"" + escapeHtml(name) + "\"");
}

std::string sample(const cv::Vec3b& color, const std::string& meaning) {
  char style[64];
  std::snprintf(style, sizeof style, "class=\"sample\" style=\"background: #%02x%02x%02x\"",
                color[2], color[1], color[0]);
  return element("span", "", style) + escapeHtml(meaning);
}

std::string legend() {
  return element("p",
                 "Truth and result: an object and its segment share a colour; what has no "
                 "counterpart is striped. " +
                     sample(tableColor(), "table.")) +
         element("p", "Faults: " + sample(FaultColor::missed(), "of an object, in no segment; ") +
                          sample(FaultColor::otherSegment(),
                                 "of an object, in another segment than its own; ") +
                          sample(FaultColor::noObject(), "in a segment, of no object; ") +
                          sample(FaultColor::tableMissed(), "of the table, without a label."));
}

std::string figureTable(const std::vector<std::vector<std::string>>& rows) {
  std::string html = tableRow(figureHeads(), "th");
  for (const auto& row : rows) html += tableRow(row);
  return element("table", html);
}

std::string summaryTable(const std::vector<LabelledScene>& scenes) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& category : categoriesOf(scenes)) {
    const auto summary = summaryOf(scenes, category);
    rows.push_back(figureRow(category + " (" + std::to_string(summary.scenes) + ")", summary));
  }
  rows.push_back(
      figureRow("all " + std::to_string(scenes.size()) + " scenes", summaryOf(scenes, "")));
  return figureTable(rows);
}

/// As figureTable, with each scene's name leading to its pictures.
std::string sceneTable(const std::vector<LabelledScene>& scenes) {
  std::string html = tableRow(figureHeads(), "th");
  for (const auto& scene : scenes) {
    auto row = figureRow(scene.name, summarize({scene.score}));
    const auto link =
        element("a", escapeHtml(row.front()), "href=\"#" + fileUrl(scene.name) + "\"");
    std::string cells = element("td", link);
    for (std::size_t i = 1; i < row.size(); ++i) cells += textElement("td", row[i]);
    html += element("tr", cells);
  }
  return element("table", html);
}

std::string objectTable(const LabelledScene& scene, const LabelFindings& findings) {
  std::string html = tableRow({"object", "read as", "points", "segment", "its points", "shared",
                               "IoU", "verdict", "missing and foreign points"},
                              "th");
  for (std::size_t i = 0; i < findings.objects.size(); ++i) {
    const auto& object = scene.score.best.objects[i];
    const auto& finding = findings.objects[i];
    const auto cells =
        tableRow({finding.name, object.part == 0 ? "whole" : "part", std::to_string(object.points),
                  object.segment == 0 ? "-" : std::to_string(object.segment),
                  std::to_string(object.segment_points), std::to_string(object.overlap),
                  percent(object.iou()), finding.verdict, finding.details});
    html += object.iou() < FOUND_IOU ? element("tbody", cells, "class=\"fault\"")
                                     : element("tbody", cells);
  }
  return element("table", html, "class=\"words\"");
}

std::string strayTable(const LabelFindings& findings) {
  if (findings.strays.empty()) return "";
  std::string html = tableRow({"segment without an object", "points", "holds"}, "th");
  for (const auto& stray : findings.strays)
    html += tableRow({std::to_string(stray.label), std::to_string(stray.points), stray.details});
  return element("table", html, "class=\"words\"");
}

/// One line about how a scene came out.
std::string outcomeOf(const LabelledScene& scene) {
  const auto& score = scene.score;
  const auto summary = summarize({score});
  return "F " + percent(score.best.f()) + " (all whole " + percent(score.whole.f()) +
         ", all in parts " + percent(score.parts.f()) + "), precision " +
         percent(score.best.precision()) + ", recall " + percent(score.best.recall()) + ", " +
         std::to_string(summary.best.found) + " of " + std::to_string(summary.best.objects) +
         " found, table IoU " + percent(score.table_iou) + ".";
}

std::string sceneSection(const LabelledScene& scene, const fs::path& folder) {
  const auto truth = readLabels(scene.truth);
  const Labels result =
      scene.result.empty() ? Labels(truth.labels.size(), 0) : readLabels(scene.result).labels;
  const auto findings = findObjects(truth.labels, result, scene.score);
  const auto canvas = sceneCanvas(truth);
  Pictures pictures(folder, scene.name);
  pictures.add("scene", naturalPicture(canvas), "Scene");
  pictures.add("truth", truthPicture(canvas, truth.labels, findings), "Truth, by object");
  pictures.add("result", resultPicture(canvas, result, findings), "Result, by segment");
  pictures.add("faults", faultPicture(canvas, truth.labels, result, findings), "Faults");
  const std::string remark = scene.result.empty() ? " (no result)" : "";
  return heading(scene.name, " - " + scene.category + remark) + textElement("p", outcomeOf(scene)) +
         pictures.html() + objectTable(scene, findings) + strayTable(findings);
}

std::string sectionWithoutTruth(const std::string& name, const fs::path& file,
                                const fs::path& folder) {
  const auto result = readLabels(file);
  std::map<std::uint32_t, std::size_t> points;
  for (const auto label : result.labels) ++points[label];
  const auto canvas = sceneCanvas(result);
  Pictures pictures(folder, name);
  pictures.add("scene", naturalPicture(canvas), "Scene");
  pictures.add("result", segmentPicture(canvas, result.labels), "Result, by segment");

  const std::size_t table = points[1];
  std::string html = tableRow({"segment", "points"}, "th");
  for (const auto& [label, count] : points)
    if (label >= 2) html += tableRow({std::to_string(label), std::to_string(count)});
  return heading(name, "") +
         textElement("p", table == 0 ? "No table." : std::to_string(table) + " points of tables.") +
         pictures.html() + element("table", html);
}

}  // namespace

LabelReport::LabelReport(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (!fs::is_directory(folder_))
    throw std::invalid_argument("--report " + folder_.string() + " cannot be made a folder" +
                                (error ? ": " + error.message() : ""));
  page_.open(folder_ / PAGE);
  if (!page_)
    throw std::invalid_argument("--report: " + (folder_ / PAGE).string() + " cannot be written");
}

void LabelReport::write(const std::vector<LabelledScene>& scenes,
                        const std::map<std::string, fs::path>& without_truth) {
  std::string body = textElement("h1", "Segmentation compared with the truth") +
                     summaryTable(scenes) + sceneTable(scenes) + legend();
  for (const auto& scene : scenes) body += sceneSection(scene, folder_);
  if (!without_truth.empty()) body += textElement("h1", "Without truth");
  for (const auto& [name, file] : without_truth) body += sectionWithoutTruth(name, file, folder_);
  page_ << htmlPage("Segmentation compared with the truth", STYLE, body);
  page_.close();
  if (!page_) throw std::runtime_error((folder_ / PAGE).string() + ": cannot be written");
}

}  // namespace tabletop_perception::tools
