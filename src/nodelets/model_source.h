#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "tabletop_perception/database.h"
#include "tabletop_perception/model_index.h"

namespace tabletop_perception {

/// `~` and `~/...` with the home directory in its place.
std::filesystem::path expandHome(const std::string& path);

/// The objects of a database file, opened read-only and read again whenever the file changes,
/// appears or is replaced. Not for several threads at once.
class ModelSource {
 public:
  explicit ModelSource(const std::string& path) : file_(expandHome(path)) {}

  const std::filesystem::path& file() const { return file_; }

  /// Looks at the file; call it once per frame. What it refers to is valid until the next call.
  const ModelIndex& update();

  /// Why the last update() found no object; empty if it did.
  const std::string& reason() const { return reason_; }

  /// Counts the updates that found other objects than before.
  int generation() const { return generation_; }

 private:
  void clear(const std::string& reason);

  std::filesystem::path file_;
  std::uint64_t inode_ = 0;  ///< of the open file: a replaced one has another
  std::optional<ObjectDatabase> database_;
  std::optional<long> version_;  ///< that the index, or the reason, was made from
  ModelIndex index_;
  std::string reason_;
  int generation_ = 0;
};

}  // namespace tabletop_perception
