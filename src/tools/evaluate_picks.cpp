#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "evaluate.h"
#include "evaluate_labels.h"
#include "scene_source.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/pick_scene.h"
#include "tabletop_perception/planes.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr std::size_t MIN_POINTS = 1000;    // smaller objects are not picked
constexpr double TOUCHING = 0.02;           // objects nearer to each other touch [m]
constexpr std::size_t TOUCHING_STEP = 3;    // every so manieth point is asked for its neighbours
constexpr double RIGHT_IOU = 0.5;           // of the taken points with the truth
constexpr double SURFACE_DISTANCE = 0.005;  // of the points on the main plane [m]
constexpr double MIN_SURFACE_SHARE = 0.4;   // of an object that has a main plane
constexpr double MIN_ELONGATION = 1.5;      // of one that has a longer side
constexpr double MAX_Z_ERROR_DEG = 5, MAX_X_ERROR_DEG = 10;

/// An object of the truth.
struct Mask {
  Indices points;                ///< with depth
  std::map<int, Indices> parts;  ///< by label: those that the truth tells apart
  std::vector<cv::Point> picks;  ///< the innermost pixel, and four half-way from it to the border
};

struct Truth {
  Cloud cloud;
  cv::Mat1i labels;  ///< of its pixels
  std::optional<Eigen::Vector3d> up;
  std::vector<Mask> masks;
};

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

std::vector<cv::Point> picksIn(const cv::Mat1b& mask) {
  cv::Mat1b padded;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::Mat1f distances;
  cv::distanceTransform(padded, distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::Point middle;
  cv::minMaxLoc(distances, nullptr, nullptr, nullptr, &middle);
  std::vector<cv::Point> picks = {middle};
  for (const cv::Point& direction :
       {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
    int steps = 0;
    while (padded(middle + (steps + 1) * direction)) ++steps;
    picks.push_back(middle + steps / 2 * direction);
  }
  for (auto& pick : picks) pick -= cv::Point(1, 1);
  return picks;
}

/// Adds the object whose pixels carry any of the labels.
void addMask(const std::set<int>& values, Truth& truth) {
  const cv::Mat1i& labels = truth.labels;
  Mask mask;
  cv::Mat1b pixels = cv::Mat1b::zeros(labels.rows, labels.cols);
  for (int i = 0; i < static_cast<int>(truth.cloud.size()); ++i) {
    const int value = labels(i / labels.cols, i % labels.cols);
    if (values.count(value) == 0) continue;
    pixels(i / labels.cols, i % labels.cols) = 255;
    if (!truth.cloud.valid(i)) continue;
    mask.points.push_back(i);
    mask.parts[value].push_back(i);
  }
  if (mask.points.size() < MIN_POINTS) return;
  mask.picks = picksIn(pixels);
  truth.masks.push_back(std::move(mask));
}

Truth truthOf(const LabelledScene& scene) {
  auto contents = readLabels(scene.truth);
  Truth truth;
  truth.cloud = std::move(contents.cloud);
  if (!truth.cloud.organized())
    throw std::invalid_argument(scene.truth.string() + " must be organised: pixels are picked");
  truth.labels.create(truth.cloud.height, truth.cloud.width);
  std::transform(contents.labels.begin(), contents.labels.end(), truth.labels.begin(),
                 [](std::uint32_t label) { return static_cast<int>(label); });
  std::map<int, std::set<int>> objects;
  for (const int label : truth.labels)
    if (label >= 20) objects[label / 10].insert(label);
  for (const auto& object : objects) addMask(object.second, truth);
  return truth;
}

/// The values of a label.png that are objects.
std::vector<int> objectValues(const fs::path& file) {
  std::vector<int> values;
  visitJson(file, [&](const auto& content) {
    for (const auto& object : content.at("objects"))
      values.push_back(object.contains("label_value") ? object.at("label_value").template get<int>()
                                                      : object.at("ycbv_id").template get<int>());
  });
  return values;
}

Truth truthOf(const fs::path& folder) {
  Truth truth;
  visitScenes({folder.string()}, "", [&](const Scene& scene) {
    truth.cloud = scene.cloud;
    truth.up = scene.up;
  });
  const cv::Mat image = cv::imread((folder / "label.png").string(), cv::IMREAD_GRAYSCALE);
  if (image.rows != truth.cloud.height || image.cols != truth.cloud.width)
    throw std::invalid_argument((folder / "label.png").string() + " must have the depth's size");
  image.convertTo(truth.labels, CV_32S);
  for (const int value : objectValues(folder / "gt.json")) addMask({value}, truth);
  return truth;
}

bool touchesAnother(const Truth& truth, const Mask& mask) {
  std::vector<Eigen::Vector3f> others;
  for (const auto& other : truth.masks) {
    if (&other == &mask) continue;
    const auto points = pointsAt(truth.cloud, other.points);
    others.insert(others.end(), points.begin(), points.end());
  }
  const KdTree tree(std::move(others));
  for (std::size_t k = 0; k < mask.points.size(); k += TOUCHING_STEP) {
    const auto nearest = tree.nearest(truth.cloud.point(mask.points[k]));
    if (nearest.index >= 0 && nearest.squared_distance < TOUCHING * TOUCHING) return true;
  }
  return false;
}

double iouOf(const Indices& a, const Indices& b) {
  Indices both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return static_cast<double>(both.size()) / static_cast<double>(a.size() + b.size() - both.size());
}

/// An object in parts counts as a whole or by the part that was pointed at.
bool isRight(const Indices& taken, const Mask& mask, int label) {
  const auto part = mask.parts.find(label);
  return iouOf(taken, mask.points) >= RIGHT_IOU ||
         (part != mask.parts.end() && iouOf(taken, part->second) >= RIGHT_IOU);
}

/// What the axes of the frame should be.
struct TrueAxes {
  std::optional<Eigen::Vector3d> z, x;
};

/// z from the plane that most of the mask's points lie on, of many draws; x along the longer side
/// of the least rectangle about them.
TrueAxes axesOf(const Cloud& cloud, const Mask& mask) {
  constexpr std::uint32_t DRAWS = 20;
  const Cloud points = selectPoints(cloud, mask.points);
  std::optional<Plane> best;
  for (std::uint32_t seed = 100; seed < 100 + DRAWS; ++seed) {
    auto plane = findLargestPlane(points, SURFACE_DISTANCE, std::nullopt, seed);
    if (plane && (!best || plane->points.size() > best->points.size())) best = std::move(plane);
  }
  TrueAxes axes;
  if (!best || static_cast<double>(best->points.size()) <
                   MIN_SURFACE_SHARE * static_cast<double>(points.size()))
    return axes;
  axes.z = best->plane.head<3>();
  const Eigen::Vector3d u = axes.z->unitOrthogonal(), v = axes.z->cross(u);
  std::vector<cv::Point2f> flat;
  for (const int i : best->points) {
    const Eigen::Vector3d p = points.point(i).cast<double>();
    flat.emplace_back(static_cast<float>(u.dot(p)), static_cast<float>(v.dot(p)));
  }
  std::array<cv::Point2f, 4> corners;
  cv::minAreaRect(flat).points(corners.data());
  const cv::Point2f a = corners[1] - corners[0], b = corners[2] - corners[1];
  const double length_a = std::hypot(a.x, a.y), length_b = std::hypot(b.x, b.y);
  const cv::Point2f longer = length_a > length_b ? a : b;
  if (std::max(length_a, length_b) < MIN_ELONGATION * std::min(length_a, length_b)) return axes;
  axes.x = (longer.x * u + longer.y * v).normalized();
  return axes;
}

/// Between two lines [deg].
double angleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::min(1.0, std::abs(a.dot(b)))) * 180 / M_PI;
}

