#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <optional>

#include "evaluate.h"
#include "pick_truth.h"
#include "tabletop_perception/pick_scene.h"
#include "true_axes.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr std::size_t MIN_POINTS = 1000;  // smaller objects are not picked
constexpr double RIGHT_IOU = 0.5;         // of the taken points with the truth
constexpr double MAX_Z_ERROR_DEG = 5, MAX_X_ERROR_DEG = 10;

/// Counts of right ones.
struct Share {
  int right = 0, all = 0;
  void add(bool is_right) { right += is_right, ++all; }
  std::string text() const {
    return all == 0 ? "-"
                    : formatted(static_cast<double>(right) / all, 100, 1) + " (" +
                          std::to_string(right) + "/" + std::to_string(all) + ")";
  }
  ordered_json json() const { return {{"right", right}, {"all", all}}; }
};

struct PickFigures {
  Share separated, touching, z, x;
};

/// One pick of a scene, as complaints name it.
struct PickedPixel {
  const std::string& scene;
  cv::Point pixel;

  void say(const std::string& what) const {
    std::fprintf(stderr, "%s: (%d, %d): %s\n", scene.c_str(), pixel.x, pixel.y, what.c_str());
  }
};

double iouOf(const Indices& a, const Indices& b) {
  Indices both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return static_cast<double>(both.size()) / static_cast<double>(a.size() + b.size() - both.size());
}

/// An object and those of its parts that the truth tells apart, each with its true axes.
class JudgedTarget {
 public:
  JudgedTarget(const Cloud& cloud, const PickTarget& target)
      : whole_(judged(cloud, target.points)) {
    for (const auto& [label, points] : target.parts) parts_.emplace(label, judged(cloud, points));
  }

  /// The axes of what a pick at a pixel of a label took: of the object or of that part of it,
  /// whichever fits better; null where neither fits.
  const TrueAxes* axesOf(const Indices& taken, int label) const {
    const double whole = iouOf(taken, whole_.points);
    const auto part = parts_.find(label);
    const double of_part = part == parts_.end() ? 0 : iouOf(taken, part->second.points);
    if (std::max(whole, of_part) < RIGHT_IOU) return nullptr;
    return of_part > whole ? &part->second.axes : &whole_.axes;
  }

 private:
  struct Judged {
    const Indices& points;
    TrueAxes axes;
  };
  static Judged judged(const Cloud& cloud, const Indices& points) {
    return {points, trueAxesOf(pointsAt(cloud, points))};
  }

  Judged whole_;
  std::map<int, Judged> parts_;
};

/// Between two lines [deg].
double angleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::min(1.0, std::abs(a.dot(b)))) * 180 / M_PI;
}

void addAngle(const std::string& axis, double off_deg, double limit_deg, const PickedPixel& where,
              Share& share) {
  share.add(off_deg <= limit_deg);
  if (off_deg > limit_deg) where.say(axis + " is " + formatted(off_deg, 1, 1) + " deg off");
}

void addAxes(const Eigen::Matrix3d& frame, const TrueAxes& truth, const PickedPixel& where,
             PickFigures& figures) {
  if (!truth.z.empty()) {
    double off_deg = 180;
    for (const auto& z : truth.z) off_deg = std::min(off_deg, angleDeg(frame.col(2), z));
    addAngle("z", off_deg, MAX_Z_ERROR_DEG, where, figures.z);
  }
  if (truth.x) addAngle("x", angleDeg(frame.col(0), *truth.x), MAX_X_ERROR_DEG, where, figures.x);
}

PickFigures figuresOf(const std::string& name, const PickTruth& truth,
                      const PipelineOptions& options) {
  PickFigures figures;
  for (const auto& target : truth.targets) {
    if (target.points.size() < MIN_POINTS) continue;
    Share& share = truth.touching(target) ? figures.touching : figures.separated;
    const JudgedTarget judged(truth.cloud, target);
    for (const auto& pixel : target.picks) {
      const PickedPixel where{name, pixel};
      const auto point =
          pointAtPixel(truth.cloud, {static_cast<double>(pixel.x), static_cast<double>(pixel.y)},
                       options.pick.pixel_window);
      const auto pick = point ? pickInScene(truth.cloud, *point, truth.up, options)
                              : Found<Pick>::none(point.reason);
      const TrueAxes* axes =
          pick ? judged.axesOf(pickedPoints(*pick), truth.labels(pixel)) : nullptr;
      share.add(axes != nullptr);
      if (!pick) where.say(pick.reason);
      if (pick && !axes) where.say("another thing, or the thing with too much or too little");
      if (axes) addAxes(pick->surface.T_camera_pick.linear(), *axes, where, figures);
    }
  }
  return figures;
}

PickFigures sumOf(const PickFigures& a, const PickFigures& b) {
  const auto sum = [](Share s, const Share& t) {
    s.right += t.right, s.all += t.all;
    return s;
  };
  return {sum(a.separated, b.separated), sum(a.touching, b.touching), sum(a.z, b.z), sum(a.x, b.x)};
}

/// The folders with a gt.json of which the objects' pixels are known, sorted.
std::vector<fs::path> labelledFolders(const fs::path& truth, bool with_models) {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(truth)) {
    if (!fs::exists(entry.path() / "gt.json")) continue;
    if (with_models || fs::exists(entry.path() / "label.png"))
      folders.push_back(entry.path());
    else
      std::fprintf(stderr, "%s: left out, it has no label.png; with --models it can be rendered\n",
                   entry.path().c_str());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace

void evaluatePicks(const PickEvaluation& evaluation) {
  const fs::path& truth = evaluation.truth;
  const PipelineOptions& options = evaluation.options;
  checkFolder(truth, "--picks");
  std::vector<std::pair<std::string, PickFigures>> rows;  // by category, in their order
  const auto add = [&](const std::string& category, const PickFigures& figures) {
    const auto row = std::find_if(rows.begin(), rows.end(),
                                  [&](const auto& other) { return other.first == category; });
    if (row == rows.end())
      rows.emplace_back(category, figures);
    else
      row->second = sumOf(row->second, figures);
  };
  const bool with_models = !evaluation.models.empty();
  const auto folders = labelledFolders(truth, with_models);
  const TrueModels models =
      with_models ? readTrueModels(evaluation.models, objectsNamedIn(folders)) : TrueModels();
  for (const auto& folder : folders)
    add("all", figuresOf(folder.filename().string(), readPickTruth(folder, models), options));
  if (folders.empty())
    for (const auto& scene : labelledScenes(truth, "--picks"))
      add(scene.category, figuresOf(scene.name, readPickTruth(scene), options));

  PickFigures all;
  for (const auto& row : rows) all = sumOf(all, row.second);
  if (rows.size() > 1) rows.emplace_back("all", all);
  if (evaluation.json) {
    ordered_json lines = ordered_json::array();
    for (const auto& [name, f] : rows)
      lines.push_back({{"category", name},
                       {"separated", f.separated.json()},
                       {"touching", f.touching.json()},
                       {"z", f.z.json()},
                       {"x", f.x.json()}});
    std::printf("%s\n", lines.dump().c_str());
    return;
  }
  std::vector<std::vector<std::string>> table = {
      {"right picks [%]", "separated", "touching", "z", "x"}};
  for (const auto& [name, f] : rows)
    table.push_back({name, f.separated.text(), f.touching.text(), f.z.text(), f.x.text()});
  printColumns(table);
}

}  // namespace tabletop_perception::tools
