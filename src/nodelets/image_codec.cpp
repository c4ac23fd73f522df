#include "image_codec.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <boost/make_shared.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "conversions.h"

namespace tabletop_perception {
namespace {

/// What the plug-in puts before the PNG: how inverse depth became whole numbers.
struct DepthHeader {
  std::int32_t format = 0;  ///< inverse depth, the only one
  float a = 0, b = 0;       ///< depth [m] = a / (number - b); zeros: the numbers are millimetres
};

/// The least that pays: higher levels take several times as long for a tenth of the bytes.
constexpr int PNG_LEVEL = 1;
constexpr int JPEG_QUALITY = 90;

sensor_msgs::ImagePtr messageOf(const cv::Mat& pixels, const std::string& encoding,
                                const std_msgs::Header& header) {
  const auto message = boost::make_shared<sensor_msgs::Image>();
  message->header = header;
  message->encoding = encoding;
  message->width = static_cast<std::uint32_t>(pixels.cols);
  message->height = static_cast<std::uint32_t>(pixels.rows);
  message->step = static_cast<std::uint32_t>(pixels.cols * pixels.elemSize());
  message->data.assign(pixels.datastart, pixels.dataend);
  return message;
}

sensor_msgs::ImagePtr depthFromCompressed(const sensor_msgs::CompressedImage& message) {
  if (message.format.find("compressedDepth rvl") != std::string::npos)
    throw std::invalid_argument("'" + message.format +
                                "' is not read: the plug-in's parameter format must be png");
  DepthHeader header;
  cv::Mat numbers;
  if (message.data.size() > sizeof header) {
    std::memcpy(&header, message.data.data(), sizeof header);
    numbers = cv::imdecode(
        std::vector<std::uint8_t>(message.data.begin() + sizeof header, message.data.end()),
        cv::IMREAD_UNCHANGED);
  }
  if (numbers.type() != CV_16UC1 || numbers.empty())
    throw std::invalid_argument("compressed depth of " + std::to_string(message.data.size()) +
                                " bytes is no PNG of 16 bits behind a header of 12 bytes");
  if (message.format.rfind("32FC1", 0) != 0) return messageOf(numbers, "16UC1", message.header);
  cv::Mat depths(numbers.size(), CV_32FC1);
  for (int i = 0; i < static_cast<int>(numbers.total()); ++i) {
    const auto number = numbers.at<std::uint16_t>(i);
    depths.at<float>(i) = number == 0 ? std::numeric_limits<float>::quiet_NaN()
                                      : header.a / (static_cast<float>(number) - header.b);
  }
  return messageOf(depths, "32FC1", message.header);
}

}  // namespace

sensor_msgs::CompressedImagePtr compressedDepth(const sensor_msgs::Image& depth) {
  const auto metres = depthsInMetres(packedView(depth));
  cv::Mat millimetres(static_cast<int>(depth.height), static_cast<int>(depth.width), CV_16UC1);
  for (std::size_t i = 0; i < metres.size(); ++i) {
    const float rounded = std::round(1e3f * metres[i]);
    const bool fits = rounded >= 1 && rounded <= std::numeric_limits<std::uint16_t>::max();
    millimetres.at<std::uint16_t>(static_cast<int>(i)) =
        fits ? static_cast<std::uint16_t>(rounded) : 0;
  }
  std::vector<std::uint8_t> png;
  cv::imencode(".png", millimetres, png, {cv::IMWRITE_PNG_COMPRESSION, PNG_LEVEL});
  const auto message = boost::make_shared<sensor_msgs::CompressedImage>();
  message->header = depth.header;
  message->format = "16UC1; compressedDepth png";
  message->data.resize(sizeof(DepthHeader));
  const DepthHeader header;
  std::memcpy(message->data.data(), &header, sizeof header);
  message->data.insert(message->data.end(), png.begin(), png.end());
  return message;
}

sensor_msgs::CompressedImagePtr compressedColor(const sensor_msgs::Image& color) {
  struct Layout {
    int type, conversion;
  };
  static const std::map<std::string, Layout> LAYOUTS = {{"bgr8", {CV_8UC3, -1}},
                                                        {"rgb8", {CV_8UC3, cv::COLOR_RGB2BGR}},
                                                        {"bgra8", {CV_8UC4, cv::COLOR_BGRA2BGR}},
                                                        {"rgba8", {CV_8UC4, cv::COLOR_RGBA2BGR}},
                                                        {"mono8", {CV_8UC1, -1}}};
  const auto layout = LAYOUTS.find(color.encoding);
  if (layout == LAYOUTS.end())
    throw std::invalid_argument("colour image must be rgb8, bgr8, rgba8, bgra8 or mono8, got '" +
                                color.encoding + "'");
  const std::size_t row = std::size_t{color.width} * CV_ELEM_SIZE(layout->second.type);
  if (color.width == 0 || color.height == 0 || color.step < row ||
      color.data.size() < std::size_t{color.step} * color.height)
    throw std::invalid_argument("colour image of " + std::to_string(color.width) + " x " +
                                std::to_string(color.height) + " pixels has " +
                                std::to_string(color.data.size()) + " bytes");
  cv::Mat pixels(static_cast<int>(color.height), static_cast<int>(color.width), layout->second.type,
                 const_cast<std::uint8_t*>(color.data.data()), color.step);
  if (layout->second.conversion >= 0) {
    cv::Mat converted;
    cv::cvtColor(pixels, converted, layout->second.conversion);
    pixels = converted;
  }
  const auto message = boost::make_shared<sensor_msgs::CompressedImage>();
  message->header = color.header;
  message->format = color.encoding + "; jpeg compressed " + (pixels.channels() == 1 ? "" : "bgr8");
  cv::imencode(".jpg", pixels, message->data, {cv::IMWRITE_JPEG_QUALITY, JPEG_QUALITY});
  return message;
}

sensor_msgs::ImagePtr imageFromCompressed(const sensor_msgs::CompressedImage& message) {
  if (message.format.find("compressedDepth") != std::string::npos)
    return depthFromCompressed(message);
  const cv::Mat pixels =
      message.data.empty() ? cv::Mat() : cv::imdecode(message.data, cv::IMREAD_COLOR);
  if (pixels.empty())
    throw std::invalid_argument("compressed image of " + std::to_string(message.data.size()) +
                                " bytes in the format '" + message.format +
                                "' is neither JPEG nor PNG");
  return messageOf(pixels, "bgr8", message.header);
}

}  // namespace tabletop_perception
