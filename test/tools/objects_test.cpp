#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "tabletop_perception/database.h"
#include "temp_folder.h"
#include "trained_model.h"

namespace tabletop_perception::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Mode = ObjectDatabase::Mode;

/// Runs `objects` with the words of a command line; gives back what it prints on stdout.
std::string objects(const std::string& words) {
  CLI::App app;
  addObjects(app);
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  try {
    app.parse("objects " + words, false);
  } catch (...) {
    testing::internal::GetCapturedStdout();
    testing::internal::GetCapturedStderr();
    throw;
  }
  testing::internal::GetCapturedStderr();
  return testing::internal::GetCapturedStdout();
}

/// The line with which `objects` ends for bad input.
std::string complaint(const std::string& words) {
  try {
    objects(words);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "was not refused";
}

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// A database of two objects, one of them a bottle that any turn about z leaves as it is.
class Objects : public testing::Test {
 protected:
  Objects() {
    auto egg = trainedModel();
    auto bottle = egg;
    bottle.name = "bottle";
    bottle.origin = "4 clouds";
    bottle.symmetry = {};
    bottle.symmetry.axis = -Eigen::Vector3d::UnitZ();
    ObjectDatabase(file_, Mode::WRITE).store({egg, bottle});
  }

  std::vector<std::string> names(const std::string& file) const {
    return ObjectDatabase(file, Mode::READ).names();
  }

  TempFolder folder_;
  const std::string file_ = folder_.file("objects.db");
};

TEST_F(Objects, AreListedInARowEach) {
  const auto lines = linesOf(objects("--database " + file_));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].find("name    diameter [mm]  size x y z [mm]"), 0u) << lines[0];
  EXPECT_EQ(lines[1].find("bottle  160            100 x 70 x 160"), 0u) << lines[1];
  EXPECT_NE(lines[1].find("any turn about z  "), std::string::npos) << lines[1];
  EXPECT_NE(lines[2].find("180 deg about z (declared)"), std::string::npos) << lines[2];
  EXPECT_NE(lines[2].find("a \"spiral\": #7 of points"), std::string::npos) << lines[2];
  EXPECT_NE(lines[2].find(" 4 vfh"), std::string::npos) << lines[2];
}

TEST_F(Objects, AreListedAsJsonInALineEach) {
  const auto lines = linesOf(objects("--json --database " + file_));
  ASSERT_EQ(lines.size(), 2u);
  const auto bottle = json::parse(lines[0]), egg = json::parse(lines[1]);
  EXPECT_EQ(bottle["name"], "bottle");
  EXPECT_EQ(bottle["symmetry"]["axis"], json::parse("[-0.0, -0.0, -1.0]"));
  EXPECT_TRUE(egg["symmetry"]["axis"].is_null());
  EXPECT_NEAR(egg["symmetry"]["rotations"][0][0][0].get<double>(), -1, 1e-12);
  EXPECT_EQ(egg["origin"], trainedModel().origin);
  EXPECT_EQ(egg["diameter"], 0.16);
  EXPECT_NEAR(egg["size"][1].get<double>(), 0.07, 1e-3);
  EXPECT_EQ(egg["views"], 4);
  EXPECT_EQ(egg["descriptors"]["vfh"], 4);
  EXPECT_EQ(egg["options"]["leaf"], 0.004);
}

TEST_F(Objects, AreRemovedByName) {
  EXPECT_EQ(complaint("--remove tea --database " + file_),
            file_ + " holds no object 'tea', its objects are: bottle, egg-1");
  objects("--remove bottle --database " + file_);
  EXPECT_EQ(names(file_), std::vector<std::string>{"egg-1"});
  const auto missing = folder_.file("missing.db");
  EXPECT_EQ(complaint("--remove bottle --database " + missing), missing + ": does not exist");
  EXPECT_FALSE(fs::exists(missing));
}

