#pragma once

#include <cstdint>
#include <vector>

#include <visualization_msgs/MarkerArray.h>

#include "marker_options.h"
#include "messages.h"
#include "tabletop_perception/cloud.h"
#include "tabletop_perception/model_index.h"

namespace tabletop_perception {

/// The tables' hulls, a name above each thing, and a box about each one that is not known; first of
/// all the order to delete what was drawn before.
visualization_msgs::MarkerArrayPtr sceneMarkers(const RecognizedObjectArray& objects,
                                                const TableArray& tables,
                                                const MarkerOptions& options);

/// The points of all things, each thing in a colour of its own that stays as long as its id.
Cloud coloredThings(const Cloud& cloud, const std::vector<std::uint32_t>& labels,
                    const RecognizedObjectArray& objects);

/// The models of the known objects at their poses, in the objects' frame.
Cloud modelsAtPoses(const RecognizedObjectArray& objects, const ModelIndex& index);

}  // namespace tabletop_perception
