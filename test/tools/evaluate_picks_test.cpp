#include "evaluate.h"

#include <filesystem>
#include <sstream>

#include <gtest/gtest.h>

#include "commands.h"
#include "printed.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

using nlohmann::json;

/// Simulated scenes of a box and a long box, which lie 6 cm apart.
class EvaluatePicks : public testing::Test {
 protected:
  EvaluatePicks() {
    writeBox("box", 0.1, 0.12, 0.14);
    writeBox("bar", 0.06, 0.07, 0.2);
    printedBy(addSimulate, "simulate --models " + folder.file("models") +
                               " --scenes 2 --objects 2 --gap 0.06 --seed 3 --output " +
                               folder.file("truth"));
  }

  void writeBox(const std::string& name, double x, double y, double z) {
    std::ostringstream mesh;
    mesh << "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
            "property float z\nelement face 6\nproperty list uchar int vertex_indices\n"
            "end_header\n";
    for (int i = 0; i < 8; ++i)
      mesh << (i & 1 ? x : 0) << ' ' << (i & 2 ? y : 0) << ' ' << (i & 4 ? z : 0) << '\n';
    mesh << "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
    folder.write("models/" + name + "/mesh.ply", mesh.str());
  }

  json figures(const std::string& words = "") const {
    return json::parse(printedBy(addEvaluate,
                                 "evaluate --json --picks " + folder.file("truth") + ' ' + words))
        .at(0);
  }

  TempFolder folder;
};

TEST_F(EvaluatePicks, countFivePerObjectAndTheFramesOfTheRightOnes) {
  const auto all = figures();
  EXPECT_EQ(all["separated"]["all"], 15);  // of one object there are too few points
  EXPECT_EQ(all["separated"]["right"], 15);
  EXPECT_EQ(all["touching"]["all"], 0);
  EXPECT_GT(all["z"]["all"], 0);
  EXPECT_EQ(all["z"]["right"], all["z"]["all"]);
  EXPECT_EQ(all["x"]["right"], all["x"]["all"]);
}

TEST_F(EvaluatePicks, areTheSameWithPixelsThatAreRenderedFromTheMeshes) {
  const auto labelled = figures();
  for (const auto* scene : {"truth/000000/", "truth/000001/"})
    std::filesystem::remove(folder.file(scene) + "label.png");
  const auto rendered = figures("--models " + folder.file("models"));
  for (const auto* figure : {"separated", "touching", "z", "x"})
    EXPECT_EQ(rendered[figure], labelled[figure]) << figure;
}

TEST_F(EvaluatePicks, aThingThatIsNotFoundCountsAsWrong) {
  const auto config = folder.write("config.yaml", "table:\n  max_height: 0.05\n");
  const auto all = figures("--config " + config);
  EXPECT_EQ(all["separated"]["all"], 15);
  EXPECT_LT(all["separated"]["right"], 15);
}

}  // namespace
}  // namespace tabletop_perception::tools
