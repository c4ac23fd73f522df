#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// A point cloud as planar arrays, row by row as the camera sent it: what every stage takes and
/// gives back. A pixel without a point is NaN in x, y and z alike; nothing is ever infinite.
/// Planar, because that is what compilers vectorise (see docs/design.md).
struct Cloud {
  int width = 0;
  int height = 0;                  ///< 1: unorganised, neighbours in the array mean nothing
  std::vector<float> x, y, z;      ///< [m], in the frame of the camera
  std::vector<std::uint32_t> rgb;  ///< 0x00RRGGBB; empty when the cloud has no colour

  Cloud() = default;
  /// A cloud of `width` x `height` pixels without a point.
  Cloud(int width, int height, bool colored);

  std::size_t size() const { return x.size(); }
  bool empty() const { return x.empty(); }
  bool organized() const { return height > 1; }
  bool colored() const { return !rgb.empty(); }

  bool valid(std::size_t i) const { return !std::isnan(x[i]); }
  Eigen::Vector3f point(std::size_t i) const { return {x[i], y[i], z[i]}; }
  void setPoint(std::size_t i, const Eigen::Vector3f& p) {
    x[i] = p.x(), y[i] = p.y(), z[i] = p.z();
  }
  void drop(std::size_t i) { x[i] = y[i] = z[i] = std::numeric_limits<float>::quiet_NaN(); }
};

/// Red, green and blue, 0 to 255.
using Rgb = Eigen::Vector3f;

/// Of 0x00RRGGBB.
Rgb rgbOf(std::uint32_t color);

/// Whether any point has a colour, and not a grey: a cloud of a camera without colours has none.
bool hasHues(const Cloud& cloud);

/// Indices of points in a cloud, ascending.
using Indices = std::vector<int>;

/// The pixels that hold a point.
Indices validIndices(const Cloud& cloud);

/// The given points, in their order.
std::vector<Eigen::Vector3f> pointsAt(const Cloud& cloud, const Indices& indices);

/// The given points as an unorganised cloud, in their order.
Cloud selectPoints(const Cloud& cloud, const Indices& indices);

/// The same without colours.
Cloud selectPositions(const Cloud& cloud, const Indices& indices);

/// Every step-th pixel of every step-th row of an organised cloud, without colours.
Cloud decimated(const Cloud& cloud, int step);

/// A rectangle of pixels that lies in the image.
struct PixelRectangle {
  int column = 0, row = 0;    ///< of its first pixel
  int width = 0, height = 0;  ///< [pixels]
};

/// The same of a part of the image, with its colours.
Cloud decimated(const Cloud& cloud, const PixelRectangle& part, int step);

/// The same grid with every point dropped that is not among `indices`.
Cloud keepPoints(const Cloud& cloud, const Indices& indices);

}  // namespace tabletop_perception
