#include "tabletop_perception/database.h"

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>
#include <sstream>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

using namespace tabletop_perception;
namespace fs = std::filesystem;
using Mode = ObjectDatabase::Mode;

namespace {

std::string readBytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return bytes.str();
}

void writeBytes(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

Surface randomSurface(std::size_t points, std::mt19937& random) {
  std::normal_distribution<float> value;
  Surface surface;
  for (std::size_t i = 0; i < points; ++i) {
    surface.points.emplace_back(value(random), value(random), value(random));
    surface.normals.push_back(
        Eigen::Vector3f(value(random), value(random), value(random)).normalized());
  }
  return surface;
}

/// An object with something in every field, all of it depending on the seed.
ObjectModel randomModel(const std::string& name, unsigned seed, std::size_t points = 30,
                        int views = 3) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> value(0.1, 1);
  ObjectModel model;
  model.name = name;
  model.origin = "seed " + std::to_string(seed);
  model.surface = randomSurface(points, random);
  for (std::size_t i = 0; i < points; ++i)
    model.colors.push_back(static_cast<std::uint32_t>(random()));
  model.diameter = value(random);
  model.symmetry.center = {value(random), -value(random), value(random)};
  model.symmetry.axis = Eigen::Vector3d(value(random), value(random), value(random)).normalized();
  model.symmetry.rotations.push_back(
      Eigen::AngleAxisd(value(random), Eigen::Vector3d::UnitY()).toRotationMatrix());
  model.symmetry.rotations.push_back(
      Eigen::AngleAxisd(value(random), model.symmetry.axis).toRotationMatrix());
  model.symmetry.declared = true;
  model.options.leaf = 0.001 + 0.01 * value(random);
  model.options.min_points = 77;
  for (int i = 0; i < views; ++i) {
    View view;
    view.T_view_object = Eigen::Translation3d(value(random), value(random), value(random)) *
                         Eigen::AngleAxisd(value(random), Eigen::Vector3d::UnitX());
    view.surface = randomSurface(points + 1 + i, random);
    for (const char* kind : {"vfh", "cvfh", "cvfh"}) {
      Descriptor descriptor;
      descriptor.kind = kind;
      for (int bin = 0; bin < VFH_SIZE; ++bin)
        descriptor.values.push_back(static_cast<float>(value(random)));
      descriptor.centroid = view.surface.points[i];
      view.descriptors.push_back(descriptor);
    }
    model.views.push_back(view);
  }
  for (const char* grasp : {"side", "top"}) {
    StoredGrasp stored;
    stored.name = grasp;
    stored.T_object_gripper = Eigen::Translation3d(value(random), value(random), value(random)) *
                              Eigen::AngleAxisd(value(random), Eigen::Vector3d::UnitZ());
    stored.width = value(random);
    stored.preference = -value(random);
    model.grasps.push_back(stored);
  }
  return model;
}

bool same(const Surface& a, const Surface& b) {
  return a.points == b.points && a.normals == b.normals;
}

bool same(const Descriptor& a, const Descriptor& b) {
  return a.kind == b.kind && a.values == b.values && a.centroid == b.centroid;
}

bool same(const View& a, const View& b) {
  bool equal = a.T_view_object.matrix() == b.T_view_object.matrix() && same(a.surface, b.surface) &&
               a.descriptors.size() == b.descriptors.size();
  for (std::size_t i = 0; equal && i < a.descriptors.size(); ++i)
    equal = same(a.descriptors[i], b.descriptors[i]);
  return equal;
}

bool same(DescriptorOptions a, DescriptorOptions b) {
  std::vector<double> of_a, of_b;
  a.visitFields([&](const auto&, auto& field, const auto&...) { of_a.push_back(field); });
  b.visitFields([&](const auto&, auto& field, const auto&...) { of_b.push_back(field); });
  return of_a == of_b;
}

bool same(const StoredGrasp& a, const StoredGrasp& b) {
  return a.name == b.name && a.T_object_gripper.matrix() == b.T_object_gripper.matrix() &&
         a.width == b.width && a.preference == b.preference;
}

