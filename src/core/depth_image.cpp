#include "tabletop_perception/depth_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <iterator>
#include <optional>
#include <stdexcept>

#include "byte_order.h"
#include "format.h"
#include "inverse_depth.h"
#include "range_crop.h"
#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr std::uint64_t MAX_PIXELS = 1u << 30;  // indices of points are ints
constexpr std::size_t WRITE_AHEAD = 4096;       // fetched before it is written [bytes]

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument(what); }

// --- what an image must be

/// Throws unless the rows that the header speaks of lie within the data.
void checkLayout(const char* name, const PackedImage& image, std::size_t pixel_bytes) {
  const std::uint64_t pixels = std::uint64_t{image.width} * image.height;
  if (pixels == 0 || pixels > MAX_PIXELS)
    refuse(format("%s of %u x %u pixels cannot be used", name, image.width, image.height));
  const std::uint64_t row = std::uint64_t{image.width} * pixel_bytes;
  if (image.step < row)
    refuse(format("step of %s must be at least %llu bytes for %u pixels of %s, got %u", name,
                  static_cast<unsigned long long>(row), image.width, image.encoding.c_str(),
                  image.step));
  const std::uint64_t needed = std::uint64_t{image.step} * (image.height - 1) + row;
  if (image.data_size < needed)
    refuse(format("data of %s is too short for %u x %u pixels: %zu bytes, %llu needed", name,
                  image.width, image.height, image.data_size,
                  static_cast<unsigned long long>(needed)));
}

void checkSameSize(const char* name, std::uint64_t width, std::uint64_t height,
                   const PackedImage& depth) {
  if (width != depth.width || height != depth.height)
    refuse(
        format("%s is of %llu x %llu pixels, the depth image of %u x %u: they must be of one "
               "size",
               name, static_cast<unsigned long long>(width),
               static_cast<unsigned long long>(height), depth.width, depth.height));
}

void checkCamera(const Projection& camera, const PackedImage& depth) {
  if (!(camera.fx > 0) || !(camera.fy > 0) || !std::isfinite(camera.fx + camera.fy) ||
      !std::isfinite(camera.cx + camera.cy))
    refuse(
        format("camera_info has no usable K: focal lengths must be positive, got %g and %g; is "
               "the camera calibrated?",
               camera.fx, camera.fy));
  checkSameSize("camera_info", camera.width, camera.height, depth);
}

// --- depth

TABLETOP_SIMD_CLONES
void depthsOfIntegers(const std::uint8_t* bytes, std::size_t count, float unit, float* depths) {
  for (std::size_t i = 0; i < count; ++i) {
    std::uint16_t raw;
    std::memcpy(&raw, bytes + 2 * i, sizeof raw);
    depths[i] = nanUnless(raw != 0, static_cast<float>(raw) * unit);
  }
}

TABLETOP_SIMD_CLONES
void depthsOfFloats(const std::uint8_t* bytes, std::size_t count, float* depths) {
  constexpr float FARTHEST = 1e6f;  // also keeps out what is infinite [m]
  for (std::size_t i = 0; i < count; ++i) {
    float depth;
    std::memcpy(&depth, bytes + 4 * i, sizeof depth);
    depths[i] = nanUnless((depth > 0) & (depth < FARTHEST), depth);
  }
}

/// The depths of an image, row by row.
class DepthReader {
 public:
  DepthReader(const PackedImage& image, double unit) : image_(image), unit_(unit) {
    const auto& encoding = image.encoding;
    if (encoding != "16UC1" && encoding != "mono16" && encoding != "32FC1")
      refuse("depth image must be 16UC1 (mm) or 32FC1 (m), got '" + encoding + "'");
    integers_ = encoding != "32FC1";
    checkLayout("depth image", image, pixelBytes());
    if (image.big_endian != hostIsBigEndian()) swapped_.resize(image.width * pixelBytes());
    checkUnit();
  }

  /// Metres along z, NaN for none.
  void read(int row, float* depths) {
    const auto* bytes = image_.data + static_cast<std::size_t>(row) * image_.step;
    if (!swapped_.empty()) {
      for (std::size_t i = 0; i < swapped_.size(); i += pixelBytes())
        std::reverse_copy(bytes + i, bytes + i + pixelBytes(), &swapped_[i]);
      bytes = swapped_.data();
    }
    if (integers_)
      depthsOfIntegers(bytes, image_.width, static_cast<float>(unit_), depths);
    else
      depthsOfFloats(bytes, image_.width, depths);
  }

 private:
  std::size_t pixelBytes() const { return integers_ ? 2 : 4; }

