#include "tabletop_perception/simulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>

#include "scene.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {
namespace {

class Simulated : public testing::Test {
 protected:
  Simulated() {
    meshes_ = {{"bracket", scene::painted(scene::bracket(), 0xC03030)},
               {"can", scene::cylinder(0.04, 0.1)},
               {"house", scene::house()}};
    for (const auto& [name, mesh] : meshes_)
      objects_.push_back(std::make_unique<TableObject>(name, mesh));
    options_.objects = 3;
  }

  SimulatedScene scene(std::uint64_t seed) const {
    Random random(seed);
    return simulateScene(objects_, options_, random);
  }

  std::map<std::string, Mesh> meshes_;
  TableObjects objects_;
  SimulationOptions options_;
};

TEST_F(Simulated, SameSeedGivesTheSameScene) {
  const auto a = scene(5), b = scene(5), other = scene(6);
  EXPECT_EQ(a.labels, b.labels);
  EXPECT_EQ(a.cloud.rgb, b.cloud.rgb);
  for (std::size_t i = 0; i < a.cloud.size(); ++i) {
    ASSERT_EQ(a.cloud.valid(i), b.cloud.valid(i));
    if (!a.cloud.valid(i)) continue;
    ASSERT_EQ(a.cloud.z[i], b.cloud.z[i]);
  }
  EXPECT_NE(a.labels, other.labels);
}

TEST_F(Simulated, ObjectsStandOnTheTableThatIsStated) {
  const auto made = scene(1);
  ASSERT_EQ(made.objects.size(), 3u);
  EXPECT_TRUE(made.plane.head<3>().isApprox(made.up, 1e-9));
  for (const auto& object : made.objects) {
    double lowest = 1;
    for (const auto& v : meshes_.at(object.name).vertices)
      lowest = std::min(lowest, made.up.dot(object.T_camera_object * v.cast<double>()));
    EXPECT_NEAR(lowest + made.plane[3], 0, 1e-3) << object.name;
  }
}

TEST_F(Simulated, VisibleShareIsThatOfTheLabels) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const auto made = scene(seed);
    for (const auto& object : made.objects) {
      const auto pixels = std::count(made.labels.begin(), made.labels.end(), object.label);
      const auto alone = validIndices(MeshRenderer(meshes_.at(object.name))
                                          .render(object.T_camera_object, options_.projection))
                             .size();
      EXPECT_EQ(object.visible_pixels, static_cast<std::size_t>(pixels));
      EXPECT_DOUBLE_EQ(object.visible, static_cast<double>(pixels) / alone);
      EXPECT_GT(object.visible, 0);
      EXPECT_LE(object.visible, 1);
    }
  }
}

TEST_F(Simulated, LabelsNameWhatTheDepthShows) {
  const auto made = scene(2);
  int on_table = 0, off_table = 0;
  for (const int i : validIndices(made.cloud)) {
    if (made.labels[i] != SimulatedScene::TABLE) continue;
    const double height =
        made.plane.head<3>().dot(made.cloud.point(i).cast<double>()) + made.plane[3];
    (std::abs(height) < 0.02 ? on_table : off_table) += 1;
  }
  EXPECT_GT(on_table, 50000);
  EXPECT_LT(off_table, 0.02 * on_table);  // the slab's sides, and outlines
}

TEST_F(Simulated, PaintedObjectsKeepTheirHue) {
  const auto made = scene(3);
  const auto bracket =
      std::find_if(made.objects.begin(), made.objects.end(),
                   [](const SimulatedObject& object) { return object.name == "bracket"; });
  ASSERT_NE(bracket, made.objects.end());
  for (std::size_t i = 0; i < made.labels.size(); ++i) {
    if (made.labels[i] != bracket->label) continue;
    const int red = made.cloud.rgb[i] >> 16 & 0xFF, green = made.cloud.rgb[i] >> 8 & 0xFF;
    ASSERT_GT(red, 2 * green);
  }
}

TEST_F(Simulated, ThePipelineFindsTableAndObjects) {
  options_.gap = 0.08;
  options_.min_pitch_deg = 45;
  const auto made = scene(4);
  const auto found = segmentScene(made.cloud, made.up, PipelineOptions());
  ASSERT_TRUE(found.table);
  EXPECT_GT(found.table->plane.head<3>().dot(made.up), std::cos(M_PI / 180));
  EXPECT_EQ(found.clusters.size(), 3u);
}

TEST_F(Simulated, TooManyObjectsAreRefusedWithTheNumberThatFits) {
  options_.objects = 60;
  try {
    scene(1);
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.rfind("only ", 0), 0u) << what;
    EXPECT_NE(what.find(" of 60 objects fit"), std::string::npos) << what;
  }
}

TEST_F(Simulated, EachObjectComesOnceBeforeAnyComesAgain) {
  std::set<std::string> names;
  for (const auto& object : scene(7).objects) names.insert(object.name);
  EXPECT_EQ(names.size(), 3u);
}

}  // namespace
}  // namespace tabletop_perception
