#include "tabletop_perception/packed_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

using namespace tabletop_perception;

namespace {

constexpr std::uint8_t UINT8 = 2, UINT32 = 6, FLOAT32 = 7, FLOAT64 = 8;

/// A packed cloud that owns its bytes, laid out as a test wants it.
struct Packed {
  PackedCloud cloud;
  std::vector<std::uint8_t> bytes;

  Packed(std::uint32_t width, std::uint32_t height, std::uint32_t point_step,
         std::uint32_t row_padding = 0, bool big_endian = false) {
    cloud.width = width;
    cloud.height = height;
    cloud.point_step = point_step;
    cloud.row_step = width * point_step + row_padding;
    cloud.big_endian = big_endian;
    bytes.assign(std::size_t{cloud.row_step} * height, 0xAB);  // padding is not zero
  }

  void addField(const std::string& name, std::uint32_t offset, std::uint8_t datatype) {
    cloud.fields.push_back({name, offset, datatype, 1});
  }

  template <typename Value>
  void put(std::uint32_t row, std::uint32_t column, const std::string& name, Value value) {
    for (const auto& field : cloud.fields) {
      if (field.name != name) continue;
      auto* target = &bytes[row * cloud.row_step + column * cloud.point_step + field.offset];
      std::memcpy(target, &value, sizeof(Value));
      if (cloud.big_endian) std::reverse(target, target + sizeof(Value));
    }
  }

