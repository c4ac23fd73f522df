#include <cmath>
#include <fstream>
#include <regex>
#include <sstream>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "commands.h"
#include "temp_folder.h"
#include "wedge_model.h"

namespace tabletop_perception::tools {
namespace {

using nlohmann::json;

#define EXPECT_MENTIONS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

/// A wall 2 m away; before it, says the truth, two wedges of 20 cm.
class ReportPoses : public testing::Test {
 protected:
  ReportPoses() {
    writeWedgeModel(folder);
    json objects = json::array();
    for (const double x : {-0.3, 0.1})
      objects.push_back({{"name", "wedge"},
                         {"visible_share", 0.9},
                         {"model_to_camera_3x4", {{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, 1}}}});
    folder.write("truth/s<1/gt.json", json{{"camera",
                                            {{"fx", 200.0},
                                             {"fy", 200.0},
                                             {"cx", 79.5},
                                             {"cy", 59.5},
                                             {"width", WIDTH},
                                             {"height", HEIGHT}}},
                                           {"depth_unit_m", 0.001},
                                           {"objects", objects}}
                                          .dump());
    cv::imwrite(folder.file("truth/s<1/depth.png"), cv::Mat1w(HEIGHT, WIDTH, std::uint16_t{2000}));
  }

  static json result(double x, double score) {
    return {{"name", "wedge"},
            {"score", score},
            {"pose", {{"position", {x, 0, 1}}, {"orientation", {0, 0, 0, 1}}}}};
  }

  void report(const json& objects) const {
    folder.write("results/s<1.json", json{{"objects", objects}}.dump());
    CLI::App app;
    addEvaluate(app);
    testing::internal::CaptureStdout();
    std::string problem;
    try {
      app.parse("evaluate --poses " + folder.file("truth") + " --models " + folder.file("models") +
                    " --results " + folder.file("results") + " --report " + folder.file("report"),
                false);
    } catch (const std::exception& error) {
      problem = error.what();
    }
    testing::internal::GetCapturedStdout();
    EXPECT_EQ(problem, "");
  }

  std::string page() const {
    std::ifstream stream(folder.file("report/index.html"));
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }

  /// Pixels of a colour in the picture, BGR.
  int count(const cv::Vec3b& color) const {
    const cv::Mat picture = cv::imread(folder.file("report/s<1_poses.png"), cv::IMREAD_COLOR);
    EXPECT_EQ(picture.size(), cv::Size(WIDTH, HEIGHT));
    int pixels = 0;
    for (auto pixel = picture.begin<cv::Vec3b>(); pixel != picture.end<cv::Vec3b>(); ++pixel)
      pixels += *pixel == color;
    return pixels;
  }

  static constexpr int WIDTH = 160, HEIGHT = 120;
  const cv::Vec3b RIGHT{80, 220, 80}, WRONG{60, 60, 250}, MISSED{40, 170, 255};

  TempFolder folder;
};

TEST_F(ReportPoses, showsWhatIsRightAndWhatIsMissed) {
  report(json::array({result(-0.3, 0.9)}));  // braces alone would copy
  EXPECT_MENTIONS(page(), "s&lt;1");
  EXPECT_EQ(page().find("s<1"), std::string::npos);
  EXPECT_MENTIONS(page(), "<td>right</td>");
  EXPECT_MENTIONS(page(), "<td>missed</td>");
  EXPECT_GT(count(RIGHT), 40);
  EXPECT_GT(count(MISSED), 40);
  EXPECT_EQ(count(WRONG), 0);
}

TEST_F(ReportPoses, showsWhatIsWrong) {
  report({result(-0.3, 0.9), result(0.2, 0.7), result(0.25, 0.6)});
  EXPECT_MENTIONS(page(), "<td>wrong</td>");
  EXPECT_MENTIONS(page(), "<td>no object of this name is left</td>");
  EXPECT_GT(count(WRONG), 40);
  EXPECT_EQ(count(MISSED), 0);
}

TEST_F(ReportPoses, anEarlierPageStaysWhenTheInputIsBad) {
  report(json::array({result(-0.3, 0.9)}));
  const std::string before = page();
  folder.write("truth/s<1/gt.json", "{");
  CLI::App app;
  addEvaluate(app);
  EXPECT_THROW(
      app.parse("evaluate --poses " + folder.file("truth") + " --models " + folder.file("models") +
                    " --results " + folder.file("results") + " --report " + folder.file("report"),
                false),
      std::invalid_argument);
  EXPECT_EQ(page(), before);
}

TEST_F(ReportPoses, plotsTheRightOnesByScoreAndVisibility) {
  report({result(-0.3, 0.95), result(0.1, 0.93), result(0.3, 0.65)});
  EXPECT_MENTIONS(page(), ">2/2</text>");  // at scores from 0.9 on; and of the objects seen
  EXPECT_MENTIONS(page(), ">0/1</text>");  // at scores from 0.6 to 0.7
  const auto text = page();
  const std::regex circle("<circle cx=\"([0-9.]+)\" cy=\"([0-9.]+)\"");
  std::vector<std::pair<double, double>> circles;
  for (std::sregex_iterator i(text.begin(), text.end(), circle), end; i != end; ++i)
    circles.emplace_back(std::stod((*i)[1]), std::stod((*i)[2]));
  ASSERT_EQ(circles.size(), 3u);  // two of scores, one of visibility
  EXPECT_NEAR((circles[1].first - circles[0].first) / 300, 0.94 - 0.65, 0.001);
  EXPECT_NEAR((circles[0].second - circles[1].second) / 300, 1, 0.001);
}

}  // namespace
}  // namespace tabletop_perception::tools
