#include "tabletop_perception/depth_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "scene.h"

using namespace tabletop_perception;

namespace {

constexpr float NONE = std::numeric_limits<float>::quiet_NaN();
const Projection CAMERA{100, 110, 31.5, 23.5, 64, 48, 1};

/// An image that owns its bytes.
struct Image {
  PackedImage packed;
  std::vector<std::uint8_t> bytes;

  template <typename Value>
  static Image of(const std::string& encoding, int width, int height, int channels,
                  const std::vector<Value>& values, int padding = 0, bool big_endian = false) {
    Image image;
    auto& p = image.packed;
    p.encoding = encoding;
    p.width = width;
    p.height = height;
    const std::size_t row = std::size_t{p.width} * channels * sizeof(Value);
    p.step = static_cast<std::uint32_t>(row + padding);
    p.big_endian = big_endian;
    image.bytes.assign(p.step * std::size_t{p.height}, 0xAB);  // padding is not zero
    for (int v = 0; v < height; ++v)
      std::memcpy(&image.bytes[v * std::size_t{p.step}], values.data() + v * row / sizeof(Value),
                  row);
    if (big_endian)
      for (int v = 0; v < height; ++v)
        for (std::size_t i = 0; i < row; i += sizeof(Value)) {
          auto* value = &image.bytes[v * std::size_t{p.step} + i];
          std::reverse(value, value + sizeof(Value));
        }
    return image;
  }

  const PackedImage& view() {
    packed.data = bytes.data();
    packed.data_size = bytes.size();
    return packed;
  }
};

Image metres(const std::vector<float>& depths, const Projection& camera = CAMERA) {
  return Image::of("32FC1", camera.width, camera.height, 1, depths);
}

std::vector<std::uint16_t> millimetres(const std::vector<float>& depths) {
  std::vector<std::uint16_t> raw;
  for (const float depth : depths)
    raw.push_back(static_cast<std::uint16_t>(std::isnan(depth) ? 0 : std::lround(1000 * depth)));
  return raw;
}

Cloud cloudOf(Image image, const DepthImageOptions& options = {}, DepthMemory* memory = nullptr) {
  return cloudFromDepth(image.view(), nullptr, CAMERA, options, memory);
}

template <typename Depth>  // of a column and a row [m]
std::vector<float> depthsOf(Depth depth) {
  std::vector<float> depths;
  for (int v = 0; v < CAMERA.height; ++v)
    for (int u = 0; u < CAMERA.width; ++u) depths.push_back(depth(u, v));
  return depths;
}

/// A wall through (0, 0, 1.2), turned by 50 degrees about a slanting axis.
const Eigen::Vector3d WALL_NORMAL =
    Eigen::AngleAxisd(50 * M_PI / 180, Eigen::Vector3d(1, 0.6, 0).normalized()) *
    -Eigen::Vector3d::UnitZ();

double offWall(const Eigen::Vector3f& point) {
  return WALL_NORMAL.dot(point.cast<double>() - Eigen::Vector3d(0, 0, 1.2));
}

float wallDepth(int u, int v) {
  const Eigen::Vector3d ray((u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, 1);
  return static_cast<float>(1.2 * WALL_NORMAL.z() / WALL_NORMAL.dot(ray));
}

/// A wall at 1 m on the left, at 1.05 m on the right.
float stepDepth(int u, int) { return u < CAMERA.width / 2 ? 1.f : 1.05f; }

std::vector<float> withNoise(std::vector<float> depths, float sigma, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, sigma);
  for (auto& depth : depths) depth += noise(random);
  return depths;
}

double rms(const Cloud& cloud, float depth) {
  double sum = 0;
  for (const float z : cloud.z) sum += (z - depth) * (z - depth);
  return std::sqrt(sum / cloud.size());
}

TEST(DepthImage, aPixelBecomesThePointThatTheCameraSeesThere) {
  auto depths = depthsOf([](int u, int v) { return 1 + 0.01f * u + 0.002f * v; });
  for (auto image : {metres(depths), Image::of("16UC1", 64, 48, 1, millimetres(depths))}) {
    const Cloud cloud = cloudOf(image);
    ASSERT_EQ(cloud.width, 64);
    ASSERT_EQ(cloud.height, 48);
    EXPECT_FALSE(cloud.colored());
    for (int v = 0; v < 48; ++v)
      for (int u = 0; u < 64; ++u) {
        const Eigen::Vector3f p = cloud.point(v * 64 + u);
        const Eigen::Vector2d pixel = CAMERA.pixel(p.cast<double>());
        EXPECT_NEAR(pixel.x(), u, 1e-4);
        EXPECT_NEAR(pixel.y(), v, 1e-4);
        EXPECT_NEAR(p.z(), 1 + 0.01 * u + 0.002 * v, 1e-6);
      }
  }
}

TEST(DepthImage, depthsInMetresAreThoseOfBothEncodings) {
  auto depths = depthsOf([](int u, int v) { return 0.5f + 0.001f * u + 0.01f * v; });
  depths[5] = NONE;
  for (auto image : {metres(depths), Image::of("16UC1", 64, 48, 1, millimetres(depths))}) {
    const auto read = depthsInMetres(image.view());
    ASSERT_EQ(read.size(), depths.size());
    for (std::size_t i = 0; i < depths.size(); ++i)
      if (i != 5) {
        EXPECT_NEAR(read[i], depths[i], 1e-6);
      }
    EXPECT_TRUE(std::isnan(read[5]));
  }
}

TEST(DepthImage, aRenderedSceneComesBack) {
  const auto scene = scene::threeObjects();
  const Projection camera = scene::SceneOptions().projection;
  auto image = Image::of("16UC1", camera.width, camera.height, 1, millimetres(scene.cloud.z));
  const Cloud cloud = cloudFromDepth(image.view(), nullptr, camera, {});
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_EQ(cloud.valid(i), scene.cloud.valid(i));
    if (cloud.valid(i)) {
      ASSERT_LT((cloud.point(i) - scene.cloud.point(i)).norm(), 0.001);
    }
  }
}

