#pragma once

#include <vector>

#include "evaluate_poses.h"

namespace tabletop_perception::tools {

/// Prints the weights of the terms of `probabilityOf` under which the results with a name are most
/// likely to be right and wrong as they are, beside those that gave the results their scores.
/// Throws std::invalid_argument where no result says its evidence, or all are right or wrong.
void printScoreFit(const std::vector<PosedScene>& scenes, bool json);

}  // namespace tabletop_perception::tools
