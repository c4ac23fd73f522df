#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/projection.h"

/// Tabletop scenes whose truth is known by construction. The table's frame: origin at the middle of
/// its surface, z up, x away from the camera. Metres throughout.
namespace tabletop_perception::scene {

/// Colours every vertex alike.
inline Mesh painted(Mesh mesh, std::uint32_t rgb) {
  mesh.colors.assign(mesh.vertices.size(), rgb);
  return mesh;
}

inline Mesh moved(Mesh mesh, const Eigen::Isometry3d& T_target_source) {
  for (auto& v : mesh.vertices) v = (T_target_source * v.cast<double>()).cast<float>();
  return mesh;
}

inline Mesh moved(Mesh mesh, double x, double y, double z) {
  return moved(std::move(mesh), Eigen::Isometry3d(Eigen::Translation3d(x, y, z)));
}

/// Several meshes as one; coloured only if all of them are.
inline Mesh merged(const std::vector<Mesh>& parts) {
  Mesh all;
  bool colored = true;
  for (const auto& part : parts) {
    const int offset = static_cast<int>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
    all.colors.insert(all.colors.end(), part.colors.begin(), part.colors.end());
    for (const auto& f : part.faces) all.faces.push_back(f.array() + offset);
    colored = colored && !part.colors.empty();
  }
  if (!colored) all.colors.clear();
  return all;
}

/// An upright prism over a convex outline (counter-clockwise), from z = 0 to `height`.
inline Mesh prism(const std::vector<Eigen::Vector2d>& outline, double height) {
  Mesh mesh;
  const int n = static_cast<int>(outline.size());
  for (const double z : {0.0, height})
    for (const auto& p : outline)
      mesh.vertices.push_back(Eigen::Vector3d(p.x(), p.y(), z).cast<float>());
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    mesh.faces.emplace_back(i, j, n + j);
    mesh.faces.emplace_back(i, n + j, n + i);
  }
  for (int i = 1; i + 1 < n; ++i) {
    mesh.faces.emplace_back(0, i + 1, i);
    mesh.faces.emplace_back(n, n + i, n + i + 1);
  }
  return mesh;
}

/// A box that stands on z = 0 about the z axis.
inline Mesh box(double x, double y, double z) {
  return prism({{-x / 2, -y / 2}, {x / 2, -y / 2}, {x / 2, y / 2}, {-x / 2, y / 2}}, z);
}

/// A cylinder that stands on z = 0 about the z axis.
inline Mesh cylinder(double radius, double height, int segments = 72) {
  std::vector<Eigen::Vector2d> circle;
  for (int i = 0; i < segments; ++i) {
    const double a = 2 * M_PI * i / segments;
    circle.emplace_back(radius * std::cos(a), radius * std::sin(a));
  }
  return prism(circle, height);
}

/// A ball that rests on z = 0.
inline Mesh ball(double radius, int segments = 72) {
  Mesh mesh;
  const int rings = segments / 2;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const double polar = M_PI * i / rings, around = 2 * M_PI * j / segments;
      mesh.vertices.push_back(
          (radius * Eigen::Vector3d(std::sin(polar) * std::cos(around),
                                    std::sin(polar) * std::sin(around), 1 + std::cos(polar)))
              .cast<float>());
    }
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const int a = i * segments + j, b = i * segments + (j + 1) % segments;
      mesh.faces.emplace_back(a, a + segments, b);
      mesh.faces.emplace_back(b, a + segments, b + segments);
    }
  return mesh;
}

/// An angle bracket of two unequal arms, 13 x 5.5 x 11 cm; no rotation maps it onto itself.
inline Mesh bracket() {
  return merged({box(0.13, 0.055, 0.035), moved(box(0.045, 0.055, 0.075), -0.0425, 0, 0.035)});
}

/// Two steps and a post, 12 x 10 x 14 cm; no rotation maps it onto itself.
inline Mesh steppedBlock() {
  return merged({box(0.12, 0.10, 0.04), moved(box(0.07, 0.10, 0.04), -0.025, 0, 0.04),
                 moved(box(0.04, 0.035, 0.06), -0.04, 0.0325, 0.08)});
}

/// A house whose ridge lies off its middle, with a chimney, 15 x 9 x 12 cm; no rotation maps it
/// onto itself.
inline Mesh house() {
  const Mesh lying =
      prism({{-0.045, 0}, {0.045, 0}, {0.045, 0.05}, {0.02, 0.10}, {-0.045, 0.065}}, 0.15);
  Eigen::Isometry3d upright = Eigen::Isometry3d::Identity();
  upright.translate(Eigen::Vector3d(-0.075, 0, 0));
  upright.linear() << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // the outline's y becomes up
  return merged({moved(lying, upright), moved(box(0.03, 0.03, 0.12), 0.05, -0.02, 0)});
}

/// Where something stands: on the table, turned by `yaw` about the vertical [rad].
inline Eigen::Isometry3d standing(double x, double y, double yaw) {
  return Eigen::Translation3d(x, y, 0) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
}

