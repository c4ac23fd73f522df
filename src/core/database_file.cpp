#include "database_file.h"

#include <cstdint>

#include <unistd.h>

#include "tabletop_perception/database.h"

namespace tabletop_perception::database_file {
namespace {

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

}  // namespace

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

void recover(const fs::path& file) {
  try {
    SQLite::Database(file, SQLite::OPEN_READWRITE, BUSY_TIMEOUT_MS)
        .execAndGet("PRAGMA schema_version");
  } catch (const SQLite::Exception& error) {
    fail(file, "was left half written by a program that was killed, and cannot be rolled back: " +
                   causeOf(error));
  }
}

int pragma(SQLite::Database& db, const std::string& name) {
  return db.execAndGet("PRAGMA " + name).getInt();
}

bool knowsGrasps(SQLite::Database& db) { return pragma(db, "user_version") >= VERSION_OF_GRASPS; }

std::unique_ptr<SQLite::Database> openToRead(const fs::path& file) {
  return reading(file, [&] {
    checkReadable(file);
    auto db = std::make_unique<SQLite::Database>(file, SQLite::OPEN_READONLY, BUSY_TIMEOUT_MS);
    const SQLite::Transaction transaction(*db);
    checkFile(*db, file);
    return db;
  });
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

}  // namespace tabletop_perception::database_file
