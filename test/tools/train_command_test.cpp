// Runs `tabletop train` itself: every source, refusals, and killing it at any moment.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "progress.h"
#include "scene.h"
#include "tabletop_perception/database.h"
#include "tabletop_perception/pcd.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int exit_code;
  std::string out, err;
};

std::string textOf(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class TrainCommand : public testing::Test {
 protected:
  Outcome train(const std::string& arguments, const std::string& name = "thing") const {
    const auto command = "'" TABLETOP_PROGRAM "' train --database '" + database_ + "' --name " +
                         name + " " + arguments + " >'" + folder_.file("out") + "' 2>'" +
                         folder_.file("err") + "' </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, textOf(folder_.file("out")),
            textOf(folder_.file("err"))};
  }

  /// Exit code 2, one line on stderr that holds `what`, and no database made.
  void expectRefusal(const std::string& arguments, const std::string& what) const {
    const auto ran = train(arguments);
    EXPECT_EQ(ran.exit_code, 2) << arguments;
    EXPECT_TRUE(ran.out.empty()) << ran.out;
    EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
    EXPECT_NE(ran.err.find(what), std::string::npos) << ran.err;
    EXPECT_FALSE(fs::exists(database_)) << arguments;
  }

  ObjectModel stored(const std::string& name = "thing") const {
    return ObjectDatabase(database_, ObjectDatabase::Mode::READ).load(name);
  }

  std::string writeMesh(const std::string& name, const Mesh& mesh, double scale = 1) const {
    std::ostringstream obj;
    for (const auto& v : mesh.vertices)
      obj << "v " << scale * v.x() << ' ' << scale * v.y() << ' ' << scale * v.z() << '\n';
    for (const auto& f : mesh.faces)
      obj << "f " << f[0] + 1 << ' ' << f[1] + 1 << ' ' << f[2] + 1 << '\n';
    return folder_.write(name, obj.str());
  }

  /// A cloud of the object alone, points in the object's frame; `posed`: VIEWPOINT is the camera's.
  std::string writeView(const std::string& name, double yaw, bool posed = true) const {
    const Eigen::Isometry3d T = scene::cameraPose(0.7, 40) * scene::standing(0, 0, yaw);
    PcdContents contents;
    contents.cloud = MeshRenderer(scene::bracket()).render(T, scene::SceneOptions().projection);
    for (const int i : validIndices(contents.cloud))
      contents.cloud.setPoint(i,
                              (T.inverse() * contents.cloud.point(i).cast<double>()).cast<float>());
    if (posed) contents.T_data_sensor = T.inverse();
    writePcd(folder_.file(name), contents);
    return folder_.file(name);
  }

  std::string writeScene(const std::string& name, const scene::SyntheticScene& scene) const {
    PcdContents contents;
    contents.cloud = scene.cloud;
    writePcd(folder_.file(name), contents);
    return folder_.file(name);
  }

  TempFolder folder_;
  std::string database_ = folder_.file("objects.db");
};

TEST_F(TrainCommand, LearnsAMeshAndSaysSoInOneLine) {
  const auto ran = train("--mesh " + writeMesh("bracket.obj", scene::bracket()));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(ran.out.rfind("thing: 80 views, diameter 179 mm, symmetry none, ", 0), 0u) << ran.out;
  EXPECT_EQ(std::count(ran.out.begin(), ran.out.end(), '\n'), 1);
  for (const char* quarter : {": 0 %", ": 25 %", ": 50 %", ": 75 %", ": 100 %"})
    EXPECT_NE(ran.err.find(quarter), std::string::npos) << ran.err;
  EXPECT_EQ(stored().origin, "mesh bracket.obj");
  EXPECT_EQ(stored().views.size(), 80u);
}

TEST_F(TrainCommand, MillimetresAreConverted) {
  const auto mesh = "--mesh " + writeMesh("bracket.obj", scene::bracket(), 1000);
  expectRefusal(mesh, "--unit mm");
  EXPECT_EQ(train(mesh + " --unit mm").exit_code, 0);
  EXPECT_NEAR(stored().diameter, 0.179, 0.001);
}

TEST_F(TrainCommand, SymmetryCanBeStated) {
  const auto ran =
      train("--mesh " + writeMesh("can.obj", scene::cylinder(0.03, 0.1)) + " --symmetry half x");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const Symmetry symmetry = stored().symmetry;
  EXPECT_TRUE(symmetry.declared);
  EXPECT_FALSE(symmetry.continuous());
  ASSERT_EQ(symmetry.rotations.size(), 1u);
  EXPECT_NEAR(symmetry.center.z(), 0.05, 0.002);
}

TEST_F(TrainCommand, AnObjectIsReplaced) {
  ASSERT_EQ(train("--mesh " + writeMesh("bracket.obj", scene::bracket())).exit_code, 0);
  ASSERT_EQ(train("--mesh " + writeMesh("house.obj", scene::house())).exit_code, 0);
  EXPECT_EQ(ObjectDatabase(database_, ObjectDatabase::Mode::READ).names().size(), 1u);
  EXPECT_EQ(stored().origin, "mesh house.obj");
}

