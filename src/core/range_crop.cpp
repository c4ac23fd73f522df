#include "range_crop.h"

#include "simd.h"

namespace tabletop_perception {
namespace {

TABLETOP_SIMD_CLONES
void dropOutsideSquared(float* x, float* y, float* z, std::size_t count, float nearest,
                        float farthest) {
  for (std::size_t i = 0; i < count; ++i) {
    const float squared_range = x[i] * x[i] + (y[i] * y[i] + z[i] * z[i]);
    const bool within = (squared_range >= nearest) & (squared_range <= farthest);
    x[i] = nanUnless(within, x[i]);
    y[i] = nanUnless(within, y[i]);
    z[i] = nanUnless(within, z[i]);
  }
}

}  // namespace

void dropOutside(float* x, float* y, float* z, std::size_t count, double min, double max) {
  dropOutsideSquared(x, y, z, count, static_cast<float>(min * min), static_cast<float>(max * max));
}

}  // namespace tabletop_perception
