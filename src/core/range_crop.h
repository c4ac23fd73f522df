#pragma once

#include <cstddef>

namespace tabletop_perception {

/// Makes the points NaN whose distance from the sensor is not from `min` to `max` [m]: with a
/// finite `max` also those that are not finite.
void dropOutside(float* x, float* y, float* z, std::size_t count, double min, double max);

}  // namespace tabletop_perception