  const PackedCloud& view() {
    cloud.data = bytes.data();
    cloud.data_size = bytes.size();
    return cloud;
  }
};

/// The point of pixel (row, column) in every test: no two alike, exact in float32.
Eigen::Vector3f pointAt(int row, int column) {
  return {0.5f + column, -0.25f - row, 1.0f + 0.125f * row + column};
}

template <typename Value>
void putPoints(Packed& packed) {
  for (std::uint32_t row = 0; row < packed.cloud.height; ++row) {
    for (std::uint32_t column = 0; column < packed.cloud.width; ++column) {
      const auto p = pointAt(row, column);
      packed.put(row, column, "x", static_cast<Value>(p.x()));
      packed.put(row, column, "y", static_cast<Value>(p.y()));
      packed.put(row, column, "z", static_cast<Value>(p.z()));
    }
  }
}

void expectPoints(const Cloud& cloud, int width, int height) {
  ASSERT_EQ(cloud.width, width);
  ASSERT_EQ(cloud.height, height);
  ASSERT_EQ(cloud.size(), static_cast<std::size_t>(width * height));
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      EXPECT_EQ(cloud.point(row * width + column), pointAt(row, column)) << row << " " << column;
}

/// 4 x 3 points, tightly packed x y z float32.
Packed plainCloud() {
  Packed packed(4, 3, 12);
  packed.addField("x", 0, FLOAT32);
  packed.addField("y", 4, FLOAT32);
  packed.addField("z", 8, FLOAT32);
  putPoints<float>(packed);
  return packed;
}

std::string refusalOf(Packed& packed) {
  try {
    unpackCloud(packed.view());
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "was not refused";
}

}  // namespace

TEST(PackedCloud, ReadsTightlyPackedPoints) {
  auto packed = plainCloud();
  const auto cloud = unpackCloud(packed.view());
  expectPoints(cloud, 4, 3);
  EXPECT_FALSE(cloud.colored());
}

TEST(PackedCloud, SkipsPaddingInPointsAndRowsInAnyFieldOrder) {
  Packed packed(4, 3, 41, 13);  // unaligned on purpose
  packed.addField("z", 3, FLOAT32);
  packed.addField("intensity", 7, FLOAT32);
  packed.addField("x", 33, FLOAT32);
  packed.addField("y", 21, FLOAT32);
  putPoints<float>(packed);
  expectPoints(unpackCloud(packed.view()), 4, 3);
}

TEST(PackedCloud, ReadsRowsOfAnyLengthWhetherCoordinatesLieSideBySideOrNot) {
  for (const std::uint32_t width : {1, 3, 63, 64, 65, 131})
    for (const std::uint32_t y_offset : {4, 12}) {
      SCOPED_TRACE(width);
      Packed packed(width, 2, 17, 5);  // unaligned on purpose
      packed.addField("x", 0, FLOAT32);
      packed.addField("y", y_offset, FLOAT32);
      packed.addField("z", 8, FLOAT32);
      putPoints<float>(packed);
      expectPoints(unpackCloud(packed.view()), static_cast<int>(width), 2);
    }
}

TEST(PackedCloud, NeedsNoPaddingAfterTheLastRow) {
  Packed packed(4, 3, 16, 8);
  packed.addField("x", 0, FLOAT32);
  packed.addField("y", 4, FLOAT32);
  packed.addField("z", 8, FLOAT32);
  putPoints<float>(packed);
  packed.bytes.resize(packed.bytes.size() - 8);
  expectPoints(unpackCloud(packed.view()), 4, 3);
}

TEST(PackedCloud, ReadsBigEndianFloatsDoublesColorsAndLabels) {
  Packed floats(4, 3, 20, 4, true);
  floats.addField("x", 0, FLOAT32);
  floats.addField("y", 4, FLOAT32);
  floats.addField("z", 8, FLOAT32);
  floats.addField("rgb", 12, FLOAT32);
  floats.addField("label", 16, UINT32);
  putPoints<float>(floats);
  for (std::uint32_t i = 0; i < 12; ++i) {
    floats.put<std::uint32_t>(i / 4, i % 4, "rgb", 0xFF102030u + i);
    floats.put<std::uint32_t>(i / 4, i % 4, "label", 70000 + i);
  }
  const auto cloud = unpackCloud(floats.view());
  expectPoints(cloud, 4, 3);
  EXPECT_EQ(cloud.rgb[5], 0x102035u);
  EXPECT_EQ(unpackLabels(floats.view())[11], 70011u);

  Packed doubles(2, 2, 24, 0, true);
  doubles.addField("x", 0, FLOAT64);
  doubles.addField("y", 8, FLOAT64);
  doubles.addField("z", 16, FLOAT64);
  putPoints<double>(doubles);
  expectPoints(unpackCloud(doubles.view()), 2, 2);
}

TEST(PackedCloud, ReadsDoublesAlsoBesideFloats) {
  Packed packed(4, 3, 24);
  packed.addField("x", 0, FLOAT64);
  packed.addField("y", 8, FLOAT64);
  packed.addField("z", 16, FLOAT64);
  putPoints<double>(packed);
  expectPoints(unpackCloud(packed.view()), 4, 3);

  Packed mixed(1, 1, 16);
  mixed.addField("x", 0, FLOAT32);
  mixed.addField("y", 4, FLOAT64);
  mixed.addField("z", 12, FLOAT32);
  mixed.put(0, 0, "x", 1.5f);
  mixed.put(0, 0, "y", 2.5);
  mixed.put(0, 0, "z", 3.5f);
  EXPECT_EQ(unpackCloud(mixed.view()).point(0), Eigen::Vector3f(1.5f, 2.5f, 3.5f));
}

TEST(PackedCloud, ReadsColorAsFloatOrIntegerWithoutAlpha) {
  for (const std::string name : {"rgb", "rgba"}) {
    for (const auto datatype : {FLOAT32, UINT32}) {
      Packed packed(1, 1, 16);
      packed.addField("x", 0, FLOAT32);
      packed.addField("y", 4, FLOAT32);
      packed.addField("z", 8, FLOAT32);
      packed.addField(name, 12, datatype);
      putPoints<float>(packed);
      packed.put<std::uint32_t>(0, 0, name, 0xFF8040C0u);  // as a float this is negative
      EXPECT_EQ(unpackCloud(packed.view()).rgb, std::vector<std::uint32_t>{0x8040C0u});
    }
  }
}

TEST(PackedCloud, MakesPointsThatAreNotFinitePixelsWithoutAPoint) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const std::string axis : {"x", "y", "z"}) {
    for (const float value : {nan, inf, -inf}) {
      auto packed = plainCloud();
      packed.put(1, 2, axis, value);
      const auto cloud = unpackCloud(packed.view());
      EXPECT_TRUE(std::isnan(cloud.x[6]) && std::isnan(cloud.y[6]) && std::isnan(cloud.z[6]));
      EXPECT_EQ(validIndices(cloud).size(), 11u);
    }
  }
}

TEST(PackedCloud, MakesADoubleBeyondFloatAPixelWithoutAPoint) {
  Packed packed(2, 1, 24);
  packed.addField("x", 0, FLOAT64);
  packed.addField("y", 8, FLOAT64);
  packed.addField("z", 16, FLOAT64);
  putPoints<double>(packed);
  packed.put(0, 1, "y", 1e300);
  const auto cloud = unpackCloud(packed.view());
  EXPECT_TRUE(cloud.valid(0));
  EXPECT_FALSE(cloud.valid(1));
  EXPECT_TRUE(std::isnan(cloud.x[1]));
}

