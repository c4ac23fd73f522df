#include "tabletop_perception/train.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "scene.h"
#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

const Eigen::Vector3f BOX_SIZE(0.10f, 0.06f, 0.16f);
const Progress SILENT;

Mesh boxMesh() { return scene::box(BOX_SIZE.x(), BOX_SIZE.y(), BOX_SIZE.z()); }

/// Distance of a point from the surface of the box [m].
float distanceFromBox(const Eigen::Vector3f& p) {
  const Eigen::Vector3f beyond =
      (p - Eigen::Vector3f(0, 0, BOX_SIZE.z() / 2)).cwiseAbs() - BOX_SIZE / 2;
  const float inside = std::min(beyond.maxCoeff(), 0.0f);
  return beyond.cwiseMax(0).norm() - inside;
}

/// The message of the std::invalid_argument that `call` throws; empty if it throws none.
template <typename Call>
std::string refusalOf(Call&& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

/// What a camera sees of a mesh at a pose.
TrainingView viewOf(const Mesh& mesh, const Eigen::Isometry3d& T_view_object) {
  return {MeshRenderer(mesh).render(T_view_object, scene::SceneOptions().projection),
          T_view_object};
}

Eigen::Isometry3d standingBefore(double yaw) {
  return scene::cameraPose(0.7, 40) * scene::standing(0, 0, yaw);
}

TEST(TrainFromMesh, BoxHasEightyViewsOnItsSurface) {
  const ObjectModel model = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  ASSERT_EQ(model.views.size(), 80u);
  for (const View& view : model.views) {
    const Surface in_object = transformed(view.surface, view.T_view_object.inverse());
    EXPECT_GT(in_object.size(), 150u);
    const auto off = std::count_if(in_object.points.begin(), in_object.points.end(),
                                   [](const auto& p) { return distanceFromBox(p) > 0.001; });
    EXPECT_LT(off, 0.02 * in_object.size());  // the mean of points about an edge lies within it
    for (const auto& p : in_object.points) EXPECT_LT(distanceFromBox(p), 0.002);
    for (std::size_t i = 0; i < view.surface.size(); ++i)
      EXPECT_LT(view.surface.normals[i].dot(view.surface.points[i]), 0);  // towards the camera
    ASSERT_FALSE(view.descriptors.empty());
    EXPECT_EQ(view.descriptors[0].kind, "vfh");
    EXPECT_GT(view.T_view_object.translation().z(), 0.5);
  }
}

TEST(TrainFromMesh, ModelCoversTheMeshWithNormalsOutwards) {
  const ObjectModel model = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  EXPECT_NEAR(model.diameter, BOX_SIZE.norm(), 1e-5);
  int inwards = 0;
  for (std::size_t i = 0; i < model.surface.size(); ++i) {
    const Eigen::Vector3f& p = model.surface.points[i];
    EXPECT_LT(distanceFromBox(p), 0.001);
    if (model.surface.normals[i].dot(p - Eigen::Vector3f(0, 0, BOX_SIZE.z() / 2)) < 0) ++inwards;
  }
  EXPECT_LT(inwards, 0.001 * model.surface.size());  // normals on an edge are not defined
  const KdTree tree(model.surface.points);
  for (const float x : {-0.5f, -0.3f, 0.0f, 0.4f, 0.5f})
    for (const float y : {-0.5f, 0.0f, 0.2f, 0.5f})
      for (const float z : {0.0f, 1.0f}) {
        const Eigen::Vector3f p = BOX_SIZE.cwiseProduct(Eigen::Vector3f(x, y, z));
        EXPECT_LT(tree.nearest(p).squared_distance, 0.004 * 0.004);
      }
}

TEST(TrainFromMesh, InnerSurfacesAreLeftOut) {
  const Mesh shell =
      scene::merged({boxMesh(), scene::moved(scene::box(0.04, 0.03, 0.08), 0, 0, 0.04)});
  const ObjectModel model = trainFromMesh("shell", shell, DescriptorOptions(), SILENT);
  for (const auto& p : model.surface.points) EXPECT_LT(distanceFromBox(p), 0.001);
}

TEST(TrainFromMesh, SymmetryOfTheShapeIsKnown) {
  const ObjectModel box = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  EXPECT_EQ(box.symmetry.rotations.size(), 3u);
  EXPECT_FALSE(box.symmetry.declared);
  const ObjectModel can =
      trainFromMesh("can", scene::cylinder(0.035, 0.12), DescriptorOptions(), SILENT);
  EXPECT_GT(std::abs(can.symmetry.axis.z()), std::cos(0.02));
}

TEST(TrainFromMesh, ColoursComeFromTheVertices) {
  const Mesh mesh = scene::merged(
      {scene::painted(boxMesh(), 0xFF0000),
       scene::moved(scene::painted(scene::box(0.04, 0.04, 0.04), 0x0000FF), 0, 0, BOX_SIZE.z())});
  const ObjectModel model = trainFromMesh("tower", mesh, DescriptorOptions(), SILENT);
  ASSERT_EQ(model.colors.size(), model.surface.size());
  for (std::size_t i = 0; i < model.surface.size(); ++i) {
    const float z = model.surface.points[i].z();
    if (z < BOX_SIZE.z() - 0.003f) {
      EXPECT_EQ(model.colors[i], 0xFF0000u);
    }
    if (z > BOX_SIZE.z() + 0.003f) {
      EXPECT_EQ(model.colors[i], 0x0000FFu);
    }
  }
  EXPECT_TRUE(trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT).colors.empty());
}

