#include "clustered_scene.h"

#include <algorithm>
#include <utility>

#include "near_model.h"
#include "tabletop_perception/agreement.h"
#include "tabletop_perception/decide.h"

namespace tabletop_perception {
namespace {

constexpr double REACH = 0.03;                  // of points about a model [m]
constexpr double MIN_MET_SHARE = 0.2;           // of a part within reach, if it may show a model
constexpr std::size_t MAX_SOURCE_POINTS = 600;  // that ICP looks at

void append(const Surface& from, std::size_t i, Surface& to) {
  to.points.push_back(from.points[i]);
  to.normals.push_back(from.normals[i]);
}

bool isAmong(int cluster, const std::vector<std::uint32_t>& labels) {
  return std::find(labels.begin(), labels.end(), static_cast<std::uint32_t>(cluster) + 2) !=
         labels.end();
}

}  // namespace

void Parts::add(Surface part) {
  planar.emplace_back(part);
  surfaces.push_back(std::move(part));
}

ClusteredScene::ClusteredScene(const Cloud& scene, const std::vector<Indices>& clusters,
                               const ModelIndex& index)
    : scene_(scene), clusters_(clusters), index_(index) {
  const auto& options = index.descriptorOptions();
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (auto& part : smoothParts(sampleCluster(scene, clusters[k], options), options)) {
      parts_.add(std::move(part));
      cluster_of_part_.push_back(static_cast<int>(k));
    }
}

Parts ClusteredScene::partsOf(const std::vector<std::uint32_t>& labels) const {
  Parts parts;
  for (std::size_t p = 0; p < cluster_of_part_.size(); ++p) {
    if (!isAmong(cluster_of_part_[p], labels)) continue;
    parts.surfaces.push_back(parts_.surfaces[p]);
    parts.planar.push_back(parts_.planar[p]);
  }
  return parts;
}

Parts ClusteredScene::restOf(const std::vector<std::uint32_t>& labels, const Marks& marks) const {
  Parts parts;
  for (std::size_t p = 0; p < cluster_of_part_.size(); ++p) {
    if (!isAmong(cluster_of_part_[p], labels)) continue;
    Surface rest;
    for (std::size_t i = 0; i < parts_.surfaces[p].size(); ++i)
      if (!marks.at(p, i)) append(parts_.surfaces[p], i, rest);
    if (!rest.empty()) parts.add(std::move(rest));
  }
  return parts;
}

Parts ClusteredScene::partsAbout(int model, const Eigen::Isometry3d& T_camera_object) const {
  std::vector<std::uint32_t> met;
  for (std::size_t p = 0; p < cluster_of_part_.size(); ++p)
    if (explainedShare(index_, model, T_camera_object, parts_.planar[p], REACH) > MIN_MET_SHARE)
      met.push_back(static_cast<std::uint32_t>(cluster_of_part_[p]) + 2);
  return partsOf(met);
}

Marks ClusteredScene::explainedBy(int model, const Eigen::Isometry3d& T_camera_object,
                                  double tolerance) const {
  Marks explained(parts_.surfaces);
  for (std::size_t p = 0; p < parts_.planar.size(); ++p)
    explained.mark(p, explainedPoints(index_, model, T_camera_object, parts_.planar[p], tolerance));
  return explained;
}

double ClusteredScene::shareOf(const Marks& marks, std::size_t cluster) const {
  double marked = 0, all = 0;
  for (std::size_t p = 0; p < cluster_of_part_.size(); ++p) {
    if (cluster_of_part_[p] != static_cast<int>(cluster)) continue;
    marked += marks.count(p);
    all += static_cast<double>(parts_.surfaces[p].size());
  }
  return all > 0 ? marked / all : 0;
}

std::vector<Eigen::Vector3f> ClusteredScene::markedPoints(const Marks& marks) const {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t p = 0; p < parts_.surfaces.size(); ++p)
    for (std::size_t i = 0; i < parts_.surfaces[p].size(); ++i)
      if (marks.at(p, i)) points.push_back(parts_.surfaces[p].points[i]);
  return points;
}

std::vector<Eigen::Vector3f> ClusteredScene::pointsOfClusters(const Marks& marks) const {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t k = 0; k < clusters_.size(); ++k)
    if (shareOf(marks, k) > 0)
      for (const int i : clusters_[k]) points.push_back(scene_.point(i));
  return points;
}

Surface ClusteredScene::samplesAround(int model, const Eigen::Isometry3d& T_camera_object,
                                      const Marks& marks) const {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  constexpr auto squared_reach = static_cast<float>(REACH * REACH);
  Surface around;
  for (std::size_t p = 0; p < parts_.surfaces.size(); ++p) {
    const Surface& part = parts_.surfaces[p];
    if (shareOf(marks, static_cast<std::size_t>(cluster_of_part_[p])) == 0) continue;
    for (std::size_t i = 0; i < part.size(); ++i)
      if (squaredDistance(index_, model, T_object_camera, part.points[i]) <= squared_reach)
        append(part, i, around);
  }
  return around;
}

std::vector<Eigen::Vector3f> ClusteredScene::pointsNear(int model,
                                                        const Eigen::Isometry3d& T_camera_object,
                                                        std::size_t cluster,
                                                        double tolerance) const {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  const auto limit = static_cast<float>(tolerance * tolerance);
  std::vector<Eigen::Vector3f> points;
  for (const int i : clusters_[cluster])
    if (squaredDistance(index_, model, T_object_camera, scene_.point(i)) <= limit)
      points.push_back(scene_.point(i));
  return points;
}

Surface ClusteredScene::sourceFor(int model, const Eigen::Isometry3d& T_camera_object,
                                  const Parts& parts) const {
  Surface near;
  for (std::size_t p = 0; p < parts.planar.size(); ++p) {
    const auto within = explainedPoints(index_, model, T_camera_object, parts.planar[p], REACH);
    for (std::size_t i = 0; i < parts.surfaces[p].size(); ++i)
      if (within[i / PlanarBlock::SIZE] >> i % PlanarBlock::SIZE & 1)
        append(parts.surfaces[p], i, near);
  }
  return thinned(near, MAX_SOURCE_POINTS);
}

}  // namespace tabletop_perception
