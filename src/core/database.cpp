#include "tabletop_perception/database.h"

#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <set>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>
#include <unistd.h>

namespace tabletop_perception {
namespace {

namespace fs = std::filesystem;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "blobs are written as they lie in memory");

constexpr int APPLICATION_ID = 0x5442544F;  ///< "TBTO", for `file` and against foreign databases
constexpr int SCHEMA_VERSION = 3;
constexpr int OLDEST_VERSION = 2;     ///< that can be read
constexpr int VERSION_OF_GRASPS = 3;  ///< that brought them
constexpr int BUSY_TIMEOUT_MS = 5000;
constexpr std::uintmax_t SMALLEST_PAGE = 512;  ///< of SQLite [bytes]

/// Blobs are little-endian and row after row: points and normals 3 x float32, colours uint32,
/// histograms float32, poses 3 x 4 and the symmetry float64.
const char* const SCHEMA = R"sql(
CREATE TABLE object (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL UNIQUE,
  origin TEXT NOT NULL,
  diameter REAL NOT NULL,             -- [m]
  symmetry_center BLOB NOT NULL,      -- [m]
  symmetry_axis BLOB NOT NULL,        -- unit, or zeros
  symmetry_rotations BLOB NOT NULL,   -- 3 x 3 each
  symmetry_declared INTEGER NOT NULL,
  points BLOB NOT NULL,               -- of the whole surface, in the object's frame [m]
  normals BLOB NOT NULL,
  colors BLOB NOT NULL);              -- 0x00RRGGBB, or nothing
CREATE TABLE descriptor_option (
  object INTEGER NOT NULL REFERENCES object(id) ON DELETE CASCADE,
  name TEXT NOT NULL,
  value REAL NOT NULL,
  PRIMARY KEY (object, name)) WITHOUT ROWID;
CREATE TABLE view (
  id INTEGER PRIMARY KEY,             -- ascending as the views of the object
  object INTEGER NOT NULL REFERENCES object(id) ON DELETE CASCADE,
  pose BLOB NOT NULL,                 -- T_view_object
  points BLOB NOT NULL,               -- in the camera's frame [m]
  normals BLOB NOT NULL);
CREATE INDEX view_object ON view(object);
CREATE TABLE descriptor (
  id INTEGER PRIMARY KEY,             -- ascending as the descriptors of the view
  view INTEGER NOT NULL REFERENCES view(id) ON DELETE CASCADE,
  kind TEXT NOT NULL,
  centroid BLOB NOT NULL,             -- in the camera's frame [m]
  histogram BLOB NOT NULL,
  axes BLOB NOT NULL);                -- 3 x 3 float32, in the camera's frame, or nothing
CREATE INDEX descriptor_view ON descriptor(view);
)sql";

const char* const SCHEMA_OF_GRASPS = R"sql(
CREATE TABLE grasp (
  object INTEGER NOT NULL REFERENCES object(id) ON DELETE CASCADE,
  name TEXT NOT NULL,
  pose BLOB NOT NULL,                 -- T_object_gripper
  width REAL NOT NULL,                -- [m]
  preference REAL NOT NULL,
  PRIMARY KEY (object, name)) WITHOUT ROWID;
)sql";

[[noreturn]] void fail(const fs::path& file, const std::string& what) {
  throw DatabaseError(file.string() + ": " + what);
}

std::string causeOf(const SQLite::Exception& error) {
  switch (error.getErrorCode()) {
    case SQLITE_NOTADB:
      return "is not an object database (no SQLite file)";
    case SQLITE_CORRUPT:
      return "is damaged or cut short: copy it again, or train its objects anew";
    case SQLITE_BUSY:
      return "has been locked by another program for more than " +
             std::to_string(BUSY_TIMEOUT_MS / 1000) + " s";
    case SQLITE_FULL:
      return "cannot be written: the disk is full";
    case SQLITE_READONLY:
      return "cannot be written: the file or its folder is read-only";
    default:
      return error.what();
  }
}

