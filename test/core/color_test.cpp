#include "tabletop_perception/color.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/cluster.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/split.h"

using namespace tabletop_perception;

namespace {

constexpr std::uint32_t RED = 0xC03030, BLUE = 0x3030C0, GREY = 0x908C88;  // grey with a tint

ColorOptions merging() {
  ColorOptions options;
  options.enabled = true;
  return options;
}

ColorOptions splitting() {
  ColorOptions options = merging();
  options.merge = false;
  options.split = true;
  return options;
}

/// What stands on the table, and its clusters.
struct Standing {
  scene::SyntheticScene scene;
  Cloud cloud;
  std::vector<Indices> clusters;
};

Standing stand(const std::vector<scene::Standing>& items) {
  Standing result;
  result.scene = scene::render(items);
  Indices points;
  for (std::size_t i = 0; i < result.scene.truth.size(); ++i)
    if (result.scene.truth[i] >= 2) points.push_back(static_cast<int>(i));
  result.cloud = keepPoints(result.scene.cloud, points);
  result.clusters = extractClusters(result.cloud, ClusterOptions());
  return result;
}

/// Two boxes side by side whose fronts and tops are flush.
Standing flushBoxes(std::uint32_t left, std::uint32_t right) {
  return stand(
      {{"left", scene::painted(scene::box(0.1, 0.1, 0.1), left), scene::standing(0, 0.05, 0)},
       {"right", scene::painted(scene::box(0.1, 0.1, 0.1), right), scene::standing(0, -0.05, 0)}});
}

/// A low front and a high back with nothing seen between them, as of a deep bowl.
Standing frontAndBack(std::uint32_t front, std::uint32_t back) {
  return stand(
      {{"front", scene::painted(scene::box(0.01, 0.14, 0.08), front), scene::standing(-0.05, 0, 0)},
       {"back", scene::painted(scene::box(0.01, 0.14, 0.12), back), scene::standing(0.05, 0, 0)}});
}

/// A flat image of one point per pixel, all of them one cluster.
struct Image {
  Cloud cloud = Cloud(60, 40, true);
  std::vector<Indices> clusters = {Indices(60 * 40)};
  Image() {
    std::iota(clusters[0].begin(), clusters[0].end(), 0);
    for (const int i : clusters[0])
      cloud.setPoint(i, {0.002f * (i % 60), 0.002f * static_cast<float>(i / 60), 1.0f});
  }
};

}  // namespace

TEST(Color, TwoFlushBoxesOfTwoColorsAreCutWhereTheyMeet) {
  const auto boxes = flushBoxes(RED, BLUE);
  ASSERT_EQ(boxes.clusters.size(), 1u);
  ASSERT_EQ(splitClusters(boxes.cloud, boxes.clusters, SplitOptions()).size(), 1u)
      << "no hollow tells them apart";
  const auto parts = splitByColor(boxes.cloud, boxes.clusters, splitting());
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].size() + parts[1].size(), boxes.clusters[0].size());
  for (const auto& part : parts) {
    EXPECT_TRUE(std::is_sorted(part.begin(), part.end()));
    const auto left =
        std::count_if(part.begin(), part.end(), [&](int i) { return boxes.scene.truth[i] == 2; });
    const double share = static_cast<double>(left) / static_cast<double>(part.size());
    EXPECT_GT(std::max(share, 1 - share), 0.99);
  }
}

TEST(Color, TheFrontAndTheBackOfOneColorAreOneThing) {
  const auto bowl = frontAndBack(RED, RED);
  ASSERT_EQ(bowl.clusters.size(), 2u) << "they are meant to be apart in depth";
  const auto merged = mergeByColor(bowl.cloud, bowl.clusters, merging());
  ASSERT_EQ(merged.size(), 1u);
  EXPECT_EQ(merged[0].size(), bowl.clusters[0].size() + bowl.clusters[1].size());
  EXPECT_TRUE(std::is_sorted(merged[0].begin(), merged[0].end()));

  const auto different = frontAndBack(RED, BLUE);
  EXPECT_EQ(mergeByColor(different.cloud, different.clusters, merging()), different.clusters);
}

TEST(Color, ThingsOfOneColorFartherApartThanTheGapStayTwo) {
  const auto bowl = frontAndBack(RED, RED);
  ColorOptions near = merging();
  near.max_gap = 0.03;
  EXPECT_EQ(mergeByColor(bowl.cloud, bowl.clusters, near), bowl.clusters);
}

