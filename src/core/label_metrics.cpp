#include "tabletop_perception/label_metrics.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

namespace tabletop_perception {
namespace {

using Label = std::uint32_t;

constexpr Label FIRST_OBJECT = 20;  // of the truth
constexpr Label FIRST_SEGMENT = 2;  // of the result

bool isTableTruth(Label truth) { return truth >= 1 && truth <= 9; }

double share(std::size_t part, std::size_t all) { return static_cast<double>(part) / all; }

/// The assignment for at least as many columns as rows, with the smallest sum of costs: shortest
/// augmenting paths with potentials. Index 0 of rows and columns stands for "none yet".
std::vector<int> cheapestAssignment(const Eigen::MatrixXd& costs) {
  const auto rows = static_cast<int>(costs.rows());
  const auto columns = static_cast<int>(costs.cols());
  std::vector<double> row_potential(rows + 1, 0), column_potential(columns + 1, 0);
  std::vector<int> row_of(columns + 1, 0);
  for (int row = 1; row <= rows; ++row) {
    std::vector<double> shortest(columns + 1, std::numeric_limits<double>::infinity());
    std::vector<int> previous(columns + 1, 0);
    std::vector<bool> visited(columns + 1, false);
    int column = 0;
    row_of[0] = row;
    do {
      visited[column] = true;
      const int from = row_of[column];
      int nearest = -1;
      for (int c = 1; c <= columns; ++c) {
        if (visited[c]) continue;
        const double length = costs(from - 1, c - 1) - row_potential[from] - column_potential[c];
        if (length < shortest[c]) {
          shortest[c] = length;
          previous[c] = column;
        }
        if (nearest < 0 || shortest[c] < shortest[nearest]) nearest = c;
      }
      const double step = shortest[nearest];
      for (int c = 0; c <= columns; ++c) {
        if (visited[c]) {
          row_potential[row_of[c]] += step;
          column_potential[c] -= step;
        } else {
          shortest[c] -= step;
        }
      }
      column = nearest;
    } while (row_of[column] != 0);
    for (; column != 0; column = previous[column]) row_of[column] = row_of[previous[column]];
  }
  std::vector<int> assignment(rows, -1);
  for (int c = 1; c <= columns; ++c)
    if (row_of[c] != 0) assignment[row_of[c] - 1] = c - 1;
  return assignment;
}

/// The points that the truth's parts and the result's segments hold, alone and together.
struct Overlaps {
  std::map<Label, std::size_t> part_points;  ///< parts that are large enough
  std::vector<Label> segments;
  std::vector<std::size_t> segment_points;
  /// Per part, per segment.
  std::map<Label, std::vector<std::size_t>> shared;
};

Overlaps countOverlaps(const std::vector<Label>& truth, const std::vector<Label>& result) {
  std::map<Label, std::size_t> part_points, segment_points;
  std::map<std::pair<Label, Label>, std::size_t> shared;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const bool in_part = truth[i] >= FIRST_OBJECT;
    const bool in_segment = truth[i] != 0 && result[i] >= FIRST_SEGMENT;
    if (in_part) ++part_points[truth[i]];
    if (in_segment) ++segment_points[result[i]];
    if (in_part && in_segment) ++shared[{truth[i], result[i]}];
  }

  Overlaps overlaps;
  for (const auto& [segment, points] : segment_points) {
    overlaps.segments.push_back(segment);
    overlaps.segment_points.push_back(points);
  }
  for (const auto& [part, points] : part_points) {
    if (points < MIN_PART_POINTS) continue;
    overlaps.part_points[part] = points;
    auto& row = overlaps.shared[part];
    for (const Label segment : overlaps.segments) {
      const auto both = shared.find({part, segment});
      row.push_back(both == shared.end() ? 0 : both->second);
    }
  }
  return overlaps;
}

std::map<Label, std::vector<Label>> partsByObject(const Overlaps& overlaps) {
  std::map<Label, std::vector<Label>> parts;
  for (const auto& [part, points] : overlaps.part_points) parts[part / 10 - 1].push_back(part);
  return parts;
}

/// An object of the truth as a reading has it, with the points it shares with each segment.
struct Reading {
  ObjectOverlap object;
  std::vector<std::size_t> shared;
};

Reading readParts(const Overlaps& overlaps, const std::vector<Label>& parts) {
  Reading reading;
  reading.object.object = parts.front() / 10 - 1;
  reading.shared.assign(overlaps.segments.size(), 0);
  for (const Label part : parts) {
    reading.object.points += overlaps.part_points.at(part);
    const auto& shared = overlaps.shared.at(part);
    for (std::size_t s = 0; s < shared.size(); ++s) reading.shared[s] += shared[s];
  }
  return reading;
}

std::vector<Reading> readObjects(const Overlaps& overlaps, const std::set<Label>& in_parts) {
  std::vector<Reading> readings;
  for (const auto& [object, parts] : partsByObject(overlaps)) {
    if (in_parts.count(object) == 0) {
      readings.push_back(readParts(overlaps, parts));
      continue;
    }
    for (const Label part : parts) {
      readings.push_back(readParts(overlaps, {part}));
      readings.back().object.part = part;
    }
  }
  return readings;
}

/// Matches the objects, those of `in_parts` in parts, with the segments.
OverlapScore scoreReading(const Overlaps& overlaps, const std::set<Label>& in_parts) {
  const auto readings = readObjects(overlaps, in_parts);
  Eigen::MatrixXd f(readings.size(), overlaps.segments.size());
  for (std::size_t r = 0; r < readings.size(); ++r)
    for (std::size_t s = 0; s < overlaps.segments.size(); ++s)
      f(r, s) =
          share(2 * readings[r].shared[s], readings[r].object.points + overlaps.segment_points[s]);
  const auto matches = bestAssignment(f);

  OverlapScore score;
  for (const std::size_t points : overlaps.segment_points) score.segment_points += points;
  for (std::size_t r = 0; r < readings.size(); ++r) {
    ObjectOverlap object = readings[r].object;
    const int match = matches[r];
    if (match >= 0 && readings[r].shared[match] > 0) {
      object.segment = overlaps.segments[match];
      object.segment_points = overlaps.segment_points[match];
      object.overlap = readings[r].shared[match];
    }
    score.truth_points += object.points;
    score.overlap += object.overlap;
    score.objects.push_back(object);
  }
  return score;
}

/// Turns objects from whole to parts and back as long as the overlap grows (or an object becomes
/// whole at the same overlap), from `in_parts` on. Both numbers bound it, so it ends.
OverlapScore improveReading(const Overlaps& overlaps, const std::vector<Label>& divided,
                            std::set<Label> in_parts) {
  OverlapScore best = scoreReading(overlaps, in_parts);
  for (bool changed = true; changed;) {
    changed = false;
    for (const Label object : divided) {
      auto other = in_parts;
      const bool to_whole = other.erase(object) > 0;
      if (!to_whole) other.insert(object);
      const OverlapScore score = scoreReading(overlaps, other);
      if (score.overlap < best.overlap || (score.overlap == best.overlap && !to_whole)) continue;
      in_parts = other;
      best = score;
      changed = true;
    }
  }
  return best;
}

double tableIou(const std::vector<Label>& truth, const std::vector<Label>& result) {
  std::size_t both = 0, either = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth[i] == 0) continue;
    const bool is_table = isTableTruth(truth[i]), called_table = result[i] == 1;
    both += is_table && called_table;
    either += is_table || called_table;
  }
  return either == 0 ? 1.0 : share(both, either);
}

