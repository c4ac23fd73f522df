#include "plot.h"

#include <cstdio>

#include "html.h"

namespace tabletop_perception::tools {
namespace {

constexpr double SIDE = 300, LEFT = 60, TOP = 20, WIDTH = 420, HEIGHT = 380;  // [pixels]

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

std::string attribute(const std::string& name, double value) {
  return name + "=\"" + number(value) + "\" ";
}

double columnOf(double x) { return LEFT + SIDE * x; }
double rowOf(double y) { return TOP + SIDE * (1 - y); }

std::string line(const PlotPoint& from, const PlotPoint& to, const std::string& style) {
  return element("line", "",
                 attribute("x1", columnOf(from.x)) + attribute("y1", rowOf(from.y)) +
                     attribute("x2", columnOf(to.x)) + attribute("y2", rowOf(to.y)) + style);
}

std::string text(double column, double row, const std::string& words, const std::string& anchor) {
  return element("text", escapeHtml(words),
                 attribute("x", column) + attribute("y", row) + "font-size=\"12\" text-anchor=\"" +
                     anchor + "\"");
}

std::string grid() {
  constexpr int STEPS = 5;
  const std::string faint = "stroke=\"#ccc\"";
  std::string svg;
  for (int i = 0; i <= STEPS; ++i) {
    const double share = static_cast<double>(i) / STEPS;
    svg +=
        line({0, share, ""}, {1, share, ""}, faint) + line({share, 0, ""}, {share, 1, ""}, faint);
    const std::string percent = std::to_string(100 * i / STEPS) + " %";
    svg += text(LEFT - 6, rowOf(share) + 4, percent, "end") +
           text(columnOf(share), TOP + SIDE + 16, percent, "middle");
  }
  return svg;
}

}  // namespace

std::string sharePlot(const std::string& x_name, const std::string& y_name,
                      const std::vector<PlotPoint>& points, bool diagonal) {
  std::string svg = grid() + text(LEFT, TOP - 6, y_name, "middle") +
                    text(LEFT + SIDE / 2, TOP + SIDE + 36, x_name, "middle");
  if (diagonal) svg += line({0, 0, ""}, {1, 1, ""}, "stroke=\"#888\" stroke-dasharray=\"4\"");
  const std::string ours = "stroke=\"#1060c0\" stroke-width=\"2\"";
  for (std::size_t i = 1; i < points.size(); ++i) svg += line(points[i - 1], points[i], ours);
  for (const auto& point : points)
    svg += element("circle", "",
                   attribute("cx", columnOf(point.x)) + attribute("cy", rowOf(point.y)) +
                       "r=\"4\" fill=\"#1060c0\"") +
           text(columnOf(point.x) + 6, rowOf(point.y) - 6, point.label, "start");
  return element("svg", svg, attribute("width", WIDTH) + attribute("height", HEIGHT));
}

}  // namespace tabletop_perception::tools
