#pragma once

#include <string>
#include <vector>

#include "diagnose.h"

namespace tabletop_perception::tools {

/// What was found, in its order.
inline std::string idsOf(const std::vector<Finding>& findings) {
  std::string ids;
  for (const auto& finding : findings) ids += (ids.empty() ? "" : " ") + finding.id;
  return ids;
}

}  // namespace tabletop_perception::tools