TEST(TrainFromMesh, ALargeObjectFitsIntoTheImage) {
  const ObjectModel model =
      trainFromMesh("crate", scene::box(0.3, 0.25, 0.4), DescriptorOptions(), SILENT);
  for (const View& view : model.views)
    for (const auto& p : view.surface.points) {
      EXPECT_LT(std::abs(p.x() / p.z()), 319.0 / 525);
      EXPECT_LT(std::abs(p.y() / p.z()), 238.0 / 525);  // nothing reaches the border
    }
}

TEST(TrainFromMesh, SameMeshSameModel) {
  const ObjectModel a = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  const ObjectModel b = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  ASSERT_EQ(a.surface.points, b.surface.points);
  for (std::size_t i = 0; i < a.views.size(); ++i)
    ASSERT_EQ(a.views[i].descriptors[0].values, b.views[i].descriptors[0].values);
}

TEST(TrainFromMesh, EveryDistanceGivesItsViews) {
  MeshViewOptions views;
  views.distances = {1.0, 0.6, 0.6};
  const ObjectModel model = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT, views);
  ASSERT_EQ(model.views.size(), 160u);
  const Eigen::Vector3d middle(0, 0, BOX_SIZE.z() / 2);
  for (std::size_t i = 0; i < 160; ++i)
    EXPECT_NEAR((model.views[i].T_view_object * middle).norm(), i < 80 ? 0.6 : 1.0, 1e-6);
}

TEST(TrainFromMesh, NoiseIsInTheViewsAndNotInTheModel) {
  MeshViewOptions views;
  views.noise = true;
  const ObjectModel noisy = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT, views);
  const ObjectModel exact = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT);
  EXPECT_EQ(noisy.surface.points, exact.surface.points);
  ASSERT_EQ(noisy.views.size(), 80u);
  double squares = 0;
  std::size_t points = 0;
  for (const View& view : noisy.views)
    for (const auto& p : transformed(view.surface, view.T_view_object.inverse()).points) {
      squares += std::pow(distanceFromBox(p), 2);
      ++points;
    }
  const double rms = std::sqrt(squares / points);
  EXPECT_GT(rms, 0.0003);  // the mean of several pixels
  EXPECT_LT(rms, 0.0014);  // a pixel's own noise at 0.7 m
  const ObjectModel again = trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT, views);
  for (std::size_t i = 0; i < 80; ++i)
    ASSERT_EQ(noisy.views[i].surface.points, again.views[i].surface.points);
}

TEST(TrainFromMesh, ProgressGrowsToOne) {
  std::vector<double> told;
  trainFromMesh("box", boxMesh(), DescriptorOptions(), [&](double done) { told.push_back(done); });
  ASSERT_FALSE(told.empty());
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_GT(told.front(), 0);
  EXPECT_GT(told.back(), 0.9);
  EXPECT_LE(told.back(), 1);
}

TEST(TrainFromMesh, TwoMillionFacesAreLearntAsFewAre) {
  const ObjectModel fine =
      trainFromMesh("ball", scene::ball(0.05, 1416), DescriptorOptions(), SILENT);
  EXPECT_EQ(fine.origin, "mesh of 2005056 faces");
  const ObjectModel coarse =
      trainFromMesh("ball", scene::ball(0.05, 144), DescriptorOptions(), SILENT);
  EXPECT_EQ(fine.views.size(), 80u);
  EXPECT_NEAR(fine.diameter, 0.1, 1e-6);
  EXPECT_NEAR(static_cast<double>(fine.surface.size()), coarse.surface.size(),
              0.02 * coarse.surface.size());
  EXPECT_TRUE(fine.symmetry.continuous());
}

TEST(TrainFromMesh, WhatCannotBeAnObjectIsRefused) {
  const auto refusal = [](const std::string& name, const Mesh& mesh) {
    return refusalOf([&] { trainFromMesh(name, mesh, DescriptorOptions(), SILENT); });
  };
  EXPECT_NE(refusal("two words", boxMesh()).find("two words"), std::string::npos);
  EXPECT_NE(refusal("empty", Mesh()).find("no faces"), std::string::npos);
  EXPECT_NE(refusal("huge", scene::box(100, 60, 160)).find("--unit mm"), std::string::npos);
  const std::string pea = refusal("pea", scene::ball(0.006));
  EXPECT_NE(pea.find("'pea': no view shows 40 sampled points"), std::string::npos) << pea;
  MeshViewOptions near;
  near.distances = {0.7, 0.1};
  EXPECT_EQ(refusalOf([&] { trainFromMesh("box", boxMesh(), DescriptorOptions(), SILENT, near); }),
            "distances of the views must be 0.4 to 3 m, got 0.1");
  DescriptorOptions options;
  options.leaf = -1;
  EXPECT_NE(refusalOf([&] { trainFromMesh("box", boxMesh(), options, SILENT); }).find("leaf"),
            std::string::npos);
}

