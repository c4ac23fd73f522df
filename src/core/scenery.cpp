#include "scenery.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace tabletop_perception {
namespace {

constexpr int ROOM_ATTEMPTS = 3;          // to find room for all objects
constexpr int CAMERA_ATTEMPTS = 30;       // to find a place for the camera
constexpr int SPARE_ATTEMPTS = 30;        // to find a second place for the first one
constexpr double SPARE_GAP = 0.02;        // that it keeps beyond the gap [m]
constexpr double HAND_WIDTH = 0.08;       // of a forearm [m]
constexpr double HAND_LENGTH = 0.5;       // [m]
constexpr double TABLE_THICKNESS = 0.03;  // [m]
constexpr double FLOOR_SIDE = 6;          // [m]
constexpr double MARGIN = 8;              // of the picture that objects keep clear of [pixels]
constexpr double MIN_VISIBLE = 0.1;       // of each object, where the camera finds a place for it
constexpr std::uint32_t TABLE_COLOR = 0xA88C6C;
constexpr std::uint32_t FLOOR_COLOR = 0x5A5A60;
constexpr std::uint32_t SKIN_COLOR = 0xD0A080;
constexpr std::uint32_t PLAIN_COLOR = 0xB8B8B8;  // of objects without colours
constexpr float AMBIENT = 0.4f;                  // share of the light that comes from all around

/// What stands in a scene: meshes with their poses and labels.
class Stage {
 public:
  explicit Stage(const Projection& projection) : projection_(projection) {}

  void add(const MeshRenderer& renderer, const Eigen::Isometry3d& T_table_mesh,
           std::uint16_t label) {
    parts_.push_back({&renderer, T_table_mesh, label});
  }

  struct Picture {
    Cloud cloud;
    std::vector<std::uint16_t> labels;
    std::vector<std::size_t> alone;    ///< pixels that would show each part by itself
    std::vector<std::size_t> visible;  ///< pixels with each part's label
  };

  Picture seenFrom(const Eigen::Isometry3d& T_camera_table) const {
    Picture picture{Cloud(projection_.width, projection_.height, true), {}, {}, {}};
    picture.labels.assign(picture.cloud.size(), 0);
    for (const auto& part : parts_) {
      const Cloud layer = part.renderer->render(T_camera_table * part.T_table_mesh, projection_);
      const Indices seen = validIndices(layer);
      picture.alone.push_back(seen.size());
      for (const int i : seen) {
        if (picture.cloud.z[i] <= layer.z[i]) continue;
        picture.cloud.setPoint(i, layer.point(i));
        picture.cloud.rgb[i] = layer.colored() ? layer.rgb[i] : PLAIN_COLOR;
        picture.labels[i] = part.label;
      }
    }
    for (const auto& part : parts_)
      picture.visible.push_back(static_cast<std::size_t>(
          std::count(picture.labels.begin(), picture.labels.end(), part.label)));
    return picture;
  }

 private:
  struct Part {
    const MeshRenderer* renderer;
    Eigen::Isometry3d T_table_mesh;
    std::uint16_t label;
  };
  Projection projection_;
  std::vector<Part> parts_;
};

/// A box about the z axis from z = -height to 0, of one colour.
Mesh slab(double x, double y, double height, std::uint32_t color) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.vertices.push_back(Eigen::Vector3d((corner & 1 ? 0.5 : -0.5) * x,
                                            (corner & 2 ? 0.5 : -0.5) * y,
                                            corner & 4 ? 0.0 : -height)
                                .cast<float>());
  mesh.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  mesh.colors.assign(mesh.vertices.size(), color);
  return mesh;
}

/// Of the pixels of an object.
std::uint16_t labelOf(std::size_t object) {
  return static_cast<std::uint16_t>(SimulatedScene::TABLE + 1 + object);
}

/// Indices in a random order, each as often as another or once more.
std::vector<std::size_t> chooseObjects(std::size_t available, std::size_t wanted, Random& random) {
  std::vector<std::size_t> chosen, left;
  while (chosen.size() < wanted) {
    if (left.empty())
      for (std::size_t i = 0; i < available; ++i) left.push_back(i);
    const std::size_t pick = random.index(left.size());
    chosen.push_back(left[pick]);
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(pick));
  }
  return chosen;
}