void addTo(OverlapSummary& summary, const OverlapScore& score) {
  summary.precision += score.precision();
  summary.recall += score.recall();
  summary.f += score.f();
  summary.objects += score.objects.size();
  summary.found += std::count_if(score.objects.begin(), score.objects.end(),
                                 [](const auto& object) { return object.iou() >= FOUND_IOU; });
}

void divideBy(std::size_t scenes, OverlapSummary& summary) {
  summary.precision /= scenes;
  summary.recall /= scenes;
  summary.f /= scenes;
}

}  // namespace

std::vector<int> bestAssignment(const Eigen::MatrixXd& scores) {
  if (scores.rows() <= scores.cols()) return cheapestAssignment(-scores);
  const auto row_of_column = cheapestAssignment(-scores.transpose());
  std::vector<int> assignment(scores.rows(), -1);
  for (std::size_t column = 0; column < row_of_column.size(); ++column)
    assignment[row_of_column[column]] = static_cast<int>(column);
  return assignment;
}

double ObjectOverlap::iou() const {
  return overlap == 0 ? 0.0 : share(overlap, points + segment_points - overlap);
}

double OverlapScore::precision() const {
  if (segment_points == 0) return truth_points == 0 ? 1 : 0;
  return share(overlap, segment_points);
}

double OverlapScore::recall() const {
  if (truth_points == 0) return segment_points == 0 ? 1 : 0;
  return share(overlap, truth_points);
}

double OverlapScore::f() const {
  const std::size_t points = segment_points + truth_points;
  return points == 0 ? 1.0 : share(2 * overlap, points);
}

LabelScore scoreLabels(const std::vector<std::uint32_t>& truth,
                       const std::vector<std::uint32_t>& result) {
  if (truth.size() != result.size())
    throw std::invalid_argument("the result must have a label for each of the " +
                                std::to_string(truth.size()) + " points of the truth, got " +
                                std::to_string(result.size()));
  const auto overlaps = countOverlaps(truth, result);
  std::vector<Label> divided;
  for (const auto& [object, parts] : partsByObject(overlaps))
    if (parts.size() > 1) divided.push_back(object);
  const std::set<Label> all_divided(divided.begin(), divided.end());

  LabelScore score;
  score.whole = scoreReading(overlaps, {});
  score.parts = scoreReading(overlaps, all_divided);
  const bool parts_are_better = score.parts.overlap > score.whole.overlap;
  score.best =
      improveReading(overlaps, divided, parts_are_better ? all_divided : std::set<Label>{});
  score.table_iou = tableIou(truth, result);
  return score;
}

std::optional<double> OverlapSummary::foundShare() const {
  if (objects == 0) return std::nullopt;
  return share(found, objects);
}

LabelSummary summarize(const std::vector<LabelScore>& scores) {
  if (scores.empty()) throw std::invalid_argument("no scene to summarize");
  LabelSummary summary;
  summary.scenes = scores.size();
  summary.worst_table_iou = 1;
  for (const auto& score : scores) {
    addTo(summary.best, score.best);
    addTo(summary.whole, score.whole);
    addTo(summary.parts, score.parts);
    summary.table_iou += score.table_iou;
    summary.worst_table_iou = std::min(summary.worst_table_iou, score.table_iou);
  }
  divideBy(summary.scenes, summary.best);
  divideBy(summary.scenes, summary.whole);
  divideBy(summary.scenes, summary.parts);
  summary.table_iou /= summary.scenes;
  return summary;
}

}  // namespace tabletop_perception
