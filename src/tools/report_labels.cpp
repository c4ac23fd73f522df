#include "report_labels.h"

#include <cstdio>
#include <utility>

#include "evaluate.h"
#include "html.h"
#include "label_pictures.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

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
    std::string cells = element("td", sceneLink(scene.name));
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
                  percentText(object.iou()), finding.verdict, finding.details});
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
  return "F " + percentText(score.best.f()) + " (all whole " + percentText(score.whole.f()) +
         ", all in parts " + percentText(score.parts.f()) + "), precision " +
         percentText(score.best.precision()) + ", recall " + percentText(score.best.recall()) +
         ", " + std::to_string(summary.best.found) + " of " + std::to_string(summary.best.objects) +
         " found, table IoU " + percentText(score.table_iou) + ".";
}

std::string sceneSection(const LabelledScene& scene, ReportPage& page) {
  const auto truth = readLabels(scene.truth);
  const Labels result =
      scene.result.empty() ? Labels(truth.labels.size(), 0) : readLabels(scene.result).labels;
  const auto findings = findObjects(truth.labels, result, scene.score);
  const auto canvas = sceneCanvas(truth);
  const std::string figures =
      page.picture(scene.name + "_scene", naturalPicture(canvas), "Scene") +
      page.picture(scene.name + "_truth", truthPicture(canvas, truth.labels, findings),
                   "Truth, by object") +
      page.picture(scene.name + "_result", resultPicture(canvas, result, findings),
                   "Result, by segment") +
      page.picture(scene.name + "_faults", faultPicture(canvas, truth.labels, result, findings),
                   "Faults");
  const std::string remark = scene.result.empty() ? " (no result)" : "";
  return sceneHeading(scene.name, " - " + scene.category + remark) +
         textElement("p", outcomeOf(scene)) + figureRow(figures) + objectTable(scene, findings) +
         strayTable(findings);
}

std::string sectionWithoutTruth(const std::string& name, const fs::path& file, ReportPage& page) {
  const auto result = readLabels(file);
  std::map<std::uint32_t, std::size_t> points;
  for (const auto label : result.labels) ++points[label];
  const auto canvas = sceneCanvas(result);
  const std::string figures =
      page.picture(name + "_scene", naturalPicture(canvas), "Scene") +
      page.picture(name + "_result", segmentPicture(canvas, result.labels), "Result, by segment");

  const std::size_t table = points[1];
  std::string html = tableRow({"segment", "points"}, "th");
  for (const auto& [label, count] : points)
    if (label >= 2) html += tableRow({std::to_string(label), std::to_string(count)});
  return sceneHeading(name, "") +
         textElement("p", table == 0 ? "No table." : std::to_string(table) + " points of tables.") +
         figureRow(figures) + element("table", html);
}

}  // namespace

LabelReport::LabelReport(fs::path folder) : page_(std::move(folder)) {}

void LabelReport::write(const std::vector<LabelledScene>& scenes,
                        const std::map<std::string, fs::path>& without_truth) {
  std::string body = summaryTable(scenes) + sceneTable(scenes) + legend();
  for (const auto& scene : scenes) body += sceneSection(scene, page_);
  if (!without_truth.empty()) body += textElement("h1", "Without truth");
  for (const auto& [name, file] : without_truth) body += sectionWithoutTruth(name, file, page_);
  page_.write("Segmentation compared with the truth", body);
}

}  // namespace tabletop_perception::tools