/// Does `work`; what SQLite has to say against it becomes a DatabaseError.
template <typename Work>
auto guarded(const fs::path& file, const Work& work) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    fail(file, causeOf(error));
  } catch (const fs::filesystem_error& error) {
    fail(file, error.code().message());
  }
}

/// Rolls back what a killed writer left, as a connection that only reads cannot.
void recover(const fs::path& file) {
  try {
    SQLite::Database(file, SQLite::OPEN_READWRITE, BUSY_TIMEOUT_MS)
        .execAndGet("PRAGMA schema_version");
  } catch (const SQLite::Exception& error) {
    fail(file, "was left half written by a program that was killed, and cannot be rolled back: " +
                   causeOf(error));
  }
}

/// As `guarded`, for work that only reads.
template <typename Work>
auto reading(const fs::path& file, const Work& work) {
  return guarded(file, [&] {
    try {
      return work();
    } catch (const SQLite::Exception& error) {
      if (error.getExtendedErrorCode() != SQLITE_READONLY_ROLLBACK) throw;
    }
    recover(file);
    return work();
  });
}

int pragma(SQLite::Database& db, const std::string& name) {
  return db.execAndGet("PRAGMA " + name).getInt();
}

bool blank(SQLite::Database& db) {
  return pragma(db, "application_id") == 0 && pragma(db, "user_version") == 0 &&
         db.execAndGet("SELECT count(*) FROM sqlite_master").getInt() == 0;
}

void setVersion(SQLite::Database& db) {
  db.exec("PRAGMA user_version = " + std::to_string(SCHEMA_VERSION));
}

void createSchema(SQLite::Database& db) {
  db.exec(SCHEMA);
  db.exec(SCHEMA_OF_GRASPS);
  db.exec("PRAGMA application_id = " + std::to_string(APPLICATION_ID));
  setVersion(db);
}

/// Adds what a file of an older version lacks, and changes nothing that is in it.
void migrate(SQLite::Database& db) {
  const int version = pragma(db, "user_version");
  if (version == SCHEMA_VERSION) return;
  if (version < VERSION_OF_GRASPS) db.exec(SCHEMA_OF_GRASPS);
  setVersion(db);
}

/// Within a transaction, so that nobody writes meanwhile.
void checkFile(SQLite::Database& db, const fs::path& file) {
  if (pragma(db, "application_id") != APPLICATION_ID)
    fail(file, "is an SQLite file, but not an object database");
  const int version = pragma(db, "user_version");
  if (version < OLDEST_VERSION || version > SCHEMA_VERSION)
    fail(file, "has schema version " + std::to_string(version) + ", this program reads " +
                   std::to_string(OLDEST_VERSION) + " to " + std::to_string(SCHEMA_VERSION) +
                   ": train its objects anew, or use the program that wrote it");
  // SQLite takes the missing bytes of the last page for zeros
  const auto size =
      std::uintmax_t(pragma(db, "page_count")) * std::uintmax_t(pragma(db, "page_size"));
  if (fs::file_size(file) < size)
    fail(file, "is cut short: " + std::to_string(fs::file_size(file)) + " bytes of " +
                   std::to_string(size));
}

void checkReadable(const fs::path& file) {
  if (!fs::exists(file)) fail(file, "does not exist");
  if (!fs::is_regular_file(file)) fail(file, "is not a file");
  if (fs::file_size(file) == 0) fail(file, "is empty (0 bytes), not an object database");
}

std::unique_ptr<SQLite::Database> openToRead(const fs::path& file) {
  return reading(file, [&] {
    checkReadable(file);
    auto db = std::make_unique<SQLite::Database>(file, SQLite::OPEN_READONLY, BUSY_TIMEOUT_MS);
    const SQLite::Transaction transaction(*db);
    checkFile(*db, file);
    return db;
  });
}

