#include "tabletop_perception/symmetry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>

#include "scene.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/mesh.h"

namespace tabletop_perception {
namespace {

/// Random points of a mesh, evenly by area, thinned to one in 3 mm.
Surface sampled(const Mesh& mesh, double noise = 0) {
  std::vector<double> area_up_to;
  double area = 0;
  for (const auto& f : mesh.faces) {
    const Eigen::Vector3f a = mesh.vertices[f[0]];
    area += (mesh.vertices[f[1]] - a).cross(mesh.vertices[f[2]] - a).norm() / 2;
    area_up_to.push_back(area);
  }
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share;
  std::normal_distribution<float> error(0, static_cast<float>(noise));
  Surface surface;
  for (int i = 0; i < 40000; ++i) {
    const auto f = std::lower_bound(area_up_to.begin(), area_up_to.end(), area * share(random)) -
                   area_up_to.begin();
    const auto& face = mesh.faces[f];
    double u = share(random), v = share(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Eigen::Vector3f a = mesh.vertices[face[0]];
    const Eigen::Vector3f b = mesh.vertices[face[1]] - a, c = mesh.vertices[face[2]] - a;
    const Eigen::Vector3f normal = b.cross(c).normalized();
    surface.points.push_back(a + static_cast<float>(u) * b + static_cast<float>(v) * c +
                             error(random) * normal);
    surface.normals.push_back(normal);
  }
  return downsampled(surface, 0.003);
}

/// Number of symmetries that turn by `degrees`.
int turnsBy(const Symmetry& symmetry, double degrees) {
  return static_cast<int>(std::count_if(symmetry.rotations.begin(), symmetry.rotations.end(),
                                        [degrees](const Eigen::Matrix3d& r) {
                                          return std::abs(angleOf(r) * 180 / M_PI - degrees) < 5;
                                        }));
}

bool alongZ(const Eigen::Vector3d& axis) { return std::abs(axis.z()) > std::cos(M_PI / 180); }

/// The mesh without its faces above a height.
Mesh cutOff(Mesh mesh, float height) {
  const auto above = [&](const Eigen::Vector3i& f) {
    return mesh.vertices[f[0]].z() + mesh.vertices[f[1]].z() + mesh.vertices[f[2]].z() > 3 * height;
  };
  mesh.faces.erase(std::remove_if(mesh.faces.begin(), mesh.faces.end(), above), mesh.faces.end());
  return mesh;
}

Mesh bowl() { return cutOff(scene::ball(0.08), 0.081f); }

Mesh mug() {
  return scene::merged({cutOff(scene::cylinder(0.04, 0.09), 0.089f),
                        scene::moved(scene::box(0.035, 0.012, 0.06), 0.055, 0, 0.015)});
}

TEST(DetectSymmetry, CylinderIsRoundAndTurnsOver) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::cylinder(0.04, 0.12)));
  EXPECT_TRUE(alongZ(symmetry.axis));
  ASSERT_EQ(symmetry.rotations.size(), 1u);
  EXPECT_NEAR((symmetry.rotations[0] * symmetry.axis).dot(symmetry.axis), -1, 1e-6);
  EXPECT_LT((symmetry.center - Eigen::Vector3d(0, 0, 0.06)).norm(), 0.001);
}

TEST(DetectSymmetry, CylinderIsRoundWhenItsExtentsAreEqual) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::cylinder(0.04, 0.07)));
  EXPECT_TRUE(alongZ(symmetry.axis));
}

TEST(DetectSymmetry, NoiseDoesNotHideARoundAxis) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::cylinder(0.04, 0.12), 0.001));
  EXPECT_TRUE(alongZ(symmetry.axis));
}

TEST(DetectSymmetry, BowlIsRoundButDoesNotTurnOver) {
  const Symmetry symmetry = detectSymmetry(sampled(bowl()));
  EXPECT_TRUE(alongZ(symmetry.axis));
  EXPECT_TRUE(symmetry.rotations.empty());
}

TEST(DetectSymmetry, BoxHasThreeHalfTurns) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::box(0.10, 0.06, 0.20)));
  EXPECT_FALSE(symmetry.continuous());
  EXPECT_EQ(symmetry.rotations.size(), 3u);
  EXPECT_EQ(turnsBy(symmetry, 180), 3);
  EXPECT_LT((symmetry.center - Eigen::Vector3d(0, 0, 0.10)).norm(), 0.001);
}

