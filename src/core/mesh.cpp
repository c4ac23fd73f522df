#include "tabletop_perception/mesh.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

namespace tabletop_perception {
namespace {

constexpr double MAX_DIAMETER = 2.0;   // [m]
constexpr double MIN_DIAMETER = 0.01;  // [m]
constexpr double SAME_PLACE = 1e-6;    // vertices are rounded to for one place [m]

/// A number for every vertex, the same for those at the same place but for rounding.
std::vector<int> placesOf(const std::vector<Eigen::Vector3f>& vertices) {
  const auto place = [](const Eigen::Vector3f& v) {
    return std::tuple(std::lround(v.x() / SAME_PLACE), std::lround(v.y() / SAME_PLACE),
                      std::lround(v.z() / SAME_PLACE));
  };
  std::vector<int> order(vertices.size()), numbers(vertices.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return place(vertices[a]) < place(vertices[b]); });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && place(vertices[order[i]]) == place(vertices[order[i - 1]]);
    numbers[order[i]] = same ? numbers[order[i - 1]] : order[i];
  }
  return numbers;
}

/// A kd-tree of boxes for the search of the farthest pair.
class FarthestPair {
 public:
  explicit FarthestPair(const std::vector<Eigen::Vector3f>& points) : points_(points) {
    best_ = sweep();
    dropInner();
    if (points_.empty()) return;
    nodes_.reserve(points_.size());
    build(0, static_cast<int>(points_.size()));
    search(0, 0);
  }

  double squaredDistance() const { return best_; }

 private:
  static constexpr int LEAF = 8;
  static constexpr double ROUNDING = 2e-7;  // of coordinates that are floats
  struct Node {
    Eigen::AlignedBox3f box;
    int begin, end;
    int left = -1, right = -1;
    bool leaf() const { return left < 0; }
  };

  int build(int begin, int end) {
    const int id = static_cast<int>(nodes_.size());
    nodes_.push_back({Eigen::AlignedBox3f(), begin, end});
    for (int i = begin; i < end; ++i) nodes_[id].box.extend(points_[i]);
    if (end - begin <= LEAF) return id;
    int axis;
    nodes_[id].box.sizes().maxCoeff(&axis);
    const int middle = (begin + end) / 2;
    std::nth_element(points_.begin() + begin, points_.begin() + middle, points_.begin() + end,
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    const int left = build(begin, middle);
    const int right = build(middle, end);
    nodes_[id].left = left;
    nodes_[id].right = right;
    return id;
  }

  /// A good pair to begin with: the farthest from a point, then the farthest from that one.
  double sweep() const {
    double best = 0;
    Eigen::Vector3f from = points_.front();
    for (int round = 0; round < 4; ++round) {
      const auto farthest =
          *std::max_element(points_.begin(), points_.end(), [&from](const auto& a, const auto& b) {
            return (a - from).squaredNorm() < (b - from).squaredNorm();
          });
      best = std::max(best, (farthest - from).cast<double>().squaredNorm());
      from = farthest;
    }
    return best;
  }

  /// No point is farther from another than from the middle and from there to the rim: those for
  /// which that is too little are left out. Of a ball, where all pairs across are equal, it is all.
  void dropInner() {
    Eigen::AlignedBox3f box;
    for (const auto& p : points_) box.extend(p);
    const Eigen::Vector3d middle = box.center().cast<double>();
    const auto fromMiddle = [&](const Eigen::Vector3f& p) {
      return (p.cast<double>() - middle).norm();
    };
    double rim = 0;
    for (const auto& p : points_) rim = std::max(rim, fromMiddle(p));
    const double enough = (1 + ROUNDING) * std::sqrt(best_) - rim;
    points_.erase(std::remove_if(points_.begin(), points_.end(),
                                 [&](const auto& p) { return fromMiddle(p) <= enough; }),
                  points_.end());
  }

  static double bound(const Node& a, const Node& b) {
    const Eigen::Vector3d reach = (a.box.max() - b.box.min())
                                      .cast<double>()
                                      .cwiseMax((b.box.max() - a.box.min()).cast<double>());
    return reach.squaredNorm();
  }

  void search(int ia, int ib) {
    const Node &a = nodes_[ia], &b = nodes_[ib];
    if (bound(a, b) <= best_) return;
    if (a.leaf() && b.leaf()) {
      for (int i = a.begin; i < a.end; ++i)
        for (int j = b.begin; j < b.end; ++j)
          best_ = std::max(best_, (points_[i] - points_[j]).cast<double>().squaredNorm());
    } else if (ia == ib) {
      search(a.left, a.right);
      search(a.left, a.left);
      search(a.right, a.right);
    } else if (b.leaf() || (!a.leaf() && a.end - a.begin >= b.end - b.begin)) {
      searchBoth(a.left, a.right, ib);
    } else {
      searchBoth(b.left, b.right, ia);
    }
  }

  void searchBoth(int first, int second, int other) {
    if (bound(nodes_[first], nodes_[other]) < bound(nodes_[second], nodes_[other]))
      std::swap(first, second);
    search(first, other);
    search(second, other);
  }

  std::vector<Eigen::Vector3f> points_;
  std::vector<Node> nodes_;
  double best_ = 0;
};

/// Columns [first, last) and rows of the image that a mesh may touch.
struct PixelBox {
  int left, right, top, bottom;
};

PixelBox pixelsOf(const Eigen::AlignedBox3f& box, const Eigen::Isometry3d& T_camera_object,
                  const Projection& projection) {
  const PixelBox whole{0, projection.width, 0, projection.height};
  Eigen::AlignedBox2d pixels;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d p =
        T_camera_object *
        box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner)).cast<double>();
    if (p.z() * projection.forward < 1e-3) return whole;  // reaches behind the camera
    pixels.extend(projection.pixel(p));
  }
  const auto clamped = [](double v, int max) {
    return static_cast<int>(std::clamp(v, 0.0, static_cast<double>(max)));
  };
  return {clamped(std::floor(pixels.min().x()), projection.width),
          clamped(std::floor(pixels.max().x()) + 1, projection.width),
          clamped(std::floor(pixels.min().y()), projection.height),
          clamped(std::floor(pixels.max().y()) + 1, projection.height)};
}

/// Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
Eigen::Vector3f nearestInTriangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a,
                                  const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a;
  const float d1 = ab.dot(p - a), d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) return a;
  const float d3 = ab.dot(p - b), d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const float d5 = ab.dot(p - c), d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b);
  return a + (vb * ab + vc * ac) / (va + vb + vc);
}

std::uint32_t mixColors(const std::array<std::uint32_t, 3>& colors,
                        const std::array<float, 3>& weights) {
  std::uint32_t mixed = 0;
  for (const int shift : {16, 8, 0}) {
    float channel = 0;
    for (int k = 0; k < 3; ++k)
      channel += weights[k] * static_cast<float>(colors[k] >> shift & 0xFF);
    mixed |= static_cast<std::uint32_t>(std::lround(std::clamp(channel, 0.0f, 255.0f))) << shift;
  }
  return mixed;
}

}  // namespace

void checkObjectMesh(const Mesh& mesh) {
  if (mesh.faces.empty()) throw std::invalid_argument("the mesh has no faces");
  for (const auto& vertex : mesh.vertices)
    if (!vertex.allFinite())
      throw std::invalid_argument("the mesh has vertices that are not finite");
  const double diameter = diameterOf(mesh.vertices);
  if (diameter >= MIN_DIAMETER && diameter <= MAX_DIAMETER) return;
  std::ostringstream message;
  message << "the mesh has a diameter of " << diameter << " m, an object has " << MIN_DIAMETER
          << " to " << MAX_DIAMETER << " m";
  if (diameter > MAX_DIAMETER) message << "; is the file in millimetres? use --unit mm";
  if (diameter < MIN_DIAMETER) message << "; is the file in metres? use --unit m";
  throw std::invalid_argument(message.str());
}

std::size_t countOpenEdges(const Mesh& mesh) {
  const std::vector<int> place = placesOf(mesh.vertices);
  std::vector<std::pair<int, int>> edges;
  edges.reserve(3 * mesh.faces.size());
  for (const auto& face : mesh.faces)
    for (int k = 0; k < 3; ++k) {
      const auto ends = std::minmax(place[face[k]], place[face[(k + 1) % 3]]);
      if (ends.first != ends.second) edges.emplace_back(ends);
    }
  std::sort(edges.begin(), edges.end());
  std::size_t open = 0;
  for (auto edge = edges.begin(); edge != edges.end();) {
    const auto next = std::find_if(edge, edges.end(), [&](const auto& e) { return e != *edge; });
    if (next - edge == 1) ++open;
    edge = next;
  }
  return open;
}

double diameterOf(const std::vector<Eigen::Vector3f>& vertices) {
  if (vertices.empty()) return 0;
  return std::sqrt(FarthestPair(vertices).squaredDistance());
}

struct MeshRenderer::Scene {
  explicit Scene(const Mesh& mesh)
      : vertices(mesh.vertices), faces(mesh.faces), colors(mesh.colors) {
    device = rtcNewDevice("threads=1");
    if (!device) throw std::runtime_error("Embree gives no device");
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // no ray slips through an edge
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* corners = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), mesh.vertices.size()));
    for (const auto& v : mesh.vertices) {
      corners = std::copy(v.data(), v.data() + 3, corners);
      box.extend(v);
    }
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), mesh.faces.size()));
    for (const auto& f : mesh.faces) indices = std::copy(f.data(), f.data() + 3, indices);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
  }
  ~Scene() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }

  std::uint32_t colorAt(const RTCHit& hit) const {
    const Eigen::Vector3i& face = faces[hit.primID];
    return mixColors({colors[face[0]], colors[face[1]], colors[face[2]]},
                     {1 - hit.u - hit.v, hit.u, hit.v});
  }

  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> faces;
  std::vector<std::uint32_t> colors;
  Eigen::AlignedBox3f box;
};

