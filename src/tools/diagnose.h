#pragma once

#include <string>
#include <vector>

#include "observed.h"

namespace tabletop_perception::tools {

/// Something that is wrong.
struct Finding {
  enum class Severity {
    ERROR,    ///< nothing can come out
    WARNING,  ///< what comes out is less, slower or worse than it could be
    HINT      ///< nothing is wrong, but it may go wrong elsewhere
  };
  std::string id;  ///< stable, for scripts: "cloud_unorganized" (docs/doctor.md lists all)
  Severity severity;
  std::string text;  ///< one line: name, value and what would be right
};

/// What is wrong with what was seen, causes nearest to the camera first; empty: nothing. What only
/// follows from another finding is left out: points in millimetres also give no table.
std::vector<Finding> diagnose(const Observed& seen);

}  // namespace tabletop_perception::tools