std::vector<Placement> placeAll(const TableObjects& objects, const SimulationOptions& options,
                                Random& random) {
  std::size_t most = 0;
  for (int attempt = 0; attempt < ROOM_ATTEMPTS; ++attempt) {
    const auto chosen = chooseObjects(objects.size(), options.objects, random);
    auto placed = placeObjects(objects, chosen, options.gap, options.radius, random);
    if (placed.size() == chosen.size()) return placed;
    most = std::max(most, placed.size());
  }
  std::ostringstream message;
  message << "only " << most << " of " << options.objects
          << " objects fit on the table with gaps of " << options.gap << " m";
  throw std::invalid_argument(message.str());
}

/// A second place for the first object, clear of all that stand; none where there is no room.
std::optional<Placement> sparePlace(const TableObjects& objects,
                                    const std::vector<Placement>& placed,
                                    const SimulationOptions& options, Random& random) {
  const TableObject& object = *objects[placed.front().object];
  for (int attempt = 0; attempt < SPARE_ATTEMPTS; ++attempt) {
    Placement place = placed.front();
    const double angle = random.uniform(-M_PI, M_PI), far = random.uniform(0.1, options.radius);
    place.T_table_object.pretranslate(
        Eigen::Vector3d(far * std::cos(angle), far * std::sin(angle), 0) -
        Eigen::Vector3d(place.T_table_object.translation().x(),
                        place.T_table_object.translation().y(), 0));
    const bool clear = std::all_of(placed.begin(), placed.end(), [&](const Placement& other) {
      return clearance(object, place.T_table_object, *objects[other.object], other.T_table_object,
                       options.gap + SPARE_GAP) >= options.gap + SPARE_GAP;
    });
    if (clear) return place;
  }
  return std::nullopt;
}

/// The table's frame as seen by a camera that looks at its origin.
Eigen::Isometry3d cameraPose(double distance, double pitch, double azimuth) {
  const Eigen::Vector3d forward(std::cos(pitch) * std::cos(azimuth),
                                std::cos(pitch) * std::sin(azimuth), -std::sin(pitch));
  const Eigen::Vector3d right(std::sin(azimuth), -std::cos(azimuth), 0);
  Eigen::Isometry3d T_table_camera = Eigen::Isometry3d::Identity();
  T_table_camera.linear() << right, forward.cross(right), forward;
  T_table_camera.translation() = -distance * forward;
  return T_table_camera.inverse();
}

bool inPicture(const TableObject& object, const Eigen::Isometry3d& T_camera_object,
               const Projection& projection) {
  return std::all_of(object.points.begin(), object.points.end(), [&](const Eigen::Vector3f& point) {
    const Eigen::Vector3d p = T_camera_object * point.cast<double>();
    if (p.z() <= 0) return false;
    const Eigen::Vector2d pixel = projection.pixel(p);
    return pixel.x() >= MARGIN && pixel.x() < projection.width - MARGIN && pixel.y() >= MARGIN &&
           pixel.y() < projection.height - MARGIN;
  });
}

/// The share of each part that others do not hide.
std::vector<double> visibleShares(const Stage::Picture& picture) {
  std::vector<double> shares;
  for (std::size_t part = 0; part < picture.alone.size(); ++part)
    shares.push_back(picture.alone[part] == 0
                         ? 0
                         : static_cast<double>(picture.visible[part]) / picture.alone[part]);
  return shares;
}

/// A random place of the camera from where all objects are in the picture and none is hidden
/// almost; after many attempts the one where most is seen of the most hidden.
Eigen::Isometry3d chooseCamera(const TableObjects& objects, const std::vector<Placement>& placed,
                               const Stage& stage, const SimulationOptions& options,
                               Random& random) {
  double min_distance = options.min_distance;
  Eigen::Isometry3d T_camera_table, best;
  double most_visible = -1;
  for (int attempt = 0; attempt < CAMERA_ATTEMPTS; ++attempt) {
    const double distance = random.uniform(min_distance, options.max_distance);
    const double pitch_deg = random.uniform(options.min_pitch_deg, options.max_pitch_deg);
    T_camera_table = cameraPose(distance, pitch_deg * M_PI / 180, random.uniform(-M_PI, M_PI));
    const bool all_in = std::all_of(placed.begin(), placed.end(), [&](const Placement& placement) {
      return inPicture(*objects[placement.object], T_camera_table * placement.T_table_object,
                       options.projection);
    });
    if (!all_in) min_distance = distance;  // farther, then
    const auto shares = visibleShares(stage.seenFrom(T_camera_table));
    const double visible = all_in ? *std::min_element(shares.begin(), shares.end()) : 0;
    if (visible <= most_visible) continue;
    most_visible = visible;
    best = T_camera_table;
    if (visible >= MIN_VISIBLE) break;
  }
  return best;
}

