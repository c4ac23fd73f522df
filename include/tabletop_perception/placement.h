#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/mesh.h"
#include "tabletop_perception/random.h"
#include "tabletop_perception/rests.h"

namespace tabletop_perception {

/// A mesh with what is needed to stand it beside others and to look at it.
struct TableObject {
  /// Throws std::invalid_argument as checkObjectMesh and stableRests.
  TableObject(std::string object_name, const Mesh& mesh);

  std::string name;
  MeshRenderer renderer;
  std::vector<Rest> rests;
  std::vector<Eigen::Vector3f>
      points;               ///< all over the surface, at most 3 mm apart along edges [m]
  Eigen::AlignedBox3f box;  ///< of the points
};

using TableObjects = std::vector<std::unique_ptr<TableObject>>;

/// Where an object stands; the table's surface is z = 0, z up.
struct Placement {
  std::size_t object = 0;  ///< an index
  Eigen::Isometry3d T_table_object = Eigen::Isometry3d::Identity();
};

/// Distance of two surfaces that stand apart [m], or `limit` if that is less; too large by a
/// millimetre at most (where edges cross).
double clearance(const TableObject& a, const Eigen::Isometry3d& T_table_a, const TableObject& b,
                 const Eigen::Isometry3d& T_table_b, double limit);

/// Stands objects on a table, one after the other: each in a random rest, turned at random, comes
/// from a random side towards the table's middle until it is `gap` [m] from the nearest one that
/// stands there already (with 0 they touch). All stay within `radius` [m] of the middle. `chosen`:
/// indices of `objects`. Fewer placements than chosen: no more found room.
std::vector<Placement> placeObjects(const TableObjects& objects,
                                    const std::vector<std::size_t>& chosen, double gap,
                                    double radius, Random& random);

}  // namespace tabletop_perception