TEST(DepthImage, whatIsNoDepthIsNoPoint) {
  const std::vector<float> no_depths = {0, -1, NONE, std::numeric_limits<float>::infinity(),
                                        -std::numeric_limits<float>::infinity()};
  auto depths = depthsOf([](int, int) { return 1.f; });
  std::copy(no_depths.begin(), no_depths.end(), depths.begin());
  const Cloud cloud = cloudOf(metres(depths));
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(cloud.valid(i), i >= no_depths.size()) << i;
    EXPECT_EQ(std::isnan(cloud.x[i]), std::isnan(cloud.z[i]));
    EXPECT_EQ(std::isnan(cloud.y[i]), std::isnan(cloud.z[i]));
  }
  const auto dark =
      Image::of("16UC1", 64, 48, 1, millimetres(depthsOf([](int, int) { return NONE; })));
  EXPECT_TRUE(validIndices(cloudOf(dark)).empty());
}

TEST(DepthImage, theRangeIsADistanceFromTheSensor) {
  DepthImageOptions options;
  options.min_range = 1.01;
  options.max_range = 1.05;
  const Cloud all = cloudOf(metres(depthsOf([](int, int) { return 1.f; })));
  const Cloud cropped = cloudOf(metres(depthsOf([](int, int) { return 1.f; })), options);
  int kept = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double range = all.point(i).norm();
    EXPECT_EQ(cropped.valid(i), range >= 1.01 && range <= 1.05) << range;
    kept += cropped.valid(i);
  }
  EXPECT_GT(kept, 100);
}

TEST(DepthImage, paddingAndBigEndianAreUnderstood) {
  const auto depths = depthsOf([](int u, int v) { return 0.5f + 0.003f * u + 0.07f * v; });
  const auto raw = millimetres(depths);
  const Cloud floats = cloudOf(metres(depths)),
              integers = cloudOf(Image::of("16UC1", 64, 48, 1, raw));
  EXPECT_EQ(cloudOf(Image::of("32FC1", 64, 48, 1, depths, 12, true)).z, floats.z);
  EXPECT_EQ(cloudOf(Image::of("16UC1", 64, 48, 1, raw, 6, true)).z, integers.z);
  EXPECT_EQ(cloudOf(Image::of("16UC1", 64, 48, 1, raw, 6)).x, integers.x);
}

TEST(DepthImage, colorsOfEveryEncodingAreTheSame) {
  auto depth = metres(depthsOf([](int, int) { return 1.f; }));
  const auto red = [](int i) { return static_cast<std::uint8_t>(i); };
  const auto green = [](int i) { return static_cast<std::uint8_t>(3 * i + 1); };
  const auto blue = [](int i) { return static_cast<std::uint8_t>(255 - i); };
  for (const std::string encoding : {"rgb8", "bgr8", "rgba8", "bgra8", "mono8"}) {
    SCOPED_TRACE(encoding);
    std::vector<std::uint8_t> values;
    for (int i = 0; i < 64 * 48; ++i)
      for (const char channel : encoding == "mono8" ? "r" : encoding.substr(0, encoding.size() - 1))
        if (channel != '\0')
          values.push_back(channel == 'r'   ? red(i)
                           : channel == 'g' ? green(i)
                           : channel == 'b' ? blue(i)
                                            : 7);
    auto color =
        Image::of(encoding, 64, 48, static_cast<int>(values.size() / (64 * 48)), values, 5);
    const Cloud cloud = cloudFromDepth(depth.view(), &color.view(), CAMERA, {});
    ASSERT_EQ(cloud.rgb.size(), cloud.size());
    for (int i = 0; i < 64 * 48; ++i) {
      const std::uint32_t grey = red(i) * 0x010101u;
      const std::uint32_t rgb = red(i) << 16 | green(i) << 8 | blue(i);
      ASSERT_EQ(cloud.rgb[i], encoding == "mono8" ? grey : rgb) << i;
    }
  }
}

