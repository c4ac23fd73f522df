#include "tabletop_perception/rests.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {
namespace {

constexpr int DIRECTIONS = 2000;          // in which the extreme points are looked for
constexpr double FLATNESS = 1e-6;         // points nearer to a face lie in it [m]
constexpr double SAME_REST_COS = 0.9994;  // of 2 deg

using Points = std::vector<Eigen::Vector3d>;

/// The farthest points in directions all around, the outermost first. For scanned meshes of many
/// thousand vertices their hull is the whole hull, to within a fraction of a millimetre.
Points extremePoints(const std::vector<Eigen::Vector3f>& vertices) {
  std::set<std::size_t> chosen;
  for (int i = 0; i < DIRECTIONS; ++i) {
    const double z = 1 - (2 * i + 1.0) / DIRECTIONS;  // a spiral from pole to pole
    const double angle = i * M_PI * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
    const Eigen::Vector3f direction =
        Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z).cast<float>();
    std::size_t farthest = 0;
    float reach = -std::numeric_limits<float>::max();
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      const float along = direction.dot(vertices[v]);
      if (along <= reach) continue;
      reach = along;
      farthest = v;
    }
    if (!vertices.empty()) chosen.insert(farthest);
  }
  Points points;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto v : chosen) {
    points.push_back(vertices[v].cast<double>());
    center += points.back() / static_cast<double>(chosen.size());
  }
  std::stable_sort(points.begin(), points.end(), [&](const auto& a, const auto& b) {
    return (a - center).squaredNorm() > (b - center).squaredNorm();
  });
  return points;
}

/// A triangle of the hull, counter-clockwise from outside.
struct HullFace {
  std::array<int, 3> corners;
  Eigen::Vector3d normal;  // out of the hull; zero for a sliver
  double offset;           // normal.dot(p) of the points in its plane

