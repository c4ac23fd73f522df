#include "label_findings.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tabletop_perception::tools {
namespace {

using Label = std::uint32_t;

constexpr Label TABLE = 1;          // of the result
constexpr Label FIRST_OBJECT = 20;  // of the truth
constexpr Label FIRST_SEGMENT = 2;  // of the result
constexpr int NO_OBJECT = -1;
constexpr double MENTIONED = 0.02;  // smaller shares are not worth a word

using Counts = std::map<std::pair<int, Label>, std::size_t>;  // by object and result label

double share(std::size_t part, std::size_t all) {
  return all == 0 ? 0.0 : static_cast<double>(part) / all;
}

std::string nameOf(const ObjectOverlap& object) {
  const std::string name = std::to_string(object.object);
  return object.part == 0 ? name : name + "." + std::to_string(object.part % 10);
}

/// Labels of the truth that count as objects, and which ones.
std::map<Label, int> objectsOfLabels(const std::vector<Label>& truth, const OverlapScore& score) {
  std::map<Label, std::size_t> points;
  for (const Label label : truth)
    if (label >= FIRST_OBJECT) ++points[label];
  std::map<Label, int> objects;
  for (const auto& [label, count] : points) {
    if (count < MIN_PART_POINTS) continue;
    for (std::size_t i = 0; i < score.objects.size(); ++i) {
      const auto& object = score.objects[i];
      if (object.part == label || (object.part == 0 && object.object == label / 10 - 1))
        objects[label] = static_cast<int>(i);
    }
  }
  return objects;
}

/// Adds "what 12 %" to a list, unless it is next to nothing.
void mention(const std::string& what, double share, std::string& list) {
  if (share < MENTIONED) return;
  if (!list.empty()) list += ", ";
  list += what + " " + std::to_string(std::lround(100 * share)) + " %";
}

/// What a segment holds, as shares of its points; without one object, if that is stated.
std::string contentsOf(Label segment, std::size_t points, int but,
                       const std::vector<ObjectFinding>& objects, const Counts& counts) {
  std::string list;
  for (const auto& [key, count] : counts) {
    const auto& [object, label] = key;
    if (label != segment || (object == but && but != NO_OBJECT)) continue;
    mention(object == NO_OBJECT ? "no object" : "object " + objects[object].name,
            share(count, points), list);
  }
  return list;
}

bool isItsSegment(const ObjectOverlap& object, Label label) {
  return object.segment != 0 && label == object.segment;
}

/// The shares of an object's points, and of its segment's, that went wrong.
struct Faults {
  double split = 0;    ///< of the object: in other segments
  double missing = 0;  ///< of the object: in no segment
  double merged = 0;   ///< of the segment: on other objects
  double spilt = 0;    ///< of the segment: on no object
};

Faults faultsOf(int index, const ObjectOverlap& object, const Counts& counts) {
  Faults faults;
  for (const auto& [key, count] : counts) {
    const auto& [owner, label] = key;
    const bool inside = isItsSegment(object, label);
    if (owner == index && !inside)
      (label < FIRST_SEGMENT ? faults.missing : faults.split) += share(count, object.points);
    if (owner != index && inside)
      (owner == NO_OBJECT ? faults.spilt : faults.merged) += share(count, object.segment_points);
  }
  return faults;
}

std::string verdictOn(const ObjectOverlap& object, const Faults& faults) {
  if (object.iou() >= FOUND_IOU) return "found";
  if (object.segment == 0) return faults.split > faults.missing ? "merged" : "missed";
  const double worst = std::max({faults.split, faults.missing, faults.merged, faults.spilt});
  if (worst == faults.merged) return "merged";
  if (worst == faults.split) return "split";
  return worst == faults.missing ? "incomplete" : "spills over";
}

std::string detailsOf(int index, const ObjectOverlap& object,
                      const std::vector<ObjectFinding>& objects, const Counts& counts) {
  std::string lost;
  for (const auto& [key, count] : counts) {
    const auto& [owner, label] = key;
    if (owner != index || isItsSegment(object, label)) continue;
    const std::string where = label == TABLE          ? "as table"
                              : label < FIRST_SEGMENT ? "without label"
                                                      : "in segment " + std::to_string(label);
    mention(where, share(count, object.points), lost);
  }
  if (object.segment == 0) return lost;
  const auto also = contentsOf(object.segment, object.segment_points, index, objects, counts);
  if (also.empty()) return lost;
  return (lost.empty() ? "" : lost + "; ") + "of its segment: " + also;
}

}  // namespace

LabelFindings findObjects(const std::vector<Label>& truth, const std::vector<Label>& result,
                          const LabelScore& score) {
  const auto& objects = score.best.objects;
  const auto object_of_label = objectsOfLabels(truth, score.best);
  LabelFindings findings;
  for (const Label label : truth) {
    const auto object = object_of_label.find(label);
    findings.object_of_point.push_back(object == object_of_label.end() ? NO_OBJECT
                                                                       : object->second);
  }
  Counts counts;
  std::map<Label, std::size_t> segment_points;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth[i] == 0) continue;
    ++counts[{findings.object_of_point[i], result[i]}];
    if (result[i] >= FIRST_SEGMENT) ++segment_points[result[i]];
  }

  for (const auto& object : objects) findings.objects.push_back({nameOf(object), "", ""});
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const int index = static_cast<int>(i);
    if (objects[i].segment != 0) findings.object_of_segment[objects[i].segment] = index;
    findings.objects[i].verdict = verdictOn(objects[i], faultsOf(index, objects[i], counts));
    findings.objects[i].details = detailsOf(index, objects[i], findings.objects, counts);
  }
  for (const auto& [segment, points] : segment_points)
    if (findings.object_of_segment.count(segment) == 0)
      findings.strays.push_back(
          {segment, points, contentsOf(segment, points, NO_OBJECT, findings.objects, counts)});
  return findings;
}

}  // namespace tabletop_perception::tools
