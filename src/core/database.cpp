#include "tabletop_perception/database.h"

#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <set>

#include <SQLiteCpp/SQLiteCpp.h>

#include "database_file.h"

namespace tabletop_perception {
namespace {

namespace fs = std::filesystem;
using database_file::fail, database_file::guarded, database_file::reading;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "blobs are written as they lie in memory");

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
  if (!database_file::knowsGrasps(db)) return grasps;
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
    : file_(file),
      db_(mode == Mode::READ ? database_file::openToRead(file) : database_file::openToWrite(file)) {
}

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
  return reading(
      file_, [&] { return database_file::pragma(*db_, "data_version") + db_->getTotalChanges(); });
}

}  // namespace tabletop_perception
