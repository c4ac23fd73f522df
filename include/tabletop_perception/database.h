#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tabletop_perception/model.h"

namespace SQLite {
class Database;
}

namespace tabletop_perception {

/// A database that is missing, damaged, of another schema version or locked for too long.
struct DatabaseError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One SQLite file of objects. An object is in it whole or not at all: every change is one
/// transaction. Not for use by several threads at once; several processes may open the same file.
class ObjectDatabase {
 public:
  enum class Mode { READ, WRITE };

  /// Opens a file; WRITE creates it where there is none or where it is empty, as a killed creator
  /// leaves it, and brings one of an older schema up to date. Throws DatabaseError with the path
  /// and what is wrong with it. READ never changes the file, but rolls back what a killed writer
  /// left.
  ObjectDatabase(const std::filesystem::path& file, Mode mode);
  ~ObjectDatabase();
  ObjectDatabase(ObjectDatabase&&) noexcept;

  /// Names of all objects, sorted.
  std::vector<std::string> names() const;

  /// Adds an object, or replaces the one of the same name. Throws std::invalid_argument for an
  /// object that is not whole (no name, no view, numbers that are not finite).
  void store(const ObjectModel& model);

  /// All of them or, when this throws, none; it also does for two of one name.
  void store(const std::vector<ObjectModel>& models);

  /// Takes an object out; false if there is none of that name.
  bool remove(const std::string& name);

  /// Adds a grasp to an object, or replaces its one of that name. Throws DatabaseError when there
  /// is no such object, std::invalid_argument as checkGrasp.
  void storeGrasp(const std::string& object, const StoredGrasp& grasp);

  /// Takes a grasp from an object; false if that has none of the name. Throws DatabaseError when
  /// there is no such object.
  bool removeGrasp(const std::string& object, const std::string& grasp);

  /// One object; throws DatabaseError when there is none of that name or its data are damaged.
  ObjectModel load(const std::string& name) const;

  /// Every object, sorted by name, all from one state of the file.
  std::vector<ObjectModel> loadAll() const;

  /// Calls visit(object) for every object, sorted by name, with one in memory at a time. Each is
  /// read when its turn comes, and the file is free in between: one that is taken out meanwhile is
  /// left out.
  void visitAll(const std::function<void(ObjectModel)>& visit) const;

  /// A number that grows whenever the file's contents were changed, by whatever process.
  long version() const;

 private:
  std::optional<ObjectModel> find(const std::string& name) const;

  std::filesystem::path file_;
  std::unique_ptr<SQLite::Database> db_;
};

}  // namespace tabletop_perception
