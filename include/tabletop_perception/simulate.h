#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/depth_sensor.h"
#include "tabletop_perception/placement.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/random.h"

namespace tabletop_perception {

/// How simulated scenes look.
struct SimulationOptions {
  std::size_t objects = 5;    ///< on the table
  double gap = 0.02;          ///< of each to the nearest one before it [m]; 0: they touch
  double radius = 0.35;       ///< about the table's middle that the objects stay within [m]
  double min_distance = 0.6;  ///< of the camera from the table's middle, at which it looks [m]
  double max_distance = 1.2;  ///< likewise [m]
  double min_pitch_deg = 25;  ///< the camera looks down by at least this angle [deg]
  double max_pitch_deg = 60;  ///< and at most by this one [deg]
  double table_x = 1.2;       ///< sides of the table [m]
  double table_y = 0.8;
  double table_height = 0.72;  ///< above the floor [m]
  Projection projection{525, 525, 319.5, 239.5, 640, 480, 1};
  DepthSensor sensor;
};

/// An object of a simulated scene.
struct SimulatedObject {
  std::string name;
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  std::uint16_t label = 0;         ///< of its pixels
  std::size_t visible_pixels = 0;  ///< that show it
  double visible = 0;              ///< share of the pixels that would show it if it were alone
  bool moving = false;             ///< in somebody's hand
};

/// A scene on a table with its truth, in the camera's frame (x right, y down, z forward) [m].
struct SimulatedScene {
  static constexpr std::uint16_t TABLE = 1;  ///< label of the table; 0: nothing, or the floor

  Cloud cloud;                        ///< as the sensor saw it, coloured
  std::vector<std::uint16_t> labels;  ///< per pixel, of what is there, with or without depth
  std::vector<SimulatedObject> objects;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();     ///< unit, against gravity
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();  ///< of the table, unit normal up
};

/// A scene of objects drawn from `objects`, each once before any comes again, that stand on a table
/// (placeObjects) and are all in the picture; the camera is moved until it sees a tenth of each,
/// where it can. Throws
/// std::invalid_argument without objects and when fewer than options.objects find room, with the
/// number of those that do.
SimulatedScene simulateScene(const TableObjects& objects, const SimulationOptions& options,
                             Random& random);

/// What is done with a frame of a sequence: its number from 0, and what is seen.
using FrameVisitor = std::function<void(int frame, SimulatedScene scene)>;

/// Frames of one scene, as above, in which nothing changes but the sensor's noise.
void simulateStill(const TableObjects& objects, const SimulationOptions& options, int frames,
                   Random& random, const FrameVisitor& visit);

/// Frames of one scene in which things happen: the first two objects stand there, the others are
/// put down one after the other, the first is lifted to another place where there is room for one,
/// a forearm passes between camera and table, and the last of at least three is taken away, at
/// a pace that the number of frames sets. The camera stays.
void simulateSequence(const TableObjects& objects, const SimulationOptions& options, int frames,
                      Random& random, const FrameVisitor& visit);

}  // namespace tabletop_perception