TEST(DepthImage, filtersLeaveAPlaneAsItIs) {
  for (int which = 0; which < 4; ++which) {
    SCOPED_TRACE(which);
    DepthImageOptions options;
    if (which == 0) options.decimation = 2;
    if (which == 1) options.decimation = 3;
    if (which == 2) options.smoothing_radius = 3;
    if (which == 3) options.newest_weight = 0.3;
    DepthMemory memory;
    for (int frame = 0; frame < 2; ++frame) {
      const Cloud cloud = cloudOf(metres(depthsOf(wallDepth)), options, &memory);
      EXPECT_EQ(validIndices(cloud).size(), cloud.size());
      for (std::size_t i = 0; i < cloud.size(); ++i)
        ASSERT_LT(std::abs(offWall(cloud.point(i))), 1e-5) << i;
    }
  }
}

TEST(DepthImage, decimatedPixelsAreSquaresOfPixels) {
  DepthImageOptions options;
  options.decimation = 3;
  auto depth = metres(depthsOf(wallDepth));
  std::vector<std::uint8_t> grey;
  for (int i = 0; i < 64 * 48; ++i) grey.push_back(static_cast<std::uint8_t>(i % 64 + i / 64));
  auto color = Image::of("mono8", 64, 48, 1, grey);
  const Cloud cloud = cloudFromDepth(depth.view(), &color.view(), CAMERA, options);
  ASSERT_EQ(cloud.width, 21);
  ASSERT_EQ(cloud.height, 16);
  for (int v = 0; v < cloud.height; ++v)
    for (int u = 0; u < cloud.width; ++u) {
      const Eigen::Vector2d pixel = CAMERA.pixel(cloud.point(v * 21 + u).cast<double>());
      EXPECT_NEAR(pixel.x(), 3 * u + 1, 1e-4);
      EXPECT_NEAR(pixel.y(), 3 * v + 1, 1e-4);
      EXPECT_EQ(cloud.rgb[v * 21 + u] & 0xFF, 3u * u + 3u * v + 2);
    }
}

TEST(DepthImage, decimationInventsNothingBetweenTwoSurfaces) {
  DepthImageOptions options;
  options.decimation = 3;  // squares across the step have pixels of both
  const Cloud cloud = cloudOf(metres(depthsOf(stepDepth)), options);
  for (const float z : cloud.z) EXPECT_LT(std::min(std::abs(z - 1), std::abs(z - 1.05f)), 1e-5);

  auto depths = depthsOf([](int u, int) { return u % 3 == 0 ? 1.f : NONE; });
  EXPECT_TRUE(validIndices(cloudOf(metres(depths), options)).empty()) << "a third is too little";
}

TEST(DepthImage, smoothingTakesNoiseAndLeavesEdges) {
  DepthImageOptions options;
  options.smoothing_radius = 2;
  const auto flat = withNoise(depthsOf([](int, int) { return 1.f; }), 0.0015f, 1);
  EXPECT_LT(rms(cloudOf(metres(flat), options), 1), rms(cloudOf(metres(flat)), 1) / 3);

  const Cloud step = cloudOf(metres(depthsOf(stepDepth)), options);
  for (int i = 0; i < 64 * 48; ++i) EXPECT_NEAR(step.z[i], stepDepth(i % 64, 0), 1e-5) << i % 64;
}

TEST(DepthImage, smoothingFillsNothing) {
  DepthImageOptions options;
  options.smoothing_radius = 2;
  const auto depths = depthsOf([](int u, int v) { return (u + v) % 7 == 0 ? NONE : 1.f; });
  EXPECT_EQ(validIndices(cloudOf(metres(depths), options)), validIndices(cloudOf(metres(depths))));
}

TEST(DepthImage, timeTakesNoiseAndWhatChangesIsSeenAtOnce) {
  DepthImageOptions options;
  options.newest_weight = 0.2;
  const auto flat = depthsOf([](int, int) { return 1.f; });
  DepthMemory memory;
  Cloud cloud;
  for (unsigned frame = 0; frame < 20; ++frame)
    cloud = cloudOf(metres(withNoise(flat, 0.001f, frame)), options, &memory);
  EXPECT_LT(rms(cloud, 1), 0.001 / 2);

  auto depths = depthsOf(stepDepth);
  depths[0] = NONE;
  cloud = cloudOf(metres(depths), options, &memory);
  EXPECT_FALSE(cloud.valid(0)) << "what has no depth now has none";
  EXPECT_FLOAT_EQ(cloud.z[63], 1.05f);
}

