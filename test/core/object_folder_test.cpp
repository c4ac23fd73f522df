#include "tabletop_perception/object_folder.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <numeric>
#include <sstream>

#include <gtest/gtest.h>

#include "tabletop_perception/pcd.h"
#include "trained_model.h"

using namespace tabletop_perception;
namespace fs = std::filesystem;

namespace {

double largestDistance(const std::vector<Eigen::Vector3f>& a,
                       const std::vector<Eigen::Vector3f>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max<double>(largest, (a[i] - b[i]).norm());
  return largest;
}

/// Share of two histograms that differs.
double difference(const Descriptor& a, const Descriptor& b) {
  double difference = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i)
    difference += std::abs(a.values[i] - b.values[i]);
  return difference / std::accumulate(a.values.begin(), a.values.end(), 0.0);
}

class ObjectFolder : public testing::Test {
 protected:
  ObjectFolder() {
    std::string pattern = (fs::temp_directory_path() / "object_folder_test_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~ObjectFolder() override { fs::remove_all(folder_); }

  std::string refusal() const {
    try {
      importObject(folder_);
    } catch (const std::invalid_argument& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      EXPECT_EQ(what.find(folder_.string()), 0u) << what;
      return what.substr(std::min(what.size(), folder_.string().size()));
    }
    return "was not refused";
  }

  void replaceInYaml(const std::string& old_text, const std::string& new_text) const {
    std::ifstream stream(folder_ / "object.yaml");
    std::ostringstream text;
    text << stream.rdbuf();
    auto yaml = text.str();
    ASSERT_NE(yaml.find(old_text), std::string::npos) << yaml;
    yaml.replace(yaml.find(old_text), old_text.size(), new_text);
    std::ofstream(folder_ / "object.yaml") << yaml;
  }

  fs::path folder_;
};

}  // namespace

TEST_F(ObjectFolder, GivesBackTheObjectUpToRounding) {
  auto model = trainedModel();
  StoredGrasp grasp;
  grasp.name = "top";
  grasp.T_object_gripper = Eigen::Translation3d(0.01, -0.02, 0.03) *
                           Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  grasp.width = 0.06;
  grasp.preference = 2.5;
  model.grasps = {grasp};
  exportObject(folder_, model);
  const auto back = importObject(folder_);

  ASSERT_EQ(back.grasps.size(), 1u);
  EXPECT_EQ(back.grasps[0].name, "top");
  EXPECT_TRUE(back.grasps[0].T_object_gripper.isApprox(grasp.T_object_gripper, 1e-12));
  EXPECT_EQ(back.grasps[0].width, 0.06);
  EXPECT_EQ(back.grasps[0].preference, 2.5);

  EXPECT_EQ(back.name, model.name);
  EXPECT_EQ(back.origin, model.origin);
  EXPECT_EQ(back.surface.points, model.surface.points);
  EXPECT_EQ(back.surface.normals, model.surface.normals);
  EXPECT_EQ(back.colors, model.colors);
  EXPECT_EQ(back.diameter, model.diameter);
  EXPECT_EQ(back.symmetry.center, model.symmetry.center);
  EXPECT_EQ(back.symmetry.axis, model.symmetry.axis);
  EXPECT_EQ(back.symmetry.rotations, model.symmetry.rotations);
  EXPECT_TRUE(back.symmetry.declared);
  EXPECT_EQ(back.options.leaf, 0.004);
  EXPECT_EQ(back.options.region_min_points, 20);

  ASSERT_EQ(back.views.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto &view = back.views[i], &original = model.views[i];
    EXPECT_LT((view.T_view_object.matrix() - original.T_view_object.matrix()).norm(), 5e-6);
    ASSERT_EQ(view.surface.size(), original.surface.size());
    EXPECT_LT(largestDistance(view.surface.points, original.surface.points), 5e-6);
    EXPECT_LT(largestDistance(view.surface.normals, original.surface.normals), 5e-6);
    ASSERT_EQ(view.descriptors.size(), original.descriptors.size());
    ASSERT_GE(view.descriptors.size(), 2u);
    for (std::size_t d = 0; d < view.descriptors.size(); ++d) {
      EXPECT_EQ(view.descriptors[d].kind, original.descriptors[d].kind);
      // a point on the border of two bins may change sides
      EXPECT_LT(difference(view.descriptors[d], original.descriptors[d]), 0.01);
      EXPECT_LT((view.descriptors[d].centroid - original.descriptors[d].centroid).norm(), 1e-4);
    }
  }
}

TEST_F(ObjectFolder, WithoutGraspsAsOlderOnesAreIsRead) {
  exportObject(folder_, trainedModel());
  replaceInYaml("grasps:\n  []\n", "");
  EXPECT_TRUE(importObject(folder_).grasps.empty());
}

TEST_F(ObjectFolder, WritesViewsInTheObjectsFrameWithTheCamerasPose) {
  const auto model = trainedModel();
  exportObject(folder_, model);
  const auto pcd = readPcd(folder_ / "view_0002.pcd");
  const auto camera = model.views[2].T_view_object.inverse();
  EXPECT_TRUE(pcd.T_data_sensor.isApprox(camera, 1e-5));
  const Eigen::Vector3f first = camera.cast<float>() * model.views[2].surface.points[0];
  EXPECT_LT((pcd.cloud.point(0) - first).norm(), 1e-6);
}

TEST_F(ObjectFolder, AnObjectWithoutColorsStaysWithout) {
  auto model = trainedModel();
  model.colors.clear();
  exportObject(folder_, model);
  EXPECT_TRUE(importObject(folder_).colors.empty());
}

TEST_F(ObjectFolder, IsNotWrittenOverAnother) {
  exportObject(folder_, trainedModel());
  EXPECT_THROW(exportObject(folder_, trainedModel()), std::runtime_error);
}

TEST_F(ObjectFolder, RefusesWhatIsMissingOrDamagedWithTheFilesName) {
  EXPECT_EQ(refusal(), "/object.yaml: cannot be opened: every object's folder has one");
  const auto refusal_after = [&](const std::function<void()>& damage) {
    for (const auto& file : fs::directory_iterator(folder_)) fs::remove(file);
    exportObject(folder_, trainedModel());
    damage();
    return refusal();
  };
  EXPECT_EQ(refusal_after([&] { fs::remove(folder_ / "view_0003.pcd"); }),
            "/view_0003.pcd: cannot be opened: No such file or directory");
  EXPECT_EQ(refusal_after([&] { fs::remove(folder_ / "model.pcd"); }),
            "/model.pcd: cannot be opened: No such file or directory");
  EXPECT_NE(refusal_after([&] {
              fs::resize_file(folder_ / "view_0001.pcd", 900);
            }).find("/view_0001.pcd: is cut short"),
            std::string::npos);
  EXPECT_EQ(refusal_after([&] {
              auto pcd = readPcd(folder_ / "view_0001.pcd");
              pcd.normals.clear();
              writePcd(folder_ / "view_0001.pcd", pcd);
            }),
            "/view_0001.pcd: has no normals (fields normal_x, normal_y, normal_z)");
  EXPECT_EQ(refusal_after([&] {
              auto pcd = readPcd(folder_ / "model.pcd");
              pcd.cloud.drop(5);
              writePcd(folder_ / "model.pcd", pcd);
            }),
            ": object 'egg-1' has points that are not finite");
  EXPECT_EQ(
      refusal_after([&] { replaceInYaml("declared: true", "declared: 3"); }).find("/object.yaml: "),
      0u);
  EXPECT_EQ(refusal_after([&] {
              replaceInYaml("leaf: 0.004", "leaf: 7");
            }).find("/object.yaml: descriptor.leaf must be between"),
            0u);
  EXPECT_EQ(refusal_after([&] {
              replaceInYaml("views: 4", "view: 4");
            }).find("/object.yaml: no such option: object.view"),
            0u);
  EXPECT_EQ(refusal_after([&] {
              replaceInYaml("\"egg-1\"", "\"../egg\"");
            }).find(": '../egg' cannot name an object"),
            0u);
  EXPECT_EQ(refusal_after([&] {
              std::ofstream(folder_ / "object.yaml") << "name: [1, 2";
            }).find("/object.yaml: "),
            0u);
  EXPECT_EQ(refusal_after([&] { std::ofstream(folder_ / "object.yaml") << ""; }),
            "/object.yaml: holds no keys and values");
}
