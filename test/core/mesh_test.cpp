#include "tabletop_perception/mesh.h"

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>

namespace tabletop_perception {
namespace {

constexpr Projection CAMERA{525, 525, 319.5, 239.5, 640, 480, 1};

/// The corners of a box about the origin; bit 0, 1, 2 of the index tell the side in x, y, z.
Mesh boxMesh(const Eigen::Vector3f& size) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.vertices.emplace_back((corner & 1 ? 0.5f : -0.5f) * size.x(),
                               (corner & 2 ? 0.5f : -0.5f) * size.y(),
                               (corner & 4 ? 0.5f : -0.5f) * size.z());
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

Mesh sphereMesh(float radius, int rings, int segments) {
  Mesh mesh;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const double polar = M_PI * i / rings, around = 2 * M_PI * j / segments;
      mesh.vertices.emplace_back(radius * std::sin(polar) * std::cos(around),
                                 radius * std::sin(polar) * std::sin(around),
                                 radius * std::cos(polar));
    }
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const int a = i * segments + j, b = i * segments + (j + 1) % segments;
      mesh.faces.emplace_back(a, a + segments, b);
      mesh.faces.emplace_back(b, a + segments, b + segments);
    }
  return mesh;
}

Eigen::Isometry3d ahead(double distance) {
  return Eigen::Isometry3d(Eigen::Translation3d(0, 0, distance));
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

class MeshFile : public testing::Test {
 protected:
  MeshFile() { std::filesystem::create_directories(folder_); }
  ~MeshFile() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("mesh_test_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

const std::string TETRAHEDRON_PLY =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 255 0 0\n0.1 0 0 0 255 0\n0 0.2 0 0 0 255\n0 0 0.3 16 32 48\n"
    "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

TEST_F(MeshFile, PlyKeepsVerticesFacesAndColours) {
  const Mesh mesh = readMesh(write("tetrahedron.ply", TETRAHEDRON_PLY), 1);
  ASSERT_EQ(mesh.vertices.size(), 4u);
  ASSERT_EQ(mesh.faces.size(), 4u);
  ASSERT_EQ(mesh.colors.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const float x = mesh.vertices[i].x(), y = mesh.vertices[i].y(), z = mesh.vertices[i].z();
    const std::uint32_t expected = x > 0   ? 0x00FF00
                                   : y > 0 ? 0x0000FF
                                   : z > 0 ? 0x102030
                                           : 0xFF0000;
    EXPECT_EQ(mesh.colors[i], expected);
  }
}

TEST_F(MeshFile, UnitScalesVertices) {
  const Mesh mesh = readMesh(
      write("box.obj", "v 0 0 0\nv 100 0 0\nv 0 200 0\nv 0 0 300\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"),
      0.001);
  EXPECT_NEAR(diameterOf(mesh.vertices), std::hypot(0.2, 0.3), 1e-6);
  EXPECT_TRUE(mesh.colors.empty());
}

TEST_F(MeshFile, ObjQuadsBecomeTriangles) {
  const Mesh mesh =
      readMesh(write("quad.obj", "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nf 1 2 3 4\n"), 1);
  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.faces.size(), 2u);
}

TEST_F(MeshFile, StlVerticesAreJoined) {
  const auto file = write(
      "two.stl",
      "solid two\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0.1 0.1 0\n"
      "endloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.1 0.1 0\n"
      "vertex 0 0.1 0\nendloop\nendfacet\nendsolid two\n");
  const Mesh mesh = readMesh(file, 1);
  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_EQ(mesh.faces.size(), 2u);
}

TEST_F(MeshFile, DaeNodeTransformsApplyAndAxesStay) {
  const auto file = write("moved.dae", R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="a" count="9">0 0 0 10 0 0 0 20 0</float_array>
      <technique_common><accessor source="#a" count="3" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n">
    <translate>0 0 50</translate><instance_geometry url="#g"/></node></visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>)");
  const Mesh mesh = readMesh(file, 1);
  ASSERT_EQ(mesh.vertices.size(), 3u);
  EXPECT_TRUE(mesh.vertices[0].isApprox(Eigen::Vector3f(0, 0, 0.5f), 1e-5f));
  EXPECT_TRUE(mesh.vertices[1].isApprox(Eigen::Vector3f(0.1f, 0, 0.5f), 1e-5f));
  EXPECT_TRUE(mesh.vertices[2].isApprox(Eigen::Vector3f(0, 0.2f, 0.5f), 1e-5f));
}

/// A square whose texture, two by two pixels, has a colour at every corner.
const std::string TEXTURED_OBJ =
    "mtllib square.mtl\nv 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl picture\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
const std::string TEXTURED_MTL = "newmtl picture\nKd 1 1 1\nmap_Kd square.png\n";

TEST_F(MeshFile, TextureColoursTheVertices) {
  write("square.mtl", TEXTURED_MTL);
  cv::Mat image(2, 2, CV_8UC3);  // blue, green, red; the first row is the upper one
  image.at<cv::Vec3b>(0, 0) = {0, 0, 255};
  image.at<cv::Vec3b>(0, 1) = {0, 255, 0};
  image.at<cv::Vec3b>(1, 0) = {255, 0, 0};
  image.at<cv::Vec3b>(1, 1) = {48, 32, 16};
  cv::imwrite((folder_ / "square.png").string(), image);
  const Mesh mesh = readMesh(write("square.obj", TEXTURED_OBJ), 1);
  EXPECT_EQ(mesh.unread_texture, "");
  ASSERT_EQ(mesh.vertices.size(), 4u);
  ASSERT_EQ(mesh.colors.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const bool right = mesh.vertices[i].x() > 0, up = mesh.vertices[i].y() > 0;
    EXPECT_EQ(mesh.colors[i],
              up ? (right ? 0x00FF00u : 0xFF0000u) : (right ? 0x102030u : 0x0000FFu));
  }
}

TEST_F(MeshFile, TextureRepeatsAndIsMixedBetweenItsPixels) {
  write("square.mtl", TEXTURED_MTL);
  cv::Mat image(1, 4, CV_8UC3, cv::Scalar(0, 0, 0));
  image.at<cv::Vec3b>(0, 1) = {0, 0, 200};
  cv::imwrite((folder_ / "square.png").string(), image);
  const Mesh mesh =
      readMesh(write("square.obj",
                     "mtllib square.mtl\nv 0 0 0\nv 0.1 0 0\nv 0 0.2 0\n"
                     "vt 0.375 0.5\nvt 2.375 -0.5\nvt 0.25 0.5\nusemtl picture\nf 1/1 2/2 3/3\n"),
               1);
  ASSERT_EQ(mesh.colors.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)  // between two pixels it is the mean of them
    EXPECT_EQ(mesh.colors[i], mesh.vertices[i].y() > 0 ? 0x640000u : 0xC80000u);
}

TEST_F(MeshFile, WithoutTheImageOfItsTextureAMeshHasNoColours) {
  const auto obj = write("square.obj", TEXTURED_OBJ);
  write("square.mtl", TEXTURED_MTL);
  EXPECT_EQ(readMesh(obj, 1).unread_texture, (folder_ / "square.png").string());
  EXPECT_TRUE(readMesh(obj, 1).colors.empty());
  write("square.png", "no picture");
  EXPECT_EQ(readMesh(obj, 1).unread_texture, (folder_ / "square.png").string());
}

TEST(CountOpenEdges, AClosedMeshHasNoneAndAHoleHasItsRim) {
  Mesh box = boxMesh(Eigen::Vector3f(0.1f, 0.1f, 0.1f));
  EXPECT_EQ(countOpenEdges(box), 0u);
  box.faces.pop_back();
  EXPECT_EQ(countOpenEdges(box), 3u);
  box.faces.pop_back();
  EXPECT_EQ(countOpenEdges(box), 4u);
}

TEST(CountOpenEdges, SeamsAreNotOpen) {
  const Mesh box = boxMesh(Eigen::Vector3f(0.1f, 0.1f, 0.1f));
  Mesh seams;  // every face with vertices of its own
  for (const auto& face : box.faces) {
    const int first = static_cast<int>(seams.vertices.size());
    for (const int corner : face) seams.vertices.push_back(box.vertices[corner]);
    seams.faces.emplace_back(first, first + 1, first + 2);
  }
  EXPECT_EQ(countOpenEdges(seams), 0u);
  EXPECT_EQ(countOpenEdges(sphereMesh(0.05f, 20, 40)), 0u);  // at its poles vertices coincide
}

TEST_F(MeshFile, BadFilesAreRefusedByNameInOneLine) {
  const auto refusal = [&](const std::filesystem::path& file) {
    const std::string message = refusalOf([&] { readMesh(file, 1); });
    EXPECT_EQ(message.rfind(file.string(), 0), 0u) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    return message;
  };
  EXPECT_NE(refusal(folder_ / "none.ply").find("no such file"), std::string::npos);
  EXPECT_NE(refusal(write("text.ply", "hello")).find("cannot be read"), std::string::npos);
  EXPECT_NE(refusal(write("name.xyz", "hello")).find("cannot be read"), std::string::npos);
  EXPECT_NE(refusal(write("header.ply", TETRAHEDRON_PLY.substr(0, 100))).find("header"),
            std::string::npos);
  refusal(write("cut.ply", TETRAHEDRON_PLY.substr(0, TETRAHEDRON_PLY.size() - 60)));
  const std::string points =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\nend_header\n"
      "0 0 0\n0.1 0 0\n0 0.1 0\n";
  EXPECT_NE(refusal(write("points.ply", points)).find("no faces"), std::string::npos);
  EXPECT_NE(refusal(write("nan.obj", "v 0 0 0\nv 0.1 0 0\nv 0 nan 0\nf 1 2 3\n")).find("finite"),
            std::string::npos);
}

TEST(CheckObjectMesh, SizeBeyondAnObjectIsRefusedWithTheUnit) {
  const std::string large =
      refusalOf([] { checkObjectMesh(boxMesh(Eigen::Vector3f(71, 164, 120))); });
  EXPECT_NE(large.find("215.2"), std::string::npos) << large;  // its diagonal
  EXPECT_NE(large.find("--unit mm"), std::string::npos) << large;
  const std::string small =
      refusalOf([] { checkObjectMesh(boxMesh(Eigen::Vector3f(7e-5f, 1e-4f, 1e-4f))); });
  EXPECT_NE(small.find("--unit m"), std::string::npos) << small;
  EXPECT_EQ(refusalOf([] { checkObjectMesh(boxMesh(Eigen::Vector3f(0.1f, 0.1f, 0.1f))); }), "");
}

double diameterByAllPairs(const std::vector<Eigen::Vector3f>& points) {
  double best = 0;
  for (const auto& a : points)
    for (const auto& b : points) best = std::max(best, (a - b).cast<double>().norm());
  return best;
}

TEST(DiameterOf, EqualsTheSearchOverAllPairs) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  for (const float flatness : {1.0f, 0.2f, 0.0f}) {
    std::vector<Eigen::Vector3f> cloud, sphere;
    for (int i = 0; i < 1500; ++i) {
      const Eigen::Vector3f p(normal(random), normal(random), flatness * normal(random));
      cloud.push_back(p);
      sphere.push_back(p.normalized());
    }
    EXPECT_DOUBLE_EQ(diameterOf(cloud), diameterByAllPairs(cloud));
    EXPECT_DOUBLE_EQ(diameterOf(sphere), diameterByAllPairs(sphere));
  }
  EXPECT_EQ(diameterOf({}), 0);
  EXPECT_EQ(diameterOf({Eigen::Vector3f::Ones()}), 0);
  EXPECT_EQ(diameterOf(std::vector<Eigen::Vector3f>(100, Eigen::Vector3f::Ones())), 0);
}

TEST(MeshRenderer, BoxHasTheDepthOfItsFrontFace) {
  const MeshRenderer renderer(boxMesh(Eigen::Vector3f(0.2f, 0.1f, 0.06f)));
  const Cloud cloud = renderer.render(ahead(0.8), CAMERA);
  ASSERT_EQ(cloud.width, 640);
  ASSERT_EQ(cloud.height, 480);
  EXPECT_FALSE(cloud.colored());
  for (int row = 0; row < 480; ++row)
    for (int column = 0; column < 640; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * 640 + column;
      const double x = (column - 319.5) / 525 * 0.77, y = (row - 239.5) / 525 * 0.77;
      const bool inside = std::abs(x) < 0.1 && std::abs(y) < 0.05;
      ASSERT_EQ(cloud.valid(i), inside) << column << ", " << row;
      if (!inside) continue;
      ASSERT_NEAR(cloud.x[i], x, 1e-5);
      ASSERT_NEAR(cloud.y[i], y, 1e-5);
      ASSERT_NEAR(cloud.z[i], 0.77, 1e-5);
    }
}

TEST(MeshRenderer, SphereHasAnalyticDepth) {
  const double radius = 0.05, distance = 0.6;
  const MeshRenderer renderer(sphereMesh(radius, 200, 400));
  const Cloud cloud = renderer.render(ahead(distance), CAMERA);
  int seen = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d ray((static_cast<int>(i % 640) - 319.5) / 525,
                              (static_cast<int>(i / 640) - 239.5) / 525, 1);
    const double b = distance / ray.squaredNorm();
    const double root = b * b - (distance * distance - radius * radius) / ray.squaredNorm();
    if (std::abs(root) < 1e-4) continue;  // grazes the sphere
    ASSERT_EQ(cloud.valid(i), root > 0);
    if (root < 0) continue;
    ASSERT_NEAR(cloud.z[i], b - std::sqrt(root), 2e-4);
    ++seen;
  }
  EXPECT_GT(seen, 4000);
}

