#include "tabletop_perception/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace tabletop_perception {
namespace {

constexpr float SPACING = 0.003f;  // of the points that are held against other surfaces [m]
constexpr double CONTACT = 3e-4;   // nearer than this to the wanted gap is there [m]
constexpr int MAX_STEPS = 200;     // of a slide
constexpr int ATTEMPTS = 30;       // to find room for an object

/// The vertices, and points along edges and over faces that are larger than the spacing.
std::vector<Eigen::Vector3f> pointsOver(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> points = mesh.vertices;
  std::vector<std::array<Eigen::Vector3f, 3>> rest;
  for (const auto& f : mesh.faces)
    rest.push_back({mesh.vertices[f[0]], mesh.vertices[f[1]], mesh.vertices[f[2]]});
  while (!rest.empty()) {
    const auto [a, b, c] = rest.back();
    rest.pop_back();
    const float ab = (b - a).norm(), bc = (c - b).norm(), ca = (a - c).norm();
    const float longest = std::max({ab, bc, ca});
    if (longest <= SPACING) continue;
    // Halved at its longest side, whose middle is the same from both triangles at that side.
    if (ab == longest) {
      points.push_back((a + b) / 2);
      rest.push_back({a, points.back(), c});
      rest.push_back({points.back(), b, c});
    } else if (bc == longest) {
      points.push_back((b + c) / 2);
      rest.push_back({a, b, points.back()});
      rest.push_back({a, points.back(), c});
    } else {
      points.push_back((c + a) / 2);
      rest.push_back({a, b, points.back()});
      rest.push_back({points.back(), b, c});
    }
  }
  return points;
}

/// The least distance of the points of one object from the surface of another.
float pointsToSurface(const TableObject& from, const TableObject& to,
                      const Eigen::Isometry3f& T_to_from, float limit) {
  for (const auto& point : from.points) {
    const Eigen::Vector3f p = T_to_from * point;
    if (to.box.squaredExteriorDistance(p) < limit * limit) limit = to.renderer.distanceTo(p, limit);
  }
  return limit;
}

double radiusOf(const TableObject& object, const Eigen::Isometry3d& T_table_object) {
  double radius = 0;
  for (const auto& point : object.points)
    radius = std::max(radius, (T_table_object * point.cast<double>()).head<2>().norm());
  return radius;
}

class Slide {
 public:
  Slide(const TableObjects& objects, const std::vector<Placement>& placed, double gap)
      : objects_(objects), placed_(placed), gap_(gap) {}

  /// Moves an object along the table by steps as long as the way is certainly free (conservative
  /// advancement, Mirtich 1996) until it is the gap away; none if it meets nothing within `length`.
  std::optional<Eigen::Isometry3d> along(const Eigen::Vector3d& direction, double length,
                                         const TableObject& object,
                                         Eigen::Isometry3d T_table_object) const {
    double way = 0;
    for (int step = 0; step < MAX_STEPS && way < length; ++step) {
      double nearest = length + gap_;
      for (const auto& other : placed_)
        nearest = clearance(object, T_table_object, *objects_[other.object], other.T_table_object,
                            nearest);
      if (nearest - gap_ < CONTACT) return T_table_object;
      // Half of what remains to be free is left over for what the distance is too large by.
      const double advance = nearest - gap_ - CONTACT / 2;
      T_table_object.pretranslate(advance * direction);
      way += advance;
    }
    return std::nullopt;
  }

 private:
  const TableObjects& objects_;
  const std::vector<Placement>& placed_;
  double gap_;
};

const Rest& chooseRest(const std::vector<Rest>& rests, Random& random) {
  double left = random.uniform(0, 1);
  for (const auto& rest : rests) {
    left -= rest.probability;
    if (left < 0) return rest;
  }
  return rests.front();
}

}  // namespace

TableObject::TableObject(std::string object_name, const Mesh& mesh)
    : name(std::move(object_name)),
      renderer((checkObjectMesh(mesh), mesh)),
      rests(stableRests(mesh.vertices)),
      points(pointsOver(mesh)) {
  for (const auto& point : points) box.extend(point);
}

double clearance(const TableObject& a, const Eigen::Isometry3d& T_table_a, const TableObject& b,
                 const Eigen::Isometry3d& T_table_b, double limit) {
  const Eigen::Isometry3d T_a_b = T_table_a.inverse() * T_table_b;
  const auto radius = [](const TableObject& object) { return object.box.diagonal().norm() / 2; };
  const double between =
      (T_a_b * b.box.center().cast<double>() - a.box.center().cast<double>()).norm();
  if (between - radius(a) - radius(b) >= limit) return limit;
  const float one_way = pointsToSurface(b, a, T_a_b.cast<float>(), static_cast<float>(limit));
  return pointsToSurface(a, b, T_a_b.inverse().cast<float>(), one_way);
}

std::vector<Placement> placeObjects(const TableObjects& objects,
                                    const std::vector<std::size_t>& chosen, double gap,
                                    double radius, Random& random) {
  const auto place = [&](std::size_t index,
                         const std::vector<Placement>& placed) -> std::optional<Placement> {
    const TableObject& object = *objects[index];
    const Eigen::Isometry3d T_table_object =
        Eigen::AngleAxisd(random.uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ()) *
        chooseRest(object.rests, random).T_table_object;
    const double from = random.uniform(-M_PI, M_PI);
    if (placed.empty()) return Placement{index, T_table_object};
    const Eigen::Vector3d outwards(std::cos(from), std::sin(from), 0);
    const double start = 2 * radius + radiusOf(object, T_table_object) + gap;
    const auto T_moved = Slide(objects, placed, gap)
                             .along(-outwards, start, object,
                                    Eigen::Translation3d(start * outwards) * T_table_object);
    if (!T_moved || radiusOf(object, *T_moved) > radius) return std::nullopt;
    return Placement{index, *T_moved};
  };

  std::vector<Placement> placed;
  for (const auto index : chosen) {
    std::optional<Placement> found;
    for (int attempt = 0; attempt < ATTEMPTS && !found; ++attempt) found = place(index, placed);
    if (!found) break;
    placed.push_back(*found);
  }
  return placed;
}

}  // namespace tabletop_perception
