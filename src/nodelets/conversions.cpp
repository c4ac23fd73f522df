#include "conversions.h"

#include "tabletop_perception/packed_cloud.h"

namespace tabletop_perception {

Cloud cloudFromMessage(const sensor_msgs::PointCloud2& message) {
  PackedCloud packed;
  packed.width = message.width;
  packed.height = message.height;
  packed.point_step = message.point_step;
  packed.row_step = message.row_step;
  packed.big_endian = message.is_bigendian;
  for (const auto& field : message.fields)
    packed.fields.push_back({field.name, field.offset, field.datatype, field.count});
  packed.data = message.data.data();
  packed.data_size = message.data.size();
  return unpackCloud(packed);
}

}  // namespace tabletop_perception