TEST(MeshRenderer, PosedMeshIsSeenWhereItIs) {
  const Eigen::Vector3f half(0.05f, 0.03f, 0.02f);
  const MeshRenderer renderer(boxMesh(2 * half));
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  T_camera_object.translate(Eigen::Vector3d(0.1, -0.08, 0.7));
  T_camera_object.rotate(Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, 3).normalized()));
  const Cloud cloud = renderer.render(T_camera_object, CAMERA);
  const Indices seen = validIndices(cloud);
  EXPECT_GT(seen.size(), 1000u);
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  for (const int i : seen) {
    const Eigen::Array3f outside = (T_object_camera * cloud.point(i)).array().abs() - half.array();
    EXPECT_NEAR(outside.maxCoeff(), 0, 1e-5);  // on the surface of the box
  }
}

TEST(MeshRenderer, CameraLookingAlongNegativeZSeesTheSame) {
  const MeshRenderer renderer(boxMesh(Eigen::Vector3f(0.2f, 0.1f, 0.06f)));
  Projection backward = CAMERA;
  backward.fx = -525;
  backward.forward = -1;
  const Cloud cloud = renderer.render(ahead(-0.8), backward);
  const std::size_t corner = 220 * 640 + 270;  // upper left of the centre
  ASSERT_TRUE(cloud.valid(corner));
  EXPECT_NEAR(cloud.z[corner], -0.77, 1e-5);
  EXPECT_NEAR(backward.pixel(cloud.point(corner).cast<double>()).x(), 270, 1e-3);
  EXPECT_NEAR(backward.pixel(cloud.point(corner).cast<double>()).y(), 220, 1e-3);
  EXPECT_TRUE(validIndices(renderer.render(ahead(0.8), backward)).empty());
}