TEST_F(TrainCommand, CloudsWithPosesJoinToOneObject) {
  const auto ran = train("--cloud " + writeView("a.pcd", 0.4) + " " + writeView("b.pcd", 3.5));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const ObjectModel model = stored();
  ASSERT_EQ(model.views.size(), 2u);
  EXPECT_EQ(model.origin, "2 clouds");
  EXPECT_NEAR(model.diameter, 0.179, 0.004);  // both together show the whole
  EXPECT_NEAR(model.views[0].T_view_object.translation().norm(), 0.7, 1e-4);
  for (const auto& p : model.views[0].surface.points) EXPECT_GT(p.z(), 0.4);
}

TEST_F(TrainCommand, FolderIsReadByNameWithoutTheWholeModel) {
  fs::create_directories(folder_.file("views"));
  writeView("views/view_1.pcd", 3.5);
  writeView("views/view_0.pcd", 0.4);
  writeView("views/model.pcd", 2);
  EXPECT_EQ(train("--views " + folder_.file("views")).exit_code, 0);
  ASSERT_EQ(stored().views.size(), 2u);
  const Eigen::Isometry3d first = scene::cameraPose(0.7, 40) * scene::standing(0, 0, 0.4);
  EXPECT_TRUE(stored().views[0].T_view_object.isApprox(first, 1e-4));
}

TEST_F(TrainCommand, ViewsWithoutPosesAreRefused) {
  expectRefusal("--cloud " + writeView("a.pcd", 0.4, false) + " " + writeView("b.pcd", 3.5, false),
                "views without poses");
  EXPECT_EQ(train("--cloud " + folder_.file("a.pcd")).exit_code, 0);  // one needs none
}

TEST_F(TrainCommand, OneOfTheViewsMayHaveTheObjectsFrame) {
  const auto a = writeView("a.pcd", 0.4, false), b = writeView("b.pcd", 3.5, false);
  expectRefusal("--cloud " + writeView("c.pcd", 1) + " " + a + " " + b,
                "2 of 3 views without poses (" + a + ", " + b + ")");
  EXPECT_EQ(train("--cloud " + a + " " + folder_.file("c.pcd")).exit_code, 0);
}

TEST_F(TrainCommand, CloudsThatShowNothingAreRefused) {
  PcdContents contents;
  contents.cloud = Cloud(640, 480, false);
  writePcd(folder_.file("nothing.pcd"), contents);
  expectRefusal("--cloud " + writeView("a.pcd", 0.4) + " " + folder_.file("nothing.pcd"),
                folder_.file("nothing.pcd") + ": the cloud has no points");
  for (int i = 0; i < 5; ++i) contents.cloud.setPoint(i, {0.01f * i, 0, 0.7f});
  writePcd(folder_.file("five.pcd"), contents);
  const auto ran = train("--cloud " + folder_.file("five.pcd"));
  EXPECT_EQ(ran.exit_code, 2);
  EXPECT_NE(ran.err.find("object 'thing': no view shows 40 sampled points"), std::string::npos)
      << ran.err;
  EXPECT_FALSE(fs::exists(database_));
}

TEST_F(TrainCommand, AMeshWithAHoleIsLearntAndTheHoleTold) {
  Mesh open = scene::bracket();
  open.faces.pop_back();
  const auto file = writeMesh("open.obj", open);
  const auto ran = train("--mesh " + file);
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find(file + ": 3 open edges"), std::string::npos) << ran.err;
  EXPECT_EQ(stored().views.size(), 80u);
  const auto closed = train("--mesh " + writeMesh("bracket.obj", scene::bracket()));
  EXPECT_EQ(closed.err.find("open edges"), std::string::npos) << closed.err;
}

TEST_F(TrainCommand, AMissingTextureIsToldAndTheShapeLearnt) {
  folder_.write("box.mtl", "newmtl picture\nmap_Kd box.png\n");
  std::ifstream shape(writeMesh("shape.obj", scene::bracket()));
  std::ostringstream obj;
  obj << "mtllib box.mtl\nvt 0 0\nusemtl picture\n";
  for (std::string word; shape >> word;)
    if (word == "v" || word == "f") {
      std::string a, b, c;
      shape >> a >> b >> c;
      const std::string vt = word == "f" ? "/1" : "";
      obj << word << ' ' << a + vt << ' ' << b + vt << ' ' << c + vt << '\n';
    }
  const auto ran = train("--mesh " + folder_.write("box.obj", obj.str()));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find(folder_.file("box.png") + ": cannot be read as an image"),
            std::string::npos)
      << ran.err;
  EXPECT_TRUE(stored().colors.empty());
}

