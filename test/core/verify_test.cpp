#include "tabletop_perception/verify.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

/// A scene, the model that is looked for in it, and the cluster that is held against it.
struct Fixture {
  /// `target`: index of the object that the cluster shows.
  Fixture(const scene::SyntheticScene& scene, std::size_t target, const Mesh& model_mesh)
      : cloud(scene.cloud),
        projection(scene::SceneOptions().projection),
        truth(scene.objects[target].T_camera_object) {
    index = ModelIndex({views::modelOf("model", model_mesh, {})});
    Indices own;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      if (scene.truth[i] == target + 2) own.push_back(static_cast<int>(i));
    cluster = views::sampled(selectPoints(cloud, own));
    table.plane = scene.plane;
  }

  Verification verify(const Eigen::Isometry3d& T) const {
    return verify(T, &table, VerifyOptions());
  }

  Verification verify(const Eigen::Isometry3d& T, const Table* on,
                      const VerifyOptions& options) const {
    return verifyPose(index, 0, T, {cluster}, observe(cloud, on, projection), options);
  }

  Cloud cloud;
  std::optional<Projection> projection;
  Eigen::Isometry3d truth;
  ModelIndex index;
  Surface cluster;
  Table table;
};

scene::Standing standing(const Mesh& mesh, double x, double y, double yaw) {
  return {"object", mesh, scene::standing(x, y, yaw)};
}

const Fixture& house() {
  static const Fixture fixture(scene::render({standing(scene::house(), 0, 0, 0.4)}), 0,
                               scene::house());
  return fixture;
}

void expectSharesAddUp(const Verification& v) {
  EXPECT_NEAR(v.agreement.visible + v.agreement.hidden + v.agreement.violation, 1, 1e-9);
  for (const double share : {v.agreement.explained, v.agreement.visible, v.agreement.hidden,
                             v.agreement.violation, v.score}) {
    EXPECT_GE(share, 0);
    EXPECT_LE(share, 1);
  }
}

}  // namespace

TEST(Verify, TheRightPoseScoresHigh) {
  const auto right = house().verify(house().truth);
  expectSharesAddUp(right);
  EXPECT_EQ(right.reason, "");
  EXPECT_GT(right.score, 0.85);
  EXPECT_GT(right.agreement.explained, 0.97);
  EXPECT_GT(right.agreement.visible, 0.9);
  EXPECT_LT(right.agreement.violation, 0.05);
  EXPECT_LT(right.sink, 0.001);
  EXPECT_LT(right.agreement.fitness, 0.003);
}

TEST(Verify, TheScoreFallsWithTheErrorOfThePose) {
  double last = house().verify(house().truth).score;
  for (const double shift : {0.005, 0.01, 0.02, 0.04}) {
    const auto off = house().verify(Eigen::Translation3d(shift, 0, 0) * house().truth);
    expectSharesAddUp(off);
    EXPECT_LT(off.score, last) << shift;
    last = off.score;
  }
  EXPECT_LT(last, 0.3);
}

TEST(Verify, APoseThatDoesNotExplainTheClusterIsRefused) {
  const auto off = house().verify(Eigen::Translation3d(0.05, 0, 0) * house().truth);
  EXPECT_EQ(off.reason.find("the model explains 0."), 0u) << off.reason;
  EXPECT_NE(off.reason.find("of the cluster, limit 0.70"), std::string::npos) << off.reason;
  const auto far = house().verify(Eigen::Translation3d(1, 0, 0) * house().truth);
  EXPECT_EQ(far.agreement.explained, 0);
  EXPECT_EQ(far.score, 0);
  EXPECT_EQ(far.reason, "the model explains 0.00 of the cluster, limit 0.70");
}

TEST(Verify, APoseThatWouldHideWhatTheCameraSawIsRefused) {
  // A short block lies where one end of a long block would: it explains all of the short one.
  const Mesh long_block = scene::moved(scene::box(0.06, 0.30, 0.08), 0, 0.09, 0);
  const Fixture fixture(scene::render({standing(scene::box(0.06, 0.12, 0.08), 0, 0, 0)}), 0,
                        long_block);
  const auto wrong = fixture.verify(fixture.truth);
  EXPECT_GT(wrong.agreement.explained, 0.9);
  EXPECT_NEAR(wrong.agreement.violation, 0.6,
              0.1);  // 18 of 30 cm, less its foot, for which the table is
  EXPECT_NE(wrong.reason.find("of the model is where the camera saw through, limit 0.25"),
            std::string::npos)
      << wrong.reason;
}

TEST(Verify, WhatSomethingNearerHidesIsNoViolation) {
  const auto scene = scene::render({standing(scene::house(), 0.05, 0, 0.4),
                                    standing(scene::box(0.03, 0.08, 0.15), -0.12, 0.03, 0)});
  const Fixture fixture(scene, 0, scene::house());
  const auto occluded = fixture.verify(fixture.truth);
  expectSharesAddUp(occluded);
  EXPECT_GT(occluded.agreement.hidden, 0.2);
  EXPECT_LT(occluded.agreement.violation, 0.05);
  EXPECT_EQ(occluded.reason, "");
}

