#include "pick_truth.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "evaluate.h"
#include "pose_files.h"
#include "scene_source.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

constexpr double TOUCHING = 0.02;         // objects nearer to each other touch [m]
constexpr std::size_t TOUCHING_STEP = 3;  // every so manieth point is asked for its neighbours
constexpr float FRINGE = 3;               // of a mask, where depth may be that of another [pixels]
constexpr float SEEN_THERE = 0.02F;       // depth of a rendered pixel from the measured one [m]

/// Of each pixel of a mask from the nearest one outside it or the picture's edge [pixels].
cv::Mat1f distancesToBorder(const cv::Mat1b& mask) {
  cv::Mat1b padded;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, 0);
  cv::Mat1f distances;
  cv::distanceTransform(padded, distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return distances(cv::Rect(1, 1, mask.cols, mask.rows));
}

std::vector<cv::Point> picksIn(const cv::Mat1f& distances) {
  const auto inside = [&](const cv::Point& p) {
    return p.inside(cv::Rect({0, 0}, distances.size())) && distances(p) > 0;
  };
  cv::Point middle;
  cv::minMaxLoc(distances, nullptr, nullptr, nullptr, &middle);
  std::vector<cv::Point> picks = {middle};
  for (const cv::Point& direction :
       {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
    int steps = 0;
    while (inside(middle + (steps + 1) * direction)) ++steps;
    picks.push_back(middle + steps / 2 * direction);
  }
  return picks;
}

/// Adds the object whose pixels carry any of the labels.
void addTarget(const std::set<int>& values, const std::optional<TrueObject>& posed,
               PickTruth& truth) {
  const cv::Mat1i& labels = truth.labels;
  PickTarget target;
  target.posed = posed;
  cv::Mat1b pixels = cv::Mat1b::zeros(labels.rows, labels.cols);
  for (int i = 0; i < static_cast<int>(truth.cloud.size()); ++i) {
    const int value = labels(i / labels.cols, i % labels.cols);
    if (values.count(value) == 0) continue;
    pixels(i / labels.cols, i % labels.cols) = 255;
    if (!truth.cloud.valid(i)) continue;
    target.points.push_back(i);
    target.parts[value].push_back(i);
  }
  if (target.points.empty()) return;
  const cv::Mat1f distances = distancesToBorder(pixels);
  target.picks = picksIn(distances);
  std::copy_if(target.points.begin(), target.points.end(), std::back_inserter(target.inner),
               [&](int i) { return distances(i / labels.cols, i % labels.cols) > FRINGE; });
  truth.targets.push_back(std::move(target));
}

/// An object of a gt.json.
struct ListedObject {
  std::optional<int> value;  ///< of its pixels in label.png
  std::optional<TrueObject> posed;
};

std::vector<ListedObject> listedObjects(const fs::path& file) {
  std::vector<ListedObject> objects;
  visitJson(file, [&](const auto& content) {
    visitObjects(content, file, [&](const std::string&, const auto& object) {
      ListedObject listed;
      for (const char* key : {"ycbv_id", "label_value"})
        if (object.contains(key)) listed.value = object.at(key).template get<int>();
      if (object.contains("model_to_camera_3x4")) listed.posed = trueObjectFrom(object);
      objects.push_back(std::move(listed));
    });
  });
  return objects;
}

cv::Mat1i readLabelImage(const fs::path& file, const Cloud& cloud) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (image.rows != cloud.height || image.cols != cloud.width)
    throw std::invalid_argument(file.string() + " must have the depth's size");
  cv::Mat1i labels;
  image.convertTo(labels, CV_32S);
  return labels;
}

/// Per pixel the number of the object, from 1, that is rendered in front of the others and that the
/// camera saw where it is rendered, or saw nothing there; else 0.
cv::Mat1i renderedLabels(const std::vector<ListedObject>& objects, const Cloud& cloud,
                         const TrueModels& models) {
  const auto projection = fitProjection(cloud);
  if (!projection) throw std::invalid_argument(projection.reason);
  cv::Mat1i labels = cv::Mat1i::zeros(cloud.height, cloud.width);
  std::vector<float> depths(cloud.size(), std::numeric_limits<float>::infinity());
  for (std::size_t k = 0; k < objects.size(); ++k) {
    if (!objects[k].posed) continue;
    const Cloud rendered = models.renderers.at(objects[k].posed->name)
                               .render(objects[k].posed->T_camera_object, *projection);
    for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
      if (!rendered.valid(i) || std::abs(rendered.z[i]) >= depths[i]) continue;
      depths[i] = std::abs(rendered.z[i]);
      labels(i / cloud.width, i % cloud.width) = static_cast<int>(k) + 1;
    }
  }
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i)
    if (cloud.valid(i) && std::abs(std::abs(cloud.z[i]) - depths[i]) > SEEN_THERE)
      labels(i / cloud.width, i % cloud.width) = 0;
  return labels;
}

}  // namespace

bool PickTruth::touching(const PickTarget& target) const {
  std::vector<Eigen::Vector3f> others;
  for (const auto& other : targets) {
    if (&other == &target) continue;
    const auto points = pointsAt(cloud, other.inner);
    others.insert(others.end(), points.begin(), points.end());
  }
  const KdTree tree(std::move(others));
  for (std::size_t k = 0; k < target.inner.size(); k += TOUCHING_STEP) {
    const auto nearest = tree.nearest(cloud.point(target.inner[k]));
    if (nearest.index >= 0 && nearest.squared_distance < TOUCHING * TOUCHING) return true;
  }
  return false;
}

PickTruth readPickTruth(const LabelledScene& scene) {
  auto contents = readLabels(scene.truth);
  PickTruth truth;
  truth.cloud = std::move(contents.cloud);
  if (!truth.cloud.organized())
    throw std::invalid_argument(scene.truth.string() + " must be organised: pixels are picked");
  truth.labels.create(truth.cloud.height, truth.cloud.width);
  std::transform(contents.labels.begin(), contents.labels.end(), truth.labels.begin(),
                 [](std::uint32_t label) { return static_cast<int>(label); });
  std::map<int, std::set<int>> objects;
  for (const int label : truth.labels)
    if (label >= 20) objects[label / 10].insert(label);
  for (const auto& object : objects) addTarget(object.second, std::nullopt, truth);
  return truth;
}

PickTruth readPickTruth(const fs::path& folder, const TrueModels& models) {
  PickTruth truth;
  visitScenes({folder.string()}, "", [&](const Scene& scene) {
    truth.cloud = scene.cloud;
    truth.up = scene.up;
  });
  auto objects = listedObjects(folder / "gt.json");
  if (fs::exists(folder / "label.png")) {
    truth.labels = readLabelImage(folder / "label.png", truth.cloud);
  } else {
    truth.labels = renderedLabels(objects, truth.cloud, models);
    for (std::size_t k = 0; k < objects.size(); ++k) objects[k].value = static_cast<int>(k) + 1;
  }
  for (const auto& object : objects)
    if (object.value) addTarget({*object.value}, object.posed, truth);
  return truth;
}

std::set<std::string> objectsNamedIn(const std::vector<fs::path>& folders) {
  std::set<std::string> names;
  for (const auto& folder : folders)
    for (const auto& object : listedObjects(folder / "gt.json"))
      if (object.posed) names.insert(object.posed->name);
  return names;
}

}  // namespace tabletop_perception::tools
