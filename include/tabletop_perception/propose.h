#pragma once

#include <vector>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// Sets of clusters that may be one thing, by their indices, ascending: each cluster alone, in
/// order, then each pair that touches, then each group of three and more that hang together. A
/// thing with a hollow in it was cut at the hollow; one set holds it whole. Clusters touch where a
/// point of each lies in neighbouring cubes of `gap` [m]; 0: no unions.
std::vector<std::vector<int>> clusterUnions(const Cloud& cloud,
                                            const std::vector<Indices>& clusters, double gap);

}  // namespace tabletop_perception