/// SQLite finds out only when it writes; a trainer wants to know before its work.
void checkWritable(const fs::path& file) {
  if (fs::exists(file) && !fs::is_regular_file(file)) fail(file, "is not a file");
  // SQLite would take a file of one byte for an empty one, and write over it
  if (fs::exists(file) && fs::file_size(file) > 0 && fs::file_size(file) < SMALLEST_PAGE)
    fail(file, "is not an object database (no SQLite file)");
  const auto folder = fs::weakly_canonical(fs::absolute(file)).parent_path();
  if (!fs::is_directory(folder))
    fail(file, "cannot be written: there is no folder " + folder.string());
  const bool writable = access(folder.c_str(), W_OK) == 0;
  if (!writable || (fs::exists(file) && access(file.c_str(), W_OK) != 0))
    fail(file, "cannot be written: no permission to change " +
                   (writable ? std::string("the file") : "the folder " + folder.string()));
}

std::unique_ptr<SQLite::Database> openToWrite(const fs::path& file) {
  return guarded(file, [&] {
    checkWritable(file);
    auto db = std::make_unique<SQLite::Database>(file, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE,
                                                 BUSY_TIMEOUT_MS);
    // The journal's default mode stays: a single file that people copy, safe against power cuts.
    db->exec("PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON");
    SQLite::Transaction transaction(*db, SQLite::TransactionBehavior::IMMEDIATE);
    const bool created = blank(*db);
    if (created) createSchema(*db);
    if (!created) {
      checkFile(*db, file);
      migrate(*db);
    }
    transaction.commit();
    return db;
  });
}

// --- blobs

template <typename Value>
void bindBlob(SQLite::Statement& insert, int index, const Value* values, std::size_t count) {
  const void* bytes = count ? static_cast<const void*>(values) : "";  // a null pointer is NULL
  insert.bindNoCopy(index, bytes, static_cast<int>(count * sizeof(Value)));
}

template <typename Value>
void bindBlob(SQLite::Statement& insert, int index, const std::vector<Value>& values) {
  bindBlob(insert, index, values.data(), values.size());
}

template <typename Value>
std::vector<Value> blobOf(const SQLite::Column& column) {
  const auto bytes = static_cast<std::size_t>(column.getBytes());
  const auto* data = static_cast<const char*>(column.getBlob());
  if (!column.isBlob() || bytes % sizeof(Value) != 0)
    throw std::invalid_argument(std::string("column ") + column.getName() + " has " +
                                std::to_string(bytes) + " bytes, no multiple of " +
                                std::to_string(sizeof(Value)));
  std::vector<Value> values(bytes / sizeof(Value));
  if (bytes) std::memcpy(static_cast<void*>(values.data()), data, bytes);
  return values;
}

template <typename Value>
Value singleBlobOf(const SQLite::Column& column) {
  const auto values = blobOf<Value>(column);
  if (values.size() != 1)
    throw std::invalid_argument(std::string("column ") + column.getName() + " has " +
                                std::to_string(column.getBytes()) + " bytes, not " +
                                std::to_string(sizeof(Value)));
  return values[0];
}

using Matrix34RowMajor = Eigen::Matrix<double, 3, 4, Eigen::RowMajor | Eigen::DontAlign>;
using Axes = Eigen::Matrix<float, 3, 3, Eigen::RowMajor | Eigen::DontAlign>;
using Matrix33RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor | Eigen::DontAlign>;

// --- writing

void insertDescriptors(SQLite::Database& db, std::int64_t view,
                       const std::vector<Descriptor>& descriptors) {
  SQLite::Statement insert(
      db, "INSERT INTO descriptor (view, kind, centroid, histogram, axes) VALUES (?, ?, ?, ?, ?)");
  for (const auto& descriptor : descriptors) {
    insert.bind(1, view);
    insert.bind(2, descriptor.kind);
    bindBlob(insert, 3, &descriptor.centroid, 1);
    bindBlob(insert, 4, descriptor.values);
    const Axes axes = descriptor.axes.value_or(Eigen::Matrix3f::Zero());
    bindBlob(insert, 5, &axes, descriptor.axes ? 1 : 0);
    insert.exec();
    insert.reset();
  }
}

