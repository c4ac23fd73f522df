#include "tabletop_perception/projection.h"

#include <random>

#include <gtest/gtest.h>

#include "clouds.h"
#include "scene.h"

using namespace tabletop_perception;

namespace {

void expectSame(const Projection& a, const Projection& b) {
  EXPECT_NEAR(a.fx, b.fx, 0.5);
  EXPECT_NEAR(a.fy, b.fy, 0.5);
  EXPECT_NEAR(a.cx, b.cx, 0.2);
  EXPECT_NEAR(a.cy, b.cy, 0.2);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.forward, b.forward);
}

scene::SyntheticScene seenThrough(const Projection& projection) {
  scene::SceneOptions options;
  options.projection = projection;
  options.noise = 0.002;
  return scene::threeObjects(options);
}

const Projection UNEVEN{430, 410, 205.5, 140.25, 400, 300, 1};

}  // namespace

TEST(Projection, IsFittedToTheCloud) {
  const auto fitted = fitProjection(seenThrough(UNEVEN).cloud);
  ASSERT_TRUE(fitted) << fitted.reason;
  expectSame(*fitted, UNEVEN);
}

TEST(Projection, IsFittedInCamerasThatLookAlongNegativeZ) {
  const Cloud cloud =
      clouds::turned(seenThrough(UNEVEN).cloud, clouds::motion(180, {1, 0, 0}, {0, 0, 0}));
  const auto fitted = fitProjection(cloud);
  ASSERT_TRUE(fitted) << fitted.reason;
  expectSame(*fitted, {-430, 410, 205.5, 140.25, 400, 300, -1});
  for (const int i : {20000, 40000, 60000}) {
    if (!cloud.valid(i)) continue;
    const Eigen::Vector2d pixel = fitted->pixel(cloud.point(i).cast<double>());
    EXPECT_NEAR(pixel.x(), i % 400, 0.2);
    EXPECT_NEAR(pixel.y(), i / 400, 0.2);
  }
}

TEST(Projection, NeedsAGrid) {
  const auto none = fitProjection(clouds::unorganised(seenThrough(UNEVEN).cloud));
  ASSERT_FALSE(none);
  EXPECT_EQ(none.reason, "the cloud is unorganised");
}

TEST(Projection, NeedsPoints) {
  EXPECT_EQ(fitProjection(Cloud(400, 300, false)).reason, "too few points to fit a camera to");
  EXPECT_EQ(fitProjection(Cloud(0, 2, false)).reason, "too few points to fit a camera to");
  Cloud few(40, 30, false);
  few.setPoint(3, {0.1f, 0.2f, 1});
  EXPECT_EQ(fitProjection(few).reason, "too few points to fit a camera to");
}

TEST(Projection, IsNoneWhereThePointsAreNotThoseOfAPinholeCamera) {
  Cloud shuffled(60, 50, false);
  const auto points = clouds::randomPoints(3000, 0.5f, 1);
  for (std::size_t i = 0; i < shuffled.size(); ++i)
    shuffled.setPoint(i, points[i] + Eigen::Vector3f(0, 0, 1));
  const auto none = fitProjection(shuffled);
  ASSERT_FALSE(none);
  EXPECT_NE(none.reason.find("points miss their pixels by"), std::string::npos) << none.reason;

  // Turned into another frame a cloud is not a camera's any more.
  const auto turned = fitProjection(
      clouds::turned(seenThrough(UNEVEN).cloud, clouds::motion(60, {0, 1, 0}, {0, 0, 1})));
  EXPECT_FALSE(turned);
  EXPECT_FALSE(turned.reason.empty());
}

TEST(Projection, PointsOnBothSidesOfTheCameraAreNoView) {
  Cloud cloud = seenThrough(UNEVEN).cloud;
  for (std::size_t i = 0; i < cloud.size(); i += 2)
    if (cloud.valid(i)) cloud.setPoint(i, -cloud.point(i));
  EXPECT_FALSE(fitProjection(cloud));
}