/// An object of a scene.
struct Placed {
  std::string name;
  Mesh mesh;                          ///< in the object's frame
  Eigen::Isometry3d T_camera_object;  ///< as it lies in the scene
};

/// What is to be rendered: an object and where it stands.
struct Standing {
  std::string name;
  Mesh mesh;
  Eigen::Isometry3d T_table_object = Eigen::Isometry3d::Identity();
};

/// How a scene is looked at.
struct SceneOptions {
  double distance = 0.9;  ///< of the camera from the middle of the table [m]
  double pitch_deg = 40;  ///< the camera looks down by this angle [deg]
  double noise = 0;       ///< standard deviation along the viewing ray [m]
  unsigned seed = 1;      ///< of the noise
  double table_x = 1.0;   ///< sides of the table; zero: there is none [m]
  double table_y = 1.4;
  Projection projection{525, 525, 319.5, 239.5, 640, 480, 1};
};

/// A rendered scene and its truth, all in the camera's frame (z forward, y down).
struct SyntheticScene {
  Cloud cloud;                       ///< organised
  std::vector<std::uint32_t> truth;  ///< per pixel: 0 nothing, 1 table, object i has i + 2
  Eigen::Vector3d up;                ///< unit, against gravity
  Eigen::Vector4d plane;             ///< of the table, unit normal up [m]
  std::vector<Placed> objects;
  Eigen::Isometry3d T_camera_table;
};

/// The table's frame as seen by a camera that looks at its origin.
inline Eigen::Isometry3d cameraPose(double distance, double pitch_deg) {
  const double pitch = pitch_deg * M_PI / 180;
  const Eigen::Vector3d forward(std::cos(pitch), 0, -std::sin(pitch));
  const Eigen::Vector3d right(0, -1, 0);
  Eigen::Isometry3d T_table_camera = Eigen::Isometry3d::Identity();
  T_table_camera.linear() << right, forward.cross(right), forward;
  T_table_camera.translation() = -distance * forward;
  return T_table_camera.inverse();
}

/// Moves every point along its viewing ray by Gaussian noise of standard deviation `sigma` [m].
inline void addAxialNoise(Cloud& cloud, double sigma, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, static_cast<float>(sigma));
  for (const int i : validIndices(cloud)) {
    const Eigen::Vector3f p = cloud.point(i);
    cloud.setPoint(i, p + p.normalized() * noise(random));
  }
}

/// Renders objects that stand on a table.
inline SyntheticScene render(const std::vector<Standing>& objects,
                             const SceneOptions& options = {}) {
  SyntheticScene scene;
  scene.T_camera_table = cameraPose(options.distance, options.pitch_deg);
  scene.up = scene.T_camera_table.linear().col(2);
  scene.plane << scene.up, -scene.up.dot(scene.T_camera_table.translation());
  scene.cloud = Cloud(options.projection.width, options.projection.height, true);
  scene.truth.assign(scene.cloud.size(), 0);

  const auto draw = [&](const Mesh& mesh, const Eigen::Isometry3d& T_camera_mesh,
                        std::uint32_t label) {
    const Cloud layer = MeshRenderer(mesh).render(T_camera_mesh, options.projection);
    for (const int i : validIndices(layer)) {
      if (scene.cloud.valid(i) && scene.cloud.point(i).norm() <= layer.point(i).norm()) continue;
      scene.cloud.setPoint(i, layer.point(i));
      scene.cloud.rgb[i] = layer.colored() ? layer.rgb[i] : 0x808080;
      scene.truth[i] = label;
    }
  };
  if (options.table_x > 0 && options.table_y > 0)
    draw(moved(painted(box(options.table_x, options.table_y, 0.02), 0xB09070), 0, 0, -0.02),
         scene.T_camera_table, 1);
  for (const auto& object : objects) {
    scene.objects.push_back(
        {object.name, object.mesh, scene.T_camera_table * object.T_table_object});
    draw(object.mesh, scene.objects.back().T_camera_object,
         static_cast<std::uint32_t>(scene.objects.size() + 1));
  }
  if (options.noise > 0) addAxialNoise(scene.cloud, options.noise, options.seed);
  return scene;
}

/// What the objects of threeObjects() look like: known by their colours, too.
constexpr std::uint32_t BRACKET_COLOR = 0xC03030, HOUSE_COLOR = 0x30A030, STEPS_COLOR = 0x3030C0;

/// Three objects without symmetry, at least 10 cm apart.
inline SyntheticScene threeObjects(const SceneOptions& options = {}) {
  return render({{"bracket", painted(bracket(), BRACKET_COLOR), standing(0.02, 0.25, 2.5)},
                 {"house", painted(house(), HOUSE_COLOR), standing(0.06, 0.0, -0.6)},
                 {"steps", painted(steppedBlock(), STEPS_COLOR), standing(0.0, -0.24, 2.4)}},
                options);
}

}  // namespace tabletop_perception::scene
