#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <sensor_msgs/PointCloud2.h>
#include <boost/shared_ptr.hpp>

#include "conversions.h"
#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// A cloud between nodelets, with a label per point or without. Nodelets of one manager pass it on
/// as it is, some points of a cloud as their indices; to everybody else, in other processes or with
/// other subscriptions, it is a sensor_msgs/PointCloud2, packed and unpacked only for them.
class CloudMessage {
 public:
  CloudMessage() = default;  ///< for roscpp, to read into
  CloudMessage(const std_msgs::Header& header, Cloud cloud);
  /// The same grid with only the points of another message's cloud that are among `indices`.
  CloudMessage(const CloudMessage& whole, Indices indices);
  /// Another message's cloud with one label per point.
  CloudMessage(const CloudMessage& unlabelled, std::vector<std::uint32_t> labels);

  std_msgs::Header header;

  /// All throw std::invalid_argument when the message came packed and its fields and sizes do not
  /// add up (see unpackCloud), labels() also when it has none.
  const Cloud& cloud() const;
  const std::vector<std::uint32_t>& labels() const;

  /// The valid points of cloud() as points of a cloud that may hold more, which spares to copy
  /// them.
  struct Points {
    const Cloud& cloud;
    Indices indices;
  };
  Points points() const;

 private:
  friend struct ros::serialization::Serializer<CloudMessage>;

  struct Content {
    std::optional<sensor_msgs::PointCloud2> packed;  ///< as it came; none when it was made here
    std::shared_ptr<Content> whole;                  ///< of which these are some points, or null
    Indices indices;                                 ///< in `whole`
    std::once_flag cloud_once, labels_once;          ///< guard what follows
    Cloud cloud;
    std::vector<std::uint32_t> labels;  ///< of those that came packed
  };
  static const Cloud& cloudOf(Content& content);

  std::shared_ptr<Content> content_ = std::make_shared<Content>();
  std::shared_ptr<const std::vector<std::uint32_t>> labels_;
};

using CloudMessagePtr = boost::shared_ptr<CloudMessage>;
using CloudMessageConstPtr = boost::shared_ptr<const CloudMessage>;

}  // namespace tabletop_perception

namespace ros {
namespace message_traits {

template <>
struct IsMessage<tabletop_perception::CloudMessage> : TrueType {};
template <>
struct HasHeader<tabletop_perception::CloudMessage> : TrueType {};
template <>
struct MD5Sum<tabletop_perception::CloudMessage> : MD5Sum<sensor_msgs::PointCloud2> {
  static const char* value() { return MD5Sum<sensor_msgs::PointCloud2>::value(); }
  static const char* value(const tabletop_perception::CloudMessage&) { return value(); }
};
template <>
struct DataType<tabletop_perception::CloudMessage> {
  static const char* value() { return DataType<sensor_msgs::PointCloud2>::value(); }
  static const char* value(const tabletop_perception::CloudMessage&) { return value(); }
};
template <>
struct Definition<tabletop_perception::CloudMessage> {
  static const char* value() { return Definition<sensor_msgs::PointCloud2>::value(); }
  static const char* value(const tabletop_perception::CloudMessage&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<tabletop_perception::CloudMessage> {
  using Message = tabletop_perception::CloudMessage;

  template <typename Stream>
  static void read(Stream& stream, Message& message) {
    auto content = std::make_shared<Message::Content>();
    stream.next(content->packed.emplace());
    message.header = content->packed->header;
    message.content_ = std::move(content);
  }

  template <typename Stream>
  static void write(Stream& stream, const Message& message) {
    if (const auto& packed = message.content_->packed) {
      stream.next(*packed);
      return;
    }
    const auto layout = layoutOf(message);
    stream.next(layout.header);
    stream.next(layout.height);
    stream.next(layout.width);
    stream.next(layout.fields);
    stream.next(layout.is_bigendian);
    stream.next(layout.point_step);
    stream.next(layout.row_step);
    stream.next(bytesOf(layout));
    tabletop_perception::packPoints(message.cloud(), labelsOf(message),
                                    stream.advance(bytesOf(layout)));
    stream.next(layout.is_dense);
  }

  static std::uint32_t serializedLength(const Message& message) {
    if (const auto& packed = message.content_->packed) return serializationLength(*packed);
    const auto layout = layoutOf(message);
    return serializationLength(layout) + bytesOf(layout);
  }

 private:
  static const std::vector<std::uint32_t>* labelsOf(const Message& message) {
    return message.labels_.get();
  }
  static sensor_msgs::PointCloud2 layoutOf(const Message& message) {
    return tabletop_perception::layoutOf(message.cloud(), message.header,
                                         message.labels_ != nullptr);
  }
  static std::uint32_t bytesOf(const sensor_msgs::PointCloud2& layout) {
    return layout.row_step * layout.height;
  }
};

}  // namespace serialization
}  // namespace ros
