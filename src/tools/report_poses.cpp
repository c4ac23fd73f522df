#include "report_poses.h"

#include <algorithm>
#include <utility>

#include "evaluate.h"
#include "html.h"
#include "plot.h"
#include "pose_picture.h"
#include "scene_source.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

const cv::Scalar RIGHT(80, 220, 80), WRONG(60, 60, 250), MISSED(40, 170, 255), TRUTH(240, 240, 240);

std::string figureTable(const std::vector<std::vector<std::string>>& rows) {
  std::string html = tableRow(poseHeads(), "th");
  for (const auto& row : rows) html += tableRow(row);
  return element("table", html);
}

std::string objectsTable(const std::vector<PosedScene>& scenes) {
  const auto scores = scoresOf(scenes);
  std::vector<std::vector<std::string>> rows;
  for (const auto& name : namesIn(scores))
    rows.push_back(poseRow(name, summarize(ofName(scores, name))));
  rows.push_back(poseRow("all " + std::to_string(scenes.size()) + " scenes", summarize(scores)));
  return figureTable(rows);
}

/// Each scene's name leads to its picture.
std::string scenesTable(const std::vector<PosedScene>& scenes) {
  std::string html = tableRow(poseHeads(), "th");
  for (const auto& scene : scenes) {
    const auto row = poseRow(scene.name, summarize({scene.score}));
    std::string cells = element("td", sceneLink(scene.name));
    for (std::size_t i = 1; i < row.size(); ++i) cells += textElement("td", row[i]);
    html += element("tr", cells);
  }
  return element("table", html);
}

/// Results of about the same score, how high it is and how many of them are right.
struct ScoreBin {
  double score_sum = 0;
  std::size_t results = 0, right = 0;
};

std::vector<ScoreBin> scoreBins(const std::vector<PosedScene>& scenes) {
  constexpr int BINS = 10;
  std::vector<ScoreBin> bins(BINS);
  for (const auto& scene : scenes)
    for (std::size_t r = 0; r < scene.results.size(); ++r) {
      const auto& score = scene.results[r].score;
      if (!score) continue;
      auto& bin = bins[std::clamp(static_cast<int>(*score * BINS), 0, BINS - 1)];
      bin.score_sum += *score;
      ++bin.results;
      bin.right += scene.right(r);
    }
  return bins;
}

std::string shareText(std::size_t part, std::size_t all) {
  return std::to_string(part) + "/" + std::to_string(all);
}

std::string reliabilityPlot(const std::vector<PosedScene>& scenes) {
  std::vector<PlotPoint> points;
  for (const auto& bin : scoreBins(scenes))
    if (bin.results > 0)
      points.push_back({bin.score_sum / static_cast<double>(bin.results),
                        static_cast<double>(bin.right) / static_cast<double>(bin.results),
                        shareText(bin.right, bin.results)});
  if (points.empty()) return "";
  return textElement("h2", "Scores") +
         textElement("p",
                     "Share of the results that are right, by their score; a score is right as a "
                     "probability where it meets the dashed line.") +
         sharePlot("mean score", "right", points, true);
}

std::string visibilityPlot(const FurtherFigures& figures) {
  std::vector<PlotPoint> points;
  for (const auto& bin : figures.visibility)
    if (bin.objects > 0)
      points.push_back({(bin.from + bin.to) / 2,
                        static_cast<double>(bin.right) / static_cast<double>(bin.objects),
                        shareText(bin.right, bin.objects)});
  if (points.empty()) return "";
  return textElement("h2", "Visibility") +
         textElement("p", "Share of the objects that are right, by how much of them is seen.") +
         sharePlot("visible", "right", points, false);
}

std::string verdictOf(const PoseOutcome& outcome) {
  if (outcome.right()) return "right";
  if (!outcome.error) return "missed";
  return outcome.close() ? "wrong, though the surfaces are near (ADD-S)" : "wrong";
}

std::string truthTable(const PosedScene& scene) {
  std::string html =
      tableRow({"object", "visible", "verdict", "MSSD mm", "ADD-S mm", "diameter mm"}, "th");
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    const auto& outcome = scene.score.truth[i];
    const auto millimetres = [&](double PoseError::*member) {
      return outcome.error ? formatted((*outcome.error).*member, 1000, 1) : std::string("-");
    };
    const auto cells =
        tableRow({outcome.name, formatted(scene.truth[i].visible, 100, 0) + " %",
                  verdictOf(outcome), millimetres(&PoseError::mssd), millimetres(&PoseError::add_s),
                  formatted(outcome.diameter, 1000, 0)});
    html += element("tbody", cells, outcome.right() ? "" : "class=\"fault\"");
  }
  return element("table", html, "class=\"words\"");
}

std::string resultsTable(const PosedScene& scene) {
  std::string html = tableRow({"result", "score", "verdict"}, "th");
  for (std::size_t r = 0; r < scene.results.size(); ++r) {
    const auto cells =
        tableRow({scene.results[r].name, formatted(scene.results[r].score, 1, 2),
                  scene.right(r)                    ? "right"
                  : scene.score.object_of_result[r] ? "wrong pose"
                                                    : "no object of this name is left"});
    html += element("tbody", cells, scene.right(r) ? "" : "class=\"fault\"");
  }
  return element("table", html, "class=\"words\"");
}

/// Truth below results, so that right ones cover it.
std::vector<Outline> outlinesOf(const PosedScene& scene, const TrueModels& models) {
  std::vector<Outline> outlines;
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    const auto& object = scene.truth[i];
    const bool missed = !scene.score.truth[i].error.has_value();
    outlines.push_back({&models.renderers.at(object.name), object.T_camera_object,
                        missed ? MISSED : TRUTH, missed ? object.name : ""});
  }
  for (std::size_t r = 0; r < scene.results.size(); ++r) {
    const auto& result = scene.results[r];
    const auto renderer = models.renderers.find(result.name);
    if (renderer == models.renderers.end()) continue;  // no such model was given
    outlines.push_back({&renderer->second, result.T_camera_object, scene.right(r) ? RIGHT : WRONG,
                        result.name + (result.score ? " " + formatted(result.score, 1, 2) : "")});
  }
  return outlines;
}

std::string sceneSection(const PosedScene& scene, const TrueModels& models, ReportPage& page) {
  std::string figures;
  if (fs::exists(scene.folder / "depth.png"))
    visitScenes({scene.folder.string()}, "", [&](const Scene& seen) {
      const auto projection = fitProjection(seen.cloud);
      if (!projection) return;  // which the figures complain about
      figures = page.picture(scene.name + "_poses",
                             outlinePicture(seen, *projection, outlinesOf(scene, models)),
                             "White: truth; green: right results; red: wrong ones; orange: objects "
                             "without a result");
    });
  return sceneHeading(scene.name, scene.has_result ? "" : " (no result)") + figureRow(figures) +
         truthTable(scene) + resultsTable(scene);
}

}  // namespace

PoseReport::PoseReport(fs::path folder) : page_(std::move(folder)) {}

void PoseReport::write(const std::vector<PosedScene>& scenes, const TrueModels& models) {
  const auto figures = furtherFigures(scenes);
  std::string further;
  for (const auto& row : furtherRows(figures)) further += tableRow(row);
  std::string body = objectsTable(scenes) + element("table", further) + scenesTable(scenes) +
                     reliabilityPlot(scenes) + visibilityPlot(figures);
  for (const auto& scene : scenes) body += sceneSection(scene, models, page_);
  page_.write("Poses compared with the truth", body);
}

}  // namespace tabletop_perception::tools