TEST_F(Objects, GraspsAreAddedListedAndRemoved) {
  const auto at = " --database " + file_;
  objects("--add-grasp bottle top --position 0 0 0.12 --rpy-deg 180 0 90 --width 0.07" + at);
  objects(
      "--add-grasp bottle side --position -0.05 0 0.06 --orientation 0 0.7071068 0 0.7071068 "
      "--width 0.09 --preference 2" +
      at);
  const auto lines = linesOf(objects("--grasps" + at));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[1].find("bottle  side   -50 0 60"), 0u) << lines[1];
  const auto bottle = json::parse(linesOf(objects("--json" + at))[0]);
  ASSERT_EQ(bottle["grasps"].size(), 2u);
  const auto top = bottle["grasps"][1];
  EXPECT_EQ(top["name"], "top");
  EXPECT_EQ(top["width"], 0.07);
  EXPECT_EQ(top["preference"], 0);
  const auto q = top["pose"]["orientation"];
  const Eigen::Matrix3d rotation = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).toRotationMatrix();
  EXPECT_TRUE(rotation.col(2).isApprox(-Eigen::Vector3d::UnitZ(), 1e-9));  // it comes from above
  EXPECT_TRUE(rotation.col(0).isApprox(Eigen::Vector3d::UnitY(), 1e-9));   // then turned by 90 deg

  objects("--remove-grasp bottle top" + at);
  EXPECT_EQ(linesOf(objects("--grasps" + at)).size(), 2u);
  EXPECT_EQ(complaint("--remove-grasp bottle top" + at), "'bottle' has no grasp 'top'");
  EXPECT_EQ(complaint("--remove-grasp tea top" + at), file_ + ": holds no object 'tea'");
}

TEST_F(Objects, AGraspThatIsNotWholeIsRefused) {
  const auto refusal = [&](const std::string& words) {
    return complaint("--add-grasp bottle top " + words + " --database " + file_);
  };
  EXPECT_NE(refusal("--position 0 0 0").find("--width"), std::string::npos);
  EXPECT_NE(refusal("--width 0.1").find("--position"), std::string::npos);
  EXPECT_NE(refusal("--position 0 0 nan --width 0.1").find("not finite"), std::string::npos);
  EXPECT_NE(refusal("--position 0 0 0 --width -1").find("width -1"), std::string::npos);
  EXPECT_NE(refusal("--position 0 0 0 --width 0.1 --orientation 1 1 0 0").find("unit quaternion"),
            std::string::npos);
  EXPECT_NE(refusal("--position 0 0 0 --width 0.1 --orientation 1 0 0 0 --rpy-deg 0 0 0"),
            "was not refused");
  EXPECT_EQ(objects("--grasps --database " + file_), "");
}

TEST_F(Objects, GoOutAsFoldersAndComeBackIntoAnotherDatabase) {
  const auto out = folder_.file("out"), other = folder_.file("other.db");
  objects("--export " + out + " --database " + file_);
  EXPECT_TRUE(fs::exists(out + "/egg-1/view_0003.pcd"));
  EXPECT_TRUE(fs::exists(out + "/bottle/object.yaml"));
  objects("--import " + out + " --database " + other);
  EXPECT_EQ(names(other), (std::vector<std::string>{"bottle", "egg-1"}));
  EXPECT_EQ(objects("--database " + other), objects("--database " + file_));
}

TEST_F(Objects, ComeInAllOrNone) {
  const auto out = folder_.file("out"), other = folder_.file("other.db");
  objects("--export " + out + " --database " + file_);
  truncateFile(out + "/egg-1/view_0003.pcd", 0.5);
  EXPECT_EQ(complaint("--import " + out + " --database " + other)
                .find(out + "/egg-1/view_0003.pcd: is cut short"),
            0u);
  EXPECT_FALSE(fs::exists(other));

  fs::remove_all(out + "/egg-1");
  fs::copy(out + "/bottle", out + "/copy", fs::copy_options::recursive);
  EXPECT_EQ(complaint("--import " + out + " --database " + other),
            out + "/copy and " + out + "/bottle hold an object of the same name, 'bottle'");
  EXPECT_FALSE(fs::exists(other));
}

TEST_F(Objects, BadUsageIsSaidInWords) {
  EXPECT_EQ(complaint("--database " + folder_.file("missing.db")),
            folder_.file("missing.db") + ": does not exist");
  EXPECT_NE(complaint("--json --remove egg-1 --database " + file_), "was not refused");
  EXPECT_NE(complaint("--json"), "was not refused");
  EXPECT_NE(complaint("--remove '' --database " + file_), "was not refused");
  EXPECT_EQ(complaint("--import " + folder_.file("missing") + " --database " + file_),
            folder_.file("missing") + " is not a folder");
  fs::create_directory(folder_.file("empty"));
  EXPECT_EQ(
      complaint("--import " + folder_.file("empty") + " --database " + file_),
      folder_.file("empty") + " holds no folders: there must be one per object, with object.yaml");
}

TEST_F(Objects, AnEmptyDatabaseIsNoError) {
  const auto empty = folder_.file("empty.db");
  ObjectDatabase(empty, Mode::WRITE);
  EXPECT_EQ(objects("--database " + empty), "");
  EXPECT_EQ(objects("--json --database " + empty), "");
}

}  // namespace
}  // namespace tabletop_perception::tools