TEST(Color, GreyNeitherJoinsNorCuts) {
  const auto bowl = frontAndBack(GREY, GREY);
  EXPECT_TRUE(colorClusters(bowl.cloud, bowl.clusters, merging()).empty());
  EXPECT_EQ(mergeByColor(bowl.cloud, bowl.clusters, merging()), bowl.clusters);
  const auto boxes = flushBoxes(GREY, 0x303034);
  EXPECT_EQ(splitByColor(boxes.cloud, boxes.clusters, splitting()), boxes.clusters);
  const auto half = flushBoxes(GREY, RED);
  EXPECT_EQ(splitByColor(half.cloud, half.clusters, splitting()), half.clusters);
}

TEST(Color, RedOnBothSidesOfHueZeroIsOneColor) {
  Image image;
  for (const int i : image.clusters[0])
    image.cloud.rgb[i] = (i + i / 60) % 2 ? 0xC83030 : 0xC83048;  // hue 0 and 350
  for (const int i : image.clusters[0])
    if (i % 60 >= 30) image.cloud.rgb[i] = 0xC84830;  // hue 10
  ASSERT_EQ(colorClusters(image.cloud, image.clusters, merging()).size(), 1u);
}

TEST(Color, BrightnessIsLeftOut) {
  Image image;
  for (const int i : image.clusters[0])
    image.cloud.rgb[i] = i % 60 < 30 ? 0xC06030 : 0x603018;  // half as bright
  EXPECT_EQ(colorClusters(image.cloud, image.clusters, merging()).size(), 1u);
}

TEST(Color, PixelsBesideAStepInDepthStartNoColor) {
  Image image;
  for (const int i : image.clusters[0]) {
    const int column = i % 60;
    if (column >= 30) image.cloud.z[i] = 1.2f;
    image.cloud.rgb[i] = RED;
    if (column >= 28 && column < 32) image.cloud.rgb[i] = BLUE;  // mixed at the step
  }
  ColorOptions options = merging();
  options.min_points = 50;
  const auto colors = colorClusters(image.cloud, image.clusters, options);
  ASSERT_EQ(colors.size(), 2u) << "a red one on each side, none of the blue rim";
  for (const auto& color : colors)
    for (const int i : color) EXPECT_EQ(image.cloud.rgb[i], RED);
}

TEST(Color, SmallPatchesAreDropped) {
  Image image;
  for (const int i : image.clusters[0]) image.cloud.rgb[i] = RED;
  for (int row = 10; row < 20; ++row)
    for (int column = 10; column < 20; ++column) image.cloud.rgb[row * 60 + column] = BLUE;
  EXPECT_EQ(colorClusters(image.cloud, image.clusters, merging()).size(), 1u);
  ColorOptions fine = merging();
  fine.min_points = 50;
  EXPECT_EQ(colorClusters(image.cloud, image.clusters, fine).size(), 2u);
}

TEST(Color, WithoutColorWithoutAGridOrSwitchedOffNothingChanges) {
  ColorOptions all = merging();
  all.split = true;
  const auto boxes = flushBoxes(RED, BLUE);
  const auto bowl = frontAndBack(RED, RED);
  for (const auto* standing : {&boxes, &bowl}) {
    Cloud colorless = standing->cloud;
    colorless.rgb.clear();
    EXPECT_EQ(colorCorrected(colorless, standing->clusters, all), standing->clusters);
    EXPECT_EQ(colorCorrected(standing->cloud, standing->clusters, ColorOptions()),
              standing->clusters);
    EXPECT_NE(colorCorrected(standing->cloud, standing->clusters, all), standing->clusters);
    const Cloud packed = selectPoints(standing->cloud, standing->clusters[0]);
    const std::vector<Indices> one{validIndices(packed)};
    EXPECT_EQ(colorCorrected(packed, one, all), one);
  }
  EXPECT_TRUE(colorCorrected(boxes.cloud, {}, all).empty());
}

TEST(Color, TheSegmentationUsesItWhereWantedAndPossible) {
  const auto boxes = flushBoxes(RED, BLUE);
  PipelineOptions plain, colored;
  colored.color = splitting();
  const auto without = segmentScene(boxes.scene.cloud, boxes.scene.up, plain).clusters;
  EXPECT_EQ(without.size(), 1u);
  EXPECT_EQ(segmentScene(boxes.scene.cloud, boxes.scene.up, colored).clusters.size(), 2u);
  Cloud colorless = boxes.scene.cloud;
  colorless.rgb.clear();
  EXPECT_EQ(segmentScene(colorless, boxes.scene.up, colored).clusters, without);
}

TEST(Color, OptionsOutOfRangeAreRefused) {
  ColorOptions options;
  options.min_cover = 2;
  EXPECT_THROW(mergeByColor(Cloud(), {}, options), std::invalid_argument);
}
