#pragma once

#include <string>

#include "tabletop_perception/model.h"

namespace tabletop_perception::tools {

/// A symmetry in a few words for people: "none", "any turn about z, either end up", "180 deg about
/// x (declared)".
std::string symmetryWords(const Symmetry& symmetry);

}  // namespace tabletop_perception::tools