TEST(DetectSymmetry, SquarePrismHasQuarterTurnsAboutItsAxis) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::box(0.06, 0.06, 0.20)));
  EXPECT_FALSE(symmetry.continuous());
  EXPECT_EQ(symmetry.rotations.size(), 7u);
  EXPECT_EQ(turnsBy(symmetry, 180), 5);
  ASSERT_EQ(turnsBy(symmetry, 90), 2);
  for (const auto& rotation : symmetry.rotations) {
    const Eigen::AngleAxisd turn(rotation);
    if (turn.angle() < 2) {
      EXPECT_TRUE(alongZ(turn.axis()));
    }
  }
}

TEST(DetectSymmetry, CubeHasTwentyThreeTurns) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::box(0.08, 0.08, 0.08)));
  EXPECT_EQ(symmetry.rotations.size(), 23u);
  EXPECT_EQ(turnsBy(symmetry, 180), 9);
  EXPECT_EQ(turnsBy(symmetry, 120), 8);
  EXPECT_EQ(turnsBy(symmetry, 90), 6);
}

TEST(DetectSymmetry, HexagonalPrismIsNotRound) {
  const Symmetry symmetry = detectSymmetry(sampled(scene::cylinder(0.04, 0.10, 6)));
  EXPECT_FALSE(symmetry.continuous());
  EXPECT_EQ(symmetry.rotations.size(), 11u);
}

TEST(DetectSymmetry, AsymmetricShapesHaveNone) {
  for (const Mesh& mesh : {scene::bracket(), scene::steppedBlock(), scene::house(), mug()}) {
    const Symmetry symmetry = detectSymmetry(sampled(mesh));
    EXPECT_FALSE(symmetry.continuous());
    EXPECT_TRUE(symmetry.rotations.empty());
  }
}

TEST(DetectSymmetry, MovingTheShapeMovesItsAxis) {
  Eigen::Isometry3d T(Eigen::Translation3d(0.3, -0.2, 0.9));
  T.rotate(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, -2, 0.5).normalized()));
  const Symmetry symmetry = detectSymmetry(sampled(scene::moved(scene::cylinder(0.04, 0.12), T)));
  EXPECT_GT(std::abs(symmetry.axis.dot(T.linear().col(2))), std::cos(M_PI / 180));
  EXPECT_LT((symmetry.center - T * Eigen::Vector3d(0, 0, 0.06)).norm(), 0.001);
}

TEST(DetectSymmetry, TooFewPointsTellNothing) {
  EXPECT_FALSE(detectSymmetry(Surface()).continuous());
  EXPECT_TRUE(detectSymmetry(Surface()).rotations.empty());
}

std::filesystem::path dataFolder() {
  if (const char* folder = std::getenv("TABLETOP_DATA")) return folder;
  return std::filesystem::path(PROJECT_DIR) / "../shared/data";
}

/// The expectations are those of models_info.json beside the meshes. Left out are the mustard
/// bottle, which the file calls asymmetric for its print though its shape has a half turn, the
/// potted meat can (nearly a half turn) and the foam brick (its underside is hollow).
TEST(DetectSymmetry, RealObjectsHaveTheSymmetryOfTheirDescription) {
  const std::filesystem::path models = dataFolder() / "models";
  if (!std::filesystem::exists(models)) GTEST_SKIP() << "no meshes in " << models;
  const auto symmetryOf = [&](const std::string& name) {
    return detectSymmetry(sampled(readMesh(models / name / "mesh.ply", 1)));
  };
  for (const char* can : {"002_master_chef_can", "005_tomato_soup_can", "024_bowl"})
    EXPECT_TRUE(alongZ(symmetryOf(can).axis)) << can;
  for (const char* box : {"003_cracker_box", "004_sugar_box", "009_gelatin_box"}) {
    const Symmetry symmetry = symmetryOf(box);
    EXPECT_FALSE(symmetry.continuous()) << box;
    EXPECT_EQ(symmetry.rotations.size(), 3u) << box;
    EXPECT_EQ(turnsBy(symmetry, 180), 3) << box;
  }
  for (const char* thing : {"011_banana", "025_mug", "035_power_drill"}) {
    const Symmetry symmetry = symmetryOf(thing);
    EXPECT_FALSE(symmetry.continuous()) << thing;
    EXPECT_TRUE(symmetry.rotations.empty()) << thing;
  }
}