/// Whether every number is the same, to the last bit.
bool same(const ObjectModel& a, const ObjectModel& b) {
  bool equal = a.name == b.name && a.origin == b.origin && same(a.surface, b.surface) &&
               a.colors == b.colors && a.diameter == b.diameter &&
               a.symmetry.center == b.symmetry.center && a.symmetry.axis == b.symmetry.axis &&
               a.symmetry.rotations == b.symmetry.rotations &&
               a.symmetry.declared == b.symmetry.declared && same(a.options, b.options) &&
               a.views.size() == b.views.size() && a.grasps.size() == b.grasps.size();
  for (std::size_t i = 0; equal && i < a.grasps.size(); ++i) equal = same(a.grasps[i], b.grasps[i]);
  for (std::size_t i = 0; equal && i < a.views.size(); ++i) equal = same(a.views[i], b.views[i]);
  return equal;
}

/// A folder of its own for every test.
class Database : public testing::Test {
 protected:
  Database() {
    std::string pattern = (fs::temp_directory_path() / "database_test_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    file_ = folder_ / "objects.db";
  }
  ~Database() override { fs::remove_all(folder_); }

  /// What is said of the database, after its path.
  std::string refusalOf(Mode mode) const {
    try {
      ObjectDatabase(file_, mode).loadAll();
    } catch (const DatabaseError& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      EXPECT_EQ(what.find(file_.string() + ": "), 0u) << what;
      return what.substr(std::min(what.size(), file_.string().size() + 2));
    }
    return "was not refused";
  }

  void sql(const std::string& statements) const {
    SQLite::Database(file_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec(statements);
  }

  fs::path folder_, file_;
};

/// Runs `work` in a process of its own, which ends with 0 unless it throws.
template <typename Work>
pid_t startProcess(const Work& work) {
  const pid_t child = fork();
  if (child != 0) return child;
  try {
    work();
  } catch (const std::exception& error) {
    std::cerr << error.what() << std::endl;
    _exit(1);
  }
  _exit(0);
}

int exitOf(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace

TEST_F(Database, GivesBackEveryBitOfWhatWasStored) {
  const auto milk = randomModel("milk", 1);
  auto bare = randomModel("bare", 2);
  bare.colors.clear();
  bare.symmetry = {};
  bare.views[1].descriptors.clear();
  {
    ObjectDatabase database(file_, Mode::WRITE);
    database.store(milk);
    database.store(bare);
  }
  const ObjectDatabase database(file_, Mode::READ);
  EXPECT_EQ(database.names(), (std::vector<std::string>{"bare", "milk"}));
  EXPECT_TRUE(same(database.load("milk"), milk));
  EXPECT_TRUE(same(database.load("bare"), bare));
  const auto all = database.loadAll();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_TRUE(same(all[0], bare) && same(all[1], milk));
}

TEST_F(Database, ReplacesAnObjectOfTheSameNameWithoutATrace) {
  ObjectDatabase database(file_, Mode::WRITE);
  database.store(randomModel("milk", 1, 30, 5));
  database.store(randomModel("milk", 2, 20, 2));
  EXPECT_EQ(database.names().size(), 1u);
  EXPECT_TRUE(same(database.load("milk"), randomModel("milk", 2, 20, 2)));
  SQLite::Database db(file_);
  EXPECT_EQ(db.execAndGet("SELECT count(*) FROM view").getInt(), 2);
  EXPECT_EQ(db.execAndGet("SELECT count(*) FROM descriptor").getInt(), 6);
}

TEST_F(Database, RemovesAnObjectWithAllThatBelongsToIt) {
  ObjectDatabase database(file_, Mode::WRITE);
  database.store(randomModel("milk", 1));
  EXPECT_FALSE(database.remove("tea"));
  EXPECT_TRUE(database.remove("milk"));
  EXPECT_TRUE(database.loadAll().empty());
  SQLite::Database db(file_);
  for (const std::string table : {"object", "view", "descriptor", "descriptor_option"})
    EXPECT_EQ(db.execAndGet("SELECT count(*) FROM " + table).getInt(), 0) << table;
}

TEST_F(Database, WithoutObjectsIsFine) {
  ObjectDatabase(file_, Mode::WRITE);
  const ObjectDatabase database(file_, Mode::READ);
  EXPECT_TRUE(database.names().empty());
  EXPECT_TRUE(database.loadAll().empty());
  EXPECT_THROW(database.load("milk"), DatabaseError);
}

TEST_F(Database, StoresAllObjectsOrNone) {
  ObjectDatabase database(file_, Mode::WRITE);
  auto broken = randomModel("broken", 2);
  broken.views[2].surface.points[3].x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(database.store({randomModel("milk", 1), broken}), std::invalid_argument);
  EXPECT_TRUE(database.names().empty());
  EXPECT_THROW(database.store({randomModel("milk", 1), randomModel("milk", 2)}),
               std::invalid_argument);
  EXPECT_TRUE(database.names().empty());
  database.store({randomModel("milk", 1), randomModel("tea", 2)});
  EXPECT_EQ(database.names().size(), 2u);
}

TEST_F(Database, ReaderSeesAChangeOfAnotherConnection) {
  ObjectDatabase writer(file_, Mode::WRITE);
  writer.store(randomModel("milk", 1));
  const ObjectDatabase reader(file_, Mode::READ);
  const auto before = reader.version();
  EXPECT_EQ(reader.version(), before);
  EXPECT_EQ(reader.loadAll().size(), 1u);
  EXPECT_EQ(reader.version(), before);

  const auto own = writer.version();
  writer.store(randomModel("tea", 2));
  EXPECT_GT(writer.version(), own);
  const auto stored = reader.version();
  EXPECT_GT(stored, before);
  EXPECT_EQ(reader.loadAll().size(), 2u);
  writer.remove("tea");
  EXPECT_GT(reader.version(), stored);
}

TEST_F(Database, IsFreeForWritersBetweenTheObjectsThatAReaderVisits) {
  ObjectDatabase writer(file_, Mode::WRITE);
  for (const char* name : {"a", "b", "c"}) writer.store(randomModel(name, 1));
  std::vector<std::string> visited;
  ObjectDatabase(file_, Mode::READ).visitAll([&](const ObjectModel& model) {
    visited.push_back(model.name);
    if (model.name == "a") EXPECT_TRUE(writer.remove("b"));
  });
  EXPECT_EQ(visited, (std::vector<std::string>{"a", "c"}));
}

TEST_F(Database, ReaderSeesAChangeOfAnotherProcess) {
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
  // in children only: a process may not carry an open SQLite connection through a fork
  const pid_t reader = startProcess([&] {
    const ObjectDatabase database(file_, Mode::READ);
    const auto before = database.version();
    writeBytes(folder_ / "ready", "1");
    while (database.version() == before) usleep(1000);
    if (database.names() != std::vector<std::string>{"milk", "tea"}) _exit(2);
  });
  while (!fs::exists(folder_ / "ready")) usleep(1000);
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("tea", 2));
  EXPECT_EQ(exitOf(reader), 0);
}

TEST_F(Database, TwoWritersAtOnceBothGetTheirObjectsIn) {
  const int count = 12;
  const auto write = [&](const std::string& prefix) {
    return startProcess([&] {
      ObjectDatabase database(file_, Mode::WRITE);  // both may create the file, too
      for (int i = 0; i < count; ++i)
        database.store(randomModel(prefix + std::to_string(i), i, 2000));
    });
  };
  const auto first = write("a"), second = write("b");
  EXPECT_EQ(exitOf(first), 0);
  EXPECT_EQ(exitOf(second), 0);
  const ObjectDatabase database(file_, Mode::READ);
  EXPECT_EQ(database.loadAll().size(), 2u * count);
  for (int i = 0; i < count; ++i)
    EXPECT_TRUE(same(database.load("b" + std::to_string(i)),
                     randomModel("b" + std::to_string(i), i, 2000)));
}

TEST_F(Database, HoldsWholeObjectsOnlyWheneverItsWriterIsKilled) {
  // Objects larger than SQLite's cache, so that a kill may find half an object in the file.
  const std::size_t points = 20000;
  const auto model = [&](int round) {
    return randomModel("object_" + std::to_string(round % 3), round, points, 8);
  };
  ObjectDatabase(file_, Mode::WRITE).store(model(0));
  std::mt19937 random(1);
  int half_written = 0, round = 1;
  for (int kill_count = 0; kill_count < 40; ++kill_count) {
    const pid_t writer = startProcess([&] {
      const std::vector<ObjectModel> models = {model(round), model(round + 1), model(round + 2)};
      writeBytes(folder_ / "ready", "1");
      ObjectDatabase database(file_, Mode::WRITE);
      for (int i = 0;; ++i) database.store(models[i % 3]);
    });
    while (!fs::exists(folder_ / "ready")) usleep(500);
    usleep(std::uniform_int_distribution<int>(0, 150000)(random));
    kill(writer, SIGKILL);
    exitOf(writer);
    fs::remove(folder_ / "ready");
    half_written += fs::exists(file_.string() + "-journal");

    const auto objects = ObjectDatabase(file_, Mode::READ).loadAll();
    ASSERT_GE(objects.size(), 1u);
    for (const auto& object : objects) {
      const int seed = std::stoi(object.origin.substr(5));
      ASSERT_TRUE(same(object, model(seed))) << object.name << " after kill " << kill_count;
    }
    EXPECT_EQ(SQLite::Database(file_).execAndGet("PRAGMA integrity_check").getString(), "ok");
    ++round;
  }
  EXPECT_GE(half_written, 10) << "kills came too rarely in the middle of a transaction";
}

TEST_F(Database, AnOpenReaderRecoversFromAKilledWriterToo) {
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
  const pid_t reader = startProcess([&] {
    const ObjectDatabase database(file_, Mode::READ);
    writeBytes(folder_ / "reading", "1");
    while (!fs::exists(folder_ / "killed")) usleep(1000);
    database.version();
    if (!same(database.load("milk"), randomModel("milk", 1))) _exit(2);
  });
  while (!fs::exists(folder_ / "reading")) usleep(1000);
  const pid_t writer = startProcess([&] {
    SQLite::Database db(file_, SQLite::OPEN_READWRITE);
    db.exec("PRAGMA cache_size = 10; BEGIN IMMEDIATE; UPDATE view SET points = zeroblob(9000000)");
    raise(SIGKILL);
  });
  exitOf(writer);
  ASSERT_TRUE(fs::exists(file_.string() + "-journal"));
  writeBytes(folder_ / "killed", "1");
  EXPECT_EQ(exitOf(reader), 0);
}

TEST_F(Database, RefusesWhatIsNoDatabase) {
  EXPECT_EQ(refusalOf(Mode::READ), "does not exist");
  EXPECT_FALSE(fs::exists(file_));
  writeBytes(file_, "");
  EXPECT_EQ(refusalOf(Mode::READ), "is empty (0 bytes), not an object database");
  EXPECT_EQ(refusalOf(Mode::WRITE), "was not refused");

  const std::string text = std::string(3000, 'x');
  writeBytes(file_, text);
  EXPECT_EQ(refusalOf(Mode::READ), "is not an object database (no SQLite file)");
  EXPECT_EQ(refusalOf(Mode::WRITE), "is not an object database (no SQLite file)");
  EXPECT_EQ(readBytes(file_), text);

  fs::remove(file_);
  sql("CREATE TABLE bookmark (url TEXT)");
  const auto foreign = readBytes(file_);
  EXPECT_EQ(refusalOf(Mode::READ), "is an SQLite file, but not an object database");
  EXPECT_EQ(refusalOf(Mode::WRITE), "is an SQLite file, but not an object database");
  EXPECT_EQ(readBytes(file_), foreign);

  fs::remove(file_);
  fs::create_directory(file_);
  EXPECT_EQ(refusalOf(Mode::READ), "is not a file");
  EXPECT_EQ(refusalOf(Mode::WRITE), "is not a file");
}

TEST_F(Database, RefusesAnotherSchemaVersion) {
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
  sql("PRAGMA user_version = 7");
  const std::string refusal =
      "has schema version 7, this program reads 2 to 3: train its objects anew, or use the program "
      "that "
      "wrote it";
  EXPECT_EQ(refusalOf(Mode::READ), refusal);
  EXPECT_EQ(refusalOf(Mode::WRITE), refusal);
}

TEST_F(Database, OpensAFileOfVersion2AndLosesNothingOfIt) {
  auto milk = randomModel("milk", 1), tea = randomModel("tea", 2);
  milk.grasps.clear();
  tea.grasps.clear();
  ObjectDatabase(file_, Mode::WRITE).store({milk, tea});
  sql("DROP TABLE grasp; PRAGMA user_version = 2");  // what version 3 brought
  const auto old = readBytes(file_);
  const auto expectBoth = [&](const ObjectDatabase& database) {
    const auto models = database.loadAll();
    ASSERT_EQ(models.size(), 2u);
    EXPECT_TRUE(same(models[0], milk));
    EXPECT_TRUE(same(models[1], tea));
  };

  expectBoth(ObjectDatabase(file_, Mode::READ));
  EXPECT_EQ(readBytes(file_), old);  // readers never change it

  const ObjectDatabase early_reader(file_, Mode::READ);
  ObjectDatabase writer(file_, Mode::WRITE);
  expectBoth(writer);
  expectBoth(early_reader);
  const auto grasp = randomModel("any", 3).grasps[0];
  writer.storeGrasp("tea", grasp);
  const auto loaded = early_reader.load("tea").grasps;
  ASSERT_EQ(loaded.size(), 1u);
  EXPECT_TRUE(same(loaded[0], grasp));
}

TEST_F(Database, AGraspIsAddedReplacedAndRemovedByName) {
  auto milk = randomModel("milk", 1);
  ObjectDatabase database(file_, Mode::WRITE);
  database.store({milk, randomModel("tea", 2)});
  const auto before = database.version();
  milk.grasps[1].width = 0.07;
  database.storeGrasp("milk", milk.grasps[1]);
  EXPECT_TRUE(same(database.load("milk"), milk));
  EXPECT_GT(database.version(), before);
  EXPECT_TRUE(database.removeGrasp("milk", "top"));
  EXPECT_FALSE(database.removeGrasp("milk", "top"));
  milk.grasps.pop_back();
  EXPECT_TRUE(same(database.load("milk"), milk));
  EXPECT_TRUE(same(database.load("tea"), randomModel("tea", 2)));

  EXPECT_THROW(database.storeGrasp("house", milk.grasps[0]), DatabaseError);
  EXPECT_THROW(database.removeGrasp("house", "top"), DatabaseError);
  const auto refused = [&](const auto& change) {
    StoredGrasp grasp = milk.grasps[0];
    change(grasp);
    EXPECT_THROW(database.storeGrasp("milk", grasp), std::invalid_argument);
  };
  refused([](StoredGrasp& grasp) { grasp.name = "a b"; });
  refused([](StoredGrasp& grasp) { grasp.width = 0; });
  refused([](StoredGrasp& grasp) { grasp.width = std::nan(""); });
  refused([](StoredGrasp& grasp) { grasp.T_object_gripper.linear() *= 2; });
  refused([](StoredGrasp& grasp) { grasp.T_object_gripper.translation().x() = INFINITY; });
  EXPECT_TRUE(same(database.load("milk"), milk));
}

TEST_F(Database, RefusesAFileCutShortAtAnyLength) {
  ObjectDatabase(file_, Mode::WRITE).store({randomModel("milk", 1), randomModel("tea", 2)});
  const auto whole = readBytes(file_);
  std::mt19937 random(3);
  std::vector<std::size_t> lengths = {1, 15, 16, 99, 100, 511, 512, 4095, 4096, 4097, 8192};
  for (std::size_t i = 1; i < 20; ++i) lengths.push_back(whole.size() - i);
  for (int i = 0; i < 200; ++i) lengths.push_back(1 + random() % (whole.size() - 1));
  for (const auto length : lengths) {
    writeBytes(file_, whole.substr(0, length));
    EXPECT_NE(refusalOf(Mode::READ), "was not refused") << length << " of " << whole.size();
    EXPECT_NE(refusalOf(Mode::WRITE), "was not refused") << length << " of " << whole.size();
    EXPECT_EQ(readBytes(file_).size(), length);
  }
  writeBytes(file_, whole);
  EXPECT_EQ(refusalOf(Mode::READ), "was not refused");
}

TEST_F(Database, RefusesDamagedObjectsByName) {
  const auto damaged = [&](const std::string& statement) {
    fs::remove(file_);
    ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
    sql(statement);
    return refusalOf(Mode::READ);
  };
  EXPECT_EQ(damaged("UPDATE object SET points = substr(points, 1, 100)"),
            "object 'milk' is damaged: column points has 100 bytes, no multiple of 12");
  EXPECT_EQ(damaged("UPDATE view SET pose = zeroblob(88)"),
            "object 'milk' is damaged: column pose has 88 bytes, no multiple of 96");
  EXPECT_EQ(damaged("UPDATE object SET symmetry_axis = zeroblob(48)"),
            "object 'milk' is damaged: column symmetry_axis has 48 bytes, not 24");
  EXPECT_EQ(
      damaged("UPDATE view SET normals = zeroblob(12)")
          .find("object 'milk' is damaged: object 'milk', view 0, has 1 normals for 31 points"),
      0u);
  EXPECT_EQ(damaged("UPDATE descriptor SET histogram = X'0000C07F'"),  // NaN
            "object 'milk' is damaged: object 'milk', view 0, has a descriptor that is not finite");
  EXPECT_EQ(damaged("UPDATE descriptor SET histogram = X'0000807F'"),  // infinity
            "object 'milk' is damaged: object 'milk', view 0, has a descriptor that is not finite");
  EXPECT_EQ(damaged("DELETE FROM descriptor_option WHERE name = 'leaf'"),
            "object 'milk' is damaged: it lacks the option leaf");
  EXPECT_EQ(damaged("DELETE FROM view"), "object 'milk' is damaged: object 'milk' has no view");
}

TEST_F(Database, RefusesALockedFileAfterWaiting) {
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
  SQLite::Database other(file_, SQLite::OPEN_READWRITE);
  other.exec("BEGIN EXCLUSIVE");
  EXPECT_EQ(refusalOf(Mode::READ), "has been locked by another program for more than 5 s");
}

TEST_F(Database, RefusesToWriteWhereItMayNot) {
  file_ = folder_ / "missing" / "objects.db";
  EXPECT_EQ(refusalOf(Mode::WRITE),
            "cannot be written: there is no folder " + (folder_ / "missing").string());

  file_ = folder_ / "locked" / "objects.db";
  fs::create_directory(file_.parent_path());
  ObjectDatabase(file_, Mode::WRITE).store(randomModel("milk", 1));
  fs::permissions(folder_, fs::perms(0755));
  fs::permissions(file_, fs::perms(0644));
  fs::permissions(file_.parent_path(), fs::perms(0555));
  const pid_t nobody = startProcess([&] {  // root may write everywhere
    if (geteuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(3);
    if (refusalOf(Mode::READ) != "was not refused") _exit(4);
    const auto refusal = refusalOf(Mode::WRITE);
    if (refusal.find("cannot be written: no permission to change the folder ") != 0)
      throw std::runtime_error(refusal);
  });
  EXPECT_EQ(exitOf(nobody), 0);
  fs::permissions(file_.parent_path(), fs::perms(0755));
}

TEST_F(Database, RefusesToStoreThroughAReader) {
  ObjectDatabase(file_, Mode::WRITE);
  ObjectDatabase database(file_, Mode::READ);
  EXPECT_THROW(database.store(randomModel("milk", 1)), DatabaseError);
  EXPECT_THROW(database.remove("milk"), DatabaseError);
}
