#include "tabletop_perception/train.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <set>
#include <sstream>
#include <stdexcept>

#include "tabletop_perception/depth_sensor.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/random.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception {
namespace {

constexpr double MODEL_LEAF = 0.003;           // spacing of the whole model's points [m]
constexpr double MODEL_NORMAL_RADIUS = 0.008;  // neighbourhood of its normals [m]
constexpr float MIN_FACING = 0.35f;         // cosine to the line of sight; normals of surfaces that
                                            // are seen nearly edge-on may point inwards
constexpr double MIN_DISTANCE_RATIO = 1.5;  // of the camera to the diameter of a large one
constexpr double MAX_OPENING = 0.25;        // of a surface seen all around; see isSeenAllAround

constexpr double MIN_DISTANCE = 0.4, MAX_DISTANCE = 3;  // that views can be wanted from [m]
constexpr std::uint64_t NOISE_SEED = 1;                 // the same mesh gives the same model

/// The camera that meshes are rendered for: that of a Kinect.
constexpr Projection KINECT{525, 525, 319.5, 239.5, 640, 480, 1};

/// A view, and what it adds to the model.
struct Seen {
  View view;
  Surface surface;                    // in the object's frame, MODEL_LEAF apart [m]
  std::vector<std::uint32_t> colors;  // one per point of `surface`; none without colours
};

/// What of a surface in the camera's frame faces the camera.
Surface facing(const Surface& surface) {
  Surface kept;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (-surface.normals[i].dot(surface.points[i].normalized()) < MIN_FACING) continue;
    kept.points.push_back(surface.points[i]);
    kept.normals.push_back(surface.normals[i]);
  }
  return kept;
}

/// The colour of the nearest of `points` for each point of a surface; none without colours.
std::vector<std::uint32_t> nearestColors(const Surface& surface,
                                         const std::vector<Eigen::Vector3f>& points,
                                         const std::vector<std::uint32_t>& colors) {
  std::vector<std::uint32_t> nearest;
  if (colors.empty()) return nearest;
  const KdTree tree(points);
  for (const auto& p : surface.points) nearest.push_back(colors[tree.nearest(p).index]);
  return nearest;
}

const Eigen::Vector3f SENSOR = Eigen::Vector3f::Zero();  // where views were taken from

std::vector<Eigen::Vector3f> pointsOf(const Cloud& cloud) {
  std::vector<Eigen::Vector3f> points;
  for (const int i : validIndices(cloud)) points.push_back(cloud.point(i));
  return points;
}

/// What a camera saw of an object; without descriptors where that is too little.
View describedView(const Cloud& cloud, const Eigen::Isometry3d& T_view_object,
                   const DescriptorOptions& options) {
  View view;
  view.T_view_object = T_view_object;
  const auto points = pointsOf(cloud);
  if (points.empty()) return view;
  view.surface = sampleSurface(points, options.leaf, options.normal_radius, SENSOR);
  view.descriptors = describeSurface(view.surface, SENSOR, options);
  return view;
}

/// A view described as it was `sensed`, and the part of the model's surface that `ideal` shows.
Seen look(const Cloud& sensed, const Cloud& ideal, const Eigen::Isometry3d& T_view_object,
          const DescriptorOptions& options) {
  Seen seen;
  seen.view = describedView(sensed, T_view_object, options);
  const auto points = pointsOf(ideal);
  if (points.empty()) return seen;
  std::vector<std::uint32_t> colors;
  if (ideal.colored())
    for (const int i : validIndices(ideal)) colors.push_back(ideal.rgb[i]);
  const Surface fine = facing(sampleSurface(points, MODEL_LEAF, MODEL_NORMAL_RADIUS, SENSOR));
  seen.colors = nearestColors(fine, points, colors);
  seen.surface = transformed(fine, T_view_object.inverse());
  return seen;
}

