#include "cloud_message.h"

#include <stdexcept>
#include <utility>

namespace tabletop_perception {

CloudMessage::CloudMessage(const std_msgs::Header& header, Cloud cloud) : header(header) {
  content_->cloud = std::move(cloud);
}

CloudMessage::CloudMessage(const CloudMessage& whole, Indices indices) : header(whole.header) {
  content_->whole = whole.content_;
  content_->indices = std::move(indices);
}

CloudMessage::CloudMessage(const CloudMessage& unlabelled, std::vector<std::uint32_t> labels)
    : header(unlabelled.header),
      content_(unlabelled.content_),
      labels_(std::make_shared<std::vector<std::uint32_t>>(std::move(labels))) {}

const Cloud& CloudMessage::cloud() const { return cloudOf(*content_); }

const std::vector<std::uint32_t>& CloudMessage::labels() const {
  if (labels_) return *labels_;
  if (!content_->packed) throw std::invalid_argument("cloud has no field 'label'");
  std::call_once(content_->labels_once,
                 [this] { content_->labels = labelsFromMessage(*content_->packed); });
  return content_->labels;
}

CloudMessage::Points CloudMessage::points() const {
  if (content_->whole) return {cloudOf(*content_->whole), content_->indices};
  return {cloud(), validIndices(cloud())};
}

const Cloud& CloudMessage::cloudOf(Content& content) {
  std::call_once(content.cloud_once, [&content] {
    if (content.packed) content.cloud = cloudFromMessage(*content.packed);
    if (content.whole) content.cloud = keepPoints(cloudOf(*content.whole), content.indices);
  });
  return content.cloud;
}

}  // namespace tabletop_perception