  /// Throws where the median depth of some rows is one that no camera measures.
  void checkUnit() {
    constexpr float TOO_NEAR = 0.02f, TOO_FAR = 100;  // [m]
    constexpr int ROWS = 9;
    std::vector<float> some;
    std::vector<float> row(image_.width);
    for (int k = 1; k <= ROWS; ++k) {
      read(static_cast<int>(std::uint64_t{image_.height} * k / (ROWS + 1)), row.data());
      std::copy_if(row.begin(), row.end(), std::back_inserter(some),
                   [](float depth) { return !std::isnan(depth); });
    }
    if (some.empty()) return;
    const auto middle = some.begin() + static_cast<std::ptrdiff_t>(some.size() / 2);
    std::nth_element(some.begin(), middle, some.end());
    if (!integers_ && *middle > TOO_FAR)
      refuse(
          format("depth image 32FC1 must be in metres, but half of it is beyond %g: are these "
                 "millimetres?",
                 *middle));
    if (integers_ && *middle < TOO_NEAR)
      refuse(
          format("depth image 16UC1 must be in millimetres, but half of it is below %g: are "
                 "these metres?",
                 *middle / unit_));
  }

  const PackedImage& image_;
  double unit_;
  bool integers_ = false;
  std::vector<std::uint8_t> swapped_;  ///< a row, empty where bytes need not be swapped
};

// --- colour

template <int STEP, int RED, int GREEN, int BLUE>
void readColors(const std::uint8_t* bytes, std::size_t count, std::uint32_t* colors) {
  for (std::size_t i = 0; i < count; ++i, bytes += STEP)
    colors[i] = std::uint32_t{bytes[RED]} << 16 | std::uint32_t{bytes[GREEN]} << 8 | bytes[BLUE];
}

struct ColorEncoding {
  const char* name;
  std::size_t pixel_bytes;
  void (*read)(const std::uint8_t* bytes, std::size_t count, std::uint32_t* colors);
};
constexpr ColorEncoding COLOR_ENCODINGS[] = {
    {"rgb8", 3, readColors<3, 0, 1, 2>},  {"bgr8", 3, readColors<3, 2, 1, 0>},
    {"rgba8", 4, readColors<4, 0, 1, 2>}, {"bgra8", 4, readColors<4, 2, 1, 0>},
    {"mono8", 1, readColors<1, 0, 0, 0>},
};

/// The colours of an image, row by row; squares of `side` pixels give their mean.
class ColorReader {
 public:
  ColorReader(const PackedImage& image, const PackedImage& depth, int side)
      : image_(image), side_(side), encoding_(encodingOf(image)), colors_(image.width) {
    checkLayout("colour image", image, encoding_.pixel_bytes);
    checkSameSize("colour image", image.width, image.height, depth);
  }

  void read(int row, std::vector<std::uint32_t>& colors) {
    if (side_ == 1) return readRow(row, colors.data());
    std::vector<std::array<std::uint32_t, 3>> sums(colors.size(), {0, 0, 0});
    for (int k = 0; k < side_; ++k) {
      readRow(row * side_ + k, colors_.data());
      for (std::size_t i = 0; i < sums.size() * side_; ++i)
        for (int c = 0; c < 3; ++c) sums[i / side_][c] += colors_[i] >> (16 - 8 * c) & 0xFF;
    }
    const std::uint32_t pixels = side_ * side_;
    for (std::size_t i = 0; i < sums.size(); ++i)
      colors[i] = sums[i][0] / pixels << 16 | sums[i][1] / pixels << 8 | sums[i][2] / pixels;
  }

 private:
  static const ColorEncoding& encodingOf(const PackedImage& image) {
    std::string names;
    for (const auto& encoding : COLOR_ENCODINGS) {
      if (image.encoding == encoding.name) return encoding;
      names += (names.empty() ? "" : ", ") + std::string(encoding.name);
    }
    refuse("colour image must be one of " + names + ", got '" + image.encoding + "'");
  }

  void readRow(int row, std::uint32_t* colors) const {
    encoding_.read(image_.data + static_cast<std::size_t>(row) * image_.step, image_.width, colors);
  }

  const PackedImage& image_;
  int side_;
  const ColorEncoding& encoding_;
  std::vector<std::uint32_t> colors_;  ///< a row of the image
};

// --- points

TABLETOP_SIMD_CLONES
void alongRays(const float* depths, const float* columns, float row, std::size_t count, float* x,
               float* y) {
  for (std::size_t i = 0; i < count; ++i) {
    x[i] = depths[i] * columns[i];
    y[i] = depths[i] * row;
  }
}

TABLETOP_SIMD_CLONES
void invert(float* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) values[i] = 1 / values[i];
}

