#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tabletop_perception/mesh.h"

namespace tabletop_perception {
namespace {

std::uint32_t packColor(const aiColor4D& c) {
  const auto byte = [](float v) {
    return static_cast<std::uint32_t>(std::lround(std::clamp(v, 0.0f, 1.0f) * 255));
  };
  return byte(c.r) << 16 | byte(c.g) << 8 | byte(c.b);
}

/// The images that a file names, each read once.
class Textures {
 public:
  explicit Textures(const std::filesystem::path& mesh_file) : folder_(mesh_file.parent_path()) {}

  /// The image of a part's material; empty where there is none.
  const cv::Mat& of(const aiScene& scene, const aiMesh& part) {
    static const cv::Mat NONE;
    aiString name;
    if (!part.HasTextureCoords(0) || part.mMaterialIndex >= scene.mNumMaterials ||
        scene.mMaterials[part.mMaterialIndex]->GetTexture(aiTextureType_DIFFUSE, 0, &name) !=
            aiReturn_SUCCESS)
      return NONE;
    const auto [image, is_new] = images_.try_emplace(name.C_Str());
    if (is_new) image->second = read(name.C_Str());
    return image->second;
  }

  std::string unreadable;  ///< file of the first image that could not be read

 private:
  cv::Mat read(std::string name) {
    std::replace(name.begin(), name.end(), '\\', '/');  // as written on Windows
    const auto file = folder_ / name;
    cv::Mat image;
    try {
      if (std::filesystem::is_regular_file(file)) image = cv::imread(file.string());
    } catch (const cv::Exception&) {
      // an image of a size that OpenCV refuses
    }
    if (image.empty() && unreadable.empty()) unreadable = file.string();
    return image;
  }

  std::filesystem::path folder_;
  std::map<std::string, cv::Mat> images_;
};

/// The colour at texture coordinates (0, 0 is the lower left corner), between the four pixels
/// around; outside of 0 to 1 the image repeats.
std::uint32_t textureColor(const cv::Mat& image, const aiVector3D& at) {
  const auto within = [](float t) {
    if (!std::isfinite(t)) return 0.0f;
    return t < 0 || t > 1 ? t - std::floor(t) : t;
  };
  const float x = std::clamp(within(at.x) * image.cols - 0.5f, 0.0f, image.cols - 1.0f);
  const float y = std::clamp((1 - within(at.y)) * image.rows - 0.5f, 0.0f, image.rows - 1.0f);
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const int right = std::min(left + 1, image.cols - 1), bottom = std::min(top + 1, image.rows - 1);
  const cv::Vec3f above = cv::Vec3f(image.at<cv::Vec3b>(top, left)) * (1 - (x - left)) +
                          cv::Vec3f(image.at<cv::Vec3b>(top, right)) * (x - left);
  const cv::Vec3f below = cv::Vec3f(image.at<cv::Vec3b>(bottom, left)) * (1 - (x - left)) +
                          cv::Vec3f(image.at<cv::Vec3b>(bottom, right)) * (x - left);
  const cv::Vec3f bgr = (above * (1 - (y - top)) + below * (y - top)) / 255;
  return packColor({bgr[2], bgr[1], bgr[0], 1});
}

/// Adds triangles to a mesh; vertices of equal position and colour become one.
class MeshBuilder {
 public:
  int addVertex(const Eigen::Vector3f& position, std::uint32_t color) {
    const auto [entry, is_new] = index_.try_emplace(
        Key{position.x(), position.y(), position.z(), color}, mesh.vertices.size());
    if (is_new) {
      mesh.vertices.push_back(position);
      mesh.colors.push_back(color);
    }
    return entry->second;
  }

  Mesh mesh;
  bool colored = false;  ///< some part has colours

