#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

/// The SQLite file of an object database: its schema, older ones of it, and what may be wrong with
/// a file.
namespace tabletop_perception::database_file {

namespace fs = std::filesystem;

/// Throws a DatabaseError with the path.
[[noreturn]] void fail(const fs::path& file, const std::string& what);

/// What an error of SQLite means for people.
std::string causeOf(const SQLite::Exception& error);

/// Rolls back what a killed writer left, as a connection that only reads cannot.
void recover(const fs::path& file);

int pragma(SQLite::Database& db, const std::string& name);

/// Whether the file's schema knows grasps; older ones are read, too.
bool knowsGrasps(SQLite::Database& db);

/// Throw DatabaseError for a file that is no database of ours, damaged or of another version.
/// To write one creates it where there is none and brings an older one up to date.
std::unique_ptr<SQLite::Database> openToRead(const fs::path& file);
std::unique_ptr<SQLite::Database> openToWrite(const fs::path& file);

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

}  // namespace tabletop_perception::database_file