/// Puts what was seen into the model: all of it into the surface, what can be described into the
/// views.
void assemble(std::vector<Seen> seen, ObjectModel& model) {
  Surface all;
  std::vector<std::uint32_t> colors;
  for (Seen& one : seen) {
    all.points.insert(all.points.end(), one.surface.points.begin(), one.surface.points.end());
    all.normals.insert(all.normals.end(), one.surface.normals.begin(), one.surface.normals.end());
    colors.insert(colors.end(), one.colors.begin(), one.colors.end());
    if (!one.view.descriptors.empty()) model.views.push_back(std::move(one.view));
  }
  if (model.views.empty())
    throw std::invalid_argument("object '" + model.name + "': no view shows " +
                                std::to_string(model.options.min_points) +
                                " sampled points; move the camera nearer or lower "
                                "descriptor.leaf");
  if (all.empty())
    throw std::invalid_argument("object '" + model.name + "': no view faces a surface");
  model.surface = downsampled(all, MODEL_LEAF);
  if (colors.size() == all.size()) model.colors = nearestColors(model.surface, all.points, colors);
}

/// Where to render a mesh from: around it at one distance after the other.
std::vector<Eigen::Isometry3d> posesAround(const Mesh& mesh, double diameter,
                                           const std::vector<double>& distances) {
  Eigen::AlignedBox3f box;
  for (const auto& v : mesh.vertices) box.extend(v);
  const Eigen::Vector3d middle = box.center().cast<double>();
  std::set<double> different;
  for (const double wanted : distances)
    different.insert(std::max(wanted, MIN_DISTANCE_RATIO * diameter));
  std::vector<Eigen::Isometry3d> poses;
  for (const double distance : different)
    for (const auto& direction : icosphereDirections()) {
      Eigen::Isometry3d T_view_object = Eigen::Isometry3d::Identity();
      T_view_object.linear() = rotationBetween(-direction, Eigen::Vector3d::UnitZ());
      T_view_object.translation() =
          distance * Eigen::Vector3d::UnitZ() - T_view_object.linear() * middle;
      poses.push_back(T_view_object);
    }
  return poses;
}

/// A rendered view as the sensor would give it; each view has noise of its own.
Cloud sensedView(const Cloud& ideal, const MeshRenderer& renderer,
                 const Eigen::Isometry3d& T_view_object, std::size_t number) {
  const DepthSensor sensor;
  Random random(NOISE_SEED, number);
  const Cloud projected = renderer.render(projectorPose(sensor) * T_view_object, KINECT);
  return senseDepth(ideal, projected, KINECT, sensor, random);
}

/// Renders and describes all views on two threads, of which the caller's reports progress.
std::vector<Seen> lookFromAll(const Mesh& mesh, const std::vector<Eigen::Isometry3d>& poses,
                              bool noise, const DescriptorOptions& options,
                              const Progress& progress) {
  const MeshRenderer renderer(mesh);
  std::vector<Seen> seen(poses.size());
  std::atomic<std::size_t> next{0}, done{0};
  const auto work = [&](const Progress& report) {
    for (std::size_t i; (i = next++) < poses.size();) {
      const Cloud ideal = renderer.render(poses[i], KINECT);
      const Cloud sensed = noise ? sensedView(ideal, renderer, poses[i], i) : ideal;
      seen[i] = look(sensed, ideal, poses[i], options);
      ++done;
      if (report) report(static_cast<double>(done) / static_cast<double>(poses.size()));
    }
  };
  auto other = std::async(std::launch::async, work, Progress());
  work(progress);
  other.get();
  if (progress) progress(1);  // the other thread may have had the last view
  return seen;
}

/// A view without its colours if they are one and the same: a cloud that a program painted. No
/// camera sees that, and it would tell the object apart from itself.
Cloud withoutPaint(Cloud cloud) {
  std::set<std::uint32_t> colors;
  for (const int i : validIndices(cloud))
    if (cloud.colored()) colors.insert(cloud.rgb[i]);
  if (colors.size() == 1) cloud.rgb.clear();
  return cloud;
}