void insertViews(SQLite::Database& db, std::int64_t object, const std::vector<View>& views) {
  SQLite::Statement insert(db,
                           "INSERT INTO view (object, pose, points, normals) VALUES (?, ?, ?, ?)");
  for (const auto& view : views) {
    const Matrix34RowMajor pose = view.T_view_object.matrix().topRows<3>();
    insert.bind(1, object);
    bindBlob(insert, 2, &pose, 1);
    bindBlob(insert, 3, view.surface.points);
    bindBlob(insert, 4, view.surface.normals);
    insert.exec();
    insert.reset();
    insertDescriptors(db, db.getLastInsertRowid(), view.descriptors);
  }
}

void insertOptions(SQLite::Database& db, std::int64_t object, DescriptorOptions options) {
  SQLite::Statement insert(db,
                           "INSERT INTO descriptor_option (object, name, value) VALUES (?, ?, ?)");
  options.visitFields([&](const std::string& name, const auto& field, const auto&...) {
    insert.bind(1, object);
    insert.bind(2, name);
    insert.bind(3, static_cast<double>(field));
    insert.exec();
    insert.reset();
  });
}

void insertGrasps(SQLite::Database& db, std::int64_t object,
                  const std::vector<StoredGrasp>& grasps) {
  SQLite::Statement insert(db,
                           "INSERT OR REPLACE INTO grasp (object, name, pose, width, preference) "
                           "VALUES (?, ?, ?, ?, ?)");
  for (const auto& grasp : grasps) {
    const Matrix34RowMajor pose = grasp.T_object_gripper.matrix().topRows<3>();
    insert.bind(1, object);
    insert.bind(2, grasp.name);
    bindBlob(insert, 3, &pose, 1);
    insert.bind(4, grasp.width);
    insert.bind(5, grasp.preference);
    insert.exec();
    insert.reset();
  }
}