TEST(PackedCloud, RefusesARowStepThatLies) {
  auto small = plainCloud();
  small.cloud.row_step = 47;
  EXPECT_EQ(refusalOf(small), "row_step must be at least width x point_step = 48 bytes, got 47");
  auto zero = plainCloud();
  zero.cloud.row_step = 0;
  EXPECT_EQ(refusalOf(zero), "row_step must be at least width x point_step = 48 bytes, got 0");
  auto large = plainCloud();
  large.cloud.row_step = 4000000000u;
  EXPECT_EQ(refusalOf(large), "data is too short for 4 x 3 points: 144 bytes, 8000000048 needed");
}

TEST(PackedCloud, RefusesDataTooShortForItsSize) {
  auto packed = plainCloud();
  packed.bytes.pop_back();
  EXPECT_EQ(refusalOf(packed), "data is too short for 4 x 3 points: 143 bytes, 144 needed");
  auto empty = plainCloud();
  empty.bytes.clear();
  EXPECT_EQ(refusalOf(empty), "data is too short for 4 x 3 points: 0 bytes, 144 needed");
  auto huge = plainCloud();
  huge.cloud.width = huge.cloud.height = 0xFFFFFFFFu;
  EXPECT_EQ(refusalOf(huge),
            "cloud of 4294967295 x 4294967295 points is too large, at most 1073741824");
}

TEST(PackedCloud, RefusesAFieldBeyondThePoint) {
  auto packed = plainCloud();
  packed.cloud.fields[2].offset = 9;
  EXPECT_EQ(refusalOf(packed), "field 'z' ends at byte 13 of a point, point_step is 12");
  packed.cloud.fields[2].offset = 0xFFFFFFFEu;
  EXPECT_EQ(refusalOf(packed), "field 'z' ends at byte 4294967298 of a point, point_step is 12");
  auto no_step = plainCloud();
  no_step.cloud.point_step = 0;
  EXPECT_EQ(refusalOf(no_step), "field 'x' ends at byte 4 of a point, point_step is 0");
}

TEST(PackedCloud, RefusesMissingOrMistypedCoordinates) {
  for (int missing = 0; missing < 3; ++missing) {
    auto packed = plainCloud();
    const auto name = packed.cloud.fields[missing].name;
    packed.cloud.fields[missing].name = "intensity";
    EXPECT_EQ(refusalOf(packed).find("cloud has no field '" + name + "', its fields are: "), 0u);
  }
  auto no_fields = plainCloud();
  no_fields.cloud.fields.clear();
  EXPECT_EQ(refusalOf(no_fields), "cloud has no field 'x', its fields are: none");
  auto mistyped = plainCloud();
  mistyped.cloud.fields[0].datatype = UINT8;
  EXPECT_EQ(refusalOf(mistyped), "field 'x' must be float32 or float64, got uint8");
  mistyped.cloud.fields[0].datatype = 200;
  EXPECT_EQ(refusalOf(mistyped), "field 'x' must be float32 or float64, got datatype 200");
}

TEST(PackedCloud, GivesAnEmptyCloudForNoPixels) {
  EXPECT_TRUE(unpackCloud(PackedCloud()).empty());
  auto packed = plainCloud();
  packed.cloud.width = 0;
  EXPECT_TRUE(unpackCloud(packed.view()).empty());
}

TEST(PackedCloud, ReadsLabelsAndNamesTheirAbsence) {
  Packed packed(2, 2, 16);
  packed.addField("x", 0, FLOAT32);
  packed.addField("label", 12, UINT32);
  for (std::uint32_t i = 0; i < 4; ++i) packed.put(i / 2, i % 2, "label", i * 1000000);
  EXPECT_EQ(unpackLabels(packed.view()),
            (std::vector<std::uint32_t>{0, 1000000, 2000000, 3000000}));
  auto unlabelled = plainCloud();
  EXPECT_THROW(unpackLabels(unlabelled.view()), std::invalid_argument);
  EXPECT_FALSE(hasField(unlabelled.view(), "label"));
}

TEST(PackedCloud, ReadsAnyFloatFieldAsItStands) {
  auto packed = plainCloud();
  packed.put(0, 1, "y", std::numeric_limits<float>::infinity());
  const auto values = unpackFloats(packed.view(), "y");
  EXPECT_EQ(values[0], pointAt(0, 0).y());
  EXPECT_TRUE(std::isinf(values[1]));
  EXPECT_THROW(unpackFloats(packed.view(), "normal_x"), std::invalid_argument);
}
