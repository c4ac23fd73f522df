#include "tabletop_perception/surface_color.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/train.h"

using namespace tabletop_perception;

namespace {

constexpr std::uint32_t RED = 0xC03028, BLUE = 0x3048C0, YELLOW = 0xD0B020, GREEN = 0x209040;
constexpr double TOLERANCE = 0.008;

/// A mesh whose faces have colours of their own, by the direction in which they face.
template <typename ColorOf>
Mesh paintedByFace(const Mesh& mesh, ColorOf colorOf) {
  Mesh painted;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f a = mesh.vertices[face[0]], b = mesh.vertices[face[1]],
                          c = mesh.vertices[face[2]];
    const auto first = static_cast<int>(painted.vertices.size());
    painted.faces.emplace_back(first, first + 1, first + 2);
    for (const auto& vertex : {a, b, c}) {
      painted.vertices.push_back(vertex);
      painted.colors.push_back(colorOf((b - a).cross(c - a).normalized()));
    }
  }
  return painted;
}

/// A box of three halves: its shape looks the same after each half turn, its colours do not.
Mesh carton() {
  return paintedByFace(scene::box(0.12, 0.07, 0.16), [](const Eigen::Vector3f& normal) {
    if (std::abs(normal.x()) > 0.5f) return normal.x() > 0 ? RED : YELLOW;
    if (std::abs(normal.y()) > 0.5f) return normal.y() > 0 ? GREEN : BLUE;
    return normal.z() > 0 ? YELLOW : RED;
  });
}

/// A can with a label on one side.
Mesh labelledCan() {
  return paintedByFace(scene::cylinder(0.04, 0.11), [](const Eigen::Vector3f& normal) {
    return normal.x() > 0.3f ? RED : YELLOW;
  });
}

ModelIndex indexOf(const std::vector<std::pair<std::string, Mesh>>& meshes) {
  std::vector<ObjectModel> models;
  for (const auto& [name, mesh] : meshes)
    models.push_back(trainFromMesh(name, mesh, DescriptorOptions(), {}));
  return ModelIndex(std::move(models));
}

/// Every colour as `change` makes it.
template <typename Change>
Cloud recolored(Cloud cloud, Change change) {
  for (auto& color : cloud.rgb) {
    const Rgb rgb = change(rgbOf(color)).cwiseMax(0.0f).cwiseMin(255.0f);
    color = static_cast<std::uint32_t>(rgb.x()) << 16 | static_cast<std::uint32_t>(rgb.y()) << 8 |
            static_cast<std::uint32_t>(rgb.z());
  }
  return cloud;
}

Cloud lit(const Cloud& cloud, const Rgb& light) {
  return recolored(cloud, [&](const Rgb& rgb) -> Rgb { return rgb.cwiseProduct(light); });
}

Cloud grey(const Cloud& cloud) {
  return recolored(cloud,
                   [](const Rgb& rgb) -> Rgb { return Rgb::Constant(std::floor(rgb.mean())); });
}

/// One object on a table, and its points.
struct OnTable {
  explicit OnTable(const Mesh& mesh, double yaw = 0.5)
      : scene(scene::render({{"object", mesh, scene::standing(0, 0, yaw)}})),
        truth(scene.objects[0].T_camera_object) {
    for (std::size_t i = 0; i < scene.cloud.size(); i += 7)
      if (scene.truth[i] == 2) points.push_back(scene.cloud.point(i));
  }

  std::optional<double> likeness(const ModelIndex& index, const Cloud& cloud) const {
    return likeness(index, cloud, truth);
  }

  std::optional<double> likeness(const ModelIndex& index, const Cloud& cloud,
                                 const Eigen::Isometry3d& T) const {
    const auto colored = coloredPoints(observe(cloud, std::nullopt), points, 300);
    return colorLikeness(index, 0, T, colored, TOLERANCE);
  }

  scene::SyntheticScene scene;
  Eigen::Isometry3d truth;
  std::vector<Eigen::Vector3f> points;
};

const ModelIndex& cartonIndex() {
  static const ModelIndex index = indexOf({{"carton", carton()}});
  return index;
}