std::int64_t insertObject(SQLite::Database& db, const ObjectModel& model) {
  const auto& symmetry = model.symmetry;
  const std::vector<Matrix33RowMajor> rotations(symmetry.rotations.begin(),
                                                symmetry.rotations.end());
  SQLite::Statement insert(
      db,
      "INSERT INTO object (name, origin, diameter, symmetry_center, symmetry_axis, "
      "symmetry_rotations, symmetry_declared, points, normals, colors) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.bind(1, model.name);
  insert.bind(2, model.origin);
  insert.bind(3, model.diameter);
  bindBlob(insert, 4, &symmetry.center, 1);
  bindBlob(insert, 5, &symmetry.axis, 1);
  bindBlob(insert, 6, rotations);
  insert.bind(7, symmetry.declared ? 1 : 0);
  bindBlob(insert, 8, model.surface.points);
  bindBlob(insert, 9, model.surface.normals);
  bindBlob(insert, 10, model.colors);
  insert.exec();
  return db.getLastInsertRowid();
}

bool deleteObject(SQLite::Database& db, const std::string& name) {
  SQLite::Statement erase(db, "DELETE FROM object WHERE name = ?");
  erase.bind(1, name);
  return erase.exec() > 0;
}

// --- reading

std::optional<std::int64_t> idOf(SQLite::Database& db, const std::string& object) {
  SQLite::Statement select(db, "SELECT id FROM object WHERE name = ?");
  select.bind(1, object);
  if (!select.executeStep()) return std::nullopt;
  return select.getColumn(0).getInt64();
}

/// By name; a file of a version that knew none has none.
std::vector<StoredGrasp> selectGrasps(SQLite::Database& db, std::int64_t object) {
  std::vector<StoredGrasp> grasps;
  if (pragma(db, "user_version") < VERSION_OF_GRASPS) return grasps;
  SQLite::Statement select(
      db, "SELECT name, pose, width, preference FROM grasp WHERE object = ? ORDER BY name");
  select.bind(1, object);
  while (select.executeStep()) {
    StoredGrasp grasp;
    grasp.name = select.getColumn(0).getString();
    grasp.T_object_gripper.affine() = singleBlobOf<Matrix34RowMajor>(select.getColumn(1));
    grasp.width = select.getColumn(2).getDouble();
    grasp.preference = select.getColumn(3).getDouble();
    grasps.push_back(std::move(grasp));
  }
  return grasps;
}

std::vector<Descriptor> selectDescriptors(SQLite::Database& db, std::int64_t view) {
  SQLite::Statement select(
      db, "SELECT kind, centroid, histogram, axes FROM descriptor WHERE view = ? ORDER BY id");
  select.bind(1, view);
  std::vector<Descriptor> descriptors;
  while (select.executeStep()) {
    Descriptor descriptor;
    descriptor.kind = select.getColumn(0).getString();
    descriptor.centroid = singleBlobOf<Eigen::Vector3f>(select.getColumn(1));
    descriptor.values = blobOf<float>(select.getColumn(2));
    if (select.getColumn(3).getBytes() > 0)
      descriptor.axes = singleBlobOf<Axes>(select.getColumn(3));
    descriptors.push_back(std::move(descriptor));
  }
  return descriptors;
}

std::vector<View> selectViews(SQLite::Database& db, std::int64_t object) {
  SQLite::Statement select(
      db, "SELECT id, pose, points, normals FROM view WHERE object = ? ORDER BY id");
  select.bind(1, object);
  std::vector<View> views;
  while (select.executeStep()) {
    View view;
    view.T_view_object.affine() = singleBlobOf<Matrix34RowMajor>(select.getColumn(1));
    view.surface.points = blobOf<Eigen::Vector3f>(select.getColumn(2));
    view.surface.normals = blobOf<Eigen::Vector3f>(select.getColumn(3));
    view.descriptors = selectDescriptors(db, select.getColumn(0).getInt64());
    views.push_back(std::move(view));
  }
  return views;
}

DescriptorOptions selectOptions(SQLite::Database& db, std::int64_t object) {
  SQLite::Statement select(db, "SELECT name, value FROM descriptor_option WHERE object = ?");
  select.bind(1, object);
  std::map<std::string, double> values;
  while (select.executeStep())
    values[select.getColumn(0).getString()] = select.getColumn(1).getDouble();
  DescriptorOptions options;
  options.visitFields([&](const std::string& name, auto& field, const auto&...) {
    const auto value = values.find(name);
    if (value == values.end()) throw std::invalid_argument("it lacks the option " + name);
    field = static_cast<std::decay_t<decltype(field)>>(value->second);
  });
  return options;
}

Symmetry symmetryOf(SQLite::Statement& object) {
  Symmetry symmetry;
  symmetry.center = singleBlobOf<Eigen::Vector3d>(object.getColumn("symmetry_center"));
  symmetry.axis = singleBlobOf<Eigen::Vector3d>(object.getColumn("symmetry_axis"));
  for (const auto& rotation : blobOf<Matrix33RowMajor>(object.getColumn("symmetry_rotations")))
    symmetry.rotations.push_back(rotation);
  symmetry.declared = object.getColumn("symmetry_declared").getInt() != 0;
  return symmetry;
}

ObjectModel modelOf(SQLite::Database& db, SQLite::Statement& object) {
  const auto id = object.getColumn("id").getInt64();
  ObjectModel model;
  model.name = object.getColumn("name").getString();
  model.origin = object.getColumn("origin").getString();
  model.diameter = object.getColumn("diameter").getDouble();
  model.symmetry = symmetryOf(object);
  model.surface.points = blobOf<Eigen::Vector3f>(object.getColumn("points"));
  model.surface.normals = blobOf<Eigen::Vector3f>(object.getColumn("normals"));
  model.colors = blobOf<std::uint32_t>(object.getColumn("colors"));
  model.options = selectOptions(db, id);
  model.views = selectViews(db, id);
  model.grasps = selectGrasps(db, id);
  checkModel(model);
  return model;
}

ObjectModel loadRow(const fs::path& file, SQLite::Database& db, SQLite::Statement& object) {
  try {
    return modelOf(db, object);
  } catch (const std::invalid_argument& error) {
    fail(file, "object '" + object.getColumn("name").getString() + "' is damaged: " + error.what());
  }
}

}  // namespace

ObjectDatabase::ObjectDatabase(const fs::path& file, Mode mode)
    : file_(file), db_(mode == Mode::READ ? openToRead(file) : openToWrite(file)) {}