TEST(DeclaredSymmetry, WordsNameAxesAndHalfTurns) {
  const Eigen::Vector3d center(0.1, 0.2, 0.3);
  EXPECT_EQ(declaredSymmetry("axis y", center).axis, Eigen::Vector3d::UnitY());
  EXPECT_TRUE(declaredSymmetry("axis y", center).rotations.empty());
  const Symmetry half = declaredSymmetry("half x", center);
  ASSERT_EQ(half.rotations.size(), 1u);
  EXPECT_TRUE((half.rotations[0] * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_TRUE((half.rotations[0] * Eigen::Vector3d::UnitY()).isApprox(-Eigen::Vector3d::UnitY()));
  EXPECT_EQ(declaredSymmetry("box", center).rotations.size(), 3u);
  const Symmetry none = declaredSymmetry("none", center);
  EXPECT_FALSE(none.continuous());
  EXPECT_TRUE(none.rotations.empty());
  EXPECT_TRUE(none.declared);
  EXPECT_EQ(none.center, center);
}

TEST(DeclaredSymmetry, OtherWordsAreRefusedByName) {
  for (const char* words : {"", "axis", "axis w", "round", "Box"}) {
    try {
      declaredSymmetry(words, Eigen::Vector3d::Zero());
      ADD_FAILURE() << "accepted \"" << words << "\"";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find('"' + std::string(words) + '"'), std::string::npos);
    }
  }
}

TEST(SymmetryMotions, IdentityComesFirstAndTheCenterStays) {
  const Eigen::Vector3d center(0.1, 0.2, 0.3);
  Symmetry symmetry = declaredSymmetry("axis z", center);
  symmetry.rotations = declaredSymmetry("half x", center).rotations;
  const auto motions = symmetryMotions(symmetry, 8);
  ASSERT_EQ(motions.size(), 16u);
  EXPECT_TRUE(motions[0].isApprox(Eigen::Isometry3d::Identity()));
  for (const auto& motion : motions) EXPECT_TRUE((motion * center).isApprox(center));
  EXPECT_NEAR(angleOf(motions[1].linear()), M_PI / 4, 1e-9);
  EXPECT_EQ(symmetryMotions(Symmetry()).size(), 1u);
  EXPECT_THROW(symmetryMotions(symmetry, 0), std::invalid_argument);
}

TEST(SamePose, TellsPosesApartThatLookDifferent) {
  const Eigen::Isometry3d T = Eigen::Translation3d(0.1, 0, 0.8) *
                              Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized());
  const auto turned = [&](double angle, const Eigen::Vector3d& axis) {
    return Eigen::Isometry3d(T * Eigen::AngleAxisd(angle, axis));
  };
  const auto same = [&](const char* words, const Eigen::Isometry3d& other) {
    return samePose(declaredSymmetry(words, Eigen::Vector3d::Zero()), T, other, 0.002, 0.02);
  };
  EXPECT_TRUE(same("none", turned(0.01, Eigen::Vector3d::UnitY())));
  EXPECT_FALSE(same("none", turned(0.03, Eigen::Vector3d::UnitY())));
  EXPECT_FALSE(same("none", Eigen::Translation3d(0, 0.003, 0) * T));
  EXPECT_FALSE(same("none", turned(M_PI, Eigen::Vector3d::UnitZ())));
  EXPECT_TRUE(same("half z", turned(M_PI, Eigen::Vector3d::UnitZ())));
  EXPECT_FALSE(same("half z", turned(M_PI / 2, Eigen::Vector3d::UnitZ())));
  EXPECT_TRUE(same("axis z", turned(1.3, Eigen::Vector3d::UnitZ())));
  EXPECT_FALSE(same("axis z", turned(0.03, Eigen::Vector3d::UnitX())));
  EXPECT_FALSE(same("axis z", turned(M_PI, Eigen::Vector3d::UnitX())));
}

TEST(CanonicalPose, IsTheSameForAllPosesThatLookAlike) {
  const Eigen::Vector3d center(0.01, 0.02, 0.03);
  const Eigen::Isometry3d T = Eigen::Translation3d(0.1, 0, 0.8) *
                              Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized());
  const Eigen::Matrix3d reference =
      Eigen::AngleAxisd(0.9, Eigen::Vector3d(-1, 2, 0.5).normalized()).toRotationMatrix();
  for (const char* words : {"none", "half x", "box", "axis y"}) {
    Symmetry symmetry = declaredSymmetry(words, center);
    if (symmetry.continuous()) symmetry.rotations = declaredSymmetry("half x", center).rotations;
    const auto canonical = canonicalPose(symmetry, T, reference);
    EXPECT_TRUE(samePose(symmetry, T, canonical, 1e-9, 1e-6)) << words;
    double least = angleOf(reference.transpose() * canonical.linear());
    for (const auto& motion : symmetryMotions(symmetry, 36)) {
      const Eigen::Isometry3d alike = T * motion;
      EXPECT_TRUE(canonicalPose(symmetry, alike, reference).isApprox(canonical, 1e-9)) << words;
      EXPECT_GE(angleOf(reference.transpose() * alike.linear()), least - 1e-9) << words;
    }
  }
}

}  // namespace
}  // namespace tabletop_perception
