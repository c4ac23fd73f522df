#include "tabletop_perception/projection.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace tabletop_perception {
namespace {

constexpr int SAMPLES = 4000;         // pixels that the fit looks at
constexpr int MIN_SAMPLES = 50;       // fewer say nothing
constexpr double MAX_RESIDUAL = 1.0;  // RMS [pixels]

/// The straight line pixel = scale * ratio + offset by least squares.
struct LineFit {
  double n = 0, sr = 0, sp = 0, srr = 0, srp = 0, spp = 0;

  void add(double ratio, double pixel) {
    n += 1, sr += ratio, sp += pixel;
    srr += ratio * ratio, srp += ratio * pixel, spp += pixel * pixel;
  }
  double spread() const { return n * srr - sr * sr; }
  double scale() const { return (n * srp - sr * sp) / spread(); }
  double offset() const { return (sp - scale() * sr) / n; }
  double squaredResidual() const {
    const double a = scale(), b = offset();
    return std::max(
        0.0, (spp + a * a * srr + n * b * b - 2 * a * srp - 2 * b * sp + 2 * a * b * sr) / n);
  }
};

}  // namespace

Found<Projection> fitProjection(const Cloud& cloud) {
  if (!cloud.organized()) return Found<Projection>::none("the cloud is unorganised");
  LineFit columns, rows;
  int in_front = 0, behind = 0;
  const int step = std::max<int>(1, static_cast<int>(cloud.size() / SAMPLES)) | 1;
  for (std::size_t i = 0; i < cloud.size(); i += step) {
    if (!cloud.valid(i) || cloud.z[i] == 0) continue;
    const double z = cloud.z[i];
    ++(z > 0 ? in_front : behind);
    columns.add(cloud.x[i] / z, static_cast<double>(i % cloud.width));
    rows.add(cloud.y[i] / z, static_cast<double>(i / cloud.width));
  }
  if (columns.n < MIN_SAMPLES || !(columns.spread() > 0) || !(rows.spread() > 0))
    return Found<Projection>::none("too few points to fit a camera to");
  if (in_front > 0 && behind > 0)
    return Found<Projection>::none("points lie on both sides of the camera's plane z = 0");

  const double residual = std::sqrt(columns.squaredResidual() + rows.squaredResidual());
  if (!(residual <= MAX_RESIDUAL)) {
    char text[120];
    std::snprintf(text, sizeof text, "points miss their pixels by %.1f px (RMS), limit %.1f",
                  residual, MAX_RESIDUAL);
    return Found<Projection>::none(text);
  }
  Projection projection;
  projection.fx = columns.scale();
  projection.fy = rows.scale();
  projection.cx = columns.offset();
  projection.cy = rows.offset();
  projection.width = cloud.width;
  projection.height = cloud.height;
  projection.forward = in_front > 0 ? 1 : -1;
  return projection;
}

}  // namespace tabletop_perception
