#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/mesh.h"
#include "tabletop_perception/placement.h"
#include "tabletop_perception/random.h"
#include "tabletop_perception/simulate.h"

namespace tabletop_perception {

/// A simulated table with a camera that looks at it, and where things stand on it at rest.
class Scenery {
 public:
  /// Places `options.objects` of them and the camera, as simulateScene says. `spare`: the first
  /// object gets a second place where it would fit, too, if there is room for one.
  Scenery(const TableObjects& objects, const SimulationOptions& options, bool spare,
          Random& random);

  /// One each, in the order of their labels.
  const std::vector<Placement>& placed() const { return placed_; }
  /// A free place of the first object.
  const std::optional<Placement>& spare() const { return spare_; }

  /// Something that is there when a picture is taken.
  struct Thing {
    std::size_t place;  ///< index into placed()
    Eigen::Isometry3d T_table_object;
    bool moving = false;
  };

  /// What is there without the sensor's noise: seen from camera and projector.
  struct Picture {
    SimulatedScene scene;  ///< its cloud is exact
    Cloud projected;
  };

  /// `hand`: pose of a forearm above the table, or none.
  Picture look(const std::vector<Thing>& things,
               const std::optional<Eigen::Isometry3d>& T_table_hand = {}) const;

  /// As the sensor sees it.
  SimulatedScene sensed(const Picture& picture, Random& random) const;

  /// The direction to the right of the camera, along the table.
  Eigen::Vector3d rightOnTable() const;

 private:
  const TableObjects& objects_;
  SimulationOptions options_;
  std::vector<Placement> placed_;
  std::optional<Placement> spare_;
  Eigen::Isometry3d T_camera_table_;
  MeshRenderer table_, floor_, hand_;
};

}  // namespace tabletop_perception
