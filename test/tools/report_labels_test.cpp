#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <stdexcept>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>
#include <opencv2/imgcodecs.hpp>

#include "commands.h"
#include "tabletop_perception/pcd.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

namespace fs = std::filesystem;
using Labels = std::vector<std::uint32_t>;

constexpr int WIDTH = 60;
constexpr int BAND = 10;  // rows

#define EXPECT_MENTIONS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

/// Truth and results are clouds of horizontal bands, each with one label.
class ReportLabels : public testing::Test {
 protected:
  ReportLabels() {
    fs::create_directories(folder.file("truth"));
    fs::create_directories(folder.file("results"));
  }

  void writeBands(const std::string& name, const Labels& bands,
                  std::uint32_t rgb = 0x204060) const {
    PcdContents contents;
    contents.cloud = Cloud(WIDTH, BAND * static_cast<int>(bands.size()), true);
    for (std::size_t i = 0; i < contents.cloud.size(); ++i) {
      contents.cloud.setPoint(i, {0.01f * (i % WIDTH), 0.01f * (i / WIDTH), 1});
      contents.cloud.rgb[i] = rgb;
      contents.labels.push_back(bands[i / WIDTH / BAND]);
    }
    writePcd(folder.file(name), contents);
  }

  /// A cloud without a grid or colours: two squares side by side, the right one labelled 2.
  void writeScatter(const std::string& name, float z) const {
    PcdContents contents;
    contents.cloud = Cloud(5000, 1, false);
    for (int i = 0; i < 5000; ++i) {
      contents.cloud.setPoint(i, {0.01f * (i % 100) - 0.5f, 0.01f * (i / 100) - 0.25f, z});
      contents.labels.push_back(i % 100 < 50 ? 1 : 2);
    }
    writePcd(folder.file(name), contents);
  }

  void report(const std::string& target) const {
    CLI::App app;
    addEvaluate(app);
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    std::string problem;
    try {
      app.parse("evaluate --labels " + folder.file("truth") + " --results " +
                    folder.file("results") + " --report " + target,
                false);
    } catch (const std::exception& error) {
      problem = error.what();
    }
    testing::internal::GetCapturedStdout();
    testing::internal::GetCapturedStderr();
    if (!problem.empty()) throw std::runtime_error(problem);
  }

  std::string page() const {
    std::ifstream stream(folder.file("report/index.html"));
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }

  cv::Mat picture(const std::string& name) const {
    return cv::imread(folder.file("report/" + name), cv::IMREAD_COLOR);
  }

  /// Near the left rim of a band, where no text is.
  static cv::Vec3b bandColor(const cv::Mat& picture, int band) {
    return picture.at<cv::Vec3b>(BAND * band + BAND / 2, 1);
  }

  TempFolder folder;
};

TEST_F(ReportLabels, showsEveryScene) {
  writeBands("truth/a.pcd", {1, 20, 30});
  writeBands("results/a.pcd", {1, 2, 3});
  writeBands("truth/lost.pcd", {1, 20});
  writeBands("results/alone.pcd", {1, 2, 2, 2});
  report(folder.file("report"));
  for (const std::string name : {"a", "lost", "alone"})
    EXPECT_MENTIONS(page(), "<h2 id=\"" + name + "\">" + name);
  EXPECT_MENTIONS(page(), "lost - all (no result)");
  EXPECT_LT(page().find("<h1>Without truth"), page().find("id=\"alone\""));
  for (const std::string kind : {"scene", "truth", "result", "faults"}) {
    EXPECT_EQ(picture("a_" + kind + ".png").size(), cv::Size(WIDTH, 3 * BAND)) << kind;
    EXPECT_EQ(picture("lost_" + kind + ".png").size(), cv::Size(WIDTH, 2 * BAND)) << kind;
  }
  EXPECT_EQ(picture("alone_scene.png").size(), cv::Size(WIDTH, 4 * BAND));
  EXPECT_EQ(picture("alone_result.png").size(), cv::Size(WIDTH, 4 * BAND));
  EXPECT_EQ(bandColor(picture("a_scene.png"), 0), cv::Vec3b(0x60, 0x40, 0x20));
}

TEST_F(ReportLabels, everyPictureOnThePageIsThere) {
  writeBands("truth/a.pcd", {1, 20});
  writeBands("results/a.pcd", {1, 2});
  report(folder.file("report"));
  const std::string html = page();
  const std::regex source("src=\"([^\"]*)\"");
  std::sregex_iterator next(html.begin(), html.end(), source), end;
  EXPECT_EQ(std::distance(next, end), 4);
  for (; next != end; ++next) EXPECT_FALSE(picture((*next)[1]).empty()) << (*next)[1];
}

