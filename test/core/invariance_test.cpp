#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "clouds.h"
#include "scene.h"
#include "tabletop_perception/pipeline.h"

using namespace tabletop_perception;

/// The same scene given otherwise has the same objects.
namespace {

/// A scene in another guise.
struct Guise {
  Cloud cloud;
  Eigen::Vector3d up;
  std::vector<int> from;  ///< the pixel of the first scene that each pixel shows, -1 for none
};

Guise unchanged(const scene::SyntheticScene& scene) {
  Guise guise{scene.cloud, scene.up, std::vector<int>(scene.cloud.size())};
  for (std::size_t i = 0; i < guise.from.size(); ++i) guise.from[i] = static_cast<int>(i);
  return guise;
}

Guise turned(const scene::SyntheticScene& scene, const Eigen::Isometry3d& T) {
  Guise guise = unchanged(scene);
  guise.cloud = clouds::turned(scene.cloud, T);
  guise.up = T.linear() * scene.up;
  return guise;
}

/// An image of which pixel (v, u) shows the scene's pixel `source(v, u)`, if there is one.
template <typename Source>
Guise resampled(const scene::SyntheticScene& scene, int width, int height, Source source) {
  Guise guise{Cloud(width, height, true), scene.up, std::vector<int>(width * height, -1)};
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const auto [from_v, from_u] = source(v, u);
      if (from_v < 0 || from_v >= scene.cloud.height || from_u < 0 || from_u >= scene.cloud.width)
        continue;
      const int i = v * width + u, j = from_v * scene.cloud.width + from_u;
      guise.from[i] = j;
      guise.cloud.setPoint(i, scene.cloud.point(j));
      guise.cloud.rgb[i] = scene.cloud.rgb[j];
    }
  return guise;
}

Guise mirrored(const scene::SyntheticScene& scene) {
  const int width = scene.cloud.width;
  Guise guise = resampled(scene, width, scene.cloud.height,
                          [&](int v, int u) { return std::pair(v, width - 1 - u); });
  for (float& x : guise.cloud.x) x = -x;
  guise.up.x() = -guise.up.x();
  return guise;
}

/// The scene's own labels of the pixels of the guise that hold a point; 0 for the others.
std::vector<std::uint32_t> labelsIn(const Guise& guise, const std::vector<std::uint32_t>& labels) {
  std::vector<std::uint32_t> mapped(guise.cloud.size(), 0);
  for (std::size_t i = 0; i < mapped.size(); ++i)
    if (guise.from[i] >= 0 && guise.cloud.valid(i)) mapped[i] = labels[guise.from[i]];
  return mapped;
}

/// Shared points over all points of two sets, both ascending.
double overlap(const Indices& a, const Indices& b) {
  Indices shared;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(shared));
  const auto both = static_cast<double>(shared.size());
  return both / (static_cast<double>(a.size() + b.size()) - both);
}

struct NamedScene {
  std::string name;
  scene::SyntheticScene scene;
};

/// Things apart, and things that touch, stand on each other and hide each other.
std::vector<NamedScene> scenes() {
  scene::SceneOptions options;
  options.noise = 0.001;
  const auto upon = [](double x, double y, double z) {
    return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
  };
  return {{"apart",
           scene::render({{"box", scene::box(0.12, 0.08, 0.15), scene::standing(0.05, 0.3, 0.7)},
                          {"can", scene::cylinder(0.035, 0.12), scene::standing(-0.05, 0.05, 0)},
                          {"ball", scene::ball(0.06), scene::standing(0.1, -0.15, 0)},
                          {"flat", scene::box(0.1, 0.2, 0.04), scene::standing(-0.1, -0.3, 0.2)}},
                         options)},
          {"crowded",
           scene::render({{"box", scene::box(0.14, 0.16, 0.08), scene::standing(0.1, 0.2, 0.5)},
                          {"on it", scene::cylinder(0.035, 0.1), upon(0.1, 0.2, 0.08)},
                          {"left", scene::box(0.06, 0.09, 0.14), scene::standing(0, 0.0, 0)},
                          {"right", scene::box(0.06, 0.09, 0.10), scene::standing(0, -0.11, 0.5)},
                          {"behind", scene::cylinder(0.05, 0.2), scene::standing(0.15, -0.05, 0)},
                          {"ball", scene::ball(0.05), scene::standing(-0.1, -0.25, 0)}},
                         options)}};
}

/// Expects that both scenes have the same objects, with and without the up direction, in the guise
/// that `change` gives them: as many, and each the same points but for 10 % at its edges.
void expectSameObjects(const std::function<Guise(const scene::SyntheticScene&)>& change) {
  static const auto all = scenes();
  for (const auto& [name, scene] : all) {
    const Guise guise = change(scene);
    for (const bool up_known : {true, false}) {
      SCOPED_TRACE(name + (up_known ? ", up known" : ", up unknown"));
      const auto segment = [&](const Cloud& cloud, const Eigen::Vector3d& up) {
        return segmentScene(cloud, up_known ? std::optional(up) : std::nullopt, PipelineOptions());
      };
      const auto before = segment(scene.cloud, scene.up);
      const auto after = segment(guise.cloud, guise.up);
      ASSERT_EQ(before.clusters.size(), scene.objects.size());
      const auto expected = clustersOf(labelsIn(guise, before.labels()));
      EXPECT_EQ(after.clusters.size(), expected.size()) << after.reason;
      for (const auto& object : expected) {
        double best = 0;
        for (const auto& found : after.clusters) best = std::max(best, overlap(object, found));
        EXPECT_GE(best, 0.9) << "object of " << object.size() << " points";
      }
    }
  }
}

}  // namespace

TEST(Invariance, ToAnotherConventionOfTheCamerasAxes) {
  Eigen::Isometry3d T_body_optical = Eigen::Isometry3d::Identity();
  T_body_optical.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // x forward, z up
  expectSameObjects([&](const auto& scene) { return turned(scene, T_body_optical); });
}

TEST(Invariance, ToTurnsOfTheFrame) {
  for (const double degrees : {5, 90, 180})
    for (const auto& axis : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0.3, -0.5)}) {
      SCOPED_TRACE(degrees);
      expectSameObjects([&](const auto& scene) {
        return turned(scene, clouds::motion(degrees, axis, Eigen::Vector3d::Zero()));
      });
    }
}

TEST(Invariance, ToAMirror) { expectSameObjects(mirrored); }

TEST(Invariance, ToAShiftOfTheImage) {
  expectSameObjects([](const scene::SyntheticScene& scene) {
    return resampled(scene, 640, 480, [](int v, int u) { return std::pair(v + 13, u - 27); });
  });
}

TEST(Invariance, ToAShiftInSpace) {
  expectSameObjects([](const scene::SyntheticScene& scene) {
    return turned(scene, Eigen::Isometry3d(Eigen::Translation3d(0.05, -0.04, 0.06)));
  });
}

TEST(Invariance, ToHalfTheResolution) {
  expectSameObjects([](const scene::SyntheticScene& scene) {
    return resampled(scene, 320, 240, [](int v, int u) { return std::pair(2 * v, 2 * u); });
  });
}

TEST(Invariance, ToAFifthOfThePixelsMissing) {
  expectSameObjects([](const scene::SyntheticScene& scene) {
    Guise guise = unchanged(scene);
    std::mt19937 random(11);
    for (const int i : validIndices(scene.cloud))
      if (random() % 5 == 0) guise.cloud.drop(i);
    return guise;
  });
}
