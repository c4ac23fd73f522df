#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <optional>
#include <string>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// The line of README.md that begins with these words; empty if there is none.
std::string lineOf(const std::string& words) {
  std::ifstream readme(std::string(PROJECT_DIR) + "/README.md");
  for (std::string line; std::getline(readme, line);)
    if (line.rfind(words, 0) == 0) return line;
  return "";
}

/// What a command prints within 10 s, while a camera sees a can on the table.
std::string outputOf(const std::string& command, Camera& camera, const Cloud& cloud) {
  auto output = std::async(std::launch::async, [&] {
    std::string text;
    std::array<char, 4096> part;
    std::FILE* pipe = popen(("timeout 10 " + command + " 2>&1").c_str(), "r");
    while (pipe && std::fgets(part.data(), part.size(), pipe)) text += part.data();
    if (pipe) pclose(pipe);
    return text;
  });
  while (output.wait_for(std::chrono::milliseconds(300)) != std::future_status::ready) {
    camera.send(cloud);
    ros::spinOnce();
  }
  return output.get();
}

/// Each line of the README that asks the running graph, as it is written there.
class Readme : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    trainObjects(scene_.objects, databaseFile());
    camera_.emplace(*nh());
    const Recorder<RecognizedObjectArray> objects(*nh(), "/perception/refine/objects");
    ASSERT_TRUE(warmUp(scene_.cloud, *camera_, objects));
  }
  static void TearDownTestSuite() {
    camera_.reset();
    std::filesystem::remove(databaseFile());
  }
  static ros::NodeHandle* nh() {
    static ros::NodeHandle nh;
    return &nh;
  }

  inline static const scene::SyntheticScene scene_ =
      scene::render({{"can", scene::painted(scene::house(), scene::HOUSE_COLOR),
                      scene::standing(0.06, 0.0, -0.6)}});
  inline static std::optional<Camera> camera_;
};

TEST_F(Readme, theServiceAnswersAsItIsCalled) {
  const auto command = lineOf("rosservice call");
  ASSERT_FALSE(command.empty());
  const auto output = outputOf(command, *camera_, scene_.cloud);
  EXPECT_NE(output.find("success: True"), output.npos) << command << ": " << output;
  EXPECT_NE(output.find("name: \"can\""), output.npos) << output;
  EXPECT_NE(output.find("frame_id: \"table\""), output.npos) << output;
}

TEST_F(Readme, objectsAreEchoed) {
  const auto command = lineOf("rostopic echo");
  ASSERT_FALSE(command.empty());
  const auto output = outputOf(command, *camera_, scene_.cloud);
  EXPECT_NE(output.find("name: \"can\""), output.npos) << command << ": " << output;
}

TEST_F(Readme, tfEchoesTheFrameOfTheObject) {
  const auto command = lineOf("rosrun tf tf_echo");
  ASSERT_FALSE(command.empty());
  const auto output = outputOf(command, *camera_, scene_.cloud);
  EXPECT_NE(output.find("- Translation:"), output.npos) << command << ": " << output;
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "readme_test");
  return RUN_ALL_TESTS();
}