PickFigures figuresOf(const std::string& name, const Truth& truth, const PipelineOptions& options) {
  PickFigures figures;
  for (const auto& mask : truth.masks) {
    Share& share = touchesAnother(truth, mask) ? figures.touching : figures.separated;
    const TrueAxes axes = axesOf(truth.cloud, mask);
    for (const auto& pixel : mask.picks) {
      const auto point =
          pointAtPixel(truth.cloud, {static_cast<double>(pixel.x), static_cast<double>(pixel.y)},
                       options.pick.pixel_window);
      const auto pick = point ? pickInScene(truth.cloud, *point, truth.up, options)
                              : Found<Pick>::none(point.reason);
      const bool right = pick && isRight(pickedPoints(*pick), mask, truth.labels(pixel));
      share.add(right);
      if (!pick)
        std::fprintf(stderr, "%s: (%d, %d): %s\n", name.c_str(), pixel.x, pixel.y,
                     pick.reason.c_str());
      if (!right) continue;
      const Eigen::Matrix3d frame = pick->surface.T_camera_pick.linear();
      if (axes.z) figures.z.add(angleDeg(frame.col(2), *axes.z) <= MAX_Z_ERROR_DEG);
      if (axes.x) figures.x.add(angleDeg(frame.col(0), *axes.x) <= MAX_X_ERROR_DEG);
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

/// The folders with a label.png and a gt.json, sorted.
std::vector<fs::path> labelledFolders(const fs::path& truth) {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(truth)) {
    if (!fs::exists(entry.path() / "gt.json")) continue;
    if (fs::exists(entry.path() / "label.png"))
      folders.push_back(entry.path());
    else
      std::fprintf(stderr, "%s: left out, it has no label.png\n", entry.path().c_str());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace

void evaluatePicks(const fs::path& truth, const PipelineOptions& options, bool json) {
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
  const auto folders = labelledFolders(truth);
  for (const auto& folder : folders)
    add("all", figuresOf(folder.filename().string(), truthOf(folder), options));
  if (folders.empty())
    for (const auto& scene : labelledScenes(truth, "--picks"))
      add(scene.category, figuresOf(scene.name, truthOf(scene), options));

  PickFigures all;
  for (const auto& row : rows) all = sumOf(all, row.second);
  if (rows.size() > 1) rows.emplace_back("all", all);
  if (json) {
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
