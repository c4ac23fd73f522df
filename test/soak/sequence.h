#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/projection.h"
#include "true_poses.h"

namespace tabletop_perception::soak {

/// The pictures of a sequence that `tabletop simulate --sequence` wrote, in memory.
class Sequence {
 public:
  /// Reads `folder`/SCENE_FRAME of the first scene. Throws std::invalid_argument with the file and
  /// what is wrong with it.
  explicit Sequence(const std::filesystem::path& folder);

  std::size_t size() const { return pictures_.size(); }
  const std::vector<tools::TrueObject>& truth(std::size_t picture) const {
    return pictures_[picture].truth;
  }
  /// As the camera saw it, coloured.
  Cloud cloud(std::size_t picture) const;
  /// The names of all objects that are ever there.
  std::set<std::string> names() const;

 private:
  struct Picture {
    std::vector<std::uint16_t> depth;  ///< [units]
    std::vector<std::uint8_t> color;   ///< bgr
    std::vector<tools::TrueObject> truth;
  };
  Picture read(const std::filesystem::path& folder);

  Projection camera_;
  double depth_unit_ = 0;  ///< [m]
  std::vector<Picture> pictures_;
};

/// Which picture of `size` is shown at step `i`: to the last one and back to the first, so that
/// nothing jumps where it begins anew.
std::size_t toAndFro(std::size_t i, std::size_t size);

}  // namespace tabletop_perception::soak