/// Darkens surfaces that are seen at an angle, as if the light came from beside the camera.
void shade(Cloud& cloud) {
  const auto cosines = incidence(cloud);
  for (const int i : validIndices(cloud)) {
    const float light = AMBIENT + (1 - AMBIENT) * cosines[i];
    std::uint32_t shaded = 0;
    for (const int shift : {16, 8, 0})
      shaded |= static_cast<std::uint32_t>(
                    std::lround(light * static_cast<float>(cloud.rgb[i] >> shift & 0xFF)))
                << shift;
    cloud.rgb[i] = shaded;
  }
}

}  // namespace

Scenery::Scenery(const TableObjects& objects, const SimulationOptions& options, bool spare,
                 Random& random)
    : objects_(objects),
      options_(options),
      table_(slab(options.table_x, options.table_y, TABLE_THICKNESS, TABLE_COLOR)),
      floor_(slab(FLOOR_SIDE, FLOOR_SIDE, TABLE_THICKNESS, FLOOR_COLOR)),
      hand_(slab(HAND_WIDTH, HAND_LENGTH, HAND_WIDTH, SKIN_COLOR)) {
  if (objects.empty()) throw std::invalid_argument("there is no object to put on the table");
  placed_ = placeAll(objects, options, random);
  std::vector<Placement> all = placed_;
  if (spare) {
    spare_ = sparePlace(objects, placed_, options, random);
    if (spare_) all.push_back(*spare_);
  }
  Stage stage(options.projection);
  for (std::size_t i = 0; i < all.size(); ++i)
    stage.add(objects[all[i].object]->renderer, all[i].T_table_object, labelOf(i));
  T_camera_table_ = chooseCamera(objects, all, stage, options, random);
}

Scenery::Picture Scenery::look(const std::vector<Thing>& things,
                               const std::optional<Eigen::Isometry3d>& T_table_hand) const {
  Stage stage(options_.projection);
  for (const auto& thing : things)
    stage.add(objects_[placed_[thing.place].object]->renderer, thing.T_table_object,
              labelOf(thing.place));
  stage.add(table_, Eigen::Isometry3d::Identity(), SimulatedScene::TABLE);
  stage.add(floor_, Eigen::Isometry3d(Eigen::Translation3d(0, 0, -options_.table_height)), 0);
  if (T_table_hand) stage.add(hand_, *T_table_hand, 0);

  auto seen = stage.seenFrom(T_camera_table_);
  const auto shares = visibleShares(seen);
  shade(seen.cloud);
  Picture picture;
  picture.projected = stage.seenFrom(projectorPose(options_.sensor) * T_camera_table_).cloud;
  SimulatedScene& scene = picture.scene;
  scene.cloud = std::move(seen.cloud);
  scene.labels = std::move(seen.labels);
  scene.up = T_camera_table_.linear().col(2);
  scene.plane << scene.up, -scene.up.dot(T_camera_table_.translation());
  for (std::size_t i = 0; i < things.size(); ++i) {
    SimulatedObject object;
    object.name = objects_[placed_[things[i].place].object]->name;
    object.T_camera_object = T_camera_table_ * things[i].T_table_object;
    object.label = labelOf(things[i].place);
    object.visible_pixels = seen.visible[i];
    object.visible = shares[i];
    object.moving = things[i].moving;
    scene.objects.push_back(std::move(object));
  }
  return picture;
}

SimulatedScene Scenery::sensed(const Picture& picture, Random& random) const {
  SimulatedScene scene = picture.scene;
  scene.cloud = senseDepth(picture.scene.cloud, picture.projected, options_.projection,
                           options_.sensor, random);
  return scene;
}

Eigen::Vector3d Scenery::rightOnTable() const {
  const Eigen::Vector3d right = T_camera_table_.linear().transpose().col(0);
  return Eigen::Vector3d(right.x(), right.y(), 0).normalized();
}

}  // namespace tabletop_perception