TEST(DepthImage, timeBeginsAnewWhereTheImageHasAnotherSize) {
  DepthImageOptions options;
  options.newest_weight = 0.2;
  DepthMemory memory{7, 5, std::vector<float>(35, 1.001f)};
  const Cloud cloud = cloudOf(metres(depthsOf([](int, int) { return 1.f; })), options, &memory);
  for (const float z : cloud.z) ASSERT_FLOAT_EQ(z, 1);
}

TEST(DepthImage, narrowHolesOnOneSurfaceAreFilledIfWanted) {
  auto depths = depthsOf(wallDepth);
  auto step = depthsOf(stepDepth);
  for (int v = 10; v < 20; ++v) {
    for (int u = 20; u < 23; ++u) depths[v * 64 + u] = NONE;
    for (int u = 40; u < 46; ++u) depths[v * 64 + u] = NONE;
    for (int u = 31; u < 33; ++u) step[v * 64 + u] = NONE;
    depths[v * 64] = NONE;  // at the edge of the picture
  }
  DepthImageOptions options;
  EXPECT_FALSE(cloudOf(metres(depths), options).valid(10 * 64 + 21)) << "by default nothing is";
  options.max_hole = 3;
  options.edge_height = 0.1;  // the wall is steep
  const Cloud filled = cloudOf(metres(depths), options);
  EXPECT_EQ(filled.size() - validIndices(filled).size(), 10u * (6 + 1));
  for (const int i : validIndices(filled)) ASSERT_LT(std::abs(offWall(filled.point(i))), 1e-5);

  options.edge_height = 0.006;
  EXPECT_FALSE(cloudOf(metres(step), options).valid(10 * 64 + 31)) << "nor across an edge";
}

/// The reason why an image is refused.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "not refused";
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != text.npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << text << "' does not say '" << part << "'";
}

std::string refusalOf(Image depth, Projection camera = CAMERA,
                      const DepthImageOptions& options = {}) {
  return refusal([&] { cloudFromDepth(depth.view(), nullptr, camera, options); });
}

TEST(DepthImage, whatDoesNotAddUpIsRefusedByNameAndValue) {
  const auto depths = depthsOf([](int, int) { return 1.f; });
  auto image = metres(depths);
  EXPECT_EQ(refusalOf(image), "not refused");

  image.packed.encoding = "8UC1";
  EXPECT_TRUE(contains(refusalOf(image), "16UC1 (mm) or 32FC1 (m), got '8UC1'"));
  image = metres(depths);
  image.packed.step = 100;
  EXPECT_TRUE(contains(refusalOf(image), "at least 256 bytes"));
  image = metres(depths);
  image.bytes.resize(1000);
  EXPECT_TRUE(contains(refusalOf(image), "too short"));
  image.packed.width = 0;
  EXPECT_TRUE(contains(refusalOf(image), "0 x 48"));

  image = metres(depths);
  Projection camera = CAMERA;
  camera.width = 640;
  EXPECT_TRUE(contains(refusalOf(image, camera), "camera_info is of 640 x 48 pixels"));
  EXPECT_TRUE(contains(refusalOf(image, Projection{0, 0, 0, 0, 64, 48, 1}), "no usable K"));
  EXPECT_TRUE(contains(refusalOf(image, Projection{NAN, 1, 0, 0, 64, 48, 1}), "no usable K"));

  DepthImageOptions options;
  options.min_range = 11;
  EXPECT_TRUE(contains(refusalOf(image, CAMERA, options), "depth_image.min_range"));
}

TEST(DepthImage, aColorImageThatDoesNotFitIsRefused) {
  auto depth = metres(depthsOf([](int, int) { return 1.f; }));
  auto small = Image::of("mono8", 32, 24, 1, std::vector<std::uint8_t>(32 * 24));
  EXPECT_TRUE(contains(refusal([&] { cloudFromDepth(depth.view(), &small.view(), CAMERA, {}); }),
                       "colour image is of 32 x 24 pixels, the depth image of 64 x 48"));
  auto bayer = Image::of("bayer_rggb8", 64, 48, 1, std::vector<std::uint8_t>(64 * 48));
  EXPECT_TRUE(contains(refusal([&] { cloudFromDepth(depth.view(), &bayer.view(), CAMERA, {}); }),
                       "'bayer_rggb8'"));
}

TEST(DepthImage, depthInAnotherUnitIsRefused) {
  EXPECT_TRUE(
      contains(refusalOf(metres(depthsOf([](int, int) { return 850.f; }))), "millimetres?"));
  const auto raw = std::vector<std::uint16_t>(64 * 48, 2);
  EXPECT_TRUE(contains(refusalOf(Image::of("16UC1", 64, 48, 1, raw)), "metres?"));
}

}  // namespace
