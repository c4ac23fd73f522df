#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "tabletop_perception/pcd.h"

namespace tabletop_perception::tools {

/// Which point of a cloud each pixel of its picture shows.
struct PictureLayout {
  int width = 0, height = 0;  ///< [pixels]
  std::vector<int> point;     ///< row by row; -1: none
};

/// An organised cloud is its own picture. An unorganised one is drawn as the sensor saw it where
/// all its points lie ahead (z of one sign, within 63 deg of the axis), else from above (along z of
/// the data); nearer points hide those behind. Without a point the picture is empty, not absent.
PictureLayout pictureLayout(const PcdContents& contents);

/// The points' colours, BGR; where the cloud has none, grey by distance, the nearest brightest.
std::vector<cv::Vec3b> naturalColors(const PcdContents& contents);

/// Paints each pixel that shows a point, the others black; BGR.
cv::Mat paintPicture(const PictureLayout& layout,
                     const std::function<cv::Vec3b(std::size_t point, int column, int row)>& color);

/// Writes a text into the middle (the median pixel) of each region. `region`: per point, an index
/// into `texts`, or a negative value for none.
void writeTexts(const PictureLayout& layout, const std::vector<int>& region,
                const std::vector<std::string>& texts, cv::Mat& picture);

}  // namespace tabletop_perception::tools
