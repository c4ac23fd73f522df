#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/decide.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/grasp.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/pick.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/table.h"

/// The order of the stages from a point to the thing there: pipeline.h for a single thing.
namespace tabletop_perception {

/// The thing that somebody pointed at, in the camera's frame.
struct Pick {
  Eigen::Vector3f point;          ///< that was pointed at [m]
  Table table;                    ///< that the thing stands on, without its points
  CloudWindow window;             ///< what the camera saw around the point, some pixels of it
  std::vector<Indices> clusters;  ///< of the window: the thing, then what it was cut from
  std::vector<Indices> others;    ///< of the window: what else stands near the point, uncut
  GraspSurface surface;
  Box box;  ///< about what is seen of the thing; about the whole model once it is recognised
  Pregrasp pregrasp;
  std::map<std::string, double> times_ms;  ///< per stage, and "total"

  const Indices& thing() const { return clusters.front(); }
};

/// The window's points of the thing in the whole cloud, ascending; empty where a voxel grid thinned
/// the window.
Indices pickedPoints(const Pick& pick);

/// Finds the thing at `point` of a cropped cloud with known tables. Of a fine image some pixels are
/// enough to find a thing and a frame by: those alone are in the window.
Found<Pick> pickThing(const Cloud& cloud, const Eigen::Vector3f& point,
                      const std::vector<Table>& tables, const PipelineOptions& options);

/// The same of a whole frame as the camera sent it: tables are looked for among fewer of its
/// pixels, all else in a window about the point. `up`: unit direction against gravity, if known.
Found<Pick> pickInScene(const Cloud& cloud, const Eigen::Vector3f& point,
                        const std::optional<Eigen::Vector3d>& up, const PipelineOptions& options);

/// The same pick with every pixel of the cropped cloud that it was made from in its window and in
/// its clusters: what recognition needs, and who counts points.
Pick atFullResolution(const Cloud& cloud, Pick pick);

/// What the thing of a pick at full resolution is, by the stages of the recogniser: its cluster
/// alone or with all that stands near the point, whichever is the likelier. Where that resembles
/// nothing, the cluster is cut at shallower hollows, and what is left of it beside the objects that
/// are known around it is looked at by itself; so is, at last, what a model that may stand at the
/// point would explain. Of several objects the one nearest to the point.
/// "unknown" with the reason where no object of the index stands up to the limits.
SceneObject recognizePick(const Pick& pick, const ModelIndex& index,
                          const PipelineOptions& options);

/// With the object that was recognised: the box about its whole surface, and pregrasp above it.
void completePick(Pick& pick, const ObjectModel& model, const Eigen::Isometry3d& T_camera_object,
                  const GraspOptions& options);

/// The stored grasps of a recognised object on the table under it; none of an unknown one, and none
/// without a table.
std::vector<PlacedGrasp> graspsOf(const SceneObject& object, const std::vector<Table>& tables,
                                  const ModelIndex& index, const GraspOptions& options);

}  // namespace tabletop_perception
