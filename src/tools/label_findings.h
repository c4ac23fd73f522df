#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tabletop_perception/label_metrics.h"

namespace tabletop_perception::tools {

/// What became of an object of the truth, or of a part that counts by itself.
struct ObjectFinding {
  std::string name;     ///< "2"; of a part "2.1", the truth's label 31
  std::string verdict;  ///< found, missed, split, merged, incomplete or spills over
  std::string details;  ///< where its points went, and what else its segment holds
};

/// A segment of the result that belongs to no object.
struct StraySegment {
  std::uint32_t label = 0;
  std::size_t points = 0;
  std::string details;  ///< what it holds
};

/// A scene's labels as the best reading of the truth understands them.
struct LabelFindings {
  std::vector<ObjectFinding> objects;              ///< as in LabelScore::best
  std::vector<StraySegment> strays;                ///< ascending
  std::vector<int> object_of_point;                ///< per point, its object; -1: none
  std::map<std::uint32_t, int> object_of_segment;  ///< only the matched
};

/// `score`: of the two. As many labels of both.
LabelFindings findObjects(const std::vector<std::uint32_t>& truth,
                          const std::vector<std::uint32_t>& result, const LabelScore& score);

}  // namespace tabletop_perception::tools