TEST(Verify, PixelsWithoutDepthAreNoViolation) {
  Fixture fixture = house();
  const auto whole = fixture.verify(fixture.truth);
  for (std::size_t i = 0; i < fixture.cloud.size(); i += 2) fixture.cloud.drop(i);
  const auto holed = fixture.verify(fixture.truth);
  expectSharesAddUp(holed);
  EXPECT_NEAR(holed.agreement.hidden, (1 + whole.agreement.hidden) / 2, 0.1);
  EXPECT_NEAR(holed.agreement.visible, whole.agreement.visible / 2, 0.1);
  EXPECT_LT(holed.agreement.violation, 0.05);
  EXPECT_NEAR(holed.score, whole.score, 0.05);
}

TEST(Verify, WithoutAProjectionFreeSpaceIsLeftOut) {
  Fixture fixture = house();
  fixture.projection.reset();
  const auto right = fixture.verify(fixture.truth);
  expectSharesAddUp(right);
  EXPECT_EQ(right.reason, "");
  EXPECT_GT(right.agreement.visible, 0.8);
  EXPECT_EQ(right.agreement.violation, 0);
  fixture.cloud = clouds::unorganised(fixture.cloud);
  EXPECT_EQ(fixture.verify(fixture.truth).score, right.score);
}

TEST(Verify, AModelThatReachesIntoTheTableIsRefused) {
  // Half of a tall block stands out of the table, as a low block would.
  const Fixture fixture(scene::render({standing(scene::box(0.08, 0.10, 0.06), 0, 0, 0.3)}), 0,
                        scene::moved(scene::box(0.08, 0.10, 0.12), 0, 0, -0.06));
  const auto sunk = fixture.verify(fixture.truth);
  EXPECT_NEAR(sunk.sink, 0.06, 0.002);
  EXPECT_NE(sunk.reason.find("m into the table, limit 0.020"), std::string::npos) << sunk.reason;
  const auto without_table = fixture.verify(fixture.truth, nullptr, VerifyOptions());
  EXPECT_EQ(without_table.sink, 0);
}

TEST(Verify, TurnsWithTheSceneIntoACameraThatLooksAlongNegativeZ) {
  const Eigen::Isometry3d T = clouds::motion(180, {1, 0, 0}, {0, 0, 0});
  Fixture turned = house();
  turned.cloud = clouds::turned(turned.cloud, T);
  turned.cluster = transformed(turned.cluster, T);
  turned.table.plane.head<3>() = T.linear() * house().table.plane.head<3>();
  turned.projection->fx *= -1;
  turned.projection->forward = -1;
  for (const double shift : {0.0, 0.03}) {
    const Eigen::Isometry3d pose = Eigen::Translation3d(shift, 0, 0) * house().truth;
    const auto there = turned.verify(T * pose), here = house().verify(pose);
    EXPECT_NEAR(there.score, here.score, 0.02);
    EXPECT_NEAR(there.agreement.visible, here.agreement.visible, 0.03);
    EXPECT_NEAR(there.agreement.violation, here.agreement.violation, 0.03);
  }
}

TEST(Verify, OptionsOutOfRangeAreRefused) {
  VerifyOptions options;
  options.min_score = 2;
  EXPECT_EQ(clouds::refusalOf([&] { house().verify(house().truth, &house().table, options); }),
            "verify.min_score must be between 0 and 1, got 2");
}

TEST(Verify, TheProbabilityFollowsTheEvidence) {
  Evidence good;
  good.agreement.explained = 0.98;
  good.agreement.fitness = 0.0015;
  good.agreement.visible = 0.8;
  good.rms = 0.001;
  good.area = 0.015;
  const double sure = probabilityOf(good);
  EXPECT_GT(sure, 0.9);
  EXPECT_LT(sure, 1);
  Evidence less = good;
  less.agreement.explained = 0.7;
  EXPECT_LT(probabilityOf(less), sure);
  Evidence seen_through = good;
  seen_through.agreement.violation = 0.2;
  EXPECT_LT(probabilityOf(seen_through), sure);
  Evidence fragment = good;
  fragment.agreement.visible = 0.16;
  EXPECT_LE(probabilityOf(fragment), sure);
  Evidence off = good;
  off.rms = 0.003;
  EXPECT_LT(probabilityOf(off), 0.5) << "3 mm off everywhere";
  Evidence alike = good;
  alike.agreement.color = 0.9;
  EXPECT_EQ(probabilityOf(alike), sure) << "no more sure than a thing whose colours are not known";
  Evidence unlike = good;
  unlike.agreement.color = 0.1;
  EXPECT_LT(probabilityOf(unlike), 0.5);
  Evidence turned = good;
  turned.turn = 0.5;
  EXPECT_EQ(probabilityOf(turned), sure / 2);
  EXPECT_LT(probabilityOf(Evidence()), 1e-6) << "nothing explained, nothing seen";
}

TEST(Verify, EveryTermOfTheScoreHasAName) {
  EXPECT_EQ(static_cast<std::size_t>(scoreTerms(Evidence()).size()), scoreTermNames().size());
  EXPECT_TRUE(scoreTerms(Evidence()).allFinite());
}
