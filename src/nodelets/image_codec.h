#pragma once

#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

namespace tabletop_perception {

/// Images in the form of image_transport's plug-ins `compressedDepth` and `compressed`, so that
/// they work at either end. All functions throw std::invalid_argument for what they cannot read.

/// Depth (16UC1, mono16 or 32FC1) as PNG in whole millimetres, without loss of a 16UC1 image.
sensor_msgs::CompressedImagePtr compressedDepth(const sensor_msgs::Image& depth);

/// Colour (rgb8, bgr8, rgba8, bgra8, mono8) as JPEG.
sensor_msgs::CompressedImagePtr compressedColor(const sensor_msgs::Image& color);

/// 16UC1 or, of depth that was sent as inverse depth, 32FC1; of colour bgr8.
sensor_msgs::ImagePtr imageFromCompressed(const sensor_msgs::CompressedImage& message);

}  // namespace tabletop_perception