MeshRenderer::MeshRenderer(const Mesh& mesh) {
  if (mesh.faces.empty()) throw std::invalid_argument("a mesh without faces cannot be rendered");
  scene_ = std::make_unique<Scene>(mesh);
}

MeshRenderer::~MeshRenderer() = default;

Cloud MeshRenderer::render(const Eigen::Isometry3d& T_camera_object,
                           const Projection& projection) const {
  Cloud cloud(projection.width, projection.height, !scene_->colors.empty());
  const PixelBox pixels = pixelsOf(scene_->box, T_camera_object, projection);
  if (pixels.left >= pixels.right) return cloud;

  const Eigen::Matrix3f R_object_camera = T_camera_object.linear().transpose().cast<float>();
  const Eigen::Vector3f origin = T_camera_object.inverse().translation().cast<float>();
  const auto directionOf = [&](int column, int row) -> Eigen::Vector3f {
    const Eigen::Vector3d d{(column - projection.cx) / projection.fx,
                            (row - projection.cy) / projection.fy, 1};
    return (projection.forward * d).cast<float>();
  };

  std::vector<RTCRayHit> rays(pixels.right - pixels.left);
  for (int row = pixels.top; row < pixels.bottom; ++row) {
    for (int column = pixels.left; column < pixels.right; ++column) {
      const Eigen::Vector3f d = R_object_camera * directionOf(column, row);
      RTCRayHit& ray = rays[column - pixels.left];
      ray = {};
      ray.ray.org_x = origin.x(), ray.ray.org_y = origin.y(), ray.ray.org_z = origin.z();
      ray.ray.dir_x = d.x(), ray.ray.dir_y = d.y(), ray.ray.dir_z = d.z();
      ray.ray.tfar = std::numeric_limits<float>::infinity();
      ray.ray.mask = ~0u;
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect1M(scene_->scene, &context, rays.data(), rays.size(), sizeof(RTCRayHit));
    for (int column = pixels.left; column < pixels.right; ++column) {
      const RTCRayHit& ray = rays[column - pixels.left];
      if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) continue;
      const std::size_t i = static_cast<std::size_t>(row) * projection.width + column;
      cloud.setPoint(i, directionOf(column, row) * ray.ray.tfar);
      if (cloud.colored()) cloud.rgb[i] = scene_->colorAt(ray.hit);
    }
  }
  return cloud;
}

float MeshRenderer::distanceTo(const Eigen::Vector3f& point, float limit) const {
  // The query's radius shrinks to the nearest triangle so far.
  const auto visit = [](RTCPointQueryFunctionArguments* arguments) {
    const auto& scene = *static_cast<const Scene*>(arguments->userPtr);
    const Eigen::Vector3i& face = scene.faces[arguments->primID];
    const Eigen::Vector3f p(arguments->query->x, arguments->query->y, arguments->query->z);
    const Eigen::Vector3f nearest = nearestInTriangle(
        p, scene.vertices[face[0]], scene.vertices[face[1]], scene.vertices[face[2]]);
    const float distance = (nearest - p).norm();
    if (!(distance < arguments->query->radius)) return false;
    arguments->query->radius = distance;
    return true;
  };
  RTCPointQuery query{point.x(), point.y(), point.z(), 0, limit};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene_->scene, &query, &context, visit, scene_.get());
  return query.radius;
}

std::vector<Eigen::Vector3d> icosphereDirections() {
  const double g = (1 + std::sqrt(5.0)) / 2;
  const std::array<Eigen::Vector3d, 12> corners{{{-1, g, 0},
                                                 {1, g, 0},
                                                 {-1, -g, 0},
                                                 {1, -g, 0},
                                                 {0, -1, g},
                                                 {0, 1, g},
                                                 {0, -1, -g},
                                                 {0, 1, -g},
                                                 {g, 0, -1},
                                                 {g, 0, 1},
                                                 {-g, 0, -1},
                                                 {-g, 0, 1}}};
  constexpr int FACES[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  std::vector<Eigen::Vector3d> directions;
  for (const auto& face : FACES) {
    const Eigen::Vector3d a = corners[face[0]].normalized();
    const Eigen::Vector3d b = corners[face[1]].normalized();
    const Eigen::Vector3d c = corners[face[2]].normalized();
    const Eigen::Vector3d ab = (a + b).normalized();
    const Eigen::Vector3d bc = (b + c).normalized();
    const Eigen::Vector3d ca = (c + a).normalized();
    directions.push_back((a + ab + ca).normalized());
    directions.push_back((b + bc + ab).normalized());
    directions.push_back((c + ca + bc).normalized());
    directions.push_back((ab + bc + ca).normalized());
  }
  return directions;
}

}  // namespace tabletop_perception