TEST_F(TrainCommand, MeshesThatCannotBeObjectsAreRefused) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
      "property float y\nproperty float z\n";
  expectRefusal("--mesh " + folder_.write("points.ply", header + "end_header\n"
                                                                 "0 0 0\n0.1 0 0\n0 0.1 0\n"),
                "points.ply: the mesh has no faces");
  Mesh mesh = scene::bracket();
  mesh.vertices[3].y() = std::numeric_limits<float>::quiet_NaN();
  expectRefusal("--mesh " + writeMesh("nan.obj", mesh),
                "nan.obj: the mesh has vertices that are "
                "not finite");
}

TEST_F(TrainCommand, NoiseAndDistancesOfTheViewsCanBeChosen) {
  const auto mesh = "--mesh " + writeMesh("bracket.obj", scene::bracket());
  expectRefusal(mesh + " --distances 0.7 0.1", "0.4 to 3 m, got 0.1");
  const auto ran = train(mesh + " --noise --distances 0.6 1");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(stored().views.size(), 160u);
}

TEST_F(TrainCommand, LoneObjectOnATableIsLearntInTheFrameOfItsScene) {
  const auto scene = scene::render({{"house", scene::house(), scene::standing(0, 0, 0.5)}});
  const auto ran = train("--scene " + writeScene("lone.pcd", scene));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const ObjectModel model = stored();
  EXPECT_EQ(model.origin, "scene lone.pcd");
  ASSERT_EQ(model.views.size(), 1u);
  EXPECT_TRUE(model.views[0].T_view_object.isApprox(Eigen::Isometry3d::Identity()));
  for (const auto& p : model.surface.points) {
    const Eigen::Vector3d at = scene.objects[0].T_camera_object.inverse() * p.cast<double>();
    EXPECT_LT(at.head<2>().norm(), 0.09);
    EXPECT_GT(at.z(), 0.004);
    EXPECT_LT(at.z(), 0.125);
  }
}

TEST_F(TrainCommand, MoreThanOneThingOnTheTableIsRefusedWithTheCount) {
  const auto three = writeScene("three.pcd", scene::threeObjects());
  expectRefusal("--scene " + three, "3 things stand on the table");
  expectRefusal("--scene " + three + " " + three, "--scene takes one scene, got 2");
  expectRefusal("--scene " + writeScene("bare.pcd", scene::render({})), "nothing to learn");
}

TEST_F(TrainCommand, BadUsageIsRefused) {
  const auto mesh = "--mesh " + writeMesh("bracket.obj", scene::bracket());
  expectRefusal("", "Exactly 1 option from [--mesh,--cloud,--views,--scene]");
  expectRefusal(mesh + " --cloud a.pcd", "Exactly 1 option from");
  expectRefusal("--mesh none.ply", "none.ply: no such file");
  expectRefusal(mesh + " --unit inch", "inch");
  expectRefusal(mesh + " --symmetry round", "\"round\"");
  expectRefusal(mesh + " --up 0 0 1", "--scene");
  expectRefusal("--views " + folder_.file("none"), "is not a folder");
  expectRefusal(mesh + " --name other", "--name");
  expectRefusal(mesh + " " + mesh, "--mesh");
  EXPECT_EQ(train(mesh, "'two words'").exit_code, 2);
}

/// Kills the program after ever longer times; whatever it left must be readable and whole.
TEST_F(TrainCommand, KilledAtAnyMomentItLeavesWholeObjects) {
  const auto mesh = writeMesh("bracket.obj", scene::bracket());
  ASSERT_EQ(train("--mesh " + mesh, "first").exit_code, 0);
  int killed = 0;
  for (int wait_ms = 20; wait_ms < 3000; wait_ms = wait_ms * 5 / 4) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      const int null = open("/dev/null", O_WRONLY);
      dup2(null, STDOUT_FILENO);
      dup2(null, STDERR_FILENO);
      execl(TABLETOP_PROGRAM, "tabletop", "train", "--database", database_.c_str(), "--name",
            "second", "--mesh", mesh.c_str(), nullptr);
      _exit(127);
    }
    usleep(wait_ms * 1000);
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) ++killed;
    for (const auto& model : ObjectDatabase(database_, ObjectDatabase::Mode::READ).loadAll())
      EXPECT_EQ(model.views.size(), 80u) << model.name << " after " << wait_ms << " ms";
    ASSERT_EQ(stored("first").views.size(), 80u);
    if (WIFEXITED(status)) {
      EXPECT_EQ(WEXITSTATUS(status), 0);
      break;
    }
  }
  EXPECT_GT(killed, 3);
}

TEST(ProgressBar, TextTellsShareAndTimeLeft) {
  EXPECT_EQ(barText(0, 0), "[..............................]   0 %");
  EXPECT_EQ(barText(0.5, 6), "[###############...............]  50 % 6 s left");
  EXPECT_EQ(barText(1, 12), "[##############################] 100 % in 12 s");
}

}  // namespace
}  // namespace tabletop_perception::tools
