#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <optional>

#include "evaluate.h"
#include "pick_truth.h"
#include "scene_arguments.h"
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

constexpr int BINS = 5;  // of the visible share

struct PickFigures {
  Share separated, touching, z, x;
  std::array<Share, BINS> recognized;  ///< by the visible share of the object, with a database
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

Found<Pick> pickAt(const PickTruth& truth, const cv::Point& pixel, const PipelineOptions& options) {
  const auto point =
      pointAtPixel(truth.cloud, {static_cast<double>(pixel.x), static_cast<double>(pixel.y)},
                   options.pick.pixel_window);
  if (!point) return Found<Pick>::none(point.reason);
  auto pick = pickInScene(truth.cloud, *point, truth.up, options);
  if (pick)
    *pick.value =
        atFullResolution(filterCloud(truth.cloud, options.filter), std::move(*pick.value));
  return pick;
}

/// What picks are recognised with, and held against.
struct Known {
  const ModelIndex& index;
  const TrueModels& models;
};

/// Picks a target at its innermost pixel and counts whether it comes out with its name and pose.
void addRecognized(const PickTruth& truth, const PickTarget& target, const Known& known,
                   const PickedPixel& where, const PipelineOptions& options, PickFigures& figures) {
  const auto pick = pickAt(truth, target.picks.front(), options);
  SceneObject object;
  if (pick) object = recognizePick(*pick, known.index, options);
  const auto& model = known.models.reference.at(target.posed->name);
  PoseOutcome outcome{target.posed->name, model.diameter, std::nullopt};
  if (object.name == outcome.name)
    outcome.error = measurePose(model, target.posed->T_camera_object, object.T_camera_object);
  const int bin = static_cast<int>(*target.posed->visible * BINS);
  figures.recognized[std::clamp(bin, 0, BINS - 1)].add(outcome.right());
  if (!outcome.right())
    where.say(outcome.name + " is " +
              (outcome.error ? formatted(outcome.error->mssd, 1000, 1) + " mm off"
                             : "taken for " + (pick ? object.name + " " + object.reason
                                                    : "nothing: " + pick.reason)));
}

PickFigures figuresOf(const std::string& name, const PickTruth& truth,
                      const std::optional<Known>& known, const PipelineOptions& options) {
  PickFigures figures;
  for (const auto& target : truth.targets) {
    if (known && target.posed && target.posed->visible)
      addRecognized(truth, target, *known, {name, target.picks.front()}, options, figures);
    if (target.points.size() < MIN_POINTS) continue;
    Share& share = truth.touching(target) ? figures.touching : figures.separated;
    const JudgedTarget judged(truth.cloud, target);
    for (const auto& pixel : target.picks) {
      const PickedPixel where{name, pixel};
      const auto pick = pickAt(truth, pixel, options);
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
  PickFigures both{
      sum(a.separated, b.separated), sum(a.touching, b.touching), sum(a.z, b.z), sum(a.x, b.x), {}};
  for (int bin = 0; bin < BINS; ++bin)
    both.recognized[bin] = sum(a.recognized[bin], b.recognized[bin]);
  return both;
}

ordered_json figuresJson(const std::string& category, const PickFigures& figures, bool recognized) {
  ordered_json json = {{"category", category},
                       {"separated", figures.separated.json()},
                       {"touching", figures.touching.json()},
                       {"z", figures.z.json()},
                       {"x", figures.x.json()}};
  for (int bin = 0; recognized && bin < BINS; ++bin) {
    json["recognized"].push_back(
        {{"from", static_cast<double>(bin) / BINS}, {"to", static_cast<double>(bin + 1) / BINS}});
    json["recognized"].back().update(figures.recognized[bin].json());
  }
  return json;
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
  std::optional<ModelIndex> index;
  if (!evaluation.database.empty()) index.emplace(loadModels(evaluation.database));
  const auto known = index ? std::optional<Known>({*index, models}) : std::nullopt;
  for (const auto& folder : folders)
    add("all",
        figuresOf(folder.filename().string(), readPickTruth(folder, models), known, options));
  if (folders.empty())
    for (const auto& scene : labelledScenes(truth, "--picks"))
      add(scene.category, figuresOf(scene.name, readPickTruth(scene), std::nullopt, options));

  PickFigures all;
  for (const auto& row : rows) all = sumOf(all, row.second);
  if (rows.size() > 1) rows.emplace_back("all", all);
  if (evaluation.json) {
    ordered_json lines = ordered_json::array();
    for (const auto& [name, f] : rows) lines.push_back(figuresJson(name, f, index.has_value()));
    std::printf("%s\n", lines.dump().c_str());
    return;
  }
  std::vector<std::vector<std::string>> table = {
      {"right picks [%]", "separated", "touching", "z", "x"}};
  for (const auto& [name, f] : rows)
    table.push_back({name, f.separated.text(), f.touching.text(), f.z.text(), f.x.text()});
  printColumns(table);
  if (!index) return;
  std::vector<std::vector<std::string>> curve = {{"recognised [%]"}, {"all"}};
  for (int bin = 0; bin < BINS; ++bin) {
    curve[0].push_back(formatted(100.0 * bin / BINS, 1, 0) + " to " +
                       formatted(100.0 * (bin + 1) / BINS, 1, 0) + " % visible");
    curve[1].push_back(all.recognized[bin].text());
  }
  std::printf("\n");
  printColumns(curve);
}

}  // namespace tabletop_perception::tools
