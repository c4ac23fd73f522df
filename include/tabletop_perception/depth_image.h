#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception {

/// An image as bytes, as sensor_msgs/Image describes it. Owns nothing.
struct PackedImage {
  std::string encoding;                 ///< "16UC1", "rgb8", ...
  std::uint32_t width = 0, height = 0;  ///< [pixels]
  std::uint32_t step = 0;               ///< from row to row [bytes]
  bool big_endian = false;
  const std::uint8_t* data = nullptr;
  std::size_t data_size = 0;  ///< [bytes]
};

/// How depth becomes a cloud. The filters work on inverse depth, which is linear in the pixels of a
/// plane: they leave planes as they are, and noise of disparities is of one size in
/// it at any distance.
struct DepthImageOptions {
  double min_range = 0;        ///< nearer points are dropped; distance from the sensor [m]
  double max_range = 10;       ///< farther points are dropped [m]
  int decimation = 1;          ///< squares of so many pixels a side become one pixel
  int smoothing_radius = 0;    ///< of the window that depth is smoothed over; 0: not [pixels]
  double newest_weight = 1;    ///< of a frame against those before it; 1: no filter over time
  int max_hole = 0;            ///< widest hole in a row that is filled; 0: none [pixels]
  double edge_height = 0.006;  ///< higher steps, over the squared depth, are edges [1/m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("min_range", min_range, Range{0, 100});
    visit("max_range", max_range, Range{0.01, 100});
    visit("decimation", decimation, Range{1, 8});
    visit("smoothing_radius", smoothing_radius, Range{0, 5});
    visit("newest_weight", newest_weight, Range{0.05, 1});
    visit("max_hole", max_hole, Range{0, 50});
    visit("edge_height", edge_height, Range{0.0001, 0.1});
  }

  std::vector<Order> order() const { return {{"min_range", min_range, "max_range", max_range}}; }
};

/// What the filter over time knows of the frames before; an empty one begins anew.
struct DepthMemory {
  int width = 0, height = 0;
  std::vector<float> inverse_depths;  ///< NaN: none [1/m]
};

/// The organised cloud of a depth image: 16UC1 (whole numbers of `unit` metres, 0: none) or 32FC1
/// (metres; what is not finite or not positive is none), seen by a camera without distortion, z
/// forward. `color`: of the same size and view, rgb8, bgr8, rgba8, bgra8 or mono8; null: none. One
/// pass over the pixels where no filter is on. `memory` is used and brought up to date where the
/// options ask for a filter over time; null: there is none.
///
/// Throws std::invalid_argument with name and value of what does not add up: another encoding, rows
/// beyond the data, sizes that differ, a camera without focal length, options out of range, and
/// depths that can only be of the other encoding's unit.
Cloud cloudFromDepth(const PackedImage& depth, const PackedImage* color, const Projection& camera,
                     const DepthImageOptions& options, DepthMemory* memory = nullptr,
                     double unit = 0.001);

/// The depths of such an image, row by row, NaN for none [m]; throws as above.
std::vector<float> depthsInMetres(const PackedImage& depth, double unit = 0.001);

}  // namespace tabletop_perception