/// Two brackets of the same mesh.
const ModelIndex& twins() {
  static const ModelIndex index = indexOf({{"blue", scene::painted(scene::bracket(), BLUE)},
                                           {"red", scene::painted(scene::bracket(), RED)}});
  return index;
}

Eigen::Isometry3d halfTurn() {
  return Eigen::Isometry3d(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
}

PipelineOptions options(bool color) {
  PipelineOptions options;
  options.split.enabled = false;  // a bracket has a hollow
  options.match.color = options.verify.color = color;
  return options;
}

const SceneObject* find(const Recognition& recognition, const std::string& name) {
  for (const auto& object : recognition.objects)
    if (object.name == name) return &object;
  return nullptr;
}

void expectSame(const Recognition& a, const Recognition& b) {
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    EXPECT_EQ(a.objects[i].name, b.objects[i].name);
    EXPECT_EQ(a.objects[i].score, b.objects[i].score);
    EXPECT_EQ(a.objects[i].T_camera_object.matrix(), b.objects[i].T_camera_object.matrix());
    EXPECT_EQ(a.objects[i].reason, b.objects[i].reason);
    EXPECT_EQ(a.objects[i].labels, b.objects[i].labels);
  }
}

}  // namespace

TEST(SurfaceColor, EqualColoursAreAlike) {
  const OnTable it(carton());
  EXPECT_GT(it.likeness(cartonIndex(), it.scene.cloud).value(), 0.85);
}

TEST(SurfaceColor, OtherColoursAreNot) {
  const ModelIndex red = indexOf({{"red", scene::painted(scene::house(), RED)}});
  for (const std::uint32_t other : {BLUE, YELLOW, GREEN, 0xD0D0D0u}) {
    const OnTable it(scene::painted(scene::house(), other));
    EXPECT_LT(it.likeness(red, it.scene.cloud).value(), 0.2) << std::hex << other;
  }
}

TEST(SurfaceColor, BlackIsNotWhiteThoughBothAreGrey) {
  const ModelIndex white = indexOf({{"white", scene::painted(scene::house(), 0xE0E0E0)}});
  const OnTable it(scene::painted(scene::house(), 0x0C0C0C));
  EXPECT_LT(it.likeness(white, it.scene.cloud).value(), 0.2);
}

TEST(SurfaceColor, LightMayBeDimBrightOrTinted) {
  const OnTable it(carton());
  const double plain = it.likeness(cartonIndex(), it.scene.cloud).value();
  for (const Rgb& light : {Rgb(0.4f, 0.4f, 0.4f), Rgb(1.2f, 1.2f, 1.2f), Rgb(1.1f, 1, 0.9f)})
    EXPECT_GT(it.likeness(cartonIndex(), lit(it.scene.cloud, light)).value(), plain - 0.15)
        << light.transpose();
}

TEST(SurfaceColor, ATurnedBoxLooksOtherThoughItsShapeIsTheSame) {
  const OnTable it(carton());
  const auto turned = Eigen::Isometry3d(it.truth * halfTurn());
  EXPECT_LT(it.likeness(cartonIndex(), it.scene.cloud, turned).value(), 0.5);
  const auto colored = coloredPoints(observe(it.scene.cloud, std::nullopt), it.points, 300);
  EXPECT_NEAR(bestColorLikeness(cartonIndex(), 0, turned, colored, TOLERANCE).value(),
              it.likeness(cartonIndex(), it.scene.cloud).value(), 0.05);
}

TEST(SurfaceColor, NothingIsComparedWithoutColours) {
  const OnTable it(carton());
  Cloud colorless = it.scene.cloud;
  colorless.rgb.clear();
  EXPECT_FALSE(it.likeness(cartonIndex(), colorless));
  EXPECT_FALSE(it.likeness(cartonIndex(), grey(it.scene.cloud))) << "a camera of greys alone";
  EXPECT_FALSE(it.likeness(indexOf({{"plain", scene::box(0.12, 0.07, 0.16)}}), it.scene.cloud));
  const auto elsewhere = Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1) * it.truth);
  EXPECT_FALSE(it.likeness(cartonIndex(), it.scene.cloud, elsewhere)) << "no point near it";
}

