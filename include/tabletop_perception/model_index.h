#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/nearest_grid.h"
#include "tabletop_perception/sparse_model.h"

namespace tabletop_perception {

class ObjectDatabase;

/// The objects of a database, made ready for matching and refinement. Never changes once built, so
/// any number of threads may read it.
class ModelIndex {
 public:
  /// One vector of one kind, and where it comes from.
  struct Entry {
    int model;                            ///< index into models()
    int view;                             ///< index into its views
    Eigen::Vector3f centroid;             ///< of what the vector describes, in the view's frame [m]
    double extent;                        ///< of what the view shows [m]
    std::optional<Eigen::Matrix3f> axes;  ///< as in Descriptor
  };

  /// All vectors of one kind, row after row.
  struct Table {
    int dimension = 0;
    std::vector<float> values;
    std::vector<Entry> entries;
  };

  ModelIndex() = default;
  /// Throws std::invalid_argument when objects were described with different options.
  explicit ModelIndex(std::vector<ObjectModel> models);
  /// Of all objects, read one after the other: their views do not fill the memory at the same time.
  /// Throws as that and as ObjectDatabase::visitAll.
  explicit ModelIndex(const ObjectDatabase& database);

  bool empty() const { return models_.empty(); }
  /// Their views hold the poses alone: descriptors are in the tables, the clouds serve no more.
  const std::vector<ObjectModel>& models() const { return models_; }
  const NearestGrid& grid(int model) const { return grids_[model]; }
  const SparseModel& sparse(int model) const { return sparse_[model]; }
  /// The mean colours about the points of a model's surface; none of a model without colours.
  const std::vector<Rgb>& colors(int model) const { return colors_[model]; }

  /// The options that every view was described with; clusters have to be described alike.
  const DescriptorOptions& descriptorOptions() const { return options_; }

  /// The vectors of a kind; an empty table for a kind that no view has.
  const Table& vectors(const std::string& kind) const;

  /// The camera-roll histogram of a view, ROLL_BINS long; null if it has none.
  const float* cameraRoll(int model, int view) const;

  /// Index of the model of that name, or -1.
  int find(const std::string& name) const;

 private:
  void add(ObjectModel model);

  std::vector<ObjectModel> models_;
  std::vector<NearestGrid> grids_;
  std::vector<SparseModel> sparse_;
  std::vector<std::vector<Rgb>> colors_;
  std::map<std::string, Table> vectors_;
  std::vector<std::vector<std::optional<std::size_t>>> rolls_;  // rows, by model and view
  DescriptorOptions options_;
};

}  // namespace tabletop_perception
