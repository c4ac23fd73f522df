#include "tabletop_perception/model_index.h"

#include <stdexcept>
#include <utility>

#include "tabletop_perception/database.h"
#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

const char* const CAMERA_ROLL = "camera_roll";
constexpr double GRID_CELL = 0.004;     // [m]
constexpr double COLOR_RADIUS = 0.005;  // over which colours are averaged [m]
constexpr double GRID_MARGIN = 0.04;    // beyond the farthest correspondence of ICP's start [m]

std::vector<double> valuesOf(DescriptorOptions options) {
  std::vector<double> values;
  options.visitFields(
      [&](const std::string&, auto& field, const auto&...) { values.push_back(field); });
  return values;
}

/// As coarse as a camera sees a print.
std::vector<Rgb> meanColors(const ObjectModel& model) {
  std::vector<Rgb> means;
  if (model.colors.empty()) return means;
  const KdTree tree(model.surface.points);
  std::vector<KdTree::Neighbor> near;
  for (const auto& p : model.surface.points) {
    tree.within(p, COLOR_RADIUS, near);
    Rgb sum = Rgb::Zero();
    for (const auto& neighbor : near) sum += rgbOf(model.colors[neighbor.index]);
    means.push_back(sum / static_cast<float>(near.size()));
  }
  return means;
}

}  // namespace

ModelIndex::ModelIndex(std::vector<ObjectModel> models) {
  for (auto& model : models) add(std::move(model));
}

ModelIndex::ModelIndex(const ObjectDatabase& database) {
  database.visitAll([this](ObjectModel model) { add(std::move(model)); });
}

void ModelIndex::add(ObjectModel model) {
  if (models_.empty()) options_ = model.options;
  if (valuesOf(model.options) != valuesOf(options_))
    throw std::invalid_argument("objects '" + models_.front().name + "' and '" + model.name +
                                "' were trained with different descriptor options; train one "
                                "of them again");
  grids_.emplace_back(model.surface, GRID_CELL, GRID_MARGIN);
  sparse_.push_back(makeSparse(model));
  colors_.push_back(meanColors(model));
  rolls_.emplace_back(model.views.size());
  const auto m = static_cast<int>(models_.size());
  for (std::size_t v = 0; v < model.views.size(); ++v) {
    View& view = model.views[v];
    const double extent = extentOf(view.surface.points);
    for (const auto& descriptor : view.descriptors) {
      Table& table = vectors_[descriptor.kind];
      if (descriptor.kind == CAMERA_ROLL) rolls_[m][v] = table.entries.size();
      table.dimension = static_cast<int>(descriptor.values.size());
      table.values.insert(table.values.end(), descriptor.values.begin(), descriptor.values.end());
      table.entries.push_back(
          {m, static_cast<int>(v), descriptor.centroid, extent, descriptor.axes});
    }
    view = View{view.T_view_object, {}, {}};
  }
  models_.push_back(std::move(model));
}

const ModelIndex::Table& ModelIndex::vectors(const std::string& kind) const {
  static const Table none;
  const auto found = vectors_.find(kind);
  return found == vectors_.end() ? none : found->second;
}

const float* ModelIndex::cameraRoll(int model, int view) const {
  const auto row = rolls_[model][view];
  return row ? vectors(CAMERA_ROLL).values.data() + *row * ROLL_BINS : nullptr;
}

int ModelIndex::find(const std::string& name) const {
  for (std::size_t m = 0; m < models_.size(); ++m)
    if (models_[m].name == name) return static_cast<int>(m);
  return -1;
}

}  // namespace tabletop_perception
