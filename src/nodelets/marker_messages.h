#pragma once

#include <cstdint>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "marker_options.h"
#include "messages.h"
#include "tabletop_perception/cloud.h"
#include "tabletop_perception/model_index.h"

namespace tabletop_perception {

/// The tables' hulls (namespace `table`), a name with its score above each thing (`name`), and a
/// box about each one that is known (`known_box`) or not (`box`); first of all the order to delete
/// what was drawn before.
visualization_msgs::MarkerArrayPtr sceneMarkers(const RecognizedObjectArray& objects,
                                                const TableArray& tables,
                                                const MarkerOptions& options);

/// The points of all things, each thing in a colour of its own that stays as long as its id.
Cloud coloredThings(const Cloud& cloud, const std::vector<std::uint32_t>& labels,
                    const RecognizedObjectArray& objects);

/// The models of the known objects at their poses, in the objects' frame.
Cloud modelsAtPoses(const RecognizedObjectArray& objects, const ModelIndex& index);

/// What was picked: its box, the axes of its frame drawn on its surface, an arrow from the pregrasp
/// frame the way the gripper comes, and a disc on the table below; first of all the order to delete
/// what was drawn before, and nothing more where nothing was picked. `depth`: of the frame's origin
/// behind the surface [m].
visualization_msgs::MarkerArrayPtr pickMarkers(const PickedObject& picked, double depth);

}  // namespace tabletop_perception
