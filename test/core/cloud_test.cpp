#include "tabletop_perception/cloud.h"

#include <cmath>

#include <gtest/gtest.h>

using namespace tabletop_perception;

namespace {

/// 3 x 2 pixels, two without a point.
Cloud smallCloud(bool colored) {
  Cloud cloud(3, 2, colored);
  for (const int i : {0, 2, 3, 5}) {
    cloud.setPoint(i, {1.0f * i, 2.0f * i, 3.0f});
    if (colored) cloud.rgb[i] = 0x010203u * i;
  }
  return cloud;
}

}  // namespace

TEST(Cloud, StartsWithoutAPoint) {
  const Cloud cloud(4, 3, true);
  EXPECT_EQ(cloud.size(), 12u);
  EXPECT_TRUE(cloud.organized());
  EXPECT_TRUE(cloud.colored());
  EXPECT_EQ(cloud.rgb.size(), 12u);
  EXPECT_TRUE(validIndices(cloud).empty());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    EXPECT_TRUE(std::isnan(cloud.x[i]) && std::isnan(cloud.y[i]) && std::isnan(cloud.z[i]));
  EXPECT_TRUE(Cloud().empty());
  EXPECT_FALSE(Cloud(5, 1, false).organized());
  EXPECT_FALSE(Cloud(5, 1, false).colored());
}

TEST(Cloud, ADroppedPointIsNone) {
  Cloud cloud = smallCloud(false);
  EXPECT_EQ(validIndices(cloud), (Indices{0, 2, 3, 5}));
  cloud.drop(2);
  EXPECT_EQ(validIndices(cloud), (Indices{0, 3, 5}));
  EXPECT_TRUE(std::isnan(cloud.y[2]) && std::isnan(cloud.z[2]));
}

TEST(Cloud, SelectedPointsComeInTheOrderAskedFor) {
  const Cloud selected = selectPoints(smallCloud(true), {5, 0, 3});
  EXPECT_EQ(selected.width, 3);
  EXPECT_EQ(selected.height, 1);
  EXPECT_EQ(selected.point(0), Eigen::Vector3f(5, 10, 3));
  EXPECT_EQ(selected.point(1), Eigen::Vector3f(0, 0, 3));
  EXPECT_EQ(selected.rgb, (std::vector<std::uint32_t>{0x010203u * 5, 0, 0x010203u * 3}));
  EXPECT_FALSE(selectPoints(smallCloud(false), {5}).colored());
}

TEST(Cloud, KeptPointsStayAtTheirPixels) {
  const Cloud kept = keepPoints(smallCloud(true), {2, 5});
  EXPECT_EQ(kept.width, 3);
  EXPECT_EQ(kept.height, 2);
  EXPECT_EQ(validIndices(kept), (Indices{2, 5}));
  EXPECT_EQ(kept.point(5), Eigen::Vector3f(5, 10, 3));
  EXPECT_EQ(kept.rgb, smallCloud(true).rgb);
}

TEST(Cloud, APartIsDecimatedWithItsColors) {
  Cloud cloud(11, 9, true);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    cloud.setPoint(i, {1.0f * (i % 11), 1.0f * (i / 11), 1});
    cloud.rgb[i] = i;
  }
  for (const int step : {1, 2, 3, 4}) {
    const PixelRectangle part{2, 1, 8, 7};
    const Cloud coarse = decimated(cloud, part, step);
    ASSERT_EQ(coarse.width, (8 + step - 1) / step);
    ASSERT_EQ(coarse.height, (7 + step - 1) / step);
    for (int row = 0; row < coarse.height; ++row)
      for (int column = 0; column < coarse.width; ++column) {
        const int i = row * coarse.width + column, from = (1 + row * step) * 11 + 2 + column * step;
        EXPECT_EQ(coarse.point(i), cloud.point(from));
        EXPECT_EQ(coarse.rgb[i], cloud.rgb[from]);
      }
  }
}
