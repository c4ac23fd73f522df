#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <future>
#include <optional>
#include <string>
#include <vector>

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

bool hasAll(const std::string& text, const std::vector<std::string>& parts) {
  return std::all_of(parts.begin(), parts.end(),
                     [&](const auto& part) { return text.find(part) != text.npos; });
}

/// What a command prints until it has printed all `parts`, for 15 s at most, while a camera sees a
/// can on the table.
std::string outputOf(const std::string& command, const std::vector<std::string>& parts,
                     Camera& camera, const Cloud& cloud) {
  auto output = std::async(std::launch::async, [&] {
    std::string text;
    std::array<char, 4096> part;
    std::FILE* pipe = popen(("timeout 15 " + command + " 2>&1").c_str(), "r");
    while (pipe && !hasAll(text, parts) && std::fgets(part.data(), part.size(), pipe))
      text += part.data();
    if (pipe) pclose(pipe);  // ends at its next word what would go on printing
    return text;
  });
  while (output.wait_for(std::chrono::milliseconds(300)) != std::future_status::ready) {
    camera.send(cloud);
    ros::spinOnce();
  }
  return output.get();
}

/// Runs the README's line that begins with `words`, on a busy machine more than once: what it
/// prints has all `parts`.
void expectAnswer(const std::string& words, const std::vector<std::string>& parts, Camera& camera,
                  const Cloud& cloud) {
  const auto command = lineOf(words);
  ASSERT_FALSE(command.empty()) << "README.md has no line that begins with " << words;
  std::string output;
  for (int i = 0; i < 4 && !hasAll(output, parts); ++i)
    output = outputOf(command, parts, camera, cloud);
  EXPECT_TRUE(hasAll(output, parts)) << command << ": " << output;
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
  expectAnswer("rosservice call", {"success: True", "name: \"can\"", "frame_id: \"table\""},
               *camera_, scene_.cloud);
}

TEST_F(Readme, objectsAreEchoed) {
  expectAnswer("rostopic echo", {"name: \"can\""}, *camera_, scene_.cloud);
}

TEST_F(Readme, tfEchoesTheFrameOfTheObject) {
  expectAnswer("rosrun tf tf_echo", {"- Translation:"}, *camera_, scene_.cloud);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "readme_test");
  return RUN_ALL_TESTS();
}
