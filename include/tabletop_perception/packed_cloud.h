#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// A point cloud as bytes, as sensor_msgs/PointCloud2 and PCD files describe it. Owns nothing.
struct PackedCloud {
  struct Field {
    std::string name;
    std::uint32_t offset;   ///< within a point [bytes]
    std::uint8_t datatype;  ///< sensor_msgs/PointField: 1 int8, 2 uint8, 3 int16, 4 uint16, 5
                            ///< int32, 6 uint32, 7 float32, 8 float64
    std::uint32_t count;
  };
  std::uint32_t width = 0, height = 0;
  std::uint32_t point_step = 0, row_step = 0;  ///< [bytes]
  bool big_endian = false;
  std::vector<Field> fields;
  const std::uint8_t* data = nullptr;
  std::size_t data_size = 0;  ///< [bytes]
};

/// Reads x, y, z (float32 or float64) and, where there is one, rgb or rgba. Padding, any field
/// order and big-endian data are understood; points that are not finite become pixels without a
/// point; no pixels at all give an empty cloud. Throws std::invalid_argument with the name and
/// value of what does not add up: no x field, a field beyond the point, row_step or data too short
/// for the size.
Cloud unpackCloud(const PackedCloud& packed);

/// The same, without the points nearer than `min_range` or farther than `max_range` from the sensor
/// [m]: they are dropped while they are read, which spares a pass over the cloud.
Cloud unpackCloud(const PackedCloud& packed, double min_range, double max_range);

/// The `label` field (uint32), one per point; throws std::invalid_argument when there is none.
std::vector<std::uint32_t> unpackLabels(const PackedCloud& packed);

/// A field of float32 or float64 as it stands, one value per point, finite or not; throws
/// std::invalid_argument as unpackCloud does.
std::vector<float> unpackFloats(const PackedCloud& packed, const std::string& name);

/// Whether there is a field of that name.
bool hasField(const PackedCloud& packed, const std::string& name);

}  // namespace tabletop_perception