void readAll(DepthReader& reader, const PackedImage& image, std::vector<float>& depths) {
  depths.resize(std::size_t{image.width} * image.height);
  for (std::uint32_t row = 0; row < image.height; ++row)
    reader.read(static_cast<int>(row), &depths[std::size_t{row} * image.width]);
}

InverseDepths filteredDepths(DepthReader& reader, const PackedImage& depth,
                             const DepthImageOptions& options, DepthMemory* memory) {
  InverseDepths depths{static_cast<int>(depth.width), static_cast<int>(depth.height), {}};
  readAll(reader, depth, depths.values);
  invert(depths.values.data(), depths.values.size());

  const auto edge = static_cast<float>(options.edge_height);
  if (options.decimation > 1) depths = decimated(depths, options.decimation, edge);
  if (options.smoothing_radius > 0) depths = smoothed(depths, options.smoothing_radius, edge);
  if (options.newest_weight < 1 && memory)
    steady(depths, static_cast<float>(options.newest_weight), edge, *memory);
  if (options.max_hole > 0) fillHoles(depths, options.max_hole, edge);
  return depths;
}

/// The cloud of rows of depths, which `read_row(row, depths)` gives, with `side` pixels of the
/// camera to one.
template <typename ReadRow>
Cloud projected(int width, int height, ReadRow read_row, ColorReader* color,
                const Projection& camera, int side, const DepthImageOptions& options) {
  const auto middle = [side](int i) { return side * i + (side - 1) / 2.0; };
  std::vector<float> columns(width);  // x/z of each
  for (int u = 0; u < width; ++u)
    columns[u] = static_cast<float>((middle(u) - camera.cx) / camera.fx);

  Cloud cloud;
  cloud.width = width;
  cloud.height = height;
  const std::size_t size = static_cast<std::size_t>(width) * height;
  for (auto* values : {&cloud.x, &cloud.y, &cloud.z}) values->reserve(size);
  if (color) cloud.rgb.reserve(size);
  std::vector<float> x(width), y(width), z(width);
  std::vector<std::uint32_t> colors(color ? width : 0);
  const auto append = [](const auto& row, auto& to) {
    prefetch<true>(reinterpret_cast<const char*>(to.data() + to.size()) + WRITE_AHEAD,
                   row.size() * sizeof row[0]);
    to.insert(to.end(), row.begin(), row.end());
  };
  for (int v = 0; v < height; ++v) {
    read_row(v, z.data());
    const auto row = static_cast<float>((middle(v) - camera.cy) / camera.fy);
    alongRays(z.data(), columns.data(), row, z.size(), x.data(), y.data());
    dropOutside(x.data(), y.data(), z.data(), z.size(), options.min_range, options.max_range);
    append(x, cloud.x);
    append(y, cloud.y);
    append(z, cloud.z);
    if (!color) continue;
    color->read(v, colors);
    append(colors, cloud.rgb);
  }
  return cloud;
}

}  // namespace

Cloud cloudFromDepth(const PackedImage& depth, const PackedImage* color, const Projection& camera,
                     const DepthImageOptions& options, DepthMemory* memory, double unit) {
  checkOptions("depth_image", options);
  DepthReader depth_reader(depth, unit);
  checkCamera(camera, depth);
  const int side = options.decimation;
  const int width = static_cast<int>(depth.width) / side;
  const int height = static_cast<int>(depth.height) / side;
  if (width == 0 || height == 0)
    refuse(
        format("depth_image.decimation must not be more than the image has pixels, got %d for "
               "%u x %u",
               side, depth.width, depth.height));
  std::optional<ColorReader> color_reader;
  if (color) color_reader.emplace(*color, depth, side);
  ColorReader* colors = color_reader ? &*color_reader : nullptr;

  const bool filtered = side > 1 || options.smoothing_radius > 0 || options.max_hole > 0 ||
                        (options.newest_weight < 1 && memory);
  if (!filtered) {
    const auto read = [&](int row, float* depths) { depth_reader.read(row, depths); };
    return projected(width, height, read, colors, camera, side, options);
  }
  const InverseDepths depths = filteredDepths(depth_reader, depth, options, memory);
  const auto read = [&](int row, float* to) {
    std::copy_n(depths.row(row), width, to);
    invert(to, width);
  };
  return projected(width, height, read, colors, camera, side, options);
}

std::vector<float> depthsInMetres(const PackedImage& depth, double unit) {
  DepthReader reader(depth, unit);
  std::vector<float> depths;
  readAll(reader, depth, depths);
  return depths;
}

}  // namespace tabletop_perception
