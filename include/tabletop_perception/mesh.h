#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception {

/// A triangle mesh in the object's frame.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;  ///< [m]
  std::vector<std::uint32_t> colors;      ///< 0x00RRGGBB per vertex, or empty
  std::vector<Eigen::Vector3i> faces;     ///< indices of vertices, counter-clockwise from outside
  std::string unread_texture;  ///< an image that the mesh's file names and that cannot be read
};

/// Throws std::invalid_argument unless the mesh can be an object on a table: it has faces, finite
/// vertices and a diameter of 1 cm to 2 m (over that with the hint that it may be in millimetres).
void checkObjectMesh(const Mesh& mesh);

/// Edges that one face alone has, by the places of their ends: seams of colour are not open. A mesh
/// around a whole thing has none.
std::size_t countOpenEdges(const Mesh& mesh);

/// Reads ply, obj, stl, dae (assimp) and scales by `unit` (1 for metres, 0.001 for millimetres).
/// Nodes' transforms are applied, equal vertices become one. Colours come from vertex colours, else
/// from the texture's image at the texture coordinates of each vertex; without both, or where the
/// image cannot be read, there are none. Throws std::invalid_argument with the file and what is
/// wrong with it, also as checkObjectMesh.
Mesh readMesh(const std::filesystem::path& file, double unit);

/// Largest distance of two vertices [m], exact but for the rounding of floats; 0 without vertices.
double diameterOf(const std::vector<Eigen::Vector3f>& vertices);

/// Renders depth clouds of a mesh by ray casting (Embree). Faces are seen from both sides. Several
/// threads may render at once. Throws std::invalid_argument for a mesh without faces.
class MeshRenderer {
 public:
  explicit MeshRenderer(const Mesh& mesh);
  ~MeshRenderer();
  MeshRenderer(const MeshRenderer&) = delete;
  MeshRenderer& operator=(const MeshRenderer&) = delete;

  /// An organised cloud, in the camera's frame [m], of what the camera sees; pixels past the mesh
  /// hold no point. Coloured if the mesh is.
  Cloud render(const Eigen::Isometry3d& T_camera_object, const Projection& projection) const;

  /// Distance of a point of the object's frame from the surface [m], or `limit` if that is less.
  float distanceTo(const Eigen::Vector3f& point, float limit) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

/// Directions to the faces of an icosahedron subdivided once: 80, evenly spread, unit length.
std::vector<Eigen::Vector3d> icosphereDirections();

}  // namespace tabletop_perception