TEST_F(ReportLabels, anObjectAndItsSegmentShareAColour) {
  writeBands("truth/a.pcd", {1, 20, 30, 0});
  writeBands("results/a.pcd", {1, 3, 2, 0});
  report(folder.file("report"));
  const auto truth = picture("a_truth.png"), result = picture("a_result.png");
  for (int band = 0; band < 4; ++band)
    EXPECT_EQ(bandColor(truth, band), bandColor(result, band)) << band;
  EXPECT_NE(bandColor(truth, 1), bandColor(truth, 2));
  EXPECT_NE(bandColor(truth, 0), bandColor(truth, 1));
}

TEST_F(ReportLabels, faultsStandOutFromWhatIsRight) {
  writeBands("truth/a.pcd", {1, 1, 20, 20, 20, 30});
  writeBands("results/a.pcd", {1, 0, 2, 2, 3, 0});
  report(folder.file("report"));
  const auto faults = picture("a_faults.png");
  const auto right = bandColor(faults, 0);
  EXPECT_EQ(bandColor(faults, 2), right);
  EXPECT_NE(bandColor(faults, 1), right);
  EXPECT_NE(bandColor(faults, 4), right);
  EXPECT_NE(bandColor(faults, 5), right);
  EXPECT_NE(bandColor(faults, 4), bandColor(faults, 5));
  EXPECT_MENTIONS(page(), "<td>missed</td>");
  EXPECT_MENTIONS(page(), "<td>in segment 3 33 %</td>");
  EXPECT_MENTIONS(page(), "<td>object 1 100 %</td>");
}

TEST_F(ReportLabels, escapesNames) {
  writeBands("truth/a<b>&c.pcd", {1, 20});
  writeBands("results/a<b>&c.pcd", {1, 2});
  folder.write("truth/gt_summary.json",
               R"({"scenes": [{"file": "a<b>&c.pcd", "category": "<script>"}]})");
  report(folder.file("report"));
  EXPECT_EQ(page().find("<b>"), std::string::npos);
  EXPECT_EQ(page().find("<script>"), std::string::npos);
  EXPECT_MENTIONS(page(), "a&lt;b&gt;&amp;c - &lt;script&gt;");
  EXPECT_MENTIONS(page(), "src=\"a%3Cb%3E%26c_truth.png\"");
  EXPECT_FALSE(picture("a<b>&c_truth.png").empty());
}

TEST_F(ReportLabels, cloudsWithoutAGridAreDrawnAsTheSensorSawThem) {
  writeBands("truth/a.pcd", {1, 20});
  writeBands("results/a.pcd", {1, 2});
  writeScatter("results/ahead.pcd", 1);
  writeScatter("results/behind.pcd", -1);
  report(folder.file("report"));
  const auto ahead = picture("ahead_result.png"), behind = picture("behind_result.png");
  EXPECT_EQ(ahead.cols, 640);
  EXPECT_NEAR(ahead.rows, 320, 10);
  const cv::Point left(100, 160), right(420, 160);
  EXPECT_NE(ahead.at<cv::Vec3b>(left), ahead.at<cv::Vec3b>(right));
  EXPECT_EQ(ahead.at<cv::Vec3b>(left), behind.at<cv::Vec3b>(left));
  EXPECT_EQ(ahead.at<cv::Vec3b>(right), behind.at<cv::Vec3b>(right));
  EXPECT_NE(picture("ahead_scene.png").at<cv::Vec3b>(left), cv::Vec3b(0, 0, 0));
}

TEST_F(ReportLabels, refusesAFolderThatCannotBeWritten) {
  writeBands("truth/a.pcd", {1, 20});
  writeBands("results/a.pcd", {1, 2});
  folder.write("file", "");
  fs::create_directories(folder.file("blocked/index.html"));
  for (const std::string target : {"file", "file/below", "blocked"}) {
    try {
      report(folder.file(target));
      ADD_FAILURE() << target;
    } catch (const std::exception& error) {
      const std::string line = error.what();
      EXPECT_MENTIONS(line, "--report");
      EXPECT_MENTIONS(line, folder.file(target));
      EXPECT_EQ(line.find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace tabletop_perception::tools
