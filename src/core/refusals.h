#pragma once

#include <string>

#include "format.h"

/// Why a thing that stands up to every limit of verification is no known object, for people.
namespace tabletop_perception::refusals {

inline std::string score(const std::string& name, double score, double limit) {
  return format("%s: score %.2f, limit %.2f", name.c_str(), score, limit);
}

/// Before it is known exactly.
inline std::string scoreAtMost(const std::string& name, double score, double limit) {
  return format("%s: score at most %.2f, limit %.2f", name.c_str(), score, limit);
}

inline std::string turn(const std::string& name, double sure, double score, double limit) {
  return format("%s: may be turned over (%.2f sure), score %.2f, limit %.2f", name.c_str(), sure,
                score, limit);
}

inline std::string margin(const std::string& name, double margin, const std::string& rival,
                          double limit) {
  return format("%s: margin %.2f over %s, limit %.2f", name.c_str(), margin, rival.c_str(), limit);
}

}  // namespace tabletop_perception::refusals
