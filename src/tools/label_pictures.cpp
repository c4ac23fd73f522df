#include "label_pictures.h"

#include <algorithm>
#include <map>
#include <string>

namespace tabletop_perception::tools {
namespace {

constexpr std::uint32_t TABLE = 1;          // of the result
constexpr std::uint32_t FIRST_SEGMENT = 2;  // of the result
constexpr int NONE = -1;
constexpr int STRIPE = 4;  // [pixels]

bool isTableTruth(std::uint32_t label) { return label >= 1 && label <= 9; }

/// Distinct colours, RGB: Sasha Trubetskoy's list without its greys, black and white.
constexpr std::uint32_t PALETTE[] = {0xe6194b, 0x3cb44b, 0xffe119, 0x4363d8, 0xf58231, 0x911eb4,
                                     0x46f0f0, 0xf032e6, 0xbcf60c, 0xfabebe, 0x008080, 0xe6beff,
                                     0x9a6324, 0xfffac8, 0x800000, 0xaaffc3, 0x808000, 0xffd8b1};

/// The colours come again after the last.
cv::Vec3b paletteColor(int index) {
  const std::uint32_t rgb = PALETTE[index % std::size(PALETTE)];
  return cv::Vec3b(rgb, rgb >> 8, rgb >> 16);
}

cv::Vec3b dimmed(const cv::Vec3b& color) { return color * 0.35; }

/// Every other stripe of an area is dark.
cv::Vec3b striped(const cv::Vec3b& color, int column, int row) {
  return (column + row) / STRIPE % 2 == 0 ? color : color * 0.25;
}

/// Areas to be coloured, numbered from 0, and what the other points are.
struct Areas {
  std::vector<int> of_point;  // NONE: of no area
  std::vector<bool> on_table;
  std::vector<std::string> names;
  std::vector<int> colors;
  std::vector<bool> striped;
};

cv::Mat paintAreas(const SceneCanvas& canvas, const Areas& areas) {
  auto picture = paintPicture(canvas.layout, [&](std::size_t point, int column, int row) {
    const int area = areas.of_point[point];
    if (area == NONE) return areas.on_table[point] ? tableColor() : dimmed(canvas.natural[point]);
    const auto color = paletteColor(areas.colors[area]);
    return areas.striped[area] ? striped(color, column, row) : color;
  });
  writeTexts(canvas.layout, areas.of_point, areas.names, picture);
  return picture;
}

/// The segments of a result as areas, in ascending order; those without an object take the colours
/// after the objects'.
Areas segmentAreas(const Labels& result, const LabelFindings& findings) {
  std::map<std::uint32_t, int> area_of_segment;
  for (const auto label : result)
    if (label >= FIRST_SEGMENT) area_of_segment[label] = 0;

  Areas areas;
  int next_color = static_cast<int>(findings.objects.size());
  for (auto& [segment, area] : area_of_segment) {
    area = static_cast<int>(areas.names.size());
    const auto object = findings.object_of_segment.find(segment);
    const bool matched = object != findings.object_of_segment.end();
    areas.names.push_back(std::to_string(segment));
    areas.colors.push_back(matched ? object->second : next_color++);
    areas.striped.push_back(!matched);
  }
  for (const auto label : result) {
    areas.of_point.push_back(label >= FIRST_SEGMENT ? area_of_segment.at(label) : NONE);
    areas.on_table.push_back(label == TABLE);
  }
  return areas;
}

}  // namespace

cv::Vec3b tableColor() { return {125, 105, 85}; }

SceneCanvas sceneCanvas(const PcdContents& contents) {
  return {pictureLayout(contents), naturalColors(contents)};
}

cv::Mat naturalPicture(const SceneCanvas& canvas) {
  return paintPicture(canvas.layout,
                      [&](std::size_t point, int, int) { return canvas.natural[point]; });
}

cv::Mat truthPicture(const SceneCanvas& canvas, const Labels& truth,
                     const LabelFindings& findings) {
  Areas areas;
  areas.of_point = findings.object_of_point;
  for (const auto label : truth) areas.on_table.push_back(isTableTruth(label));
  for (const auto& object : findings.objects) {
    areas.colors.push_back(static_cast<int>(areas.names.size()));
    areas.names.push_back(object.name);
    areas.striped.push_back(true);
  }
  for (const auto& [segment, object] : findings.object_of_segment) areas.striped[object] = false;
  return paintAreas(canvas, areas);
}

cv::Mat resultPicture(const SceneCanvas& canvas, const Labels& result,
                      const LabelFindings& findings) {
  return paintAreas(canvas, segmentAreas(result, findings));
}

cv::Mat segmentPicture(const SceneCanvas& canvas, const Labels& result) {
  auto areas = segmentAreas(result, {});
  std::fill(areas.striped.begin(), areas.striped.end(), false);
  return paintAreas(canvas, areas);
}

cv::Mat faultPicture(const SceneCanvas& canvas, const Labels& truth, const Labels& result,
                     const LabelFindings& findings) {
  return paintPicture(canvas.layout, [&](std::size_t point, int, int) {
    const auto right = dimmed(canvas.natural[point]);
    if (truth[point] == 0) return right;
    const int object = findings.object_of_point[point];
    const auto label = result[point];
    if (label < FIRST_SEGMENT) {
      if (object != NONE) return FaultColor::missed();
      return isTableTruth(truth[point]) && label != TABLE ? FaultColor::tableMissed() : right;
    }
    if (object == NONE) return FaultColor::noObject();
    const auto owner = findings.object_of_segment.find(label);
    const bool own = owner != findings.object_of_segment.end() && owner->second == object;
    return own ? right : FaultColor::otherSegment();
  });
}

}  // namespace tabletop_perception::tools