ObjectDatabase::~ObjectDatabase() = default;
ObjectDatabase::ObjectDatabase(ObjectDatabase&&) noexcept = default;

std::vector<std::string> ObjectDatabase::names() const {
  return reading(file_, [&] {
    SQLite::Statement select(*db_, "SELECT name FROM object ORDER BY name");
    std::vector<std::string> names;
    while (select.executeStep()) names.push_back(select.getColumn(0).getString());
    return names;
  });
}

void ObjectDatabase::store(const ObjectModel& model) { store(std::vector<ObjectModel>{model}); }

void ObjectDatabase::store(const std::vector<ObjectModel>& models) {
  std::set<std::string> names;
  for (const auto& model : models) {
    checkModel(model);
    if (!names.insert(model.name).second)
      throw std::invalid_argument("two objects are named '" + model.name +
                                  "', one of them would be lost");
  }
  guarded(file_, [&] {
    SQLite::Transaction transaction(*db_, SQLite::TransactionBehavior::IMMEDIATE);
    for (const auto& model : models) {
      deleteObject(*db_, model.name);
      const auto object = insertObject(*db_, model);
      insertOptions(*db_, object, model.options);
      insertViews(*db_, object, model.views);
      insertGrasps(*db_, object, model.grasps);
    }
    transaction.commit();
  });
}

bool ObjectDatabase::remove(const std::string& name) {
  return guarded(file_, [&] {
    SQLite::Transaction transaction(*db_, SQLite::TransactionBehavior::IMMEDIATE);
    const bool removed = deleteObject(*db_, name);
    transaction.commit();
    return removed;
  });
}

void ObjectDatabase::storeGrasp(const std::string& object, const StoredGrasp& grasp) {
  checkGrasp(grasp);
  guarded(file_, [&] {
    SQLite::Transaction transaction(*db_, SQLite::TransactionBehavior::IMMEDIATE);
    const auto id = idOf(*db_, object);
    if (!id) fail(file_, "holds no object '" + object + "'");
    insertGrasps(*db_, *id, {grasp});
    transaction.commit();
  });
}

bool ObjectDatabase::removeGrasp(const std::string& object, const std::string& grasp) {
  return guarded(file_, [&] {
    SQLite::Transaction transaction(*db_, SQLite::TransactionBehavior::IMMEDIATE);
    const auto id = idOf(*db_, object);
    if (!id) fail(file_, "holds no object '" + object + "'");
    SQLite::Statement erase(*db_, "DELETE FROM grasp WHERE object = ? AND name = ?");
    erase.bind(1, *id);
    erase.bind(2, grasp);
    const bool removed = erase.exec() > 0;
    transaction.commit();
    return removed;
  });
}

ObjectModel ObjectDatabase::load(const std::string& name) const {
  auto model = find(name);
  if (!model) fail(file_, "holds no object '" + name + "'");
  return std::move(*model);
}

std::vector<ObjectModel> ObjectDatabase::loadAll() const {
  return reading(file_, [&] {
    const SQLite::Transaction transaction(*db_);
    SQLite::Statement select(*db_, "SELECT * FROM object ORDER BY name");
    std::vector<ObjectModel> models;
    while (select.executeStep()) models.push_back(loadRow(file_, *db_, select));
    return models;
  });
}

void ObjectDatabase::visitAll(const std::function<void(ObjectModel)>& visit) const {
  for (const auto& name : names())
    if (auto model = find(name)) visit(std::move(*model));
}

std::optional<ObjectModel> ObjectDatabase::find(const std::string& name) const {
  return reading(file_, [&]() -> std::optional<ObjectModel> {
    const SQLite::Transaction transaction(*db_);
    SQLite::Statement select(*db_, "SELECT * FROM object WHERE name = ?");
    select.bind(1, name);
    if (!select.executeStep()) return std::nullopt;
    return loadRow(file_, *db_, select);
  });
}

long ObjectDatabase::version() const {
  // others' commits, and our own changes, which data_version leaves out; both only grow
  return reading(file_, [&] { return pragma(*db_, "data_version") + db_->getTotalChanges(); });
}

}  // namespace tabletop_perception