 private:
  struct Key {
    float x, y, z;
    std::uint32_t color;
    bool operator==(const Key& o) const {
      return x == o.x && y == o.y && z == o.z && color == o.color;
    }
  };
  struct Hash {
    std::size_t operator()(const Key& k) const {
      const std::hash<float> hash;
      std::size_t h = k.color;
      for (const float v : {k.x, k.y, k.z}) h = h * 0x9E3779B97F4A7C15u + hash(v);
      return h;
    }
  };
  std::unordered_map<Key, int, Hash> index_;
};

void addMesh(const aiMesh& part, const cv::Mat& texture, const aiMatrix4x4& T_root_node,
             double unit, MeshBuilder& builder) {
  std::vector<int> index(part.mNumVertices, -1);
  const auto color = [&](unsigned i) -> std::uint32_t {
    if (part.HasVertexColors(0)) return packColor(part.mColors[0][i]);
    return texture.empty() ? 0 : textureColor(texture, part.mTextureCoords[0][i]);
  };
  builder.colored = builder.colored || part.HasVertexColors(0) || !texture.empty();
  const auto vertex = [&](unsigned i) {
    if (index[i] < 0) {
      const aiVector3D p = T_root_node * part.mVertices[i] * static_cast<float>(unit);
      index[i] = builder.addVertex({p.x, p.y, p.z}, color(i));
    }
    return index[i];
  };
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines
    const int a = vertex(face.mIndices[0]);
    const int b = vertex(face.mIndices[1]);
    const int c = vertex(face.mIndices[2]);
    builder.mesh.faces.emplace_back(a, b, c);
  }
}

void addNode(const aiScene& scene, const aiNode& node, const aiMatrix4x4& T_root_parent,
             double unit, Textures& textures, MeshBuilder& builder) {
  const aiMatrix4x4 T_root_node = T_root_parent * node.mTransformation;
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[node.mMeshes[m]];
    addMesh(part, textures.of(scene, part), T_root_node, unit, builder);
  }
  for (unsigned c = 0; c < node.mNumChildren; ++c)
    addNode(scene, *node.mChildren[c], T_root_node, unit, textures, builder);
}

/// Whether a .ply file has its header whole. Assimp never returns from one that is cut short in it.
bool hasWholePlyHeader(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(64 * 1024, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text.find("end_header") != std::string::npos;
}

/// False for faces that speak of no vertex or of one that is not there, as a file that was cut
/// short gives them. Assimp lets them pass and then aborts the process while it triangulates.
bool hasSoundFaces(const aiMesh& part) {
  return std::all_of(part.mFaces, part.mFaces + part.mNumFaces, [&](const aiFace& face) {
    return face.mNumIndices > 0 && std::all_of(face.mIndices, face.mIndices + face.mNumIndices,
                                               [&](unsigned i) { return i < part.mNumVertices; });
  });
}

}  // namespace

Mesh readMesh(const std::filesystem::path& file, double unit) {
  if (!std::filesystem::is_regular_file(file))
    throw std::invalid_argument(file.string() + ": no such file");
  Assimp::Importer importer;
  // The axes of a .dae stay as its author wrote them, as everywhere in ROS.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const auto refuse = [&file](const std::string& why) {
    throw std::invalid_argument(file.string() + ": cannot be read as a mesh: " + why);
  };
  if (file.extension() == ".ply" && !hasWholePlyHeader(file))
    refuse("it is no .ply file, or cut short in the header");
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  if (!scene || !scene->mRootNode) {
    const std::string why = importer.GetErrorString();
    refuse(why.substr(0, why.find('\n')));
  }
  const auto sound = [](const aiMesh* part) { return hasSoundFaces(*part); };
  if (!std::all_of(scene->mMeshes, scene->mMeshes + scene->mNumMeshes, sound))
    refuse("it has faces without vertices; is it cut short?");
  scene = importer.ApplyPostProcessing(aiProcess_Triangulate);
  MeshBuilder builder;
  Textures textures(file);
  addNode(*scene, *scene->mRootNode, aiMatrix4x4(), unit, textures, builder);
  Mesh mesh = std::move(builder.mesh);
  if (!builder.colored) mesh.colors.clear();
  mesh.unread_texture = textures.unreadable;
  try {
    checkObjectMesh(mesh);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file.string() + ": " + error.what());
  }
  return mesh;
}

}  // namespace tabletop_perception