TEST(TrainFromViews, SurfaceIsTheUnionInTheFrameOfTheObject) {
  std::vector<TrainingView> views;
  for (const double yaw : {0.3, 2.1, 4.4}) views.push_back(viewOf(boxMesh(), standingBefore(yaw)));
  const ObjectModel model = trainFromViews("box", views, DescriptorOptions(), SILENT);
  ASSERT_EQ(model.views.size(), 3u);
  for (std::size_t i = 0; i < views.size(); ++i)
    EXPECT_TRUE(model.views[i].T_view_object.isApprox(views[i].T_view_object));
  Eigen::AlignedBox3f extent;
  for (const auto& p : model.surface.points) {
    EXPECT_LT(distanceFromBox(p), 0.0015);
    extent.extend(p);
  }
  EXPECT_LT((extent.sizes() - BOX_SIZE).cwiseAbs().maxCoeff(), 0.004);
  EXPECT_NEAR(model.diameter, BOX_SIZE.norm(), 0.005);
  EXPECT_EQ(model.origin, "3 views");
}

TEST(TrainFromViews, AViewMayBeAddedLater) {
  std::vector<TrainingView> views;
  for (const double yaw : {0.3, 2.1, 4.4}) views.push_back(viewOf(boxMesh(), standingBefore(yaw)));
  const ObjectModel begun =
      trainFromViews("box", {views[0], views[1]}, DescriptorOptions(), SILENT);
  const ObjectModel model = withView(begun, views[2]);
  checkModel(model);
  ASSERT_EQ(model.views.size(), 3u);
  EXPECT_TRUE(model.views[2].T_view_object.isApprox(views[2].T_view_object));
  EXPECT_FALSE(model.views[2].descriptors.empty());
  Eigen::AlignedBox3f extent;
  for (const auto& p : model.surface.points) {
    EXPECT_LT(distanceFromBox(p), 0.0015);
    extent.extend(p);
  }
  EXPECT_LT((extent.sizes() - BOX_SIZE).cwiseAbs().maxCoeff(), 0.004);
  EXPECT_EQ(model.origin, "3 views");
  EXPECT_THROW(withView(begun, TrainingView()), std::invalid_argument);
}

TEST(TrainFromViews, OneColourForAllPointsIsNone) {
  TrainingView view = viewOf(boxMesh(), standingBefore(0.3));
  view.cloud.rgb.assign(view.cloud.size(), 0x0000FF);
  EXPECT_TRUE(trainFromViews("box", {view}, DescriptorOptions(), SILENT).colors.empty());
  view.cloud.rgb[validIndices(view.cloud).front()] = 0x0000FE;
  EXPECT_FALSE(trainFromViews("box", {view}, DescriptorOptions(), SILENT).colors.empty());
}

TEST(TrainFromViews, OneSideTellsNothingOfSymmetry) {
  const ObjectModel model =
      trainFromViews("box", {viewOf(boxMesh(), standingBefore(0))}, DescriptorOptions(), SILENT);
  EXPECT_FALSE(model.symmetry.continuous());
  EXPECT_TRUE(model.symmetry.rotations.empty());
  EXPECT_EQ(model.origin, "1 view");
}

TEST(TrainFromViews, ViewsAllAroundShowARoundAxis) {
  const Mesh can = scene::cylinder(0.035, 0.12);
  std::vector<TrainingView> views;
  for (int i = 0; i < 6; ++i) views.push_back(viewOf(can, standingBefore(i * M_PI / 3)));
  const ObjectModel model = trainFromViews("can", views, DescriptorOptions(), SILENT);
  EXPECT_GT(std::abs(model.symmetry.axis.z()), std::cos(0.05));
}

TEST(TrainFromViews, WhatCannotBeDescribedIsRefused) {
  const auto refusal = [](const std::vector<TrainingView>& views) {
    return refusalOf([&] { trainFromViews("box", views, DescriptorOptions(), SILENT); });
  };
  const TrainingView good = viewOf(boxMesh(), standingBefore(0));
  EXPECT_NE(refusal({}).find("no view"), std::string::npos);
  EXPECT_NE(refusal({good, {Cloud(640, 480, false), Eigen::Isometry3d::Identity()}})
                .find("object 'box': view 2 of 2 has no points"),
            std::string::npos);
  const std::string small = refusal({viewOf(scene::ball(0.01), standingBefore(0))});
  EXPECT_NE(small.find("object 'box': no view shows 40 sampled points"), std::string::npos)
      << small;
}

}  // namespace
}  // namespace tabletop_perception