  double height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

HullFace makeFace(const Points& points, int a, int b, int c) {
  const Eigen::Vector3d cross = (points[b] - points[a]).cross(points[c] - points[a]);
  const double length = cross.norm();
  const Eigen::Vector3d normal =
      length > 1e-14 ? Eigen::Vector3d(cross / length) : Eigen::Vector3d(Eigen::Vector3d::Zero());
  return {{a, b, c}, normal, normal.dot(points[a])};
}

/// Index of the point with the largest value.
template <typename Value>
int farthest(const Points& points, const Value& value) {
  int best = 0;
  for (int i = 1; i < static_cast<int>(points.size()); ++i)
    if (value(points[i]) > value(points[best])) best = i;
  return best;
}

std::vector<HullFace> firstTetrahedron(const Points& points) {
  const auto refuse = [] { throw std::invalid_argument("the vertices span no volume"); };
  if (points.size() < 4) refuse();
  const int a = 0;
  const int b = farthest(points, [&](const auto& p) { return (p - points[a]).norm(); });
  const Eigen::Vector3d line = (points[b] - points[a]).normalized();
  const int c = farthest(points, [&](const auto& p) { return line.cross(p - points[a]).norm(); });
  const HullFace base = makeFace(points, a, b, c);
  const int d = farthest(points, [&](const auto& p) { return std::abs(base.height(p)); });
  if (base.normal.isZero() || std::abs(base.height(points[d])) < 10 * FLATNESS) refuse();
  const bool above = base.height(points[d]) > 0;
  const int second = above ? c : b, third = above ? b : c;
  return {makeFace(points, a, second, third), makeFace(points, second, a, d),
          makeFace(points, third, second, d), makeFace(points, a, third, d)};
}

/// The convex hull, point by point: the faces that a point sees give way to those that it forms
/// with their outline.
std::vector<HullFace> hullOf(const Points& points) {
  auto faces = firstTetrahedron(points);
  for (int p = 0; p < static_cast<int>(points.size()); ++p) {
    const auto visible = std::partition(faces.begin(), faces.end(), [&](const HullFace& face) {
      return face.height(points[p]) <= FLATNESS;
    });
    std::set<std::pair<int, int>> edges;
    for (auto face = visible; face != faces.end(); ++face)
      for (int k = 0; k < 3; ++k) edges.insert({face->corners[k], face->corners[(k + 1) % 3]});
    faces.erase(visible, faces.end());
    for (const auto& [from, to] : edges)
      if (edges.count({to, from}) == 0) faces.push_back(makeFace(points, from, to, p));
  }
  return faces;
}

Eigen::Vector3d centerOfMass(const Points& points, const std::vector<HullFace>& hull) {
  const Eigen::Vector3d apex = points.front();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double volume = 0;
  for (const auto& face : hull) {
    const auto& a = points[face.corners[0]];
    const auto& b = points[face.corners[1]];
    const auto& c = points[face.corners[2]];
    const double part = (a - apex).dot((b - apex).cross(c - apex)) / 6;
    volume += part;
    sum += part * (apex + a + b + c) / 4;
  }
  return sum / volume;
}

/// Of a triangle seen from the origin [sr] (van Oosterom and Strackee 1983).
double solidAngle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(std::abs(a.dot(b.cross(c))),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

/// How far the centre of mass is beyond the edge after each corner, seen from above the face [m].
std::array<double, 3> overhangs(const HullFace& face, const Points& points,
                                const Eigen::Vector3d& center) {
  std::array<double, 3> beyond;
  for (int k = 0; k < 3; ++k) {
    const auto& from = points[face.corners[k]];
    const Eigen::Vector3d along = (points[face.corners[(k + 1) % 3]] - from).normalized();
    beyond[k] = -face.normal.cross(along).dot(center - from);
  }
  return beyond;
}

/// The face that an object comes to rest on after it landed on each face.
std::vector<std::size_t> finalFaces(const std::vector<HullFace>& hull, const Points& points,
                                    const Eigen::Vector3d& center) {
  constexpr double LEVEL = 1e-9;  // [m]
  std::map<std::pair<int, int>, std::size_t> face_of_edge;
  for (std::size_t f = 0; f < hull.size(); ++f)
    for (int k = 0; k < 3; ++k)
      face_of_edge[{hull[f].corners[k], hull[f].corners[(k + 1) % 3]}] = f;

  /// Over the edge that the centre is farthest beyond. It sinks on the way, or stays at its height
  /// between parts of one flat face, each of which is entered but once.
  const auto rolled = [&](std::size_t from, const std::set<std::size_t>& visited) {
    std::size_t to = from;
    double farthest = LEVEL;
    const auto beyond = overhangs(hull[from], points, center);
    const auto& corners = hull[from].corners;
    for (int k = 0; k < 3; ++k) {
      const auto next = face_of_edge.find({corners[(k + 1) % 3], corners[k]});
      if (beyond[k] <= farthest || next == face_of_edge.end() || visited.count(next->second) > 0 ||
          hull[next->second].height(center) < hull[from].height(center) - LEVEL)
        continue;
      farthest = beyond[k];
      to = next->second;
    }
    return to;
  };

  std::vector<std::size_t> final_faces;
  for (std::size_t f = 0; f < hull.size(); ++f) {
    std::set<std::size_t> visited;
    std::size_t current = f;
    while (visited.insert(current).second) current = rolled(current, visited);
    final_faces.push_back(current);
  }
  return final_faces;
}

Eigen::Isometry3d restingOn(const Eigen::Vector3d& down, const Eigen::Vector3d& center,
                            const std::vector<Eigen::Vector3f>& vertices) {
  Eigen::Isometry3d T_table_object = Eigen::Isometry3d::Identity();
  T_table_object.linear() = rotationBetween(down, -Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d moved = T_table_object.linear() * center;
  double lowest = std::numeric_limits<double>::max();
  for (const auto& v : vertices)
    lowest = std::min(lowest, T_table_object.linear().row(2).dot(v.cast<double>()));
  T_table_object.translation() << -moved.x(), -moved.y(), -lowest;
  return T_table_object;
}

}  // namespace

std::vector<Rest> stableRests(const std::vector<Eigen::Vector3f>& vertices) {
  const Points points = extremePoints(vertices);
  const auto hull = hullOf(points);
  const Eigen::Vector3d center = centerOfMass(points, hull);
  const auto final_faces = finalFaces(hull, points, center);

  std::map<std::size_t, double> angle_of_face;
  for (std::size_t f = 0; f < hull.size(); ++f) {
    const auto& corners = hull[f].corners;
    angle_of_face[final_faces[f]] += solidAngle(
        points[corners[0]] - center, points[corners[1]] - center, points[corners[2]] - center);
  }
  std::vector<std::pair<double, Eigen::Vector3d>> downs;  // with their solid angles
  for (const auto& [face, angle] : angle_of_face) downs.emplace_back(angle, hull[face].normal);
  std::stable_sort(downs.begin(), downs.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });

  std::vector<Rest> rests;
  std::vector<Eigen::Vector3d> known;
  for (const auto& [angle, down] : downs) {
    const double probability = angle / (4 * M_PI);
    const auto same = std::find_if(known.begin(), known.end(), [d = down](const auto& other) {
      return d.dot(other) > SAME_REST_COS;
    });
    if (same != known.end()) {
      rests[same - known.begin()].probability += probability;
      continue;
    }
    known.push_back(down);
    rests.push_back({restingOn(down, center, vertices), probability});
  }
  std::stable_sort(rests.begin(), rests.end(),
                   [](const Rest& a, const Rest& b) { return a.probability > b.probability; });
  return rests;
}

}  // namespace tabletop_perception