/// Whether a surface has a counterpart to nearly every side: its normals cancel out, as over every
/// closed surface. A part has symmetries that the whole has not.
bool isSeenAllAround(const Surface& surface) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& normal : surface.normals) sum += normal.cast<double>();
  return sum.norm() <= MAX_OPENING * static_cast<double>(surface.size());
}

ObjectModel begun(const std::string& name, const DescriptorOptions& options) {
  checkObjectName(name);
  checkOptions("descriptor", options);
  ObjectModel model;
  model.name = name;
  model.options = options;
  return model;
}

}  // namespace

void checkMeshViews(const MeshViewOptions& options) {
  if (options.distances.empty())
    throw std::invalid_argument("no distance to look at the mesh from");
  for (const double distance : options.distances)
    if (!(distance >= MIN_DISTANCE && distance <= MAX_DISTANCE)) {
      std::ostringstream message;
      message << "distances of the views must be " << MIN_DISTANCE << " to " << MAX_DISTANCE
              << " m, got " << distance;
      throw std::invalid_argument(message.str());
    }
}

ObjectModel trainFromMesh(const std::string& name, const Mesh& mesh,
                          const DescriptorOptions& options, const Progress& progress,
                          const MeshViewOptions& view_options) {
  ObjectModel model = begun(name, options);
  checkObjectMesh(mesh);
  checkMeshViews(view_options);
  model.origin = "mesh of " + std::to_string(mesh.faces.size()) + " faces";
  model.diameter = diameterOf(mesh.vertices);
  const auto poses = posesAround(mesh, model.diameter, view_options.distances);
  assemble(lookFromAll(mesh, poses, view_options.noise, options, progress), model);
  model.symmetry = detectSymmetry(model.surface);
  return model;
}

ObjectModel trainFromViews(const std::string& name, const std::vector<TrainingView>& views,
                           const DescriptorOptions& options, const Progress& progress) {
  ObjectModel model = begun(name, options);
  if (views.empty()) throw std::invalid_argument("object '" + name + "': no view to train from");
  model.origin = std::to_string(views.size()) + (views.size() == 1 ? " view" : " views");
  std::vector<Seen> seen;
  for (const TrainingView& view : views) {
    const Cloud cloud = withoutPaint(view.cloud);
    seen.push_back(look(cloud, cloud, view.T_view_object, options));
    if (validIndices(view.cloud).empty())
      throw std::invalid_argument("object '" + name + "': view " + std::to_string(seen.size()) +
                                  " of " + std::to_string(views.size()) + " has no points");
    if (progress) progress(static_cast<double>(seen.size()) / static_cast<double>(views.size()));
  }
  assemble(std::move(seen), model);
  model.diameter = diameterOf(model.surface.points);
  if (isSeenAllAround(model.surface)) model.symmetry = detectSymmetry(model.surface);
  return model;
}

ObjectModel withView(ObjectModel model, const TrainingView& view) {
  const ObjectModel added = trainFromViews(model.name, {view}, model.options, Progress());
  const std::size_t before = model.surface.size();
  const bool colored = model.colors.size() == before && added.colors.size() == added.surface.size();
  Surface all = std::move(model.surface);
  all.points.insert(all.points.end(), added.surface.points.begin(), added.surface.points.end());
  all.normals.insert(all.normals.end(), added.surface.normals.begin(), added.surface.normals.end());
  std::vector<std::uint32_t> colors = std::move(model.colors);
  colors.insert(colors.end(), added.colors.begin(), added.colors.end());

  model.surface = downsampled(all, MODEL_LEAF);
  model.colors.clear();
  if (colored) model.colors = nearestColors(model.surface, all.points, colors);
  model.views.insert(model.views.end(), added.views.begin(), added.views.end());
  model.origin = std::to_string(model.views.size()) + " views";
  model.diameter = diameterOf(model.surface.points);
  if (!model.symmetry.declared && isSeenAllAround(model.surface))
    model.symmetry = detectSymmetry(model.surface);
  return model;
}

}  // namespace tabletop_perception
