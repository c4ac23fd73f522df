#include "cloud_message.h"

#include <stdexcept>
#include <utility>

namespace tabletop_perception {

CloudMessage::CloudMessage(const std_msgs::Header& header, Cloud cloud) : header(header) {
  content_->cloud = std::make_shared<Cloud>(std::move(cloud));
}

CloudMessage::CloudMessage(const std_msgs::Header& header, std::shared_ptr<const Cloud> cloud,
                           std::vector<std::uint32_t> labels)
    : header(header) {
  content_->cloud = std::move(cloud);
  content_->labels = std::move(labels);
}

std::shared_ptr<const Cloud> CloudMessage::sharedCloud() const {
  std::call_once(content_->cloud_unpacked, [content = content_.get()] {
    if (!content->cloud)
      content->cloud =
          std::make_shared<Cloud>(content->packed ? cloudFromMessage(*content->packed) : Cloud());
  });
  return content_->cloud;
}

const std::vector<std::uint32_t>& CloudMessage::labels() const {
  std::call_once(content_->labels_unpacked, [content = content_.get()] {
    if (content->packed) content->labels = labelsFromMessage(*content->packed);
    if (!content->labels) throw std::invalid_argument("cloud has no field 'label'");
  });
  return *content_->labels;
}

}  // namespace tabletop_perception