TEST(SurfaceColor, CloudsWithoutAGridHaveColoursToo) {
  const OnTable it(carton());
  const Cloud packed = selectPoints(it.scene.cloud, validIndices(it.scene.cloud));
  EXPECT_NEAR(it.likeness(cartonIndex(), packed).value(),
              it.likeness(cartonIndex(), it.scene.cloud).value(), 0.05);
}

TEST(SurfaceColor, PartOfAnObjectIsEnough) {
  OnTable it(carton());
  it.points.resize(it.points.size() / 3);
  EXPECT_GT(it.likeness(cartonIndex(), it.scene.cloud).value(), 0.85);
}

TEST(LookAlikes, AreToldApartByColourInAnyLight) {
  const auto scene = scene::render(
      {{"red", scene::painted(scene::bracket(), RED), scene::standing(0, 0.2, 2.5)},
       {"blue", scene::painted(scene::bracket(), BLUE), scene::standing(0, -0.2, 1)}});
  for (const Rgb& light : {Rgb(0.5f, 0.5f, 0.5f), Rgb(1.1f, 1, 0.85f)}) {
    const auto found = recognizeScene(lit(scene.cloud, light), scene.up, twins(), options(true));
    for (const auto& truth : scene.objects) {
      const SceneObject* object = find(found, truth.name);
      ASSERT_NE(object, nullptr) << truth.name << " in light " << light.transpose();
      const Eigen::Isometry3d off = truth.T_camera_object.inverse() * object->T_camera_object;
      EXPECT_LT(off.translation().norm(), 0.01) << truth.name;
      EXPECT_TRUE(object->evidence.agreement.color) << truth.name;
    }
  }
}

TEST(LookAlikes, AreUndecidedWithoutColour) {
  const auto scene =
      scene::render({{"red", scene::painted(scene::bracket(), RED), scene::standing(0, 0, 2.5)}});
  for (const auto& found : {recognizeScene(grey(scene.cloud), scene.up, twins(), options(true)),
                            recognizeScene(scene.cloud, scene.up, twins(), options(false))}) {
    ASSERT_EQ(found.objects.size(), 1u);
    EXPECT_EQ(found.objects[0].name, "unknown");
    EXPECT_NE(found.objects[0].reason.find("margin"), std::string::npos) << found.objects[0].reason;
  }
}

TEST(LookAlikes, AGreyInputGivesTheSameWithColourOnAndOff) {
  const auto scene =
      scene::render({{"red", scene::painted(scene::bracket(), RED), scene::standing(0, 0, 2.5)}});
  const ModelIndex plain = indexOf({{"plain", scene::bracket()}});
  Cloud colorless = scene.cloud;
  colorless.rgb.clear();
  const auto found = [&](const Cloud& cloud, const ModelIndex& index, bool color) {
    return recognizeScene(cloud, scene.up, index, options(color));
  };
  expectSame(found(colorless, twins(), true), found(colorless, twins(), false));
  expectSame(found(grey(scene.cloud), twins(), true), found(grey(scene.cloud), twins(), false));
  expectSame(found(scene.cloud, plain, true), found(scene.cloud, plain, false));
}

TEST(LookAlikes, ColoursTurnABoxAndACanTheRightWay) {
  for (const double yaw : {0.5, 0.5 + M_PI}) {
    const OnTable box(carton(), yaw);
    const auto boxes = recognizeScene(box.scene.cloud, box.scene.up, cartonIndex(), options(true));
    const SceneObject* found = find(boxes, "carton");
    ASSERT_NE(found, nullptr);
    EXPECT_LT(angleOf((box.truth.inverse() * found->T_camera_object).linear()), 0.1) << yaw;
  }
  const ModelIndex cans = indexOf({{"can", labelledCan()}});
  for (const double yaw : {3.5, 4.5}) {
    const OnTable can(labelledCan(), yaw);
    const auto found = recognizeScene(can.scene.cloud, can.scene.up, cans, options(true));
    const SceneObject* object = find(found, "can");
    ASSERT_NE(object, nullptr);
    const Eigen::Vector3d label = object->T_camera_object.linear().col(0);
    EXPECT_GT(label.dot(can.truth.linear().col(0)), std::cos(0.3)) << yaw;
  }
}