TEST(MeshRenderer, ColoursAreInterpolatedBetweenVertices) {
  Mesh mesh;
  mesh.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.colors = {0x000000, 0xFF8000, 0xFF8000, 0x000000};  // runs along x
  const Cloud cloud = MeshRenderer(mesh).render(ahead(2), CAMERA);
  for (const int column : {100, 320, 500}) {
    const std::size_t i = 240 * 640 + column;
    const double share = (cloud.x[i] + 1) / 2;
    EXPECT_NEAR(cloud.rgb[i] >> 16 & 0xFF, share * 0xFF, 1);
    EXPECT_NEAR(cloud.rgb[i] >> 8 & 0xFF, share * 0x80, 1);
    EXPECT_EQ(cloud.rgb[i] & 0xFF, 0u);
  }
}

TEST(IcosphereDirections, EightyEvenlySpreadOverTheSphere) {
  const auto directions = icosphereDirections();
  ASSERT_EQ(directions.size(), 80u);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& d : directions) {
    sum += d;
    EXPECT_NEAR(d.norm(), 1, 1e-12);
    double nearest = M_PI;
    for (const auto& other : directions)
      if (&other != &d) nearest = std::min(nearest, std::acos(d.dot(other)));
    EXPECT_GT(nearest, 0.28);
    EXPECT_LT(nearest, 0.42);
  }
  EXPECT_LT(sum.norm(), 1e-9);
}

}  // namespace
}  // namespace tabletop_perception
