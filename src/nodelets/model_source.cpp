#include "model_source.h"

#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace tabletop_perception {

std::filesystem::path expandHome(const std::string& path) {
  const char* home = std::getenv("HOME");
  const bool at_home = path == "~" || path.rfind("~/", 0) == 0;
  return home && at_home ? home + path.substr(1) : path;
}

void ModelSource::clear(const std::string& reason) {
  index_ = ModelIndex();
  ++generation_;
  version_.reset();
  reason_ = reason;
}

const ModelIndex& ModelSource::update() {
  struct stat status;
  if (stat(file_.c_str(), &status) != 0) {
    database_.reset();
    clear("database " + file_.string() + ": " + std::strerror(errno));
    return index_;
  }
  try {
    if (!database_ || inode_ != status.st_ino) {
      version_.reset();
      database_.emplace(file_, ObjectDatabase::Mode::READ);
      inode_ = status.st_ino;
    }
    const long version = database_->version();
    if (version == version_) return index_;
    clear("");
    version_ = version;  // even if the objects turn out to be of no use: until the file changes
    index_ = ModelIndex(*database_);
    if (index_.empty()) reason_ = "database " + file_.string() + " holds no object";
  } catch (const DatabaseError& error) {
    database_.reset();
    clear(error.what());
  } catch (const std::invalid_argument& error) {
    index_ = ModelIndex();
    reason_ = "database " + file_.string() + ": " + error.what();
  }
  return index_;
}

}  // namespace tabletop_perception
